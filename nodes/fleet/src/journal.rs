//! What a worker has done since its last part: a file next to it, a line for each step.
//!
//! An object of a store cannot grow, and a part for each verdict would make as many files as bags. So
//! verdicts are written in parts now and then, and a worker that is killed in between has them here. The
//! file belongs to one shard of one build on one host, and to one worker at a time: it is locked.

use crate::FleetError;
use crate::core::key::key_of;
use crate::core::schema::{Row, VERDICTS};
use crate::dataset::{row_from_json, row_to_json};
use serde_json::json;
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// An open journal.
#[derive(Debug)]
pub struct Journal {
    file: File,
    path: PathBuf,
    /// Bags in which workers were stopped and that have no verdict yet, with how often.
    stopped: BTreeMap<String, u32>,
}

/// What an earlier worker left.
#[derive(Debug, Default)]
pub struct Left {
    /// Verdicts that are in no part.
    pub rows: Vec<Row>,
    /// Bags that were begun and not ended, with how often.
    pub stopped_in: BTreeMap<String, u32>,
}

impl Journal {
    /// Opens the journal of a shard of a build of the store at this place, and reads what is left in it.
    pub fn open(
        folder: &Path,
        place: &str,
        build: &str,
        shard: &str,
    ) -> Result<(Self, Left), FleetError> {
        let name = format!("{build}-{shard}-{}.jsonl", &key_of(place.as_bytes())[..12]);
        let path = folder.join(name);
        fs::create_dir_all(folder).map_err(|why| FleetError::file(folder, why))?;
        let open = OpenOptions::new().read(true).append(true).create(true).open(&path);
        let mut file = open.map_err(|why| FleetError::file(&path, why))?;
        if let Err(why) = file.try_lock() {
            let why = match why {
                fs::TryLockError::WouldBlock => {
                    format!(
                        "shard {shard} of build {build} is being replayed by another process on this host"
                    )
                }
                fs::TryLockError::Error(why) => why.to_string(),
            };
            return Err(FleetError::file(&path, why));
        }
        let mut text = String::new();
        let read = file.read_to_string(&mut text);
        read.map_err(|why| FleetError::file(&path, format!("{why}; remove it to begin anew")))?;
        let left = left(&text);
        Ok((Self { file, path, stopped: left.stopped_in.clone() }, left))
    }

    /// A bag is begun.
    pub fn begin(&mut self, bag: &str) -> Result<(), FleetError> {
        self.line(&json!({ "begin": bag }))
    }

    /// A bag has its verdict.
    pub fn end(&mut self, row: &Row) -> Result<(), FleetError> {
        self.stopped.remove(row[0].as_text());
        self.line(&json!({ "verdict": row_to_json(VERDICTS, row) }))
    }

    /// The bag in hand has no verdict, and did not stop the worker.
    pub fn skip(&mut self, bag: &str) -> Result<(), FleetError> {
        self.line(&json!({ "skip": bag }))
    }

    /// All is in parts; which bags stopped workers is kept.
    pub fn clear(&mut self) -> Result<(), FleetError> {
        let cleared =
            self.file.set_len(0).and_then(|()| self.file.seek(SeekFrom::Start(0)).map(|_| ()));
        cleared.map_err(|why| FleetError::file(&self.path, why))?;
        for (bag, times) in self.stopped.clone() {
            self.line(&json!({ "stopped": bag, "times": times }))?;
        }
        Ok(())
    }

    /// Removes the file of a shard that is done.
    pub fn remove(self) -> Result<(), FleetError> {
        fs::remove_file(&self.path).map_err(|why| FleetError::file(&self.path, why))
    }

    fn line(&mut self, line: &serde_json::Value) -> Result<(), FleetError> {
        // In one call, so that a kill leaves whole lines and at most one that is cut.
        let text = format!("{line}\n");
        self.file.write_all(text.as_bytes()).map_err(|why| FleetError::file(&self.path, why))
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        // A process that is being started holds a copy of the file for a moment, and the lock with it.
        let _ = self.file.unlock();
    }
}

/// Reads a journal; a line that is cut is the last thing that a worker did, and is left out.
fn left(text: &str) -> Left {
    let mut left = Left::default();
    for line in text.lines() {
        let Ok(line) = serde_json::from_str::<serde_json::Value>(line) else { continue };
        if let Some(bag) = line.get("begin").and_then(|it| it.as_str()) {
            *left.stopped_in.entry(bag.to_owned()).or_default() += 1;
        } else if let Some(bag) = line.get("stopped").and_then(|it| it.as_str()) {
            let times = line.get("times").and_then(serde_json::Value::as_u64).unwrap_or(1);
            *left.stopped_in.entry(bag.to_owned()).or_default() += times.try_into().unwrap_or(1);
        } else if let Some(bag) = line.get("skip").and_then(|it| it.as_str()) {
            match left.stopped_in.get_mut(bag) {
                Some(times) if *times > 1 => *times -= 1,
                _ => drop(left.stopped_in.remove(bag)),
            }
        } else if let Some(row) = line.get("verdict") {
            let row = row_from_json(VERDICTS, row);
            left.stopped_in.remove(row[0].as_text());
            left.rows.push(row);
        }
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::schema::Value;

    fn verdict(bag: &str) -> Row {
        let mut row = vec![Value::Null; VERDICTS.len()];
        row[0] = Value::text(bag);
        row[1] = Value::text("reproduced");
        row
    }

    #[test]
    fn a_worker_that_was_killed_leaves_its_verdicts_and_the_bag_in_hand() {
        let folder = tempfile::tempdir().expect("a folder");
        let open = || Journal::open(folder.path(), "store", "abc", "0-of-2");
        let (mut journal, before) = open().expect("a journal");
        assert!(before.rows.is_empty());
        for bag in ["a", "b"] {
            journal.begin(bag).expect("written");
            journal.end(&verdict(bag)).expect("written");
        }
        journal.begin("c").expect("written");
        let other = open().expect_err("it is locked").to_string();
        assert!(
            other.ends_with(
                "shard 0-of-2 of build abc is being replayed by another process on this host"
            ),
            "{other}"
        );
        drop(journal);
        let (mut journal, left) = open().expect("a journal");
        assert_eq!(left.rows, [verdict("a"), verdict("b")]);
        assert_eq!(left.stopped_in, [("c".to_owned(), 1)].into());
        journal.clear().expect("cleared");
        journal.begin("absent").expect("written");
        journal.skip("absent").expect("written");
        journal.begin("d").expect("written");
        drop(journal);
        // What stopped a worker before the journal was cleared is known after it.
        let (mut journal, left) = open().expect("a journal");
        let stopped = |name: &str, times| (name.to_owned(), times);
        assert_eq!(
            (left.rows.len(), left.stopped_in),
            (0, [stopped("c", 1), stopped("d", 1)].into())
        );
        journal.begin("c").expect("written");
        drop(journal);
        let (mut journal, left) = open().expect("a journal");
        assert_eq!(left.stopped_in, [stopped("c", 2), stopped("d", 1)].into());
        journal.end(&verdict("c")).expect("written");
        journal.clear().expect("cleared");
        drop(journal);
        let (journal, left) = open().expect("a journal");
        assert_eq!((left.rows.len(), left.stopped_in), (0, [stopped("d", 1)].into()));
        journal.remove().expect("removed");
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }

    #[test]
    fn a_line_that_is_cut_is_left_out() {
        let whole = format!("{}\n", json!({ "verdict": row_to_json(VERDICTS, &verdict("a")) }));
        for cut in 0..whole.len() - 1 {
            let text = format!("{whole}{}", &whole[..cut]);
            assert_eq!(left(&text).rows.len(), 1, "{cut}");
        }
    }
}
