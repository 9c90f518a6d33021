//! Injects faults between the line and the controller.
//!
//! The controller itself works as always. The same faults, seed and bytes give the same result.

mod grammar;
mod inject;

pub use grammar::{ByteFault, Direction, Fault, FaultAction, FaultError, Trigger};
pub use inject::FaultInjector;
