//! How the axes move: a queue of straight blocks and one exact velocity profile.
//!
//! Invariant: everything here depends only on what was queued and on the seconds that passed;
//! nothing knows lines, answers or states.

mod junction;
mod planner;
mod ramp;

pub(crate) use planner::{
    MotionEvent, Move, Overrides, Planner, ProgrammedSpeed, Pushed, mm_from_steps, steps_from_mm,
};
pub(crate) use ramp::{Ramp, braking_ramp, next_ramp};
