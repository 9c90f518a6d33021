//! Records every topic and both serial directions to one MCAP bag per run; reads bags too.
//!
//! The core writes bags ([`bag_writer`]), reads them even if damaged ([`bag_reader`]) and
//! compares messages ([`diff`]) that [`rosidl`] has decoded by the definitions inside the bag.
//! It works on anything that reads, writes and seeks. Files and the write thread come with the
//! feature `std-fs`: `files` and `run_bag`.

mod bag_messages;
mod bag_problem;
pub mod bag_reader;
pub mod bag_writer;
mod chunk_index;
pub mod closing;
#[cfg(feature = "std-fs")]
mod compressed;
pub mod diff;
#[cfg(feature = "std-fs")]
pub mod files;
#[cfg(feature = "node")]
mod handed_over;
pub mod info;
mod joined;
pub mod metadata;
#[cfg(feature = "node")]
pub mod node;
mod outline;
#[cfg(feature = "std-fs")]
mod parts;
mod playable;
pub mod qos;
mod records;
pub mod recover;
pub mod retention;
#[cfg(feature = "std-fs")]
pub mod rewrite;
#[cfg(feature = "std-fs")]
pub mod run_bag;
mod scan;
pub mod split;
#[cfg(feature = "std-fs")]
pub mod stored_bags;
mod verify;
#[cfg(feature = "std-fs")]
mod write_queue;
#[cfg(feature = "std-fs")]
mod write_thread;

/// The commit of this build, in release builds from a checkout; see `build.rs`.
pub const COMMIT: Option<&str> = option_env!("KERF_COMMIT");
