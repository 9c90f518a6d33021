//! Runs any device on a pseudo-terminal or a network port, in a thread of the caller's process.
//!
//! For devices other than the virtual controller: no faults, no pulled cable, no signals, unlike
//! `serve`.

use std::path::Path;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, poll};

use super::listen::Listen;
use super::network::NetworkPort;
use super::port::{Cable, Port};
use super::serve::{BACKLOG_BYTES_MAX, ServeError, UNREAD_BYTES_MAX, timespec};
use super::stop::Stop;
use crate::firmware::Greeting;
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
    let way = Cable::Terminal { link: Some(link.to_path_buf()), resets_on_open: false };
    let port = Port::open(way)?;
    ready();
    serve_port(device, timing, port, look_every, stop)
}

/// Runs a device on a network port until `stop`; `ready` is called once, with the address.
///
/// # Errors
/// The port cannot be listened on, or it failed in use.
pub fn serve_device_on<D: Device>(
    device: D,
    timing: LineTiming,
    listen: Listen,
    look_every: Duration,
    stop: &Stop,
    ready: impl FnOnce(Listen),
) -> Result<(), ServeError> {
    let keeps_session = Duration::ZERO;
    let network = NetworkPort::open(listen, keeps_session, Greeting::default())?;
    ready(network.listen());
    serve_port(device, timing, Port::Network(network), look_every, stop)
}

fn serve_port<D: Device>(
    device: D,
    timing: LineTiming,
    mut port: Port,
    look_every: Duration,
    stop: &Stop,
) -> Result<(), ServeError> {
    let mut line = PacedLine::new(device, timing);
    let started = Instant::now();
    let mut unread = Vec::new();
    loop {
        let now = started.elapsed();
        line.advance(now);
        line.transmit(now, &mut unread);
        port.look()?;
        port.write(&mut unread, UNREAD_BYTES_MAX)?;
        let next = line.next_event().map_or(look_every, |at| at.saturating_sub(now));
        let mut fds = vec![PollFd::new(stop, PollFlags::IN)];
        let reads = line.backlog() < BACKLOG_BYTES_MAX;
        let [peer, clients] = port.waits_for(reads, !unread.is_empty());
        let has_peer = peer.is_some();
        let waits = peer.into_iter().chain(clients);
        fds.extend(waits.map(|(fd, events)| PollFd::from_borrowed_fd(fd, events)));
        match poll(&mut fds, Some(&timespec(next.min(look_every)))) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(std::io::Error::from(error).into()),
        }
        if !fds[0].revents().is_empty() {
            return Ok(());
        }
        let has_bytes = has_peer && !fds[1].revents().is_empty();
        drop(fds);
        if has_bytes {
            line.receive(started.elapsed(), &port.read()?);
        }
    }
}
