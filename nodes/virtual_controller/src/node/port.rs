//! The port that peers see while the cable is plugged in: a pseudo-terminal and a link to it, or a
//! network port.

use std::os::fd::{AsFd, BorrowedFd};
use std::path::PathBuf;
use std::time::Duration;

use rustix::event::PollFlags;

use super::listen::Listen;
use super::network::NetworkPort;
use super::opens::Opens;
use super::pty::{Link, Pty};
use super::serve::ServeError;
use crate::firmware::Greeting;

/// How peers reach a device.
#[derive(Debug, Clone)]
pub(super) enum Cable {
    /// A pseudo-terminal, with a link to it if one is named.
    Terminal { link: Option<PathBuf>, resets_on_open: bool },
    /// A network port. A session outlives its client by `keeps_session`.
    Network { listen: Listen, keeps_session: Duration, greeting: Greeting },
}

/// A port that may vanish and come back.
#[derive(Debug)]
pub(super) enum Port {
    Terminal(TerminalPort),
    Network(NetworkPort),
}

impl Port {
    pub(super) fn open(way: Cable) -> Result<Self, ServeError> {
        Ok(match way {
            Cable::Terminal { link, resets_on_open } => {
                Self::Terminal(TerminalPort::open(link, resets_on_open)?)
            }
            Cable::Network { listen, keeps_session, greeting } => {
                Self::Network(NetworkPort::open(listen, keeps_session, greeting)?)
            }
        })
    }

    /// The path or the URL that peers open, while the cable is plugged in.
    pub(super) fn path(&self) -> Option<PathBuf> {
        match self {
            Self::Terminal(port) => port.pty().map(|pty| pty.path().to_path_buf()),
            Self::Network(port) => Some(port.listen().to_string().into()),
        }
    }

    /// Checks for openings and closings, or new clients; returns whether they reset the board.
    pub(super) fn look(&mut self) -> std::io::Result<bool> {
        match self {
            Self::Terminal(port) => port.look(),
            Self::Network(port) => port.look().map(|()| false),
        }
    }

    /// Hangs up on the peer and removes the link.
    pub(super) fn pull(&mut self) -> Result<(), ServeError> {
        match self {
            Self::Terminal(port) => port.pull(),
            Self::Network(port) => {
                port.pull();
                Ok(())
            }
        }
    }

    /// Plugs the cable in; returns whether it was out before.
    pub(super) fn plug(&mut self) -> Result<bool, ServeError> {
        match self {
            Self::Terminal(port) => port.plug(),
            Self::Network(port) => port.plug(),
        }
    }

    /// Reads what the peer has sent; no bytes are no error.
    pub(super) fn read(&mut self) -> std::io::Result<Vec<u8>> {
        match self {
            Self::Terminal(port) => {
                let Some(pty) = port.pty() else { return Ok(Vec::new()) };
                let mut buffer = [0; 1024];
                let count = pty.read(&mut buffer)?;
                Ok(buffer[..count].to_vec())
            }
            Self::Network(port) => Ok(port.read()),
        }
    }

    /// Writes what fits, and takes that off; what a peer does not read waits, up to a limit.
    pub(super) fn write(&mut self, bytes: &mut Vec<u8>, unread_max: usize) -> std::io::Result<()> {
        match self {
            Self::Terminal(port) => {
                let Some(pty) = port.pty() else { return Ok(()) };
                while !bytes.is_empty() {
                    let count = pty.write(bytes)?;
                    if count == 0 {
                        break;
                    }
                    bytes.drain(..count);
                }
                bytes.truncate(unread_max);
            }
            Self::Network(port) => port.write(&std::mem::take(bytes)),
        }
        Ok(())
    }

    /// What to wait for: the peer first, then openings or new clients, which come before its bytes.
    pub(super) fn waits_for(
        &self,
        reads: bool,
        has_unread: bool,
    ) -> [Option<(BorrowedFd<'_>, PollFlags)>; 2] {
        match self {
            Self::Terminal(port) => {
                let mut flags = PollFlags::empty();
                flags.set(PollFlags::IN, reads);
                flags.set(PollFlags::OUT, has_unread);
                let pty = port.pty().map(|pty| (pty.as_fd(), flags));
                [pty, port.opens().map(|opens| (opens.as_fd(), PollFlags::IN))]
            }
            Self::Network(port) => port.waits_for(reads),
        }
    }
}

/// A pseudo-terminal that may vanish and come back as another device.
#[derive(Debug)]
pub(super) struct TerminalPort {
    link: Option<PathBuf>,
    resets_on_open: bool,
    plugged: Option<Plugged>,
    /// The device it comes back as; opened before the old one is closed, so that it is a new one.
    next: Option<Pty>,
}

#[derive(Debug)]
struct Plugged {
    pty: Pty,
    opens: Opens,
    _link: Option<Link>,
}

impl TerminalPort {
    /// Opens a port, with a link if `link` is given.
    pub(super) fn open(link: Option<PathBuf>, resets_on_open: bool) -> Result<Self, ServeError> {
        let next = Some(Pty::open().map_err(ServeError::Pty)?);
        let mut port = Self { link, resets_on_open, plugged: None, next };
        port.plug()?;
        Ok(port)
    }

    /// The pseudo-terminal, while the cable is plugged in.
    pub(super) fn pty(&self) -> Option<&Pty> {
        self.plugged.as_ref().map(|plugged| &plugged.pty)
    }

    /// The watch on openings and closings, while the cable is plugged in.
    pub(super) fn opens(&self) -> Option<&Opens> {
        self.plugged.as_ref().map(|plugged| &plugged.opens)
    }

    /// Checks for openings and closings; returns whether they reset the board.
    pub(super) fn look(&mut self) -> std::io::Result<bool> {
        let Some(Plugged { pty, opens, .. }) = &mut self.plugged else { return Ok(false) };
        let seen = opens.look(pty.hangs_up())?;
        if seen.is_left {
            pty.share_again();
        }
        Ok(seen.has_dtr_risen && self.resets_on_open)
    }

    /// Hangs up on the peer and removes the link.
    pub(super) fn pull(&mut self) -> Result<(), ServeError> {
        if self.next.is_none() {
            self.next = Some(Pty::open().map_err(ServeError::Pty)?);
        }
        self.plugged = None;
        Ok(())
    }

    /// Plugs the cable in; returns whether it was out before.
    pub(super) fn plug(&mut self) -> Result<bool, ServeError> {
        let Some(pty) = self.next.take() else { return Ok(false) };
        let link = match &self.link {
            None => None,
            Some(path) => Some(
                Link::create(path, pty.path())
                    .map_err(|source| ServeError::Link { path: path.clone(), source })?,
            ),
        };
        let opens = Opens::watch(pty.path()).map_err(ServeError::Pty)?;
        self.plugged = Some(Plugged { pty, opens, _link: link });
        Ok(true)
    }
}
