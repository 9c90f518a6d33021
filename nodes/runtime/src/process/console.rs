//! Writes to standard error without blocking: a terminal may be stopped, a pipe full.
//!
//! Lines that it does not take in time are dropped, because the thread that logs may control a
//! machine.

use crate::process::time::RosTime;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io::Stderr;

/// How long to wait for a console that is full.
const WITHIN: Timespec = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
/// Bytes that a pipe takes at once if it takes any.
const PIECE_MAX: usize = 4_000;

/// Writes a line, or drops it if the console is full.
pub(crate) fn write(line: &str) {
    write_within(line, &WITHIN);
}

/// The same with another timeout.
pub(crate) fn write_within(line: &str, within: &Timespec) {
    let console = std::io::stderr();
    for piece in line.as_bytes().chunks(PIECE_MAX) {
        if !takes(&console, within) {
            return;
        }
        // Without the lock of standard error: the thread that holds it may hang.
        let _ = rustix::io::write(&console, piece);
    }
}

fn takes(console: &Stderr, within: &Timespec) -> bool {
    let mut waiting = [PollFd::new(console, PollFlags::OUT)];
    poll(&mut waiting, Some(within)).is_ok_and(|ready| ready > 0)
}

/// `[INFO] [1700000000.123456789] [cell.driver]: text`, as rcl writes it.
pub(crate) fn log_line(level: &str, time: RosTime, logger: &str, text: &str) -> String {
    let (sec, nanosec) = time.parts();
    format!("[{level}] [{sec}.{nanosec:09}] [{logger}]: {text}\n")
}
