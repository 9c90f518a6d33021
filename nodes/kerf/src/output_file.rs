//! Writes pictures and pages, and protects other files from being overwritten.
//!
//! An existing file is replaced only if Kerf wrote it, or if it is empty, as `mktemp` makes it. It
//! is never an input of the command, a device, a pipe, a bag, or the command's standard output.
//! Kerf checks this twice: before it computes anything, and just before it replaces the file.

use crate::exit::Failure;
use rustix::fs::{CWD, RenameFlags, Stat, fstat, renameat_with, stat};
use std::fs::{self, File};
use std::io::{self, BufWriter, Read};
use std::path::{Path, PathBuf};

/// How much of a file is read to recognise it.
const BEGIN_BYTES: u64 = 64 << 10;
/// Bytes that are collected before they are written.
const BUFFER_BYTES: usize = 64 << 10;

/// The target of a picture or a page.
#[derive(Debug)]
pub(crate) struct OutputFile {
    /// The path as given.
    path: PathBuf,
    /// The resolved path: a link to it stays a link.
    place: PathBuf,
    inputs: Vec<FileId>,
}

/// Device and inode of a file, which identify it under any name.
type FileId = (u64, u64);

impl OutputFile {
    /// Two targets, if they were given.
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

    /// The target, if one was given.
    pub(crate) fn claim_if(path: Option<&Path>, inputs: &[&Path]) -> Result<Option<Self>, Failure> {
        path.map(|path| Self::claim(path, inputs)).transpose()
    }

    /// Checks that a file may be written here.
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

    /// Replaces the file at once: readers see the old one or the new one.
    ///
    /// `write` is given a buffer before the file.
    pub(crate) fn write(
        self,
        write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), Failure> {
        let Some(name) = self.place.file_name() else {
            return Err(failed(&self.path, io::ErrorKind::IsADirectory.into()));
        };
        let mut partial = std::ffi::OsString::from(".");
        partial.push(name);
        partial.push(format!(".{}.partial", std::process::id()));
        let partial = self.place.with_file_name(partial);
        let written = (|| {
            let mut file = BufWriter::with_capacity(BUFFER_BYTES, File::create_new(&partial)?);
            write(&mut file)?;
            file.into_inner()?.sync_all()
        })();
        let written = written.map_err(|error| failed(&self.path, error));
        let put = written.and_then(|()| self.put(&partial));
        if put.is_err() {
            // Nobody needs the partial file.
            let _ = fs::remove_file(&partial);
        }
        put
    }

    fn put(&self, partial: &Path) -> Result<(), Failure> {
        let replaced = if is_replaceable(&self.place, &self.inputs)? {
            fs::rename(partial, &self.place)
        } else {
            // Never overwrites a file that was made in the meantime.
            match renameat_with(CWD, partial, CWD, &self.place, RenameFlags::NOREPLACE) {
                // The file system does not support it.
                Err(rustix::io::Errno::INVAL | rustix::io::Errno::NOSYS) => {
                    fs::rename(partial, &self.place)
                }
                outcome => outcome.map_err(io::Error::from),
            }
        };
        replaced.map_err(|error| failed(&self.path, error))
    }
}

/// Whether a file exists here and may be replaced; `false` when there is none.
fn is_replaceable(path: &Path, inputs: &[FileId]) -> Result<bool, Failure> {
    if fs::symlink_metadata(path).is_err() {
        return Ok(false);
    }
    let there = stat(path).map_err(|_| refused(path, "a link that leads nowhere"))?;
    // Standard output may be a file as well.
    let printed = [fstat(io::stdout()), fstat(io::stderr())];
    if printed.iter().flatten().any(|other| id(other) == id(&there)) {
        return Err(refused(path, "the standard output of this command"));
    }
    if inputs.contains(&id(&there)) {
        return Err(refused(path, "an input of this command"));
    }
    let begin = intake::file::open(path).map_err(|error| {
        let path = path.display();
        Failure::usage(format_args!("{path}: {error}; it is not overwritten: choose another file"))
    })?;
    if !is_ours_or_empty(begin).map_err(|error| failed(path, error))? {
        return Err(refused(path, "not a picture or page of Kerf"));
    }
    Ok(true)
}

/// The path of a file that does not exist yet, the same for every spelling.
fn place_of_new(path: &Path) -> PathBuf {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    match (folder.canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        // Writing will fail there, and say why.
        _ => path.to_owned(),
    }
}

fn refused(path: &Path, why: &str) -> Failure {
    let path = path.display();
    Failure::usage(format_args!("{path} is {why} and is not overwritten: choose another file"))
}

fn failed(path: &Path, error: io::Error) -> Failure {
    Failure::usage(format_args!("cannot write {}: {error}", path.display()))
}

fn id(file: &Stat) -> FileId {
    (file.st_dev, file.st_ino)
}

/// Whether a file is empty, or begins like Kerf's pictures and pages, also of earlier versions.
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
    use std::io::Write;

    fn svg(to: &mut impl Write) -> io::Result<()> {
        to.write_all(b"<svg>")
    }

    #[test]
    fn a_file_made_in_the_meantime_is_not_overwritten() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::write(at("part.ngc"), "G1").expect("written");
        fs::write(at("empty.svg"), "").expect("written");
        for name in ["new.svg", "empty.svg"] {
            let file = OutputFile::claim(&at(name), &[]).expect("a place");
            fs::write(at(name), "the work of a day").expect("written");
            let refused = file.write(svg).expect_err("somebody else's");
            assert!(
                refused.message.contains("not a picture or page of Kerf"),
                "{}",
                refused.message
            );
            assert_eq!(fs::read_to_string(at(name)).expect("kept"), "the work of a day");
        }
        let file = OutputFile::claim(&at("linked.svg"), &[&at("part.ngc")]).expect("a place");
        fs::hard_link(at("part.ngc"), at("linked.svg")).expect("a link");
        let refused = file.write(svg).expect_err("an input");
        assert!(refused.message.contains("an input of this command"), "{}", refused.message);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 4, "no partial file");
    }

    #[test]
    fn one_file_is_not_claimed_twice_under_any_names() {
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
