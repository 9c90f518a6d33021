//! The shell: a pseudo-terminal or a network port, the clock, the command line.
//!
//! The only module here that touches files, time and signals. It decides nothing about the
//! controller.

mod cli;
mod client;
mod device;
mod gateway;
mod listen;
mod network;
mod opens;
mod port;
mod pty;
mod report;
mod serve;
mod stop;

pub use cli::{cli, read_scenario};
pub use device::{serve_device, serve_device_on};
pub use listen::{Listen, Protocol};
pub use serve::{ServeError, ServeOptions, serve};
pub use stop::{Stop, StopHandle, stop_pair};
