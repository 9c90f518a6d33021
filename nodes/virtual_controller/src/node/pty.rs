//! A pseudo-terminal that looks like a serial port, and a link to it.

use std::fs;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStringExt;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags, fchmod, fcntl_getfl, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{ControlModes, OptionalActions, ioctl_tiocnxcl, tcgetattr, tcsetattr};

/// The controller's end of a pseudo-terminal.
///
/// The slave is kept open, so that peers may open and close the port any number of times.
#[derive(Debug)]
pub(super) struct Pty {
    controller: OwnedFd,
    slave: OwnedFd,
    path: PathBuf,
}

impl Pty {
    /// Opens a raw pseudo-terminal for this user alone.
    pub(super) fn open() -> io::Result<Self> {
        let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&controller)?;
        unlockpt(&controller)?;
        let name = ptsname(&controller, Vec::new())?.into_bytes();
        let path = PathBuf::from(std::ffi::OsString::from_vec(name));
        let slave = open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        let mut termios = tcgetattr(&slave)?;
        termios.make_raw();
        // The initial state of every serial port.
        termios.control_modes.insert(ControlModes::HUPCL);
        tcsetattr(&slave, OptionalActions::Now, &termios)?;
        fchmod(&slave, Mode::RUSR | Mode::WUSR)?;
        fcntl_setfl(&controller, fcntl_getfl(&controller)? | OFlags::NONBLOCK)?;
        Ok(Self { controller, slave, path })
    }

    /// The path that peers open.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Would DTR drop at the last close?
    pub(super) fn hangs_up(&self) -> bool {
        tcgetattr(&self.slave)
            .is_ok_and(|termios| termios.control_modes.contains(ControlModes::HUPCL))
    }

    /// Releases the exclusive lock of a peer.
    pub(super) fn share_again(&self) {
        // A peer that locks the port again gets an error if another has it.
        let _ = ioctl_tiocnxcl(&self.slave);
    }

    /// Reads what the peer has written; no bytes are no error.
    pub(super) fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        match rustix::io::read(&self.controller, buffer) {
            Ok(count) => Ok(count),
            Err(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) => Ok(0),
            Err(error) => Err(error.into()),
        }
    }

    /// Writes what fits; returns how many bytes that was.
    pub(super) fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        match rustix::io::write(&self.controller, bytes) {
            Ok(count) => Ok(count),
            Err(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) => Ok(0),
            Err(error) => Err(error.into()),
        }
    }
}

impl AsFd for Pty {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.controller.as_fd()
    }
}

/// A symbolic link to the slave; removed when this value is dropped.
#[derive(Debug)]
pub(super) struct Link {
    path: PathBuf,
    target: PathBuf,
}

impl Link {
    /// Makes the link; replaces an old link, but not a file.
    pub(super) fn create(path: &Path, target: &Path) -> io::Result<Self> {
        match fs::symlink_metadata(path) {
            Ok(found) if found.is_symlink() => fs::remove_file(path)?,
            Ok(_) => {
                return Err(io::Error::new(
                    io::ErrorKind::AlreadyExists,
                    "exists and is not a symbolic link; choose another path",
                ));
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
        std::os::unix::fs::symlink(target, path)?;
        Ok(Self { path: path.to_path_buf(), target: target.to_path_buf() })
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        // A link that another process made in the meantime stays.
        if fs::read_link(&self.path).is_ok_and(|target| target == self.target) {
            let _ = fs::remove_file(&self.path);
        }
    }
}
