//! A grbl 1.1 controller with axes that move in time, on a pseudo-terminal.
//!
//! For commissioning a stack without hardware, and for provoking faults in tests.
//!
//! - [`Controller`]: the firmware and its machine; sans-IO, time is an argument.
//!
//! This is not hardware and no part of it is a safety function.

mod axes;
mod codes;
mod controller;
mod gcode;
mod homing;
mod motion;
mod plant;
mod receive;
mod settings;

pub use axes::{AXES, AXIS_LETTERS, Vector};
pub use codes::{Alarm, ErrorCode};
pub use controller::{Build, Controller};
pub use receive::{LINE_CHARACTERS_MAX, RECEIVE_BUFFER_BYTES};
pub use settings::Settings;
