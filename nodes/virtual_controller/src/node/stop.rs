//! Ends `serve` from another thread: a pipe whose write end is the handle.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use rustix::pipe::{PipeFlags, pipe_with};

/// The end that `serve` waits on.
#[derive(Debug)]
pub struct Stop(OwnedFd);

/// The end that stops `serve`: by [`StopHandle::stop`], or by being dropped.
#[derive(Debug)]
pub struct StopHandle(OwnedFd);

/// Makes a connected pair.
pub fn stop_pair() -> io::Result<(StopHandle, Stop)> {
    let (read, write) = pipe_with(PipeFlags::CLOEXEC | PipeFlags::NONBLOCK)?;
    Ok((StopHandle(write), Stop(read)))
}

impl StopHandle {
    /// Ends `serve`; may be called more than once.
    pub fn stop(&self) {
        // A full pipe stops `serve` as well.
        let _ = rustix::io::write(&self.0, b"x");
    }

    /// Another handle on the same pipe, for a signal handler.
    pub(super) fn duplicate(&self) -> io::Result<OwnedFd> {
        self.0.try_clone()
    }
}

impl AsFd for Stop {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}
