//! Runs any device on a pseudo-terminal, in a thread of the caller's process.
//!
//! For devices other than the virtual controller: no faults, no pulled cable, no signals, unlike
//! `serve`.

use std::path::Path;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, poll};

use super::port::Port;
use super::serve::{BACKLOG_BYTES_MAX, ServeError, UNREAD_BYTES_MAX, timespec};
use super::stop::Stop;
use crate::paced::{Device, LineTiming, PacedLine};

/// Runs a device at a link until `stop`.
///
/// `ready` is called once, when the link can be opened. The device is polled at least every
/// `look_every`, for devices with input other than the line.
///
/// # Errors
/// There is no pseudo-terminal or no link, or it failed in use.
pub fn serve_device<D: Device>(
    device: D,
    timing: LineTiming,
    link: &Path,
    look_every: Duration,
    stop: &Stop,
    ready: impl FnOnce(),
) -> Result<(), ServeError> {
    let mut port = Port::open(Some(link.to_path_buf()), false)?;
    let mut line = PacedLine::new(device, timing);
    let started = Instant::now();
    let mut unread = Vec::new();
    let mut buffer = [0; 1024];
    ready();
    loop {
        let now = started.elapsed();
        line.advance(now);
        line.transmit(now, &mut unread);
        port.look()?;
        let Some(pty) = port.pty() else { return Ok(()) };
        while !unread.is_empty() {
            let count = pty.write(&unread)?;
            if count == 0 {
                break;
            }
            unread.drain(..count);
        }
        unread.truncate(UNREAD_BYTES_MAX);

        let mut events = PollFlags::empty();
        if line.backlog() < BACKLOG_BYTES_MAX {
            events |= PollFlags::IN;
        }
        if !unread.is_empty() {
            events |= PollFlags::OUT;
        }
        let next = line.next_event().map_or(look_every, |at| at.saturating_sub(now));
        let mut fds = [PollFd::new(stop, PollFlags::IN), PollFd::new(pty, events)];
        match poll(&mut fds, Some(&timespec(next.min(look_every)))) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(std::io::Error::from(error).into()),
        }
        if !fds[0].revents().is_empty() {
            return Ok(());
        }
        if fds[1].revents().contains(PollFlags::IN) {
            let count = pty.read(&mut buffer)?;
            line.receive(started.elapsed(), &buffer[..count]);
        }
    }
}
