//! Bags as paths: directories, bare files, metadata.yaml.
//!
//! Decides nothing about what is in a bag; see [`crate::bag_reader`].

use intake::file::ReadError;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::bag_reader::{Bag, BagError, BagSource, Problem, RUN_RECORD};
use crate::bag_writer::BagWriteError;
use crate::compressed::{is_compressed, unpack};
use crate::metadata::{Claims, file_names, metadata_yaml};
use crate::parts::PartFile;
use crate::recover::{
    CopySelection, RECOVERED_FROM, RecoverError, Recovered, TRIMMED_FROM, recover,
};
use crate::split::part_file_name;

/// A bag opened from files.
pub type FileBag = Bag<BufReader<File>>;

pub(crate) const METADATA_FILE: &str = "metadata.yaml";
/// Its temporary name while it is written.
pub(crate) const METADATA_TEMPORARY: &str = "metadata.yaml.tmp";
/// The largest metadata.yaml, bytes.
const METADATA_SIZE_MAX: u64 = intake::yaml::Limits::FILE.bytes as u64;
const READ_BUFFER: usize = 256 * 1024;

/// Opens a bag directory or a bare `.mcap` file, finished or not.
///
/// Without metadata.yaml, or with one that broke off, all `.mcap` files of the
/// directory are read, in the order of their numbers, and the bag counts as incomplete.
pub fn open_bag(path: &Path) -> Result<FileBag, BagError> {
    let text = || path.display().to_string();
    let kind = match fs::metadata(path) {
        Ok(kind) => kind,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Err(BagError::Missing { path: text() });
        }
        Err(cause) => {
            return Err(BagError::Io { file: text(), cause });
        }
    };
    if kind.is_file() {
        return Bag::from_sources(vec![open_source(path)?]);
    }
    if !kind.is_dir() {
        return Err(BagError::NoPath { path: text() });
    }
    let (files, problems) = files_of(path)?;
    let sources = files.iter().map(|file| open_source(file));
    let mut bag = Bag::from_sources(sources.collect::<Result<_, _>>()?)?;
    for problem in problems {
        bag.add_problem(problem);
    }
    if let Ok(text) = read_metadata_file(path) {
        let directory = path.display().to_string();
        match Claims::of_file(&text) {
            Ok(claims) => bag.claims = Some((directory, claims)),
            // It still names the files, or the error is reported above.
            Err(why) if file_names(&text).is_ok() => {
                let why = format!("what cannot be read: {why}");
                bag.add_problem(Problem::MetadataDiffers { directory, why });
            }
            Err(_) => {}
        }
    }
    Ok(bag)
}

/// The files of a bag directory, in their order, and what is wrong with the list of them.
pub(crate) fn files_of(directory: &Path) -> Result<(Vec<PathBuf>, Vec<Problem>), BagError> {
    let name = directory.display().to_string();
    let mut problems = Vec::new();
    let mut there = mcap_files(directory)?;
    let listed = match read_metadata_file(directory) {
        Ok(text) => file_names(&text).map_err(|error| error.to_string()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            problems.push(Problem::NoMetadataFile);
            Ok(Vec::new())
        }
        Err(error) => Err(error.to_string()),
    };
    let listed = match listed {
        Ok(listed) => listed,
        // A truncated list loses no messages: they are in other files.
        Err(why) if !there.is_empty() => {
            problems.push(Problem::MetadataFile { directory: name.clone(), why });
            Vec::new()
        }
        Err(why) => return Err(BagError::Metadata { directory: name, why }),
    };
    if listed.is_empty() {
        if there.is_empty() {
            return Err(BagError::EmptyDirectory { directory: name });
        }
        return Ok((there, problems));
    }
    let mut files: Vec<PathBuf> = Vec::new();
    let mut missing = Vec::new();
    for listed in &listed {
        // Old bags list paths; the file is always in the directory of its metadata.yaml.
        let base = Path::new(listed).file_name().map_or(listed.as_ref(), Path::new);
        let file = directory.join(base);
        if !file.is_file() {
            missing.push(base.display().to_string());
        } else if !files.contains(&file) {
            files.push(file);
        }
    }
    if !files.is_empty() {
        // Other files in the directory; if no named file exists, all may be meant.
        there.retain(|file| !files.contains(file) && is_other_part(file, &files));
    }
    if files.is_empty() && there.is_empty() {
        return Err(BagError::MissingFile { directory: name, file: missing.swap_remove(0) });
    }
    let problem = |file| Problem::FileMissing { directory: name.clone(), file };
    problems.extend(missing.into_iter().map(problem));
    if !there.is_empty() {
        problems.extend(there.iter().map(|file| Problem::FileNotListed {
            directory: name.clone(),
            file: file.file_name().map_or(String::new(), |name| name.display().to_string()),
        }));
        files.append(&mut there);
        files.sort_by_cached_key(|file| by_number(file));
    }
    Ok((files, problems))
}

/// Whether the name of a file is that of another part of the same bag.
fn is_other_part(file: &Path, files: &[PathBuf]) -> bool {
    let bag_of = |path: &Path| {
        let stem = path.file_stem()?.to_str()?.to_owned();
        let (bag, number) = stem.rsplit_once('_')?;
        number.parse::<u32>().ok().map(|_| bag.to_owned())
    };
    let Some(bag) = bag_of(file) else { return false };
    files.iter().any(|other| bag_of(other).is_some_and(|other| other == bag))
}

/// The `.mcap` files of a directory, run_2 before run_10.
pub(crate) fn mcap_files(directory: &Path) -> Result<Vec<PathBuf>, BagError> {
    let io_error = |cause| BagError::Io { file: directory.display().to_string(), cause };
    let mut files = Vec::new();
    for entry in fs::read_dir(directory).map_err(io_error)? {
        let file = entry.map_err(io_error)?.path();
        if file.extension().is_some_and(|extension| extension == "mcap") || is_compressed(&file) {
            files.push(file);
        }
    }
    // A file that was compressed or unpacked in place exists twice.
    let plain: Vec<PathBuf> = files.iter().filter(|file| !is_compressed(file)).cloned().collect();
    files.retain(|file| !is_compressed(file) || !plain.contains(&file.with_extension("")));
    files.sort_by_cached_key(|file| by_number(file));
    Ok(files)
}

/// The sort key of files with a number at the end of the name.
fn by_number(file: &Path) -> (usize, PathBuf) {
    let plain = if is_compressed(file) { file.with_extension("") } else { file.to_owned() };
    (plain.as_os_str().len(), plain)
}

pub(crate) fn read_metadata_file(directory: &Path) -> io::Result<String> {
    let file = open(&directory.join(METADATA_FILE))?;
    let mut text = String::new();
    file.take(METADATA_SIZE_MAX + 1).read_to_string(&mut text)?;
    if text.len() as u64 > METADATA_SIZE_MAX {
        let why = format!("it has more than {METADATA_SIZE_MAX} bytes");
        return Err(io::Error::new(io::ErrorKind::InvalidData, why));
    }
    Ok(text)
}

/// Opens a regular file: a pipe that is named like one of a bag would block.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    intake::file::open(path).map_err(|error| match error {
        ReadError::Io(error) => error,
        other => io::Error::new(io::ErrorKind::InvalidInput, other.to_string()),
    })
}

fn open_source(path: &Path) -> Result<BagSource<BufReader<File>>, BagError> {
    let name = path.display().to_string();
    let opened = if is_compressed(path) { unpack(path) } else { open(path) };
    match opened {
        Ok(file) => Ok(BagSource { name, reader: BufReader::with_capacity(READ_BUFFER, file) }),
        Err(cause) => Err(BagError::Io { file: name, cause }),
    }
}

/// The directory of a bag that is being written.
#[derive(Debug)]
pub(crate) struct BagDirectory {
    pub(crate) directory: PathBuf,
    name: String,
}

impl BagDirectory {
    /// Makes `parent/name`, which must not exist.
    pub(crate) fn create(parent: &Path, name: &str) -> io::Result<Self> {
        let is_plain =
            !name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\', '\0']);
        if !is_plain {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                format!("\"{name}\" cannot be the name of a bag"),
            ));
        }
        fs::create_dir_all(parent)?;
        let directory = parent.join(name);
        fs::create_dir(&directory)?;
        Ok(Self { directory, name: name.to_owned() })
    }

    /// Makes a file of the bag, which must not exist.
    pub(crate) fn part(&self, part: usize) -> io::Result<PartFile> {
        part_file(&self.directory, part_file_name(&self.name, part))
    }
}

/// Makes a file of a bag in its directory, which must not exist.
pub(crate) fn part_file(directory: &Path, name: String) -> io::Result<PartFile> {
    let file = File::create_new(directory.join(&name))?;
    // The lock shows other processes that it is being written; not all file systems have locks.
    let _ = file.try_lock();
    let for_sync = file.try_clone()?;
    let directory = directory.to_owned();
    let is_entered = AtomicBool::new(false);
    let sync = move || {
        for_sync.sync_data()?;
        if !is_entered.swap(true, Ordering::Relaxed) {
            // The directory entry has to be synced too; not every file system
            // supports this.
            for directory in [Some(directory.as_path()), directory.parent()] {
                let _ = directory.map(File::open).transpose().map(|it| it.map(|it| it.sync_all()));
            }
        }
        Ok(())
    };
    Ok(PartFile { name, sink: Box::new(BufWriter::new(file)), sync: Box::new(sync) })
}

/// Writes metadata.yaml atomically: a reader never sees half of it.
pub(crate) fn write_metadata_file(directory: &Path, text: &str) -> io::Result<()> {
    let temporary = directory.join(METADATA_TEMPORARY);
    let mut file = File::create(&temporary)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    fs::rename(&temporary, directory.join(METADATA_FILE))?;
    // The rename has to be synced too.
    File::open(directory)?.sync_all()
}

/// Why a bag could not be copied to files.
#[derive(Debug, thiserror::Error)]
pub enum RecoverFilesError {
    #[error(transparent)]
    Recover(#[from] RecoverError),
    #[error("{path} cannot be written: {cause}")]
    Io { path: String, cause: io::Error },
    #[error("{path} cannot be written: {cause}")]
    Write { path: String, cause: BagWriteError },
}

/// Copies all that can be read of the bag at `from` into a new bag directory `to`.
pub fn recover_bag(from: &Path, to: &Path) -> Result<Recovered, RecoverFilesError> {
    copy_bag(from, to, RECOVERED_FROM, CopySelection::ALL)
}

/// Copies a part of the bag at `from` into a new bag directory `to`.
pub fn trim_bag(
    from: &Path,
    to: &Path,
    selection: CopySelection<'_>,
) -> Result<Recovered, RecoverFilesError> {
    copy_bag(from, to, TRIMMED_FROM, selection)
}

/// `relation` is the key under which metadata.yaml names the old bag.
fn copy_bag(
    from: &Path,
    to: &Path,
    relation: &str,
    selection: CopySelection<'_>,
) -> Result<Recovered, RecoverFilesError> {
    let mut bag = open_bag(from).map_err(RecoverError::from)?;
    let parent = to.parent().unwrap_or(Path::new("."));
    let name = to.file_name().map_or(String::new(), |name| name.display().to_string());
    let made = BagDirectory::create(parent, &name)
        .map_err(|cause| RecoverFilesError::Io { path: to.display().to_string(), cause })?;
    // The identity of the run stays in metadata.yaml.
    let mut custom_data = bag.metadata_named(RUN_RECORD).cloned().unwrap_or_default();
    let old = from.file_name().unwrap_or(from.as_os_str()).display().to_string();
    custom_data.insert(relation.to_owned(), old);
    let error = |cause| RecoverFilesError::Io { path: to.display().to_string(), cause };
    let copied = made
        .part(0)
        .map_err(error)
        .and_then(|file| write_copy(&made.directory, file, &mut bag, &custom_data, selection));
    // It was made here, and half a bag is useless.
    copied.inspect_err(|_| drop(fs::remove_dir_all(&made.directory)))
}

/// Copies a bag into a file of this directory and writes its metadata.yaml; syncs both to the
/// disk.
pub(crate) fn write_copy(
    directory: &Path,
    file: PartFile,
    bag: &mut FileBag,
    custom_data: &BTreeMap<String, String>,
    selection: CopySelection<'_>,
) -> Result<Recovered, RecoverFilesError> {
    let path = directory.display().to_string();
    let io_error = |cause| RecoverFilesError::Io { path: path.clone(), cause };
    let copied = recover(bag, file.sink, &file.name, custom_data, selection);
    let (mut sink, recovered) = copied.map_err(|error| match error {
        RecoverError::Write(BagWriteError::Io(cause)) => io_error(cause),
        RecoverError::Write(cause) => RecoverFilesError::Write { path: path.clone(), cause },
        error @ RecoverError::Read(_) => error.into(),
    })?;
    sink.flush().and_then(|()| (file.sync)()).map_err(io_error)?;
    let text = metadata_yaml(&recovered.summary, &file.name, custom_data);
    write_metadata_file(directory, &text).map_err(io_error)?;
    Ok(recovered)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bag_reader::BagChannel;
    use crate::bag_writer::ChannelSpec;
    use crate::run_bag::{RunBag, RunBagOptions};
    use std::time::Duration;

    fn bag(folder: &Path) -> PathBuf {
        let bag = RunBag::create(RunBagOptions::new(folder, "r")).unwrap();
        let path = bag.path().to_owned();
        let spec = ChannelSpec {
            topic: "/a".into(),
            type_name: "std_msgs/msg/UInt8".into(),
            schema_text: "uint8 data\n".into(),
            type_hash: String::new(),
            qos: Vec::new(),
        };
        let channel = bag.add_channel(&spec).unwrap();
        assert!(bag.write(channel, 1, 1, vec![0, 1, 0, 0, 7]));
        assert!(bag.finish(Duration::from_secs(60)).complete);
        path
    }

    #[test]
    fn a_file_that_lies_there_packed_and_unpacked_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = bag(folder.path());
        let file = path.join("r_0.mcap");
        let packed = zstd::encode_all(&fs::read(&file).unwrap()[..], 0).unwrap();
        fs::write(path.join("r_0.mcap.zstd"), packed).unwrap();
        fs::remove_file(path.join(METADATA_FILE)).unwrap();
        assert_eq!(mcap_files(&path).unwrap(), std::slice::from_ref(&file));
        fs::remove_file(file).unwrap();
        assert_eq!(mcap_files(&path).unwrap(), [path.join("r_0.mcap.zstd")]);
    }

    #[test]
    fn a_copy_that_fails_leaves_nothing_and_says_where() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let path = bag(folder.path());
        let name = "copy_0.mcap".to_owned();
        let file = PartFile { name, sink: Box::new(Full), sync: Box::new(|| Ok(())) };
        let mut whole = open_bag(&path).unwrap();
        let custom_data = BTreeMap::new();
        let error = write_copy(folder.path(), file, &mut whole, &custom_data, CopySelection::ALL);
        let error = error.unwrap_err().to_string();
        assert_eq!(
            error,
            format!("{} cannot be written: no storage space", folder.path().display())
        );

        let to = folder.path().join("copy");
        let in_the_way = |_: &BagChannel| fs::create_dir(to.join(METADATA_TEMPORARY)).is_ok();
        let selection = CopySelection { topics: &in_the_way, ..CopySelection::ALL };
        let error = trim_bag(&path, &to, selection).unwrap_err().to_string();
        assert!(error.contains("copy cannot be written: Is a directory"), "{error}");
        assert!(!to.exists() && path.exists());
        // An existing directory is not a half copy; it is not removed.
        fs::create_dir(&to).unwrap();
        let error = recover_bag(&path, &to).unwrap_err();
        assert!(error.to_string().contains("copy cannot be written") && to.exists(), "{error}");
    }
}
