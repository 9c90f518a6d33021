//! The cables between the driver and its board.
//!
//! A cable is a file with a type that is a [`Transport`], and a row in [`open`]. Nothing else knows
//! what kind of cable it is. Bytes come as they are: what they mean is for [`crate::link`].

mod serial_port;

use crate::serial::SerialConfig;
use rustix::fd::AsFd;
use serial_port::Port;
use std::fmt::Debug;

/// A cable that is open. Dropping it closes it. The descriptor says when there is something to read.
///
/// The errors are for people, and the cable is lost after one.
pub(crate) trait Transport: AsFd + Debug + Send {
    /// Reads what has come; nothing when nothing has. Never waits.
    fn read(&self) -> Result<Vec<u8>, String>;

    /// Writes bytes, or keeps what the system does not take now and writes it soon; never waits.
    fn write(&self, bytes: Vec<u8>) -> Result<(), String>;
}

/// What a cable calls that fails while nobody reads or writes, with the reason.
pub(crate) type OnFailure = Box<dyn FnOnce(String) + Send>;

/// Opens the cable of the configuration. The error is for people.
pub(crate) fn open(
    config: &SerialConfig,
    on_failure: OnFailure,
) -> Result<Box<dyn Transport>, String> {
    Ok(Box::new(Port::open(config, on_failure)?))
}
