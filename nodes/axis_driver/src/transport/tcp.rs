//! A TCP connection to the board: its Telnet port, a serial server, or one that speaks RFC 2217.
//!
//! Boards pass bytes on as they are. A Telnet server may negotiate; all that it offers is
//! refused, and nothing of that reaches the driver.

use super::Transport;
use super::com_port::{Opening, PortSettings, Progress};
use super::socket::{Heard, PATIENCE, Unwritten, abandon, connect};
use super::telnet::{Telnet, escape};
use crate::address::Host;
use rustix::fd::{AsFd, BorrowedFd};
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Instant;

/// Bytes that are read in one go.
const READ_BYTES_MAX: usize = 4096;

/// A connection that is open. Dropping it closes it.
#[derive(Debug)]
pub(super) struct Tcp {
    stream: TcpStream,
    telnet: Telnet,
    /// Whether the other side takes 255 for the beginning of a command.
    is_telnet: bool,
    heard: Heard,
    unwritten: Unwritten,
}

impl Tcp {
    /// Connects to a port that passes bytes on. The error is for people.
    pub(super) fn open(host: &Host) -> Result<Self, String> {
        let stream = connect(host)?;
        Self::new(stream, Telnet::new(&[]), false)
    }

    /// Connects to a gateway of RFC 2217, and opens its serial port. The error is for people.
    pub(super) fn open_com_port(host: &Host, settings: PortSettings) -> Result<Self, String> {
        let stream = connect(host)?;
        let telnet = negotiate(&stream, settings)?;
        Self::new(stream, telnet, true)
    }

    fn new(stream: TcpStream, telnet: Telnet, is_telnet: bool) -> Result<Self, String> {
        stream.set_nonblocking(true).map_err(|error| error.to_string())?;
        let (heard, unwritten) = (Heard::default(), Unwritten::default());
        Ok(Self { stream, telnet, is_telnet, heard, unwritten })
    }
}

/// Waits until the gateway has made the port as wanted.
fn negotiate(mut stream: &TcpStream, settings: PortSettings) -> Result<Telnet, String> {
    let mut heard = Heard::default();
    let (mut opening, mut reply) = Opening::new(settings);
    let begin = Instant::now();
    loop {
        stream.write_all(&reply).map_err(|error| heard.lost(&error))?;
        let left = PATIENCE.saturating_sub(begin.elapsed());
        let none = || {
            let s = PATIENCE.as_secs();
            format!(
                "no answer to the option COM-PORT of RFC 2217 within {s} s; check the port number, or write \
                 tcp:// for a port that passes bytes on as they are, ws:// for a WebSocket"
            )
        };
        if left.is_zero() {
            return Err(none());
        }
        let mut bytes = [0; READ_BYTES_MAX];
        let read = stream.set_read_timeout(Some(left)).and_then(|()| stream.read(&mut bytes));
        let bytes = match read {
            Ok(0) => return Err(heard.closed()),
            Ok(count) => &bytes[..count],
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                return Err(none());
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => &[],
            Err(error) => return Err(heard.lost(&error)),
        };
        heard.take(bytes)?;
        let (progress, more) = opening.receive(bytes);
        match progress {
            Progress::Waiting => reply = more,
            Progress::Refused(reason) => return Err(reason),
            Progress::Open => {
                stream.write_all(&more).map_err(|error| heard.lost(&error))?;
                return Ok(opening.into_telnet());
            }
        }
    }
}

impl Transport for Tcp {
    fn read(&mut self) -> Result<Vec<u8>, String> {
        let mut bytes = [0; READ_BYTES_MAX];
        match (&self.stream).read(&mut bytes) {
            Ok(0) => Err(self.heard.closed()),
            Ok(count) => {
                self.heard.take(&bytes[..count])?;
                let received = self.telnet.receive(&bytes[..count]);
                self.unwritten.write(&self.stream, &received.reply)?;
                Ok(received.data)
            }
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) =>
            {
                Ok(Vec::new())
            }
            Err(error) => Err(self.heard.lost(&error)),
        }
    }

    fn write(&mut self, bytes: Vec<u8>) -> Result<(), String> {
        let bytes = if self.is_telnet { escape(&bytes) } else { bytes };
        self.unwritten.write(&self.stream, &bytes)
    }

    fn has_unwritten(&self) -> bool {
        !self.unwritten.is_empty()
    }

    fn flush(&mut self) -> Result<(), String> {
        self.unwritten.flush(&self.stream)
    }

    fn abandon(&mut self) {
        abandon(&self.stream);
    }
}

impl AsFd for Tcp {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }
}
