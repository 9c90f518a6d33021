//! Which bags of a folder a store of many bags has been given: a file in a folder beside the bags.
//!
//! A bag was given when the store has it or a copy waits in the spool. The folder of a bag itself stays as the
//! recorder closed it.

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

    /// Where bags wait while the store does not answer.
    pub(crate) fn spool(&self) -> PathBuf {
        self.directory.join(FOLDER).join("spool")
    }

    fn list(&self) -> PathBuf {
        self.directory.join(FOLDER).join("pushed")
    }

    /// The bags that this store has not been given and no recorder writes, by name.
    ///
    /// # Errors
    /// The directory cannot be read.
    pub(crate) fn due(&self) -> io::Result<Vec<PathBuf>> {
        let text = match fs::read_to_string(self.list()) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            text => text?,
        };
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
        // In one write: what is cut is no whole line, and its bag is given again.
        file.write_all(format!("{}\t{}\n", name(bag), self.store).as_bytes())
    }
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
        ] {
            let given: Vec<&str> = given(list, store).into_iter().collect();
            assert_eq!(given, expected, "{list:?}");
        }
    }
}
