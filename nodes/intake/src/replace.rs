//! Replaces a file at once or not at all.
//!
//! The new text is written next to the old file, synced to the disk and renamed over it, so that a
//! crash or a full disk leaves one of the two whole.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, fchown};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Gives a file a new content, and what it had of permissions, owner and group, as far as this
/// process may. A link is replaced itself; [`fs::canonicalize`] finds what it leads to.
///
/// # Errors
/// The folder cannot be written, or the disk is full; the file is as before.
pub fn replace(path: &Path, content: &[u8]) -> io::Result<()> {
    static WRITES: AtomicU64 = AtomicU64::new(0);
    // Two writers of one file never have one temporary file.
    let (process, write) = (std::process::id(), WRITES.fetch_add(1, Ordering::Relaxed));
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(format!(".{process}-{write}.new"));
    let temporary = PathBuf::from(temporary);
    // A process that had this number once, and crashed, may have left it.
    match fs::remove_file(&temporary) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let old = fs::symlink_metadata(path).ok().filter(Metadata::is_file);
    let written = (|| {
        // Nobody reads it before it has the permissions of the old one.
        let mode = if old.is_some() { 0o600 } else { 0o666 };
        let mut file =
            OpenOptions::new().write(true).create_new(true).mode(mode).open(&temporary)?;
        if let Some(old) = &old {
            // Only root gives files away; others may give one to a group of theirs. A container may
            // not know the owner at all.
            let _ = fchown(&file, None, Some(old.gid()));
            file.set_permissions(old.permissions())?;
            let _ = fchown(&file, Some(old.uid()), None);
        }
        file.write_all(content)?;
        file.sync_all()?;
        fs::rename(&temporary, path)
    })();
    if let Err(error) = written {
        // It may not exist.
        let _ = fs::remove_file(&temporary);
        return Err(error);
    }
    // Renaming outlives a power cut once the folder is synced. It is in force already, so an error
    // here, as on file systems that sync no folder, must not say that the file is as before.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt, chown};

    #[test]
    fn a_file_that_is_replaced_keeps_its_mode_and_its_owner() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mill.var");
        replace(&path, b"new").expect("written");
        let rights = || {
            let it = fs::metadata(&path).expect("there");
            (it.permissions().mode() & 0o777, it.uid(), it.gid())
        };
        let (_, owner, group) = rights();
        // Where the tests may not give it away, it is ours before and after.
        let is_given = chown(&path, Some(12_345), Some(23_456)).is_ok();
        let (owner, group) = if is_given { (12_345, 23_456) } else { (owner, group) };
        for mode in [0o640, 0o604, 0o664] {
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).expect("allowed");
            let content = format!("{mode:o}");
            replace(&path, content.as_bytes()).expect("written");
            assert_eq!(rights(), (mode, owner, group));
            assert_eq!(fs::read_to_string(&path).expect("there"), content);
        }
        // A link is no file: it is replaced, and what it leads to stays.
        let link = folder.path().join("link.var");
        std::os::unix::fs::symlink(&path, &link).expect("a link");
        replace(&link, b"other").expect("written");
        assert!(fs::symlink_metadata(&link).expect("there").is_file());
        assert_eq!(fs::read_to_string(&path).expect("there"), "664");
        assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 2, "no other file is left");
        let missing = folder.path().join("none/mill.var");
        assert_eq!(replace(&missing, b"x").expect_err("no folder").kind(), ErrorKind::NotFound);
    }
}
