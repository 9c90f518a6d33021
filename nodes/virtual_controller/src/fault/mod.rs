//! Trouble on purpose, between the line and the controller.
//!
//! Knows when to spoil what; the controller behind it behaves as ever. The
//! same faults, seed and bytes give the same trouble again.

mod grammar;
mod inject;

pub use grammar::{Direction, Fault, FaultAction, FaultError, Spoil, Trigger};
pub use inject::FaultInjector;
