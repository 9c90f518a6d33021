//! Bags into a store: first the bag, then its row, so that a row without a bag was not made here.
//!
//! A push may end anywhere, and the next one of the same bags does the rest: a bag that is there is not
//! sent again, and a bag without a row gets one. Nothing of the source is changed or removed.

use crate::core::key::{bag_object, key_of};
use crate::core::schema::{INDEX, Row, Value, place};
use crate::facts::{Outside, row_of};
use crate::store::{Missing, Store};
use crate::{FleetError, bag_file, dataset, spool};
use bytes::Bytes;
use run_recorder::bag_reader::Bag;
use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

/// What is to be pushed.
#[derive(Debug, Default)]
pub struct Order {
    pub bags: Vec<PathBuf>,
    pub machine: Option<String>,
    /// Where bags wait while the store does not answer.
    pub spool: Option<PathBuf>,
    /// Whether the content of bags that are there is compared, and not only their size.
    pub verify: bool,
}

/// What came of it.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Done {
    /// Bags that were sent.
    pub sent: usize,
    /// Bags that were in the store.
    pub known: usize,
    /// Bags that were refused; each was named with the reason.
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
/// The store is none, or does not answer and there is no spool.
pub fn push(
    store: Result<&Store, FleetError>,
    order: &Order,
    say: &dyn Fn(&str),
) -> Result<Done, FleetError> {
    let (store, mut offline) = match store {
        Ok(store) => (Some(store), None),
        // What is no store will not be one tomorrow.
        Err(error) if order.spool.is_none() || matches!(error, FleetError::Usage(_)) => {
            return Err(error);
        }
        Err(error) => (None, Some(error)),
    };
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
    let mut to = Sender {
        verify: order.verify,
        problems: Vec::new(),
        known: None,
        part: Vec::new(),
        items: Vec::new(),
    };
    for item in items {
        let prepared = match prepare(&item) {
            Ok(prepared) => prepared,
            // Another push with this spool has sent it.
            Err(_) if item.is_spooled && !item.path.exists() => continue,
            Err(why) => {
                done.refused += 1;
                say(&format!("{}: not pushed: {why}", item.path.display()));
                continue;
            }
        };
        if offline.is_none()
            && let Some(store) = store
        {
            match to.send(store, &prepared) {
                Ok(is_new) => {
                    done.sent += usize::from(is_new);
                    done.known += usize::from(!is_new);
                    to.items.push(item);
                    if to.part.len() < dataset::PART_ROWS {
                        continue;
                    }
                    let Err(error) = to.flush(store) else { continue };
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
    if let Some(store) = store
        && let Err(error) = to.flush(store)
    {
        offline.get_or_insert(error);
    }
    if let (Some(store), None) = (store, &offline)
        && let Err(why) = dataset::join_index(store)
    {
        say(&format!(
            "the small parts of the index were not joined, and nothing is missing: {why}"
        ));
    }
    to.problems.iter().for_each(|problem| say(problem));
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
    // One that was given again waits once.
    done.waiting = spool::waiting(folder)?.len();
    say(&format!(
        "{error}; {} bags wait in {}, the next push sends them",
        done.waiting,
        folder.display()
    ));
    Ok(done)
}

/// The bags that are sent, and their rows until these are written.
struct Sender {
    verify: bool,
    /// Parts of the index that could not be read.
    problems: Vec<String>,
    /// The bags with a row, and its machine and mark; read with the first bag.
    known: Option<BTreeMap<String, [Value; 2]>>,
    part: Vec<Row>,
    items: Vec<Item>,
}

impl Sender {
    /// Sends a bag, and keeps its row; whether anything was missing.
    fn send(&mut self, store: &Store, bag: &Prepared) -> Result<bool, FleetError> {
        let known = match &mut self.known {
            Some(known) => known,
            None => {
                let read = dataset::index(store, &["bag", "machine", "kept"])?;
                self.problems = read.problems;
                let rows = read.rows.into_iter().map(|(bag, row)| (bag, outside(&row)));
                self.known.insert(rows.collect())
            }
        };
        let object = bag_object(&bag.key);
        let is_new = !is_whole(store, &object, bag, self.verify)?;
        if is_new {
            store.put(&object, &bag.content)?;
        }
        // A bag that was marked since, or is of another machine, has a newer row.
        let said = outside(&bag.row);
        let has_old_row = known.insert(bag.key.clone(), said.clone()).is_none_or(|it| it != said);
        if has_old_row {
            self.part.push(bag.row.clone());
        }
        Ok(is_new || has_old_row)
    }

    /// Writes the rows, and takes their bags out of the spool.
    fn flush(&mut self, store: &Store) -> Result<(), FleetError> {
        // Before anything leaves the spool: a share that was unmounted has taken nothing.
        store.check()?;
        if !self.part.is_empty() {
            dataset::write_index(store, &self.part)?;
            self.part.clear();
        }
        for item in self.items.drain(..).filter(|item| item.is_spooled) {
            spool::remove(&item.path)?;
        }
        Ok(())
    }
}

/// What a row says that the bag itself does not.
fn outside(row: &Row) -> [Value; 2] {
    ["machine", "kept"].map(|name| row[place(INDEX, name)].clone())
}

/// Whether the store has the bag as it is here, by its size or its content: else it is sent again.
fn is_whole(
    store: &Store,
    object: &str,
    bag: &Prepared,
    with_content: bool,
) -> Result<bool, FleetError> {
    if store.size(object)? != Some(bag.content.len() as u64) {
        return Ok(false);
    }
    if !with_content {
        return Ok(true);
    }
    match store.get(object) {
        Ok(content) => Ok(content == bag.content),
        Err(Missing::Absent) => Ok(false),
        Err(Missing::Failed(error)) => Err(error),
    }
}

/// Reads a bag; the error says why it is refused, and what to do.
fn prepare(item: &Item) -> Result<Prepared, String> {
    let bag_file::BagFile { name, content, mark } = bag_file::read(&item.path)?;
    let mut bag = Bag::open(&name, Cursor::new(content.clone())).map_err(|why| why.to_string())?;
    let kept = item.kept.clone().or(mark);
    let key = key_of(&content);
    let outside = Outside {
        bag: key.clone(),
        bytes: content.len() as u64,
        machine: item.machine.clone(),
        host: host(),
        kept: kept.clone(),
    };
    // This reads every chunk, and finds what is damaged.
    let mut row = row_of(&mut bag, &outside);
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    row[place(INDEX, "pushed")] = now.map_or(Value::Null, |it| Value::count(it.as_micros()));
    bag_file::check(bag.problems())?;
    Ok(Prepared { key, content, row, kept })
}

fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    name.trim().to_owned()
}
