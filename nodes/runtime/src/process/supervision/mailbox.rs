//! The socket on which a supervisor receives the messages of one child.
//!
//! Its folder is private to this user: no other user can send messages for the child, or fill
//! the queue.

use std::fs::{DirBuilder, remove_dir, remove_file};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Folders of this process so far.
static FOLDERS: AtomicU32 = AtomicU32::new(0);
/// A longer text is cut; the longest of ours is a status line.
const TEXT_MAX: usize = 4_096;
/// Messages read in one look; the rest is read in the next.
const TEXTS_MAX: usize = 1_000;

/// The messages of a child since the last look.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Notices {
    pub(crate) ready: bool,
    pub(crate) alive: bool,
    pub(crate) stopping: bool,
}

impl Notices {
    /// Reads one message, a `NAME=value` a line; skips unknown names.
    pub(crate) fn take(&mut self, text: &[u8]) {
        for line in text.split(|byte| *byte == b'\n') {
            match line {
                b"READY=1" => self.ready = true,
                b"WATCHDOG=1" => self.alive = true,
                b"STOPPING=1" => self.stopping = true,
                _ => {}
            }
        }
    }
}

/// A bound socket and its folder; both are removed with it.
#[derive(Debug)]
pub(crate) struct Mailbox {
    socket: UnixDatagram,
    folder: PathBuf,
}

impl Mailbox {
    /// Binds a socket in a folder of its own.
    pub(crate) fn new() -> io::Result<Self> {
        let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
        let places =
            [runtime, Some(std::env::temp_dir()), Some("/tmp".into()), Some("/dev/shm".into())];
        let mut last = io::Error::other("there is no folder for sockets");
        // A folder may be missing, read-only, or have a path too long for a socket.
        for place in places.into_iter().flatten().filter(|place| place.is_absolute()) {
            match Self::below(&place) {
                Ok(mailbox) => return Ok(mailbox),
                Err(error) => {
                    last = io::Error::new(error.kind(), format!("{}: {error}", place.display()));
                }
            }
        }
        Err(last)
    }

    fn below(place: &Path) -> io::Result<Self> {
        loop {
            let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
            let folder = place.join(format!("kerf-watch-{}-{number}", std::process::id()));
            match DirBuilder::new().mode(0o700).create(&folder) {
                Ok(()) => {}
                // Left by an earlier process with the same number.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => continue,
                Err(error) => return Err(error),
            }
            let bound = UnixDatagram::bind(folder.join("notify"))
                .and_then(|socket| socket.set_nonblocking(true).map(|()| socket));
            return match bound {
                Ok(socket) => Ok(Self { socket, folder }),
                Err(error) => {
                    let _ = remove_dir(&folder);
                    Err(error)
                }
            };
        }
    }

    /// The value of `NOTIFY_SOCKET` for the child.
    pub(crate) fn path(&self) -> PathBuf {
        self.folder.join("notify")
    }

    /// All messages since the last look.
    pub(crate) fn read(&self) -> Notices {
        let (mut notices, mut text) = (Notices::default(), [0; TEXT_MAX]);
        for _ in 0..TEXTS_MAX {
            // Empty or unreadable: the child is silent.
            let Ok(length) = self.socket.recv(&mut text) else { break };
            notices.take(&text[..length]);
        }
        notices
    }
}

impl Drop for Mailbox {
    fn drop(&mut self) {
        // It may have been removed already.
        let _ = remove_file(self.path());
        let _ = remove_dir(&self.folder);
    }
}
