//! One process of the operating system: its console, its end, its supervisor and its memory.
//!
//! The bottom of this crate: uses no other folder. Belongs here: what a process needs before it
//! has a name, parameters or a participant, and without ROS. Does not belong here: arguments and
//! environment (`command_line`), anything that sends or receives (`endpoints`), and the order in
//! which a node starts and stops (`run.rs` and `session.rs` at the top).

mod companion;
pub(crate) mod console;
pub(crate) mod lifecycle_states;
mod lock;
pub(crate) mod memory;
pub(crate) mod panic_guard;
pub(crate) mod shutdown;
pub mod supervision;
pub(crate) mod time;
pub(crate) mod watchdog;

pub use companion::program_beside;
pub(crate) use lock::lock;
