//! What the owner waits for: commands, bytes, the end.

use crate::driver::Command;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Commands that wait, at most.
const CONTROLS_MAX: usize = 256;
/// Reads that wait, at most; then the system's own buffer fills.
const READS_MAX: usize = 256;

/// The driver has more commands than it can take; try again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{CONTROLS_MAX} commands wait already")]
pub struct Full;

#[derive(Debug)]
pub(super) enum Control {
    Open,
    Close,
    Command { id: u64, command: Command },
}

/// What a reader or writer says. `port` counts ports, so that the words of one that is
/// gone are not taken for those of the next.
#[derive(Debug)]
pub(super) struct FromPort {
    pub(super) port: u64,
    pub(super) what: Result<Vec<u8>, String>,
}

#[derive(Debug, Default)]
struct Waiting {
    controls: VecDeque<Control>,
    reads: VecDeque<FromPort>,
    is_stopped: bool,
}

/// All that has come in since the last time.
#[derive(Debug, Default)]
pub(super) struct Batch {
    pub(super) controls: VecDeque<Control>,
    pub(super) reads: VecDeque<FromPort>,
    pub(super) is_stopped: bool,
}

#[derive(Debug, Default)]
pub(super) struct Inbox {
    waiting: Mutex<Waiting>,
    came: Condvar,
    taken: Condvar,
}

impl Inbox {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        // Nothing in here is left half done by a panic.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn push_control(&self, control: Control) -> Result<(), Full> {
        let mut waiting = self.lock();
        if waiting.controls.len() >= CONTROLS_MAX {
            return Err(Full);
        }
        waiting.controls.push_back(control);
        self.came.notify_one();
        Ok(())
    }

    /// Hands over what was read; waits while the owner is busy, up to `patience`.
    pub(super) fn push_read(&self, read: FromPort, patience: Duration) {
        let is_full = |waiting: &mut Waiting| waiting.reads.len() >= READS_MAX;
        let waiting = self.taken.wait_timeout_while(self.lock(), patience, is_full);
        let (mut waiting, _) = waiting.unwrap_or_else(PoisonError::into_inner);
        waiting.reads.push_back(read);
        self.came.notify_one();
    }

    pub(super) fn stop(&self) {
        self.lock().is_stopped = true;
        self.came.notify_one();
    }

    /// Waits until something comes or the time is over.
    pub(super) fn take(&self, patience: Duration) -> Batch {
        let is_empty = |waiting: &mut Waiting| {
            waiting.controls.is_empty() && waiting.reads.is_empty() && !waiting.is_stopped
        };
        let waiting = self.came.wait_timeout_while(self.lock(), patience, is_empty);
        let (mut waiting, _) = waiting.unwrap_or_else(PoisonError::into_inner);
        let batch = Batch {
            controls: std::mem::take(&mut waiting.controls),
            reads: std::mem::take(&mut waiting.reads),
            is_stopped: waiting.is_stopped,
        };
        self.taken.notify_all();
        batch
    }
}
