//! Detects when the port is opened: that resets some boards.
//!
//! The kernel raises DTR when a port is opened, and drops it at the last close unless HUPCL is
//! off. An Arduino board resets when DTR rises. A pseudo-terminal has no DTR: this file derives
//! it from the openings and closings of the device. Two openings within a poll may count as
//! one. A real port also loses its exclusive lock at the last close. A pseudo-terminal keeps it,
//! because its own end stays open, so `share_again` releases it.

use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::inotify::{CreateFlags, ReadFlags, Reader, WatchFlags, add_watch, init};
use rustix::io::Errno;

/// The effect of openings and closings.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Seen {
    pub(super) has_dtr_risen: bool,
    /// The last peer has closed the port.
    pub(super) is_left: bool,
}

/// Openings and closings of a port since it was made.
#[derive(Debug)]
pub(super) struct Opens {
    inotify: OwnedFd,
    open: u32,
    is_dtr_up: bool,
}

impl Opens {
    pub(super) fn watch(path: &Path) -> io::Result<Self> {
        let inotify = init(CreateFlags::NONBLOCK | CreateFlags::CLOEXEC)?;
        let events = WatchFlags::OPEN | WatchFlags::CLOSE_WRITE | WatchFlags::CLOSE_NOWRITE;
        add_watch(&inotify, path, events)?;
        Ok(Self { inotify, open: 0, is_dtr_up: false })
    }

    /// Openings and closings since the last call; `drops`: does DTR drop at the last close?
    pub(super) fn look(&mut self, drops: bool) -> io::Result<Seen> {
        let mut seen = Seen::default();
        let mut buffer = [MaybeUninit::uninit(); 512];
        let mut events = Reader::new(&self.inotify, &mut buffer);
        loop {
            let event = match events.next() {
                Ok(event) => event.events(),
                Err(Errno::WOULDBLOCK | Errno::INTR) => return Ok(seen),
                Err(error) => return Err(error.into()),
            };
            if event.contains(ReadFlags::OPEN) {
                self.open += 1;
                seen.has_dtr_risen |= !self.is_dtr_up;
                seen.is_left = false;
                self.is_dtr_up = true;
            } else if event.intersects(ReadFlags::CLOSE_WRITE | ReadFlags::CLOSE_NOWRITE) {
                self.open = self.open.saturating_sub(1);
                seen.is_left = self.open == 0;
                if self.open == 0 && drops {
                    self.is_dtr_up = false;
                }
            }
        }
    }
}

impl AsFd for Opens {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.inotify.as_fd()
    }
}
