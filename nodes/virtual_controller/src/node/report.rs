//! The report of a run: the file is complete or does not exist.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::Counts;

/// Finds early what would stop [`write`] later.
pub(super) fn check(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a folder; name a file in it"));
    }
    let draft = draft(path);
    fs::write(&draft, "")?;
    fs::remove_file(&draft)
}

/// Writes the counts; a process that waits for the file never finds half of it.
pub(super) fn write(path: &Path, counts: &Counts) -> io::Result<()> {
    let draft = draft(path);
    fs::write(&draft, counts.to_json())?;
    fs::rename(&draft, path)
}

fn draft(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    path.with_file_name(name)
}
