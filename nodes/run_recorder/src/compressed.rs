//! Bag files that are compressed as a whole: `compression_mode: FILE` of rosbag2.
//!
//! The bag reader seeks, which a compressed file does not allow. So the file is unpacked
//! first, to a file without a name that is removed with its reader.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// The suffix of such files: `run_0.mcap.zstd`.
const ENDING: &str = "zstd";
/// The largest unpacked size, bytes; a small file can expand without end.
const UNPACKED_MAX: u64 = 64 * 1024 * 1024 * 1024;

/// Whether this file has to be unpacked.
pub(crate) fn is_compressed(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == ENDING)
}

/// The content of a compressed file.
pub(crate) fn unpack(path: &Path) -> io::Result<File> {
    unpack_at_most(path, UNPACKED_MAX)
}

fn unpack_at_most(path: &Path, most: u64) -> io::Result<File> {
    let mut unpacked = nameless()?;
    let mut content = zstd::Decoder::new(crate::files::open(path)?)?.take(most + 1);
    if io::copy(&mut content, &mut unpacked)? > most {
        return Err(io::Error::other(format!("it unpacks to more than {most} bytes")));
    }
    Ok(unpacked)
}

/// A temporary file that no other process can open.
fn nameless() -> io::Result<File> {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    loop {
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("bag_{}_{number}", std::process::id()));
        match OpenOptions::new().read(true).write(true).create_new(true).open(&path) {
            Ok(file) => {
                fs::remove_file(&path)?;
                return Ok(file);
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Seek, SeekFrom};

    fn packed(bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a_0.mcap.zstd");
        fs::write(&path, zstd::encode_all(bytes, 0).unwrap()).unwrap();
        (folder, path)
    }

    #[test]
    fn what_is_unpacked_can_be_sought_in() {
        let (_folder, path) = packed(b"a bag");
        assert!(is_compressed(&path) && !is_compressed(Path::new("a_0.mcap")));
        let mut file = unpack(&path).unwrap();
        file.seek(SeekFrom::Start(2)).unwrap();
        let mut text = String::new();
        file.read_to_string(&mut text).unwrap();
        assert_eq!(text, "bag");
    }

    #[test]
    fn what_breaks_off_or_never_ends_is_an_error() {
        let (_folder, path) = packed(&[7; 100_000]);
        assert!(unpack_at_most(&path, 100_000).is_ok());
        let error = unpack_at_most(&path, 99_999).unwrap_err();
        assert_eq!(error.to_string(), "it unpacks to more than 99999 bytes");
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 3]).unwrap();
        assert!(unpack(&path).is_err());
        fs::write(&path, b"no such thing").unwrap();
        assert!(unpack(&path).is_err());
    }
}
