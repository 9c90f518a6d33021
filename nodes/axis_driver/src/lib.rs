//! Compensated path to motion controller, over a serial line.
//!
//! The one owner of motion. From the wire upwards: [`report`] reads what the
//! firmware says and [`codes`] words it, [`firmware`] has what differs between firmwares; [`link`] counts characters; [`encoder`]
//! turns a compensated path into lines, [`approach`] says how a run in the middle begins; [`driver`] decides what is sent and when,
//! and what is known of the machine; [`machine_limits`] is what its settings say, [`envelope`]
//! judges a path by them, [`cycle_time`] how long it takes; [`journal`] writes its inputs down and plays
//! them again. All of that is a function of inputs and of the time that comes with
//! them. `serial` (feature `node`) is the shell with the port, the threads and the
//! clock; nothing in all of that knows ROS. `motion` is the process around it, and `node`
//! its ROS side, another process; [`protocol`] is what they say to each other.
//!
//! None of this is a safety function; an emergency stop is wired.

pub mod address;
pub mod approach;
pub mod codes;
pub mod cycle_time;
pub mod driver;
pub mod encoder;
pub mod envelope;
pub mod firmware;
pub mod journal;
pub mod link;
pub mod machine_limits;
mod machine_path;
#[cfg(feature = "node")]
pub mod motion;
#[cfg(feature = "node")]
pub mod node;
pub mod path_watch;
pub mod protocol;
pub mod report;
#[cfg(feature = "node")]
pub mod serial;
pub mod tool_check;
pub mod tracker;
#[cfg(feature = "node")]
mod transport;
pub mod turns;
pub mod vectors;
