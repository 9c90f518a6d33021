//! Reads a file that someone else names.
//!
//! Only a regular file is read: a pipe would block; a device has side effects or no end. The
//! file is opened without waiting. The limit is checked while reading, because a file may grow.

use rustix::fs::{FileType, Mode, OFlags};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// How long reading one file may take at most: enough for 512 MiB from a slow network drive.
pub const READ_WITHIN: Duration = Duration::from_secs(20);
/// Files that are read at the same time, each by its own thread. A network drive that is gone
/// blocks a reader in the kernel; a slow one keeps it busy.
const READING_MAX: usize = 4;
/// Bytes between two checks of the clock.
const PIECE: u64 = 256 << 10;

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error("it is {0}; a regular file is needed")]
    NotRegular(&'static str),
    #[error("it has {bytes} bytes; at most {most} are read")]
    TooLarge { bytes: u64, most: u64 },
    #[error("it grew while it was read; at most {most} bytes are read")]
    Grew { most: u64 },
    #[error("it became shorter while it was read; it had {bytes} bytes")]
    Shrank { bytes: u64 },
    #[error("a line of it has more than {most} bytes")]
    LongLine { most: usize },
    #[error("it could not be read within {} s; check its drive", .0.as_secs())]
    Late(Duration),
    #[error(
        "it was not read: {READING_MAX} other files are still being read, from slow drives or from \
         ones that do not answer; try again when they are done, or check those drives"
    )]
    Busy,
    #[error("it was replaced while it was opened; try again")]
    Replaced,
}

/// Opens a regular file for reading.
///
/// # Errors
/// The file cannot be opened, or is not a regular file.
pub fn open(path: &Path) -> Result<File, ReadError> {
    // Check before opening: opening alone resets a controller at the end of a serial line.
    let seen = rustix::fs::stat(path).map_err(io::Error::from)?;
    must_be_regular(seen.st_mode)?;
    let file = rustix::fs::open(path, FLAGS, Mode::empty()).map_err(io::Error::from)?;
    is_still(&File::from(file), &seen)
}

/// Never waits for the other end of a pipe, never becomes the terminal of the process.
pub(crate) const FLAGS: OFlags =
    OFlags::RDONLY.union(OFlags::NONBLOCK).union(OFlags::CLOEXEC).union(OFlags::NOCTTY);

pub(crate) fn must_be_regular(mode: rustix::fs::RawMode) -> Result<(), ReadError> {
    Err(ReadError::NotRegular(match FileType::from_raw_mode(mode) {
        FileType::RegularFile => return Ok(()),
        FileType::Directory => "a folder",
        FileType::Fifo => "a named pipe (FIFO)",
        FileType::Socket => "a socket",
        FileType::CharacterDevice | FileType::BlockDevice => "a device",
        _ => "not a file",
    }))
}

/// Checks that the opened file is the one that was inspected before.
pub(crate) fn is_still(file: &File, seen: &rustix::fs::Stat) -> Result<File, ReadError> {
    let now = rustix::fs::fstat(file).map_err(io::Error::from)?;
    must_be_regular(now.st_mode)?;
    if (now.st_dev, now.st_ino) != (seen.st_dev, seen.st_ino) {
        return Err(ReadError::Replaced);
    }
    Ok(file.try_clone()?)
}

/// Reads a regular file of at most `most` bytes.
///
/// # Errors
/// The file cannot be read, is not a regular file, is larger, or takes longer than
/// [`READ_WITHIN`].
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, ReadError> {
    read_all(open(path)?, most)
}

/// Reads the rest of an open file.
///
/// # Errors
/// As [`read`].
pub fn read_all(file: File, most: u64) -> Result<Vec<u8>, ReadError> {
    let bytes = file.metadata()?.len();
    if bytes > most {
        return Err(ReadError::TooLarge { bytes, most });
    }
    read_bounded(file, bytes, most, Instant::now() + READ_WITHIN)
}

fn read_bounded(
    mut source: impl Read,
    expected: u64,
    most: u64,
    end: Instant,
) -> Result<Vec<u8>, ReadError> {
    let mut text = Vec::with_capacity(usize::try_from(expected).unwrap_or(0));
    loop {
        // One byte more than allowed, so that a larger file is not taken for a whole one.
        let left = most + 1 - text.len() as u64;
        if source.by_ref().take(left.min(PIECE)).read_to_end(&mut text)? == 0 {
            return Ok(text);
        }
        if text.len() as u64 > most {
            return Err(ReadError::Grew { most });
        }
        if Instant::now() > end {
            return Err(ReadError::Late(READ_WITHIN));
        }
    }
}

/// Does `work` on a thread of its own and waits for it no longer than `within`.
///
/// A drive that is gone may block a reader in the kernel for any time. The thread is abandoned
/// then; there are never more than `READING_MAX`.
///
/// # Errors
/// The errors of `work`; or it took too long; or `READING_MAX` files are being read already.
pub fn guarded<T: Send + 'static>(
    within: Duration,
    work: impl FnOnce() -> Result<T, ReadError> + Send + 'static,
) -> Result<T, ReadError> {
    static READING: AtomicUsize = AtomicUsize::new(0);
    guarded_by(&READING, within, work)
}

/// A slot of a reader; it is freed when the work ends in any way.
struct Slot(&'static AtomicUsize);

impl Drop for Slot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// As [`guarded`], where `reading` counts the slots in use.
fn guarded_by<T: Send + 'static>(
    reading: &'static AtomicUsize,
    within: Duration,
    work: impl FnOnce() -> Result<T, ReadError> + Send + 'static,
) -> Result<T, ReadError> {
    let slot = Slot(reading);
    if reading.fetch_add(1, Ordering::AcqRel) >= READING_MAX {
        return Err(ReadError::Busy);
    }
    let (sender, result) = mpsc::sync_channel(1);
    std::thread::Builder::new().name("file-reader".into()).spawn(move || {
        let outcome = work();
        drop(slot);
        // After a timeout nobody receives it any more.
        let _ = sender.send(outcome);
    })?;
    match result.recv_timeout(within) {
        Ok(outcome) => outcome,
        Err(_) => Err(ReadError::Late(within)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Reads `bytes` forever, and counts how many were read.
    struct Endless(u64);

    impl Read for Endless {
        fn read(&mut self, space: &mut [u8]) -> io::Result<usize> {
            self.0 += space.len() as u64;
            Ok(space.len())
        }
    }

    fn later() -> Instant {
        Instant::now() + Duration::from_secs(3600)
    }

    #[test]
    fn a_file_that_grows_is_read_to_the_limit_and_no_further() {
        const MOST: u64 = 3 << 20;
        let mut source = Endless(0);
        let error = read_bounded(&mut source, 10, MOST, later()).expect_err("endless");
        assert!(matches!(error, ReadError::Grew { most: MOST }), "{error}");
        assert_eq!(source.0, MOST + 1);
        let whole = read_bounded(&b"G1 X1"[..], 5, 5, later()).expect("as long as may be");
        assert_eq!(whole, b"G1 X1");
    }

    #[test]
    fn a_file_that_never_ends_is_left_at_the_deadline() {
        let mut source = Endless(0);
        let error = read_bounded(&mut source, 0, u64::MAX - 1, Instant::now() - PAUSE);
        assert!(matches!(error, Err(ReadError::Late(_))));
        assert_eq!(source.0, PIECE);
    }

    const PAUSE: Duration = Duration::from_millis(1);

    #[test]
    fn only_regular_files_are_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let fifo = folder.path().join("fifo");
        let made = std::process::Command::new("mkfifo").arg(&fifo).status();
        assert!(made.expect("mkfifo").success());
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).expect("a socket");
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&fifo, &link).expect("a link");
        let table = [
            (fifo.as_path(), "named pipe"),
            (&link, "named pipe"),
            (&socket, "a socket"),
            (folder.path(), "a folder"),
            (Path::new("/dev/zero"), "a device"),
            (Path::new("/dev/null"), "a device"),
            (Path::new("/no/such/file"), "No such file"),
        ];
        for (path, part) in table {
            let error = read(path, 1000).expect_err(part).to_string();
            assert!(error.contains(part), "{}: {error}", path.display());
        }
    }

    #[test]
    fn two_gigabytes_are_refused_by_their_size() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("large.ngc");
        fs::File::create(&path).expect("made").set_len(2 << 30).expect("a hole");
        let error = read(&path, 512 << 20).expect_err("too large");
        assert!(matches!(error, ReadError::TooLarge { bytes: 2_147_483_648, .. }), "{error}");
    }

    #[test]
    fn readers_that_hang_are_left_and_are_never_more_than_a_few() {
        // Slots of this test alone: other tests read at the same time.
        static READING: AtomicUsize = AtomicUsize::new(0);
        let (release, held) = mpsc::channel::<()>();
        let held = std::sync::Arc::new(std::sync::Mutex::new(held));
        let hang = || {
            let held = std::sync::Arc::clone(&held);
            guarded_by(&READING, PAUSE, move || {
                // Returns when the test ends.
                let _ = held.lock().map(|held| held.recv());
                Ok(())
            })
        };
        for _ in 0..READING_MAX {
            assert!(matches!(hang(), Err(ReadError::Late(_))));
        }
        let busy = hang().expect_err("no place is free");
        assert!(matches!(busy, ReadError::Busy), "{busy}");
        // The error cannot know whether the drives are slow or gone.
        for part in ["4 other files", "slow drives", "do not answer", "try again"] {
            assert!(busy.to_string().contains(part), "{busy}");
        }
        drop(release);
        // They end one after the other now, and slots become free again.
        while guarded_by(&READING, READ_WITHIN, || Ok(())).is_err() {
            std::thread::yield_now();
        }
    }
}
