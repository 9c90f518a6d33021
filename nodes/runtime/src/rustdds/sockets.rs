//! Restricts the sockets of a node to this computer.
//!
//! RustDDS announces a participant on the given networks only, but binds its
//! sockets to all addresses. The port numbers are well known, so a peer on another
//! computer could discover the node and move the machine. So we bind each socket of the
//! participant to the loopback interface: no packet arrives from outside, and none leaves.
//! The report: docs/upstream/rustdds-wildcard-sockets.md.

use rustix::io::Errno;
use rustix::process::{PidfdFlags, PidfdGetfdFlags, getpid, pidfd_getfd, pidfd_open};
use socket2::{Domain, SockRef};
use std::collections::BTreeSet;
use std::fs::{read_dir, read_link};
use std::io;
use std::os::fd::RawFd;

const LOOPBACK: &[u8] = b"lo";

/// The open sockets of this process, by number and identity.
pub(crate) fn open_sockets() -> io::Result<BTreeSet<(RawFd, String)>> {
    let mut sockets = BTreeSet::new();
    for entry in read_dir("/proc/self/fd")?.flatten() {
        let Some(number) = entry.file_name().to_str().and_then(|name| name.parse().ok()) else {
            continue;
        };
        // This includes the directory itself, which is closed by now.
        let Ok(target) = read_link(entry.path()) else { continue };
        let target = target.to_string_lossy();
        if target.starts_with("socket:") {
            sockets.insert((number, target.into_owned()));
        }
    }
    Ok(sockets)
}

/// Binds the IP sockets that were opened since to the loopback interface, and
/// returns how many there are.
pub(crate) fn confine_since(before: &BTreeSet<(RawFd, String)>) -> io::Result<usize> {
    let this = pidfd_open(getpid(), PidfdFlags::empty())?;
    let mut confined = 0;
    for (number, _) in open_sockets()?.difference(before) {
        // Two numbers of the same socket share its settings.
        let socket = match pidfd_getfd(&this, *number, PidfdGetfdFlags::empty()) {
            // A socket of another part of this process, closed by now.
            Err(Errno::BADF) => continue,
            socket => socket?,
        };
        let socket = SockRef::from(&socket);
        if matches!(socket.domain()?, Domain::IPV4 | Domain::IPV6) {
            socket.bind_device(Some(LOOPBACK))?;
            confined += 1;
        }
    }
    Ok(confined)
}
