//! The port that peers see: a pseudo-terminal and a link to it, while the cable is plugged in.

use std::path::{Path, PathBuf};

use super::opens::Opens;
use super::pty::{Link, Pty};
use super::serve::ServeError;

/// A port that may vanish and come back as another device.
#[derive(Debug)]
pub(super) struct Port {
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

impl Port {
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

    /// The path that peers open, while the cable is plugged in.
    pub(super) fn path(&self) -> Option<&Path> {
        self.pty().map(Pty::path)
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
