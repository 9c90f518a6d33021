//! A grbl 1.1, grblHAL or FluidNC controller with axes that move in time, on a pseudo-terminal.
//!
//! For commissioning a stack without hardware, and for fault tests.
//!
//! - [`Controller`]: the firmware and its machine.
//! - [`FaultInjector`]: the controller with faults of the line, the supply and the switches.
//! - [`Scenario`]: both, written as text.
//! - [`PacedLine`]: either of them on a line with a baud rate, and a faster clock.
//! - `serve` and `cli` (feature `node`): all of it on a pseudo-terminal.
//!
//! All but `serve` and `cli` is sans-IO: bytes and the time go in; bytes and the time of the
//! next event come out.
//!
//! This is not hardware and no part of it is a safety function.

mod axes;
mod codes;
mod controller;
mod counts;
mod fault;
mod firmware;
mod gcode;
mod homing;
mod line;
mod motion;
#[cfg(feature = "node")]
mod node;
mod paced;
mod plant;
mod receive;
mod scenario;
mod settings;
mod tolerances;

pub use axes::{AXES, Axes, AxisLetters, UnknownAxes, Vector};
pub use codes::ErrorCode;
pub use controller::{Build, Controller, Drawn, Switched};
pub use counts::Counts;
pub use fault::{ByteFault, Direction, Fault, FaultAction, FaultError, FaultInjector, Trigger};
pub use firmware::{Firmware, UnknownFirmware};
#[cfg(feature = "node")]
pub use node::{
    Listen, Protocol, ServeError, ServeOptions, Stop, StopHandle, cli, read_scenario, serve,
    serve_device, serve_device_on, stop_pair,
};
pub use paced::{Device, LineEvents, LineTiming, PacedLine};
pub use receive::TRANSMIT_BUFFER_BYTES;
pub use scenario::{Machine, Scenario, ScenarioError, UnknownMachine};
pub use settings::Settings;
