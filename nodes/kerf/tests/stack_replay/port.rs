//! A machine's port of which a test learns whether anybody touches it.

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

/// A pseudo-terminal without a controller.
#[derive(Debug)]
pub(crate) struct SilentPort {
    _master: OwnedFd,
    watch: OwnedFd,
    path: PathBuf,
}

impl SilentPort {
    pub(crate) fn open() -> Self {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).expect("a pseudo-terminal");
        grantpt(&master).and_then(|()| unlockpt(&master)).expect("it is ours");
        let name = ptsname(&master, Vec::new()).expect("it has a name").into_string();
        let path = PathBuf::from(name.expect("a name in ASCII"));
        let watch = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK).expect("a watch");
        inotify::add_watch(&watch, &path, WatchFlags::OPEN).expect("it can be watched");
        Self { _master: master, watch, path }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// How often it was opened since the last time.
    pub(crate) fn openings(&mut self) -> usize {
        let mut buffer = [MaybeUninit::uninit(); 1024];
        let mut events = Reader::new(&self.watch, &mut buffer);
        let mut count = 0;
        while let Ok(event) = events.next() {
            count += usize::from(event.events().contains(ReadFlags::OPEN));
        }
        count
    }
}
