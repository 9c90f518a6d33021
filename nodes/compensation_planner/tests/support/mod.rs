//! What the tests of the planner share: programs and their plans, and shapes to plan.
#![allow(dead_code, unreachable_pub)]

pub mod opened;
pub mod outline;
mod programs;
pub mod random;
pub mod shapes;

pub use programs::*;
