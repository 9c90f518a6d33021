//! Replaces a file at once or not at all.
//!
//! The new text is written next to the old file, synced to the disk and renamed over it, so that a
//! crash or a full disk leaves one of the two whole.

use std::fs::{self, File, Permissions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Gives a file a new content. A link is replaced itself; [`fs::canonicalize`] finds what it leads
/// to. `permissions` are those of the new file.
///
/// # Errors
/// The folder cannot be written, or the disk is full; the file is as before.
pub fn replace(path: &Path, content: &[u8], permissions: Option<Permissions>) -> io::Result<()> {
    static WRITES: AtomicU64 = AtomicU64::new(0);
    // Two writers of one file never have one temporary file.
    let (process, write) = (std::process::id(), WRITES.fetch_add(1, Ordering::Relaxed));
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(format!(".{process}-{write}.new"));
    let temporary = PathBuf::from(temporary);
    let written = (|| {
        let mut file = File::create(&temporary)?;
        file.write_all(content)?;
        if let Some(permissions) = permissions {
            file.set_permissions(permissions)?;
        }
        file.sync_all()?;
        fs::rename(&temporary, path)
    })();
    if let Err(error) = written {
        // It may not exist.
        let _ = fs::remove_file(&temporary);
        return Err(error);
    }
    // Renaming outlives a power cut once the folder is synced; it is already in force.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
    Ok(())
}
