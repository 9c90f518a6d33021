//! Every topic and both serial directions to one MCAP bag a run; reads bags too.
//!
//! The core writes bags ([`bag_writer`]), reads them in whatever state they are
//! ([`bag_reader`]), decodes messages by the definitions inside the bag
//! ([`decode`]) and compares them ([`diff`]). It works on anything that reads,
//! writes and seeks. Files and the write thread come with the feature `std-fs`:
//! `files` and `run_bag`.

mod bag_messages;
mod bag_problem;
pub mod bag_reader;
pub mod bag_writer;
pub mod decode;
pub mod diff;
#[cfg(feature = "std-fs")]
pub mod files;
pub mod info;
pub mod metadata;
#[cfg(feature = "node")]
pub mod node;
mod outline;
pub mod qos;
mod records;
pub mod recover;
#[cfg(feature = "std-fs")]
pub mod run_bag;
mod scan;
pub mod schema;
pub mod value;
#[cfg(feature = "std-fs")]
mod write_queue;
#[cfg(feature = "std-fs")]
mod write_thread;
