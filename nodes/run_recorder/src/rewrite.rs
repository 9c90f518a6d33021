//! Rewrites a bag in place; messages that are not replaced stay byte for byte.
//!
//! The new bag is made next to the old one, where it can be inspected. Then each of its files
//! replaces the old one atomically: first the messages, then metadata.yaml. Until then, and if
//! making the new bag fails, the old bag is unchanged.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use crate::compressed::is_compressed;
use crate::files::{
    METADATA_FILE, RecoverFilesError, files_of, open_bag, part_file, read_metadata_file, write_copy,
};
use crate::metadata::custom_data;
use crate::recover::{CopySelection, RecoverError};

/// A new bag next to the one that it may replace; dropping it removes the new bag.
#[derive(Debug)]
pub struct Rewritten {
    /// The folder of the new bag.
    copy: PathBuf,
    /// The new file, and the old file that it replaces.
    file: PathBuf,
    old_file: PathBuf,
    /// The folder of the old bag, if it has one.
    directory: Option<PathBuf>,
}

/// Writes a new copy of a bag next to it.
pub fn rewrite_bag(
    path: &Path,
    selection: CopySelection<'_>,
) -> Result<Rewritten, RecoverFilesError> {
    let text = path.display().to_string();
    let io_error = |cause| RecoverFilesError::Io { path: text.clone(), cause };
    let refused = |why: &str| io_error(io::Error::new(io::ErrorKind::InvalidInput, why.to_owned()));
    let mut bag = open_bag(path).map_err(RecoverError::from)?;
    let (directory, old_file, own_data) = if path.is_dir() {
        let (files, _) = files_of(path).map_err(RecoverError::from)?;
        let [file] = &files[..] else {
            return Err(refused("it is in several files; `kerf bag trim` makes one of them"));
        };
        let metadata = read_metadata_file(path).map_err(io_error)?;
        let own_data = custom_data(&metadata).map_err(|error| refused(&error.to_string()))?;
        (Some(path.to_owned()), file.clone(), own_data)
    } else {
        (None, path.to_owned(), BTreeMap::new())
    };
    if is_compressed(&old_file) {
        return Err(refused("its file is compressed as a whole; `zstd -d` unpacks it"));
    }
    let name = path.canonicalize().map_err(io_error)?;
    let mut copy = name.into_os_string();
    copy.push(".update");
    let copy = PathBuf::from(copy);
    fs::create_dir(&copy).map_err(|cause| {
        let path = copy.display().to_string();
        RecoverFilesError::Io { path, cause }
    })?;
    let file_name = old_file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let file = copy.join(&file_name);
    // From here on it is removed in any case.
    let rewritten = Rewritten { copy, file, old_file, directory };
    let file = part_file(&rewritten.copy, file_name).map_err(io_error)?;
    write_copy(&rewritten.copy, file, &mut bag, &own_data, selection)?;
    Ok(rewritten)
}

impl Rewritten {
    /// Where the new bag is.
    pub fn path(&self) -> &Path {
        &self.copy
    }

    /// Replaces the old bag.
    pub fn put_in_place(self) -> io::Result<()> {
        fs::rename(&self.file, &self.old_file)?;
        if let Some(directory) = &self.directory {
            fs::rename(self.copy.join(METADATA_FILE), directory.join(METADATA_FILE))?;
            // The renames have to be synced too.
            File::open(directory)?.sync_all()?;
        }
        Ok(())
    }
}

impl Drop for Rewritten {
    fn drop(&mut self) {
        // An error here would only leave a temporary folder.
        let _ = fs::remove_dir_all(&self.copy);
    }
}
