//! A bag written again in its place: all that is not replaced stays byte for byte.
//!
//! The new bag is made beside the old one, can be looked at there, and takes its place in
//! one step for each file: first its messages, then what metadata.yaml says of them. Until then,
//! and whenever making the new one fails, the old one is whole.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use crate::compressed::is_compressed;
use crate::files::{
    METADATA_FILE, RecoverFilesError, files_of, open_bag, part_file, read_metadata_file, write_copy,
};
use crate::metadata::custom_data;
use crate::recover::{RecoverError, Selection};

/// A new bag beside the one whose place it may take; removed when it is dropped.
#[derive(Debug)]
pub struct Rewritten {
    /// The folder of the new one.
    copy: PathBuf,
    /// Its file, and the one that it is of.
    file: PathBuf,
    old_file: PathBuf,
    /// The folder of the old one, if it has one.
    directory: Option<PathBuf>,
}

/// Writes a bag again beside itself.
pub fn rewrite_bag(path: &Path, selection: Selection<'_>) -> Result<Rewritten, RecoverFilesError> {
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
    // From here on it is removed whatever happens.
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

    /// Puts it in the place of the old one.
    pub fn put_in_place(self) -> io::Result<()> {
        fs::rename(&self.file, &self.old_file)?;
        if let Some(directory) = &self.directory {
            fs::rename(self.copy.join(METADATA_FILE), directory.join(METADATA_FILE))?;
            // The renames themselves have to reach the disk.
            File::open(directory)?.sync_all()?;
        }
        Ok(())
    }
}

impl Drop for Rewritten {
    fn drop(&mut self) {
        // What is left of it tells of nothing.
        let _ = fs::remove_dir_all(&self.copy);
    }
}
