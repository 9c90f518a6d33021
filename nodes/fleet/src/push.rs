//! Bags into a store: first the bag, then its row, so that a row without a bag was not made here.
//!
//! A push may end anywhere, and the next one of the same bags does the rest: a bag that is there is not
//! sent again, and a bag without a row gets one. Nothing of the source is changed or removed.

use crate::core::key::{bag_object, key_of};
use crate::core::schema::Row;
use crate::facts::{Outside, row_of};
use crate::store::Store;
use crate::{FleetError, dataset, spool};
use bytes::Bytes;
use run_recorder::bag_reader::{Bag, Problem};
use run_recorder::stored_bags::MARK_FILE;
use std::collections::BTreeSet;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Rows in one part of the index.
const PART_ROWS: usize = 1_000;
/// The largest bag that is read, bytes.
const BAG_BYTES_MAX: u64 = 4 << 30;

/// What is to be pushed.
#[derive(Debug, Default)]
pub struct Order {
    pub bags: Vec<PathBuf>,
    pub machine: Option<String>,
    /// Where bags wait while the store does not answer.
    pub spool: Option<PathBuf>,
}

/// What came of it.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Done {
    /// Bags that were sent.
    pub sent: usize,
    /// Bags that were in the store.
    pub known: usize,
    /// Bags that are no use; each was named.
    pub refused: usize,
    /// Bags that wait in the spool.
    pub waiting: usize,
}

/// One bag to push.
struct Item {
    path: PathBuf,
    machine: Option<String>,
    /// The mark that the spool has kept; of other bags it is in their folder.
    kept: Option<String>,
    is_spooled: bool,
}

/// A bag in memory, with its row.
struct Prepared {
    key: String,
    content: Bytes,
    row: Row,
    kept: Option<String>,
}

/// Pushes bags, those that wait in the spool first. `say` gets a sentence for each bag that is refused.
///
/// # Errors
/// The store does not answer, and there is no spool.
pub fn push(store: &Store, order: &Order, say: &dyn Fn(&str)) -> Result<Done, FleetError> {
    let mut done = Done::default();
    let mut items = Vec::new();
    if let Some(folder) = &order.spool {
        items.extend(spool::waiting(folder)?.into_iter().map(|it| Item {
            path: it.file,
            machine: it.machine,
            kept: it.kept,
            is_spooled: true,
        }));
    }
    let given = order.bags.iter().map(|path| Item {
        path: path.clone(),
        machine: order.machine.clone(),
        kept: None,
        is_spooled: false,
    });
    items.extend(given);
    let mut to = Sender { store, known: None, part: Vec::new(), items: Vec::new() };
    let mut offline = None;
    for item in items {
        let prepared = match prepare(&item) {
            Ok(prepared) => prepared,
            Err(why) => {
                done.refused += 1;
                say(&format!("{}: not pushed: {why}", item.path.display()));
                continue;
            }
        };
        if offline.is_none() {
            match to.send(&prepared) {
                Ok(is_new) => {
                    done.sent += usize::from(is_new);
                    done.known += usize::from(!is_new);
                    to.items.push(item);
                    if to.part.len() < PART_ROWS {
                        continue;
                    }
                    let Err(error) = to.flush() else { continue };
                    offline = Some(error);
                    continue;
                }
                Err(error) => offline = Some(error),
            }
        }
        let Some(folder) = &order.spool else { break };
        if !item.is_spooled {
            spool::add(
                folder,
                &prepared.content,
                item.machine.as_deref(),
                prepared.kept.as_deref(),
            )?;
        }
        done.waiting += 1;
    }
    if let Err(error) = to.flush() {
        offline.get_or_insert(error);
    }
    let Some(error) = offline else { return Ok(done) };
    let Some(folder) = &order.spool else { return Err(error) };
    // These are in the store without a row.
    for item in &to.items {
        done.sent = done.sent.saturating_sub(1);
        done.waiting += 1;
        if !item.is_spooled
            && let Ok(prepared) = prepare(item)
        {
            spool::add(
                folder,
                &prepared.content,
                item.machine.as_deref(),
                prepared.kept.as_deref(),
            )?;
        }
    }
    say(&format!(
        "{error}; {} bags wait in {}, the next push sends them",
        done.waiting,
        folder.display()
    ));
    Ok(done)
}

/// The bags that are sent, and their rows until these are written.
struct Sender<'a> {
    store: &'a Store,
    /// The bags with a row; read with the first bag.
    known: Option<BTreeSet<String>>,
    part: Vec<Row>,
    items: Vec<Item>,
}

impl Sender<'_> {
    /// Sends a bag, and keeps its row; whether anything was missing.
    fn send(&mut self, bag: &Prepared) -> Result<bool, FleetError> {
        let known = match &mut self.known {
            Some(known) => known,
            None => {
                let read = dataset::index(self.store, &["bag"])?;
                self.known.insert(read.rows.into_keys().collect())
            }
        };
        let object = bag_object(&bag.key);
        let is_new = !self.store.has(&object)?;
        if is_new {
            self.store.put(&object, &bag.content)?;
        }
        let has_no_row = known.insert(bag.key.clone());
        if has_no_row {
            self.part.push(bag.row.clone());
        }
        Ok(is_new || has_no_row)
    }

    /// Writes the rows, and takes their bags out of the spool.
    fn flush(&mut self) -> Result<(), FleetError> {
        if !self.part.is_empty() {
            dataset::write_index(self.store, &self.part)?;
            self.part.clear();
        }
        for item in self.items.drain(..).filter(|item| item.is_spooled) {
            spool::remove(&item.path)?;
        }
        Ok(())
    }
}

/// Reads a bag; the error says why it is of no use and what helps.
fn prepare(item: &Item) -> Result<Prepared, String> {
    let file = file_of(&item.path)?;
    let content = intake::file::read(&file, BAG_BYTES_MAX).map_err(|why| why.to_string())?;
    let content = Bytes::from(content);
    let name = file.display().to_string();
    let mut bag = Bag::open(&name, Cursor::new(content.clone())).map_err(|why| why.to_string())?;
    let mark = || fs::read_to_string(item.path.join(MARK_FILE)).ok().map(|it| it.trim().to_owned());
    let kept = item.kept.clone().or_else(mark);
    let key = key_of(&content);
    let outside = Outside {
        bag: key.clone(),
        bytes: content.len() as u64,
        machine: item.machine.clone(),
        host: host(),
        kept: kept.clone(),
    };
    // This reads every chunk, and finds what is damaged.
    let row = row_of(&mut bag, &outside);
    let damages = bag.problems().iter().filter(|it| it.is_damage() && !it.is_of_index());
    let damages: Vec<String> = damages.map(Problem::to_string).collect();
    if !damages.is_empty() {
        return Err(format!(
            "{}; if no recorder is writing it, `kerf bag recover BAG NEW` copies what can be read: push the copy",
            damages.join("; ")
        ));
    }
    Ok(Prepared { key, content, row, kept })
}

/// The one MCAP file of a bag.
fn file_of(path: &Path) -> Result<PathBuf, String> {
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    let entries = fs::read_dir(path).map_err(|why| why.to_string())?;
    let files = entries.flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> =
        files.filter(|it| it.extension().is_some_and(|it| it == "mcap")).collect();
    match files.len() {
        1 => Ok(files.swap_remove(0)),
        0 => Err("no .mcap file is in this folder".to_owned()),
        count => Err(format!(
            "the bag has {count} files, and a store has one file for each bag; `kerf bag recover BAG NEW` joins them: push NEW"
        )),
    }
}

fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    name.trim().to_owned()
}
