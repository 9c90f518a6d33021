//! Finds the interface files of a package and of the packages that it uses.
//!
//! The package's own files are in `msg`, `srv` and `action`; those of a package P
//! that it uses are in `share/P/msg` and so on, as in an ROS installation.

use std::fs;
use std::io;
use std::path::Path;

use rosidl::InterfaceError;
use rosidl::interface_file::InterfaceFile;
use rosidl::name::{InterfaceKind, TypeName, check_package, check_type};

/// Reads all files below `root`, sorted by path; refuses files that do not belong there.
pub fn read_all(root: &Path, package: &str) -> Result<Vec<InterfaceFile>, Vec<InterfaceError>> {
    let mut files = Vec::new();
    let mut refusals = Vec::new();
    read_package(root, "", package, &mut files, &mut refusals);
    for package in entries(&root.join("share"), "share", &mut refusals) {
        let folder = format!("share/{package}/");
        read_package(root, &folder, &package, &mut files, &mut refusals);
    }
    if refusals.is_empty() { Ok(files) } else { Err(refusals) }
}

fn read_package(
    root: &Path,
    prefix: &str,
    package: &str,
    files: &mut Vec<InterfaceFile>,
    refusals: &mut Vec<InterfaceError>,
) {
    for kind in InterfaceKind::ALL {
        let folder = format!("{prefix}{}", kind.folder());
        for entry in entries(&root.join(&folder), &folder, refusals) {
            let path = format!("{folder}/{entry}");
            match read(root, &path, package, kind, &entry) {
                Ok(file) => files.push(file),
                Err(message) => refusals.push(InterfaceError { file: path, line: 0, message }),
            }
        }
    }
}

fn read(
    root: &Path,
    path: &str,
    package: &str,
    kind: InterfaceKind,
    entry: &str,
) -> Result<InterfaceFile, String> {
    let stem = entry.strip_suffix(kind.folder()).and_then(|stem| stem.strip_suffix('.'));
    let stem = stem.ok_or(format!("only .{} files belong here", kind.folder()))?;
    check_package(package)?;
    check_type(stem)?;
    let text = fs::read_to_string(root.join(path)).map_err(|error| error.to_string())?;
    Ok(InterfaceFile { name: TypeName::new(package, kind, stem), path: path.into(), text })
}

/// Names in a folder, sorted; none if it does not exist. Hidden files are skipped.
fn entries(folder: &Path, label: &str, refusals: &mut Vec<InterfaceError>) -> Vec<String> {
    let names = fs::read_dir(folder).and_then(|entries| {
        entries
            .map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()))
            .collect::<io::Result<Vec<String>>>()
    });
    match names {
        Ok(mut names) => {
            names.retain(|name| !name.starts_with('.'));
            names.sort();
            names
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(error) => {
            refusals.push(InterfaceError {
                file: label.into(),
                line: 0,
                message: error.to_string(),
            });
            Vec::new()
        }
    }
}
