//! A serial port that reports when it is opened and closed.

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};
use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{ControlModes, OptionalActions, ioctl_tiocnxcl, tcgetattr, tcsetattr};
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

/// A pseudo-terminal, as a port of which this is the far end.
#[derive(Debug)]
pub(crate) struct Port {
    master: OwnedFd,
    /// Open, so that the near end may come and go.
    slave: OwnedFd,
    watch: OwnedFd,
    path: PathBuf,
    openings: usize,
    closings: usize,
}

impl Port {
    /// A port that is not open.
    pub(crate) fn open() -> std::io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?.into_string();
        let path = PathBuf::from(name.map_err(std::io::Error::other)?);
        let slave = open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        let mut termios = tcgetattr(&slave)?;
        termios.make_raw();
        // The initial state of a port.
        termios.control_modes |= ControlModes::HUPCL;
        tcsetattr(&slave, OptionalActions::Now, &termios)?;
        fcntl_setfl(&master, fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
        let watch = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK)?;
        let what = WatchFlags::OPEN | WatchFlags::CLOSE_WRITE | WatchFlags::CLOSE_NOWRITE;
        inotify::add_watch(&watch, &path, what)?;
        Ok(Self { master, slave, watch, path, openings: 0, closings: 0 })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes written here arrive at the process that has opened the port.
    pub(crate) fn master(&self) -> &OwnedFd {
        &self.master
    }

    /// Can be read when it was opened or closed.
    pub(crate) fn watch(&self) -> &OwnedFd {
        &self.watch
    }

    /// Takes note of who has opened and closed it.
    pub(crate) fn look(&mut self) {
        let mut buffer = [MaybeUninit::uninit(); 1024];
        let mut events = Reader::new(&self.watch, &mut buffer);
        let before = self.closings;
        while let Ok(event) = events.next() {
            if event.events().contains(ReadFlags::OPEN) {
                self.openings += 1;
            } else {
                self.closings += 1;
            }
        }
        if self.closings > before && !self.is_open() {
            // A device forgets whose it was when the last one closes it; this one has our
            // own end open.
            let _ = ioctl_tiocnxcl(&self.slave);
        }
    }

    /// How often it was opened.
    pub(crate) fn openings(&self) -> usize {
        self.openings
    }

    pub(crate) fn is_open(&self) -> bool {
        self.openings > self.closings
    }

    /// Whether the last one to close it would let DTR fall.
    pub(crate) fn hangs_up(&self) -> bool {
        tcgetattr(&self.slave)
            .is_ok_and(|termios| termios.control_modes.contains(ControlModes::HUPCL))
    }
}
