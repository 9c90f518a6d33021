//! Bags as paths: directories, bare files, metadata.yaml.
//!
//! Decides nothing about what is in a bag; see [`crate::bag_reader`].

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::bag_reader::{Bag, BagError, BagSource, Problem};
use crate::metadata::{file_names, metadata_yaml};
use crate::recover::{RecoverError, Recovered, recover};

/// A bag opened from files.
pub type FileBag = Bag<BufReader<File>>;

const METADATA_FILE: &str = "metadata.yaml";
const READ_BUFFER: usize = 256 * 1024;

/// Opens a bag directory or a bare `.mcap` file, finished or not.
///
/// Without metadata.yaml all `.mcap` files of the directory are read, in the
/// order of their names, and the bag counts as incomplete.
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
    let (files, is_listed) = files_of(path)?;
    let sources = files.iter().map(|file| open_source(file));
    let mut bag = Bag::from_sources(sources.collect::<Result<_, _>>()?)?;
    if !is_listed {
        bag.add_problem(Problem::NoMetadataFile);
    }
    Ok(bag)
}

/// The files of a bag directory, and whether metadata.yaml lists them.
fn files_of(directory: &Path) -> Result<(Vec<PathBuf>, bool), BagError> {
    let name = directory.display().to_string();
    let metadata_error = |why: String| BagError::Metadata { directory: name.clone(), why };
    match fs::read_to_string(directory.join(METADATA_FILE)) {
        Ok(text) => {
            let names = file_names(&text).map_err(|error| metadata_error(error.to_string()))?;
            let mut files = Vec::new();
            for listed in names {
                // Old bags list paths; the file is always beside its metadata.yaml.
                let base = Path::new(&listed)
                    .file_name()
                    .ok_or_else(|| metadata_error(format!("\"{listed}\" is no file name")))?;
                let file = directory.join(base);
                if !file.is_file() {
                    return Err(BagError::MissingFile {
                        directory: name,
                        file: base.display().to_string(),
                    });
                }
                files.push(file);
            }
            if files.is_empty() {
                return Err(BagError::EmptyDirectory { directory: name });
            }
            Ok((files, true))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let io_error = |cause| BagError::Io { file: name.clone(), cause };
            let mut files = Vec::new();
            for entry in fs::read_dir(directory).map_err(io_error)? {
                let file = entry.map_err(io_error)?.path();
                if file.extension().is_some_and(|extension| extension == "mcap") {
                    files.push(file);
                }
            }
            if files.is_empty() {
                return Err(BagError::EmptyDirectory { directory: name });
            }
            // run_2 before run_10.
            files.sort_by_key(|file| (file.as_os_str().len(), file.clone()));
            Ok((files, false))
        }
        Err(error) => Err(metadata_error(error.to_string())),
    }
}

fn open_source(path: &Path) -> Result<BagSource<BufReader<File>>, BagError> {
    let name = path.display().to_string();
    match File::open(path) {
        Ok(file) => Ok(BagSource { name, reader: BufReader::with_capacity(READ_BUFFER, file) }),
        Err(cause) => Err(BagError::Io { file: name, cause }),
    }
}

/// The directory of a bag that is being written, and its one file.
#[derive(Debug)]
pub(crate) struct BagDirectory {
    pub(crate) directory: PathBuf,
    pub(crate) file_name: String,
    pub(crate) file: File,
}

impl BagDirectory {
    /// Makes `parent/name` and `parent/name/name_0.mcap`; neither may be there before.
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
        let file_name = format!("{name}_0.mcap");
        let file = File::create_new(directory.join(&file_name))?;
        Ok(Self { directory, file_name, file })
    }
}

/// Writes metadata.yaml in one step: whoever sees it sees it whole.
pub(crate) fn write_metadata_file(directory: &Path, text: &str) -> io::Result<()> {
    let temporary = directory.join("metadata.yaml.tmp");
    let mut file = File::create(&temporary)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    fs::rename(&temporary, directory.join(METADATA_FILE))?;
    // The rename itself has to reach the disk.
    File::open(directory)?.sync_all()
}

/// Why a bag could not be copied to files.
#[derive(Debug, thiserror::Error)]
pub enum RecoverFilesError {
    #[error(transparent)]
    Recover(#[from] RecoverError),
    #[error("{path} cannot be written: {cause}")]
    Io { path: String, cause: io::Error },
}

/// Copies all that can be read of the bag at `from` into a new bag directory `to`.
pub fn recover_bag(from: &Path, to: &Path) -> Result<Recovered, RecoverFilesError> {
    let io_error = |cause| RecoverFilesError::Io { path: to.display().to_string(), cause };
    let mut bag = open_bag(from).map_err(RecoverError::from)?;
    let parent = to.parent().unwrap_or(Path::new("."));
    let name = to.file_name().map_or(String::new(), |name| name.display().to_string());
    let made = BagDirectory::create(parent, &name).map_err(io_error)?;
    let custom_data = BTreeMap::from([("recovered_from".to_owned(), from.display().to_string())]);
    let sink = BufWriter::new(made.file);
    let (sink, recovered) = recover(&mut bag, sink, &made.file_name, &custom_data)?;
    let file = sink.into_inner().map_err(|error| io_error(error.into_error()))?;
    file.sync_all().map_err(io_error)?;
    let text = metadata_yaml(&recovered.summary, &made.file_name, &custom_data);
    write_metadata_file(&made.directory, &text).map_err(io_error)?;
    Ok(recovered)
}
