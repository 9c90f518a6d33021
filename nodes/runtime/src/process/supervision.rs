//! How a process and its supervisor keep in touch, without DDS.
//!
//! The protocol is that of systemd (`sd_notify`): the supervisor names a Unix socket in
//! `NOTIFY_SOCKET`, and the process sends short texts to it. `READY=1`: it has started.
//! `WATCHDOG=1`: it is alive and serves; it is due within `WATCHDOG_USEC`. `STOPPING=1`: it shuts
//! down, and is silent from here on. So a node runs under systemd, under `kerf up`, and under
//! any other supervisor that speaks this protocol.
//!
//! [`Notifier`] is the end of the process, [`Watched`] that of a supervisor; `restart_policy` holds
//! the decisions of the second.

mod mailbox;
mod notifier;
mod restart_policy;
mod watched;

pub use notifier::Notifier;
pub use restart_policy::Limits;
pub use watched::{Change, Watched};

use rustix::process::{Signal, getppid, set_parent_process_death_signal};

/// Exit status of a process whose DDS layer no longer serves it.
///
/// It exits at once: an orderly shutdown would need the DDS layer. Its supervisor restarts it.
pub const DEAF: u8 = 70;
/// Exit status of a process that took more memory than it may.
pub const TOO_LARGE: u8 = 71;
/// Exit status of a process in which a thread panicked; the one Rust uses.
pub const PANICKED: u8 = 101;

/// The process that started this one with [`Watched`]. A child compares it with its parent.
const SUPERVISOR: &str = "KERF_SUPERVISOR";

/// Ends this process at once when the thread that started it ends, for any reason.
///
/// For a process that is useless alone and needs no orderly end. Returns false when a
/// [`Watched`] started it and has ended already.
pub fn die_with_parent() -> std::io::Result<bool> {
    signal_with_parent(Signal::KILL)
}

/// Wakes this process from SIGSTOP when the thread that started it ends, so that it notices.
///
/// For a process that shuts down when the pipe from its parent closes. If it is stopped at that
/// moment, it would otherwise live on and keep its port.
pub fn wake_with_parent() -> std::io::Result<bool> {
    signal_with_parent(Signal::CONT)
}

fn signal_with_parent(signal: Signal) -> std::io::Result<bool> {
    set_parent_process_death_signal(Some(signal))?;
    // If the parent ended before the line above, no signal comes; an orphan has another parent.
    let supervisor = std::env::var(SUPERVISOR).ok().and_then(|text| text.parse().ok());
    let parent = getppid().map(|parent| parent.as_raw_nonzero().get());
    Ok(supervisor.is_none_or(|supervisor: i32| parent == Some(supervisor)))
}
