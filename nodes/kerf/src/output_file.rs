//! Pictures and pages: what is written, and what is never written over.
//!
//! A file that is there is replaced only if Kerf wrote it. Never an input of the command, a
//! device, a pipe, a bag, or where the command prints to.

use crate::exit::Failure;
use rustix::fs::{CWD, RenameFlags, Stat, fstat, renameat_with, stat};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// How much of a file is looked at.
const BEGIN_BYTES: u64 = 64 << 10;

/// A place for a picture or a page.
#[derive(Debug)]
pub(crate) struct OutputFile {
    /// As it was named.
    path: PathBuf,
    /// Where it really is: a link to it stays a link.
    place: PathBuf,
    is_there: bool,
}

impl OutputFile {
    /// The place, if one was named.
    pub(crate) fn claim_if(path: Option<&Path>, inputs: &[&Path]) -> Result<Option<Self>, Failure> {
        path.map(|path| Self::claim(path, inputs)).transpose()
    }

    /// Looks whether something may be written here. Before the work, so that nobody waits for
    /// what is refused at its end.
    pub(crate) fn claim(path: &Path, inputs: &[&Path]) -> Result<Self, Failure> {
        let refused = |why: &str| {
            let path = path.display();
            Failure::usage(format_args!(
                "{path} is {why}; nothing is written over it: name another file"
            ))
        };
        if fs::symlink_metadata(path).is_err() {
            let place = path.to_owned();
            return Ok(Self { path: path.to_owned(), place, is_there: false });
        }
        let there = stat(path).map_err(|_| refused("a link that leads nowhere"))?;
        // Where the command prints to may be a file as well.
        let printed = [fstat(io::stdout()), fstat(io::stderr())];
        if printed.iter().flatten().any(|other| is_same(other, &there)) {
            return Err(refused("where this command prints to"));
        }
        if inputs.iter().filter_map(|input| stat(*input).ok()).any(|other| is_same(&other, &there))
        {
            return Err(refused("an input of this command"));
        }
        let begin = intake::file::open(path).map_err(|error| {
            let path = path.display();
            Failure::usage(format_args!(
                "{path}: {error}; nothing is written over it: name another file"
            ))
        })?;
        if !is_ours(begin).map_err(|error| failed(path, error))? {
            return Err(refused("no picture or page of Kerf"));
        }
        let place = path.canonicalize().map_err(|error| failed(path, error))?;
        Ok(Self { path: path.to_owned(), place, is_there: true })
    }

    /// Writes it whole: readers see the old one or the new one.
    pub(crate) fn write(self, content: &str) -> Result<(), Failure> {
        let Some(name) = self.place.file_name() else {
            return Err(failed(&self.path, io::ErrorKind::IsADirectory.into()));
        };
        let mut partial = std::ffi::OsString::from(".");
        partial.push(name);
        partial.push(format!(".{}.partial", std::process::id()));
        let partial = self.place.with_file_name(partial);
        let written = (|| {
            let mut file = File::create_new(&partial)?;
            file.write_all(content.as_bytes())?;
            file.sync_all()?;
            self.put(&partial)
        })();
        written.map_err(|error| {
            // The partial file is of no use to anybody.
            let _ = fs::remove_file(&partial);
            failed(&self.path, error)
        })
    }

    fn put(&self, partial: &Path) -> io::Result<()> {
        if self.is_there {
            return fs::rename(partial, &self.place);
        }
        // Never over a file that came in between.
        match renameat_with(CWD, partial, CWD, &self.place, RenameFlags::NOREPLACE) {
            // The file system knows no such thing.
            Err(rustix::io::Errno::INVAL | rustix::io::Errno::NOSYS) => {
                fs::rename(partial, &self.place)
            }
            outcome => Ok(outcome?),
        }
    }
}

fn failed(path: &Path, error: io::Error) -> Failure {
    Failure::usage(format_args!("cannot write {}: {error}", path.display()))
}

fn is_same(one: &Stat, other: &Stat) -> bool {
    (one.st_dev, one.st_ino) == (other.st_dev, other.st_ino)
}

/// Whether a file begins as our pictures and pages do, those of earlier versions too. An empty
/// file is nobody's.
fn is_ours(file: File) -> io::Result<bool> {
    let mut begin = Vec::new();
    file.take(BEGIN_BYTES).read_to_end(&mut begin)?;
    let begin = String::from_utf8_lossy(&begin);
    let is_svg = begin.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\" ")
        && begin.contains(
            "<style>path{fill:none;stroke-linejoin:round;stroke-linecap:round}.programmed{",
        );
    let is_page = begin.starts_with("<!DOCTYPE html>\n<html lang=\"en\">\n")
        && begin.contains("<script type=\"application/json\" id=\"data\">{\"sheets\":[");
    Ok(begin.is_empty() || is_svg || is_page)
}
