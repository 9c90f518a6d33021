//! Sends the state of a process to its supervisor (`sd_notify`).

use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::sync::Arc;
use std::time::Duration;

/// Reports to the supervisor of this process; does nothing where there is none.
///
/// Needs no DDS and never blocks: a message that the supervisor's queue cannot take is lost.
#[derive(Debug, Clone, Default)]
pub struct Notifier {
    to: Option<Arc<(UnixDatagram, SocketAddr)>>,
    interval: Option<Duration>,
}

impl Notifier {
    /// From `NOTIFY_SOCKET` and `WATCHDOG_USEC` of the environment.
    pub fn from_environment() -> Self {
        Self::new(
            std::env::var_os("NOTIFY_SOCKET").as_deref(),
            std::env::var("WATCHDOG_USEC").ok().as_deref(),
            std::env::var("WATCHDOG_PID").ok().as_deref(),
        )
    }

    fn new(socket: Option<&OsStr>, microseconds: Option<&str>, process: Option<&str>) -> Self {
        let to = socket.and_then(|name| {
            let address = address(name)?;
            let socket = UnixDatagram::unbound().ok()?;
            socket.set_nonblocking(true).ok()?;
            Some(Arc::new((socket, address)))
        });
        // Variables are inherited: these may be meant for a parent process.
        let is_ours = process.is_none_or(|it| it.trim() == std::process::id().to_string());
        let interval = microseconds
            .filter(|_| to.is_some() && is_ours)
            .and_then(|text| text.trim().parse().ok())
            .filter(|microseconds| *microseconds > 0)
            .map(Duration::from_micros);
        Self { to, interval }
    }

    /// The longest silence that the supervisor accepts; [`Self::alive`] is due at least twice
    /// within it. `None`: it does not watch.
    pub fn silence_max(&self) -> Option<Duration> {
        self.interval
    }

    /// The process has started and serves.
    pub fn ready(&self) {
        self.send("READY=1\nWATCHDOG=1");
    }

    /// The process lives and serves.
    pub fn alive(&self) {
        self.send("WATCHDOG=1");
    }

    /// The process shuts down and sends nothing more.
    pub fn stopping(&self) {
        self.send("STOPPING=1");
    }

    fn send(&self, text: &str) {
        if let Some((socket, address)) = self.to.as_deref() {
            // The supervisor has ended, or its queue is full.
            let _ = socket.send_to_addr(text.as_bytes(), address);
        }
    }
}

/// A path, or `@name` for a name without a file, as systemd writes it.
fn address(name: &OsStr) -> Option<SocketAddr> {
    match name.as_bytes() {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name).ok(),
        [b'/', ..] => SocketAddr::from_pathname(name).ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::supervision::mailbox::{Mailbox, Notices};

    #[test]
    fn what_a_process_says_reaches_the_mailbox() {
        let mailbox = Mailbox::new().expect("a socket");
        let path = mailbox.path();
        let notifier = Notifier::new(Some(path.as_os_str()), Some("1500000"), None);
        assert_eq!(notifier.silence_max(), Some(Duration::from_millis(1500)));
        assert_eq!(mailbox.read(), Notices::default());
        notifier.alive();
        assert_eq!(mailbox.read(), Notices { alive: true, ..Notices::default() });
        notifier.ready();
        notifier.stopping();
        assert_eq!(mailbox.read(), Notices { ready: true, alive: true, stopping: true });
        let folder = path.parent().expect("a folder").to_owned();
        drop(mailbox);
        assert!(!folder.exists());
        // The supervisor has ended; nothing happens.
        notifier.alive();
    }

    #[test]
    fn a_name_without_a_file_is_a_socket_too() {
        let name = format!("kerf-notifier-{}", std::process::id());
        let address = SocketAddr::from_abstract_name(&name).expect("a short name");
        let socket = UnixDatagram::bind_addr(&address).expect("nobody else has it");
        Notifier::new(Some(OsStr::new(&format!("@{name}"))), None, None).ready();
        let mut text = [0; 64];
        let length = socket.recv(&mut text).expect("a text");
        assert_eq!(&text[..length], b"READY=1\nWATCHDOG=1");
    }

    #[test]
    fn a_watchdog_of_another_process_is_not_ours() {
        let path = Some(OsStr::new("/run/nobody"));
        let own = std::process::id().to_string();
        let table = [
            (path, Some("2000000"), None, Some(2)),
            (path, Some("2000000"), Some(own.as_str()), Some(2)),
            (path, Some("2000000"), Some("1"), None),
            (path, Some("0"), None, None),
            (path, Some("soon"), None, None),
            (path, None, None, None),
            (None, Some("2000000"), None, None),
            (Some(OsStr::new("relative")), Some("2000000"), None, None),
        ];
        for (socket, microseconds, process, expected) in table {
            let notifier = Notifier::new(socket, microseconds, process);
            assert_eq!(
                notifier.silence_max().map(|it| it.as_secs()),
                expected,
                "{socket:?} {microseconds:?} {process:?}"
            );
        }
    }
}
