//! How a process and its supervisor keep in touch, without DDS.
//!
//! The protocol is that of systemd (`sd_notify`): the supervisor names a Unix socket in
//! `NOTIFY_SOCKET`, and the process sends short texts to it. `READY=1`: it has started.
//! `WATCHDOG=1`: it is alive and serves; it is due within `WATCHDOG_USEC`. `STOPPING=1`: it ends
//! in its own order, and is silent from here on. So one node runs under systemd, under `kerf up`
//! and under any other supervisor that speaks this protocol.
//!
//! [`Notifier`] is the end of the process, [`Watched`] that of a supervisor; `patience` holds
//! the decisions of the second.

mod mailbox;
mod notifier;
mod patience;
mod watched;

pub use notifier::Notifier;
pub use patience::Limits;
pub use watched::{Change, Watched};

use rustix::process::{Signal, getppid, set_parent_process_death_signal};

/// Exit status of a process whose DDS layer no longer serves it.
///
/// It ends at once, without the ordered end of a node: what DDS has to be asked for is gone. Its
/// supervisor starts it again.
pub const DEAF: u8 = 70;
/// Exit status of a process that took more memory than it may.
pub const TOO_LARGE: u8 = 71;
/// Exit status of a process in which a thread panicked; the one Rust uses.
pub const PANICKED: u8 = 101;

/// The process that started this one with [`Watched`], for those that want to know whether it is
/// still their parent.
const SUPERVISOR: &str = "KERF_SUPERVISOR";

/// Ends this process at once when the thread that started it ends, however that comes about.
///
/// For a process that is of no use alone and holds nothing that needs an orderly end. Returns
/// false when a [`Watched`] started it and has ended already.
pub fn die_with_parent() -> std::io::Result<bool> {
    signal_with_parent(Signal::KILL)
}

/// Wakes this process from SIGSTOP when the thread that started it ends, so that it notices.
///
/// For a process that leaves in order when the pipe from its parent closes: one that is stopped
/// at that moment would stay for ever, with its port.
pub fn wake_with_parent() -> std::io::Result<bool> {
    signal_with_parent(Signal::CONT)
}

fn signal_with_parent(signal: Signal) -> std::io::Result<bool> {
    set_parent_process_death_signal(Some(signal))?;
    // A parent that ended before the line above sends nothing; its orphans have another one.
    let supervisor = std::env::var(SUPERVISOR).ok().and_then(|text| text.parse().ok());
    let parent = getppid().map(|parent| parent.as_raw_nonzero().get());
    Ok(supervisor.is_none_or(|supervisor: i32| parent == Some(supervisor)))
}
