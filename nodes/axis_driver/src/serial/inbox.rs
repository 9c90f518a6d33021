//! What comes to the owner from other threads: commands, a cable that is open, a writer's failure, the end.
//!
//! The owner waits for this and for its port at once, so each push rings a bell that can
//! be polled. Bytes from the controller do not come this way: the owner reads them itself.

use crate::driver::Command;
use crate::transport::Transport;
use rustix::event::{EventfdFlags, eventfd};
use rustix::fd::{AsFd, BorrowedFd, OwnedFd};
use std::collections::VecDeque;
use std::io;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Commands that wait, at most.
const CONTROLS_MAX: usize = 256;

/// The driver has more commands than it can take; try again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{CONTROLS_MAX} commands are already waiting: try again")]
pub struct Full;

#[derive(Debug)]
pub(super) enum InboxCommand {
    Open,
    Close,
    Command { id: u64, command: Command },
}

/// Why a writer ended. `port` counts ports, so that the word of one that is gone is not
/// taken for that of the next.
#[derive(Debug)]
pub(super) struct WriterFailed {
    pub(super) port: u64,
    pub(super) reason: String,
}

/// What became of a cable that was to be opened.
#[derive(Debug)]
pub(super) struct Opened {
    pub(super) port: u64,
    pub(super) result: Result<Box<dyn Transport>, String>,
}

/// All that has come in since the last time.
#[derive(Debug, Default)]
pub(super) struct Batch {
    pub(super) controls: VecDeque<InboxCommand>,
    pub(super) opened: Option<Opened>,
    pub(super) failed: Option<WriterFailed>,
    pub(super) is_stopped: bool,
}

#[derive(Debug)]
pub(super) struct Inbox {
    waiting: Mutex<Batch>,
    bell: OwnedFd,
}

impl Inbox {
    pub(super) fn new() -> io::Result<Self> {
        let bell = eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)?;
        Ok(Self { waiting: Mutex::default(), bell })
    }

    fn lock(&self) -> MutexGuard<'_, Batch> {
        // Nothing in here is left half done by a panic.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn push_control(&self, control: InboxCommand) -> Result<(), Full> {
        let mut waiting = self.lock();
        if waiting.controls.len() >= CONTROLS_MAX {
            return Err(Full);
        }
        waiting.controls.push_back(control);
        self.ring();
        Ok(())
    }

    pub(super) fn push_failure(&self, failed: WriterFailed) {
        self.lock().failed = Some(failed);
        self.ring();
    }

    /// One cable is opened at a time.
    pub(super) fn push_opened(&self, opened: Opened) {
        self.lock().opened = Some(opened);
        self.ring();
    }

    pub(super) fn stop(&self) {
        self.lock().is_stopped = true;
        self.ring();
    }

    fn ring(&self) {
        // A bell that is full rings.
        let _ = rustix::io::write(&self.bell, &1u64.to_ne_bytes());
    }

    /// Can be read when something has come.
    pub(super) fn bell(&self) -> BorrowedFd<'_> {
        self.bell.as_fd()
    }

    /// Takes what has come; never waits.
    pub(super) fn take(&self) -> Batch {
        let mut waiting = self.lock();
        let _ = rustix::io::read(&self.bell, &mut [0; 8]);
        let is_stopped = waiting.is_stopped;
        Batch { is_stopped, ..std::mem::take(&mut *waiting) }
    }
}
