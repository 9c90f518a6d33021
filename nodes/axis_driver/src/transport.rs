//! The cables between the driver and its board.
//!
//! A cable is a file with a type that is a [`Transport`], a variant of [`Address`](crate::address::Address), and a
//! row in [`open`]. Nothing else knows what kind of cable it is. Bytes come as they are: what they mean
//! is for [`crate::link`].

mod com_port;
mod greeting;
mod serial_port;
mod socket;
mod tcp;
mod telnet;
mod websocket;

use crate::address::Address;
use crate::serial::SerialConfig;
use com_port::PortSettings;
use rustix::fd::AsFd;
use serial_port::Port;
use std::fmt::Debug;
use tcp::Tcp;
use websocket::Ws;

/// A cable that is open. Dropping it closes it. The descriptor says when there is something to read.
///
/// The errors are for people, and the cable is lost after one.
pub(crate) trait Transport: AsFd + Debug + Send {
    /// Reads what has come; nothing when nothing has. Never waits.
    fn read(&mut self) -> Result<Vec<u8>, String>;

    /// Writes bytes, or keeps what the system does not take now and writes it soon; never waits.
    fn write(&mut self, bytes: Vec<u8>) -> Result<(), String>;

    /// Whether it keeps bytes that [`Self::flush`] is to write when the descriptor takes them.
    fn has_unwritten(&self) -> bool {
        false
    }

    /// Writes what was kept, as far as the system takes it; never waits.
    fn flush(&mut self) -> Result<(), String> {
        Ok(())
    }

    /// Whether it has something to read of which the descriptor does not say so.
    fn has_unread(&self) -> bool {
        false
    }

    /// The cable counts as lost: what was not delivered must not be delivered later.
    fn abandon(&mut self) {}
}

/// What a cable calls that fails while nobody reads or writes, with the reason.
pub(crate) type OnFailure = Box<dyn FnOnce(String) + Send>;

/// Opens the cable of the configuration; may take seconds. The error is for people.
pub(crate) fn open(
    config: &SerialConfig,
    on_failure: OnFailure,
) -> Result<Box<dyn Transport>, String> {
    let address = Address::parse(&config.path);
    let cable: Result<Box<dyn Transport>, String> = address.and_then(|address| match address {
        Address::Serial { path } => Ok(Box::new(Port::open(config, &path, on_failure)?) as _),
        Address::Tcp(host) => Ok(Box::new(Tcp::open(&host)?) as _),
        Address::WebSocket { host, path } => Ok(Box::new(Ws::open(&host, &path)?) as _),
        Address::Rfc2217(host) => {
            let SerialConfig { dtr, rts, .. } = *config;
            let settings = PortSettings { baud: config.driver.baud, dtr, rts };
            Ok(Box::new(Tcp::open_com_port(&host, settings)?) as _)
        }
    });
    cable.map_err(|reason| match config.path.is_empty() {
        true => reason,
        false => format!("cannot open {}: {reason}", config.path),
    })
}
