//! Which bags of a folder were already pushed to the store: a file in a folder next to the bags.
//!
//! A bag that the store was not given is due, however long the store is away: so nothing is copied, and nothing
//! is lost when the recorder ends. The folder of a bag itself stays as the recorder closed it.

use crate::retention::Stays;
use crate::stored_bags::find;
use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The folder, of the recorder's directory.
const FOLDER: &str = ".fleet";

/// The bags of a directory and a store.
#[derive(Debug)]
pub(crate) struct HandedOver {
    directory: PathBuf,
    store: String,
}

impl HandedOver {
    pub(crate) fn new(directory: PathBuf, store: String) -> Self {
        Self { directory, store }
    }

    fn list(&self) -> PathBuf {
        self.directory.join(FOLDER).join("pushed")
    }

    /// The bags that this store has not been given and no recorder writes, by name.
    ///
    /// # Errors
    /// The directory cannot be read.
    pub(crate) fn due(&self) -> io::Result<Vec<PathBuf>> {
        let text = match fs::read(self.list()) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            text => text?,
        };
        let text = String::from_utf8_lossy(&text);
        let given = given(&text, &self.store);
        let bags = find(&self.directory)?;
        let bags = bags.into_iter().filter(|bag| !matches!(bag.stays, Some(Stays::InUse)));
        let mut due: Vec<PathBuf> =
            bags.map(|bag| bag.path).filter(|path| !given.contains(name(path))).collect();
        due.sort();
        Ok(due)
    }

    /// Notes that the store has been given this bag.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn note(&self, bag: &Path) -> io::Result<()> {
        let list = self.list();
        fs::create_dir_all(list.parent().unwrap_or(&self.directory))?;
        let mut file: File = OpenOptions::new().create(true).append(true).open(list)?;
        // In one write, on a line of its own: what is cut is no whole line, and its bag is given again.
        file.write_all(format!("\n{}\t{}\n", name(bag), self.store).as_bytes())
    }
}

/// The bags that the program named as refused.
pub(crate) fn refused_of(complaint: &str, bags: &[PathBuf]) -> BTreeSet<PathBuf> {
    let refused = complaint.lines().filter_map(|line| {
        let (path, _) = line.split_once(": ")?.1.split_once(": not pushed: ")?;
        bags.iter().find(|bag| bag.to_str() == Some(path))
    });
    refused.cloned().collect()
}

fn name(path: &Path) -> &str {
    path.file_name().and_then(|name| name.to_str()).unwrap_or_default()
}

/// The bags that a list has for this store.
fn given<'a>(list: &'a str, store: &str) -> BTreeSet<&'a str> {
    let lines = list.split_inclusive('\n').filter_map(|line| line.strip_suffix('\n'));
    let rows = lines.filter_map(|line| line.split_once('\t'));
    rows.filter(|(_, of)| *of == store).map(|(bag, _)| bag).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bag_was_given_when_a_whole_line_says_so_for_this_store() {
        for (list, store, expected) in [
            ("", "s3://a", &[][..]),
            ("one\ts3://a\ntwo\ts3://b\n", "s3://a", &["one"]),
            ("one\ts3://a\ntwo\ts3://a\n", "s3://a", &["one", "two"]),
            ("one\ts3://a\ntwo\ts3://a", "s3://a", &["one"]),
            ("noise\none\ts3://a\n", "s3://a", &["one"]),
            ("one\ts3:\n\ntwo\ts3://a\n", "s3://a", &["two"]),
        ] {
            let given: Vec<&str> = given(list, store).into_iter().collect();
            assert_eq!(given, expected, "{list:?}");
        }
    }

    #[test]
    fn a_bag_is_refused_when_a_line_names_it() {
        let bags = ["/bags/one", "/bags/two"].map(PathBuf::from);
        for (complaint, expected) in [
            ("", &[][..]),
            ("kerf fleet: s3://a: the store does not answer", &[]),
            ("kerf fleet: /bags/two: not pushed: its 2 files are not of one run", &bags[1..]),
            ("kerf fleet: /spool/three.mcap: not pushed: it is damaged", &[]),
        ] {
            let refused: Vec<PathBuf> = refused_of(complaint, &bags).into_iter().collect();
            assert_eq!(refused, expected, "{complaint:?}");
        }
    }
}
