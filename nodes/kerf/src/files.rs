//! Reads the files that the command line names.

use crate::exit::Failure;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use intake::folders::Folders;
use program_loader::limits::PROGRAM_BYTES_MAX;
use program_loader::parameter_file::{self, PARAMETER_FILE_BYTES_MAX};
use std::io::{ErrorKind, Write};
use std::path::Path;

/// The bytes of a part program.
pub(crate) fn read_program(path: &Path) -> Result<Vec<u8>, Failure> {
    intake::file::read(path, PROGRAM_BYTES_MAX as u64)
        .map_err(|error| Failure::usage(format_args!("cannot read {}: {error}", path.display())))
}

/// A program with the values of a parameter file.
pub(crate) fn with_parameters(
    text: Vec<u8>,
    profile: &Profile,
    path: &Path,
) -> Result<Vec<u8>, Failure> {
    let file = intake::file::read(path, PARAMETER_FILE_BYTES_MAX)
        .map_err(|error| Failure::usage(format_args!("cannot read {}: {error}", path.display())))?;
    parameter_file::with_parameters(text, profile, &file_name(path), &file)
        .map_err(|error| Failure::usage(format_args!("{}: {error}", path.display())))
}

/// The last component of a path, for people: one line without control characters.
pub(crate) fn file_name(path: &Path) -> String {
    intake::text::one_line(&path.file_name().unwrap_or(path.as_os_str()).to_string_lossy())
        .into_owned()
}

/// The folders of subroutine files.
pub(crate) fn subroutines(folders: &[String]) -> Result<Folders, Failure> {
    let is_missing = |folder: &&String| !Path::new(folder).is_dir();
    match folders.iter().find(is_missing) {
        Some(other) => Err(Failure::usage(format_args!("--subroutines: {other} is not a folder"))),
        None => Ok(Folders::new(folders.iter().cloned(), "--subroutines")),
    }
}

/// The text of a subroutine file, or why one that is there cannot be read.
pub(crate) fn subroutine(folders: &Folders, name: &str) -> Result<Vec<u8>, Option<String>> {
    folders.read(name, PROGRAM_BYTES_MAX as u64).map_err(|error| error.of_a_file())
}

/// A control profile by name, or from a file.
pub(crate) fn profile(name_or_path: &str) -> Result<Profile, Failure> {
    settings::load_profile(name_or_path).map_err(Failure::usage)
}

/// A tool table; empty without a file.
pub(crate) fn tool_table(path: Option<&Path>) -> Result<ToolTable, Failure> {
    match path {
        None => Ok(ToolTable::default()),
        Some(path) => settings::load_tool_table(path).map_err(Failure::usage),
    }
}

/// The files that a command reads, which it must not overwrite.
pub(crate) fn inputs<'a>(
    files: impl IntoIterator<Item = Option<&'a Path>>,
    control: &'a str,
) -> Vec<&'a Path> {
    files.into_iter().flatten().chain([Path::new(control)]).collect()
}

/// A control name for the loader. The loader runs in another folder, so a file is given by its
/// absolute path.
pub(crate) fn as_loader_finds_it(name: &str) -> String {
    let is_built_in = settings::Control::named(name).is_some();
    match Path::new(name).canonicalize() {
        Ok(path) if !is_built_in && !name.is_empty() => path.display().to_string(),
        // It may be a file on the loader's computer.
        _ => name.to_owned(),
    }
}

/// Writes an example file; keeps an identical one, and fails if another file exists.
pub(crate) fn place(path: &Path, content: &str) -> Result<(), Failure> {
    let failed = |error: &dyn std::fmt::Display| {
        Failure::usage(format_args!("cannot write {}: {error}", path.display()))
    };
    match std::fs::File::create_new(path) {
        Ok(mut file) => file.write_all(content.as_bytes()).map_err(|error| failed(&error)),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            let there = intake::file::read(path, content.len() as u64);
            match there {
                Ok(there) if there == content.as_bytes() => Ok(()),
                _ => Err(failed(&"another file exists there; remove it, or choose another folder")),
            }
        }
        Err(error) => Err(failed(&error)),
    }
}
