//! Standard error, which nobody may read: a terminal that is stopped, a pipe that is full.
//!
//! What it does not take in time is left out. Nothing waits for it for long, since whoever logs
//! may have a machine in hand.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io::Stderr;

/// How long a console that is full may take.
const WITHIN: Timespec = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
/// What a pipe takes in one piece when it takes anything.
const PIECE_MAX: usize = 4_000;

/// Writes a line, unless nobody takes it.
pub(crate) fn write(line: &str) {
    write_within(line, &WITHIN);
}

/// The same with another patience.
pub(crate) fn write_within(line: &str, within: &Timespec) {
    let console = std::io::stderr();
    for piece in line.as_bytes().chunks(PIECE_MAX) {
        if !takes(&console, within) {
            return;
        }
        // Not through the lock of standard error: whoever holds it may be the one who hangs.
        let _ = rustix::io::write(&console, piece);
    }
}

fn takes(console: &Stderr, within: &Timespec) -> bool {
    let mut waiting = [PollFd::new(console, PollFlags::OUT)];
    poll(&mut waiting, Some(within)).is_ok_and(|ready| ready > 0)
}
