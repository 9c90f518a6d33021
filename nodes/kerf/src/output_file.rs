//! Pictures and pages: what is written, and what is never written over.
//!
//! A file that is there is replaced only if Kerf wrote it, or if it is empty, as `mktemp` makes it.
//! Never an input of the command, a device, a pipe, a bag, or where the command prints to. That is
//! looked at before the work, so that nobody waits for what is refused at its end, and once more
//! just before the file is replaced.

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
    inputs: Vec<FileId>,
}

/// Which file it is, under whatever name.
type FileId = (u64, u64);

impl OutputFile {
    /// Two places, where they were named.
    pub(crate) fn claim_both(
        paths: [Option<&Path>; 2],
        inputs: &[&Path],
    ) -> Result<[Option<Self>; 2], Failure> {
        let [one, other] = paths.map(|path| Self::claim_if(path, inputs));
        let (one, other) = (one?, other?);
        if let (Some(one), Some(other)) = (&one, &other)
            && one.place == other.place
        {
            return Err(refused(&other.path, "named twice as an output of this command"));
        }
        Ok([one, other])
    }

    /// The place, if one was named.
    pub(crate) fn claim_if(path: Option<&Path>, inputs: &[&Path]) -> Result<Option<Self>, Failure> {
        path.map(|path| Self::claim(path, inputs)).transpose()
    }

    /// Looks whether something may be written here.
    pub(crate) fn claim(path: &Path, inputs: &[&Path]) -> Result<Self, Failure> {
        let inputs = inputs.iter().filter_map(|input| stat(*input).ok()).map(|it| id(&it));
        let inputs: Vec<_> = inputs.collect();
        let is_there = is_replaceable(path, &inputs)?;
        let place = match is_there {
            true => path.canonicalize().map_err(|error| failed(path, error))?,
            false => place_of_new(path),
        };
        Ok(Self { path: path.to_owned(), place, inputs })
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
            file.sync_all()
        })();
        let written = written.map_err(|error| failed(&self.path, error));
        let put = written.and_then(|()| self.put(&partial));
        if put.is_err() {
            // The partial file is of no use to anybody.
            let _ = fs::remove_file(&partial);
        }
        put
    }

    fn put(&self, partial: &Path) -> Result<(), Failure> {
        let replaced = if is_replaceable(&self.place, &self.inputs)? {
            fs::rename(partial, &self.place)
        } else {
            // Never over a file that comes in between.
            match renameat_with(CWD, partial, CWD, &self.place, RenameFlags::NOREPLACE) {
                // The file system knows no such thing.
                Err(rustix::io::Errno::INVAL | rustix::io::Errno::NOSYS) => {
                    fs::rename(partial, &self.place)
                }
                outcome => outcome.map_err(io::Error::from),
            }
        };
        replaced.map_err(|error| failed(&self.path, error))
    }
}

/// Whether there is a file here, and it may be replaced; `false` when there is none.
fn is_replaceable(path: &Path, inputs: &[FileId]) -> Result<bool, Failure> {
    if fs::symlink_metadata(path).is_err() {
        return Ok(false);
    }
    let there = stat(path).map_err(|_| refused(path, "a link that leads nowhere"))?;
    // Where the command prints to may be a file as well.
    let printed = [fstat(io::stdout()), fstat(io::stderr())];
    if printed.iter().flatten().any(|other| id(other) == id(&there)) {
        return Err(refused(path, "where this command prints to"));
    }
    if inputs.contains(&id(&there)) {
        return Err(refused(path, "an input of this command"));
    }
    let begin = intake::file::open(path).map_err(|error| {
        let path = path.display();
        Failure::usage(format_args!(
            "{path}: {error}; nothing is written over it: name another file"
        ))
    })?;
    if !is_ours_or_empty(begin).map_err(|error| failed(path, error))? {
        return Err(refused(path, "no picture or page of Kerf"));
    }
    Ok(true)
}

/// Where a file will be that is not there yet, under one name whichever way it was named.
fn place_of_new(path: &Path) -> PathBuf {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    match (folder.canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        // Writing fails there, and says why.
        _ => path.to_owned(),
    }
}

fn refused(path: &Path, why: &str) -> Failure {
    let path = path.display();
    Failure::usage(format_args!("{path} is {why}; nothing is written over it: name another file"))
}

fn failed(path: &Path, error: io::Error) -> Failure {
    Failure::usage(format_args!("cannot write {}: {error}", path.display()))
}

fn id(file: &Stat) -> FileId {
    (file.st_dev, file.st_ino)
}

/// Whether a file is empty, or begins as our pictures and pages do, those of earlier versions too.
fn is_ours_or_empty(file: File) -> io::Result<bool> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_in_between_is_not_written_over() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::write(at("part.ngc"), "G1").expect("written");
        fs::write(at("empty.svg"), "").expect("written");
        for name in ["new.svg", "empty.svg"] {
            let file = OutputFile::claim(&at(name), &[]).expect("a place");
            fs::write(at(name), "the work of a day").expect("written");
            let refused = file.write("<svg>").expect_err("somebody else's");
            assert!(refused.message.contains("no picture or page of Kerf"), "{}", refused.message);
            assert_eq!(fs::read_to_string(at(name)).expect("kept"), "the work of a day");
        }
        let file = OutputFile::claim(&at("linked.svg"), &[&at("part.ngc")]).expect("a place");
        fs::hard_link(at("part.ngc"), at("linked.svg")).expect("a link");
        let refused = file.write("<svg>").expect_err("an input");
        assert!(refused.message.contains("an input of this command"), "{}", refused.message);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 4, "no partial file");
    }

    #[test]
    fn one_place_is_not_claimed_twice_under_whichever_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("sub")).expect("made");
        fs::write(at("there"), "").expect("written");
        std::os::unix::fs::symlink("there", at("link")).expect("a link");
        for (one, other, is_taken) in [
            ("a", "a", false),
            ("a", "sub/../a", false),
            ("there", "link", false),
            ("a", "b", true),
            ("a", "sub/a", true),
        ] {
            let both = OutputFile::claim_both([Some(&at(one)), Some(&at(other))], &[]);
            assert_eq!(both.is_ok(), is_taken, "{one} and {other}: {both:?}");
        }
    }
}
