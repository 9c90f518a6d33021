//! Reading what the command line names.

use crate::exit::Failure;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use run_recorder::files::is_bag_file;
use std::path::Path;

/// The bytes of a part program.
pub(crate) fn read_program(path: &Path) -> Result<Vec<u8>, Failure> {
    std::fs::read(path)
        .map_err(|error| Failure::usage(format_args!("cannot read {}: {error}", path.display())))
}

/// The last component of a path, for people.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// A controller profile by name, or from a file.
pub(crate) fn profile(name_or_path: &str) -> Result<Profile, Failure> {
    runtime::load_profile(name_or_path).map_err(Failure::usage)
}

/// A tool table; an empty one without a file.
pub(crate) fn tool_table(path: Option<&Path>) -> Result<ToolTable, Failure> {
    match path {
        None => Ok(ToolTable::default()),
        Some(path) => runtime::load_tool_table(path).map_err(Failure::usage),
    }
}

/// Writes a file whole: readers see the old one or the new one. Never over a bag.
pub(crate) fn write(path: &Path, content: &str) -> Result<(), Failure> {
    if is_bag_file(path) {
        let path = path.display();
        return Err(Failure::usage(format_args!("{path} is a bag; nothing is written over it")));
    }
    let failed = |error| Failure::usage(format_args!("cannot write {}: {error}", path.display()));
    let mut partial = path.as_os_str().to_owned();
    partial.push(".partial");
    std::fs::write(&partial, content).map_err(failed)?;
    std::fs::rename(&partial, path).map_err(|error| {
        // The partial file is of no use to anybody.
        let _ = std::fs::remove_file(&partial);
        failed(error)
    })
}
