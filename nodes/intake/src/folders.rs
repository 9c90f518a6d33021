//! Looks up names from a peer in configured folders only.
//!
//! Links and `..` are resolved first. A path outside of the folders is then rejected; the
//! message is the same whether the file exists or not. Only of a link with a plain name in such a folder it says that it leads
//! out, and so that its target exists.

use crate::file::{self, FLAGS, ReadError};
use crate::text::one_line;
use rustix::fs::{CWD, Mode, OFlags, ResolveFlags};
use std::fs::File;
use std::io;
use std::path::{Component, Path, PathBuf};

/// Folders, and the parameter that names them.
#[derive(Debug, Clone)]
pub struct Folders {
    folders: Vec<PathBuf>,
    parameter: &'static str,
}

/// Why no file was read for a name.
#[derive(Debug, thiserror::Error)]
pub enum LookupError {
    #[error(
        "{name} is in none of the folders from which files are read: {folders} (parameter {parameter})"
    )]
    Outside { name: String, folders: String, parameter: &'static str },
    #[error(
        "{name} cannot be read: parameter {parameter} names no folder; set it, \
         or send the text"
    )]
    NoFolders { name: String, parameter: &'static str },
    #[error(
        "{name} is a link that leads out of the folders from which files are read: {folders} (parameter {parameter}); \
         copy the file there, or name its folder, too"
    )]
    Link { name: String, folders: String, parameter: &'static str },
    #[error("there is no {name} in {folders} (parameter {parameter})")]
    Missing { name: String, folders: String, parameter: &'static str },
    #[error(
        "{name} is hidden (it, or a folder on its way, begins with a dot); rename it to read it"
    )]
    Hidden { name: String },
    #[error("cannot read {name}: {error}")]
    Read { name: String, error: ReadError },
}

impl LookupError {
    /// Why a file that is there was not read; `None` if there is none.
    pub fn of_a_file(&self) -> Option<String> {
        match self {
            Self::NoFolders { .. } | Self::Missing { .. } => None,
            _ => Some(self.to_string()),
        }
    }
}

impl Folders {
    /// Folders in the order in which they are searched.
    pub fn new(folders: impl IntoIterator<Item = String>, parameter: &'static str) -> Self {
        // An empty name would mean the current folder, which nobody configured.
        let folders = folders.into_iter().filter(|folder| !folder.is_empty());
        Self { folders: folders.map(PathBuf::from).collect(), parameter }
    }

    /// Reads the file `name` of at most `most` bytes, from the first folder that has it.
    ///
    /// An absolute name is accepted when it resolves to a file in a folder.
    ///
    /// # Errors
    /// The file is in no folder, or cannot be read.
    pub fn read(&self, name: &str, most: u64) -> Result<Vec<u8>, LookupError> {
        let (folders, owned) = (self.clone(), name.to_owned());
        // The look-up may hang as well as the reading.
        let within = file::READ_WITHIN;
        let read = file::guarded(within, move || {
            Ok(folders.open(&owned).and_then(|file| {
                file::read_all(file, most).map_err(|error| folders.unreadable(&owned, error))
            }))
        });
        read.unwrap_or_else(|error| Err(self.unreadable(name, error)))
    }

    fn unreadable(&self, name: &str, error: ReadError) -> LookupError {
        LookupError::Read { name: one_line(name).into_owned(), error }
    }

    fn open(&self, name: &str) -> Result<File, LookupError> {
        let (shown, parameter) = (one_line(name).into_owned(), self.parameter);
        if self.folders.is_empty() {
            return Err(LookupError::NoFolders { name: shown, parameter });
        }
        let listed: Vec<String> =
            self.folders.iter().map(|folder| one_line(&folder.to_string_lossy()).into()).collect();
        let folders = listed.join(", ");
        // A folder that does not exist has no files.
        let roots: Vec<PathBuf> =
            self.folders.iter().filter_map(|folder| folder.canonicalize().ok()).collect();
        let (mut leads_outside, mut may_be_inside) = (false, false);
        for folder in &self.folders {
            // Joining an absolute name yields the name itself.
            let wanted = folder.join(name);
            let seems_inside = |root: &PathBuf| is_below_by_text(&wanted, root);
            may_be_inside |= roots.iter().chain(&self.folders).any(seems_inside);
            let Ok(real) = wanted.canonicalize() else { continue };
            let Some((root, rest)) =
                roots.iter().find_map(|root| Some((root, real.strip_prefix(root).ok()?)))
            else {
                leads_outside = true;
                continue;
            };
            if rest.as_os_str().is_empty() {
                return Err(self.unreadable(name, ReadError::NotRegular("a folder")));
            }
            if is_hidden(rest) {
                return Err(LookupError::Hidden { name: shown });
            }
            return open_below(root, rest).map_err(|error| self.unreadable(name, error));
        }
        // Of a longer way nobody learns what there is outside.
        let is_plain =
            matches!(Path::new(name).components().collect::<Vec<_>>()[..], [Component::Normal(_)]);
        Err(match leads_outside || !may_be_inside {
            true if is_plain => LookupError::Link { name: shown, folders, parameter },
            true => LookupError::Outside { name: shown, folders, parameter },
            false => LookupError::Missing { name: shown, folders, parameter },
        })
    }
}

/// Whether `path` is below `root` by its text alone, before links are resolved.
fn is_below_by_text(path: &Path, root: &Path) -> bool {
    let Ok(rest) = path.strip_prefix(root) else { return false };
    let mut depth = 0_i64;
    rest.components().all(|part| {
        match part {
            Component::ParentDir => depth -= 1,
            Component::Normal(_) => depth += 1,
            _ => {}
        }
        depth >= 0
    })
}

fn is_hidden(path: &Path) -> bool {
    path.components().any(|part| match part {
        Component::Normal(name) => name.as_encoded_bytes().starts_with(b"."),
        _ => false,
    })
}

/// Opens a path below a folder without following links, in case one is swapped in meanwhile.
fn open_below(root: &Path, rest: &Path) -> Result<File, ReadError> {
    let folder =
        rustix::fs::open(root, OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty())
            .map_err(io::Error::from)?;
    let resolve = ResolveFlags::BENEATH | ResolveFlags::NO_SYMLINKS | ResolveFlags::NO_MAGICLINKS;
    let opened = |flags| rustix::fs::openat2(&folder, rest, flags, Mode::empty(), resolve);
    match opened(OFlags::PATH | OFlags::CLOEXEC) {
        Ok(place) => {
            let seen = rustix::fs::fstat(&place).map_err(io::Error::from)?;
            file::must_be_regular(seen.st_mode)?;
            file::is_still(&File::from(opened(FLAGS).map_err(io::Error::from)?), &seen)
        }
        // Linux before 5.6, or a container that blocks unknown system calls.
        Err(rustix::io::Errno::NOSYS | rustix::io::Errno::PERM) => open_by_parts(root, rest),
        Err(error) => Err(io::Error::from(error).into()),
    }
}

/// As `open_below`, for old kernels: opens one folder after the other, none of them a link.
fn open_by_parts(root: &Path, rest: &Path) -> Result<File, ReadError> {
    const STEP: OFlags = OFlags::PATH.union(OFlags::NOFOLLOW).union(OFlags::CLOEXEC);
    let failed = |error| ReadError::Io(io::Error::from(error));
    let mut place = rustix::fs::openat(CWD, root, STEP, Mode::empty()).map_err(failed)?;
    let mut parts = rest.components().peekable();
    while let Some(part) = parts.next() {
        if parts.peek().is_some() {
            let flags = STEP | OFlags::DIRECTORY;
            place = rustix::fs::openat(&place, part.as_os_str(), flags, Mode::empty())
                .map_err(failed)?;
            continue;
        }
        let seen =
            rustix::fs::statat(&place, part.as_os_str(), rustix::fs::AtFlags::SYMLINK_NOFOLLOW)
                .map_err(failed)?;
        file::must_be_regular(seen.st_mode)?;
        let flags = FLAGS | OFlags::NOFOLLOW;
        let file = rustix::fs::openat(&place, part.as_os_str(), flags, Mode::empty());
        return file::is_still(&File::from(file.map_err(failed)?), &seen);
    }
    Err(ReadError::NotRegular("a folder"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    const MOST: u64 = 1000;

    /// `parts/` is configured; `secret` and `parts-old/` are outside of it.
    struct Shop {
        folder: tempfile::TempDir,
        folders: Folders,
    }

    impl Shop {
        fn new() -> Self {
            let folder = tempfile::tempdir().expect("a folder");
            let at = |name: &str| folder.path().join(name);
            for name in ["parts/sub", "parts/.git", "parts-old", "more"] {
                fs::create_dir_all(at(name)).expect("made");
            }
            for (name, text) in [
                ("parts/a.ngc", "G1"),
                ("parts/sub/b.ngc", "G2"),
                ("parts/.git/config", "key"),
                ("parts-old/a.ngc", "old"),
                ("secret", "word"),
                ("more/c.ngc", "G3"),
            ] {
                fs::write(at(name), text).expect("written");
            }
            symlink("../secret", at("parts/out")).expect("a link");
            symlink("sub/b.ngc", at("parts/in")).expect("a link");
            symlink(at("more/c.ngc"), at("parts/other")).expect("a link");
            symlink("/", at("parts/root")).expect("a link");
            let named = ["parts", "more", "not-there", ""].map(|name| match name {
                "" => String::new(),
                name => at(name).display().to_string(),
            });
            Self { folders: Folders::new(named, "program_directories"), folder }
        }

        fn at(&self, name: &str) -> String {
            self.folder.path().join(name).display().to_string()
        }

        fn read(&self, name: &str) -> Result<String, String> {
            let read = self.folders.read(name, MOST).map_err(|error| error.to_string())?;
            Ok(String::from_utf8(read).expect("text"))
        }
    }

    #[test]
    fn names_lead_into_the_folders_and_nowhere_else() {
        let shop = Shop::new();
        let table = [
            ("a.ngc".into(), Ok("G1")),
            ("./a.ngc".into(), Ok("G1")),
            ("sub/b.ngc".into(), Ok("G2")),
            ("sub/../a.ngc".into(), Ok("G1")),
            ("c.ngc".into(), Ok("G3")),
            ("in".into(), Ok("G2")),
            ("other".into(), Ok("G3")),
            (shop.at("parts/a.ngc"), Ok("G1")),
            (shop.at("more/../parts/a.ngc"), Ok("G1")),
            ("out".into(), Err("is a link that leads out of the folders")),
            ("../secret".into(), Err("in none of the folders")),
            ("../no-such".into(), Err("in none of the folders")),
            ("sub/../../secret".into(), Err("in none of the folders")),
            ("root/etc/passwd".into(), Err("in none of the folders")),
            (shop.at("secret"), Err("in none of the folders")),
            (shop.at("parts-old/a.ngc"), Err("in none of the folders")),
            (shop.at("no-such"), Err("in none of the folders")),
            ("/etc/passwd".into(), Err("in none of the folders")),
            ("/proc/self/environ".into(), Err("in none of the folders")),
            (".git/config".into(), Err("hidden")),
            ("d.ngc".into(), Err("there is no d.ngc in ")),
            ("sub".into(), Err("a folder; a regular file is needed")),
            (".".into(), Err("a folder; a regular file is needed")),
            ("a\0b".into(), Err("a\\u0000b")),
            ("\x1b[2J".into(), Err("\\u001b[2J")),
        ];
        for (name, expected) in table {
            let found = shop.read(&name);
            match (&found, expected) {
                (Ok(text), Ok(expected)) => assert_eq!(text, expected, "{name}"),
                (Err(error), Err(part)) => assert!(error.contains(part), "{name}: {error}"),
                _ => panic!("{name}: {found:?}"),
            }
        }
    }

    #[test]
    fn a_refusal_names_the_folders_and_the_parameter() {
        let shop = Shop::new();
        for name in ["/etc/passwd", "nothing.ngc"] {
            let error = shop.read(name).expect_err("refused");
            for part in [shop.at("parts"), shop.at("more"), "program_directories".into()] {
                assert!(error.contains(&part), "{error}");
            }
        }
        let none = Folders::new([], "control_directories").read("a.yaml", MOST);
        let error = none.expect_err("no folders").to_string();
        assert!(error.contains("control_directories"), "{error}");
    }

    #[test]
    fn a_file_that_is_there_and_not_read_has_a_reason() {
        let shop = Shop::new();
        let why = |name: &str| shop.folders.read(name, MOST).expect_err("not read").of_a_file();
        assert_eq!(why("d.ngc"), None);
        assert!(why("out").is_some_and(|it| it.contains("leads out")));
        assert!(why("sub").is_some_and(|it| it.contains("a folder")));
    }

    #[test]
    fn old_kernels_find_the_same() {
        let shop = Shop::new();
        let root = shop.folder.path().join("parts").canonicalize().expect("there");
        let mut text = String::new();
        let mut file = open_by_parts(&root, Path::new("sub/b.ngc")).expect("there");
        io::Read::read_to_string(&mut file, &mut text).expect("read");
        assert_eq!(text, "G2");
        // A link that was swapped in after resolving is not followed.
        for rest in ["out", "in", "root/etc/passwd"] {
            assert!(open_by_parts(&root, Path::new(rest)).is_err(), "{rest}");
            assert!(open_below(&root, Path::new(rest)).is_err(), "{rest}");
        }
        assert!(open_below(&root, Path::new("../secret")).is_err());
    }

    #[test]
    fn a_pipe_and_a_large_file_in_a_folder_are_refused() {
        let shop = Shop::new();
        let made = std::process::Command::new("mkfifo").arg(shop.at("parts/fifo")).status();
        assert!(made.expect("mkfifo").success());
        assert!(shop.read("fifo").expect_err("a pipe").contains("named pipe"));
        fs::write(shop.at("parts/large"), vec![b' '; 1001]).expect("written");
        assert!(shop.read("large").expect_err("large").contains("1001 bytes; at most 1000"));
    }
}
