//! One shard: what the index selects is replayed, and the verdicts are written.

use crate::FleetError;
use crate::core::condition::Condition;
use crate::core::key::{bag_object, key_of};
use crate::core::schema::{INDEX, Row, VERDICTS, Value, place};
use crate::core::shard::Shard;
use crate::core::todo::to_do;
use crate::core::unpacked::unpacked_bytes;
use crate::dataset;
use crate::journal::Journal;
use crate::store::{Missing, Store};
use bytes::Bytes;
use replay::compare::kind;
use replay::{Level, Options, PlanMemo, ReplayResult, replay_opened};
use run_recorder::bag_reader::Bag;
use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::Path;
use std::time::{Duration, Instant};

/// A part of the verdicts is written when it has so many rows, or is so old.
const PART_ROWS: usize = 2_000;
const PART_AGE: Duration = Duration::from_secs(20);

/// A bag in which so many workers were stopped has the verdict `error`.
const STOPS_MAX: u32 = 3;

/// What a worker is to do.
#[derive(Debug)]
pub struct Order<'a> {
    pub shard: Shard,
    pub condition: Option<Condition>,
    pub build: &'a str,
    /// Where the journal is kept.
    pub journal: &'a Path,
    /// Bags that unpack to more have the verdict `error`: a bag is replayed in memory.
    pub bag_bytes_max: u64,
}

/// What a worker did.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Done {
    /// Bags that were replayed now.
    pub replayed: usize,
    /// Verdicts that an earlier worker had left in its journal.
    pub taken_over: usize,
    /// Bags of the shard that had a verdict of this build.
    pub known: usize,
    /// Rows of the index without a bag: named, and replayed when the bag is there.
    pub absent: usize,
}

/// Replays a shard. `say` gets a sentence for everything that is not as it should be.
///
/// # Errors
/// The shard could not be done; whatever could be is written.
pub fn run(store: &Store, order: &Order<'_>, say: &dyn Fn(&str)) -> Result<Done, FleetError> {
    let shard = order.shard;
    let (mut journal, left) =
        Journal::open(order.journal, store.place(), order.build, &shard.name())?;
    let mut done = Done::default();
    let known = dataset::verdicts(store, order.build, &["bag", "message", "text"])?;
    let mut problems = known.problems;
    let mut with_verdict: BTreeSet<String> =
        known.rows.iter().filter(|(_, row)| is_final(row)).map(|(bag, _)| bag.clone()).collect();
    let mut wanted = vec!["bag", "bytes"];
    wanted.extend(order.condition.iter().flat_map(Condition::columns));
    let index = dataset::index(store, &wanted)?;
    problems.extend(index.problems);

    let new = left.rows.into_iter().filter(|row| {
        let bag = row[0].as_text();
        // Another store may have been at this place.
        shard.has(bag) && index.rows.contains_key(bag) && !with_verdict.contains(bag)
    });
    let new: Vec<Row> = new.collect();
    done.taken_over = new.len();
    if !new.is_empty() {
        store.check()?;
        dataset::write_verdicts(store, order.build, shard, &new)?;
        let new = new.iter().filter(|row| is_final(row));
        with_verdict.extend(new.map(|row| row[0].as_text().to_owned()));
    }
    journal.clear()?;

    let is_selected = |row: &Row| order.condition.as_ref().is_none_or(|it| it.selects(INDEX, row));
    let selected =
        || index.rows.iter().filter(|(_, row)| is_selected(row)).map(|(bag, _)| bag.as_str());
    done.known = selected().filter(|bag| shard.has(bag) && with_verdict.contains(*bag)).count();
    let list = to_do(selected(), shard, &with_verdict, &left.stopped_in);

    let memo = PlanMemo::default();
    let mut part: Vec<Row> = Vec::new();
    let mut since = Instant::now();
    for bag in &list {
        let stops = left.stopped_in.get(bag).copied().unwrap_or(0);
        let bytes = index.rows[bag][place(INDEX, "bytes")].as_integer().unwrap_or(0);
        let row = if stops >= STOPS_MAX {
            let why = format!(
                "{stops} workers were stopped while they replayed it; `kerf replay` on this bag alone shows why"
            );
            error_row(bag, "stop", &why)
        } else if bytes.unsigned_abs() > order.bag_bytes_max {
            too_large(bag, bytes.unsigned_abs(), order.bag_bytes_max)
        } else {
            journal.begin(bag)?;
            match store.get(&bag_object(bag)) {
                Ok(content) => judge(bag, content, order.bag_bytes_max, &memo),
                Err(Missing::Absent) => {
                    journal.skip(bag)?;
                    done.absent += 1;
                    say(&format!(
                        "{}: it is in the index, and not in the store; push it again",
                        bag_object(bag)
                    ));
                    continue;
                }
                Err(Missing::Failed(error)) => {
                    journal.skip(bag)?;
                    problems.push(error.to_string());
                    continue;
                }
            }
        };
        done.replayed += 1;
        // An error that is known is not written once more.
        if known.rows.get(bag).is_some_and(|it| says_same(it, &row)) {
            journal.skip(bag)?;
            continue;
        }
        journal.end(&row)?;
        part.push(row);
        if part.len() >= PART_ROWS || since.elapsed() >= PART_AGE {
            store.check()?;
            dataset::write_verdicts(store, order.build, shard, &part)?;
            journal.clear()?;
            part.clear();
            since = Instant::now();
        }
    }
    // The store may have gone: then its bags are not absent, and the journal stays.
    store.check()?;
    if !part.is_empty() {
        dataset::write_verdicts(store, order.build, shard, &part)?;
    }
    if problems.is_empty() {
        journal.remove()?;
    } else {
        journal.clear()?;
    }
    if problems.is_empty() {
        return Ok(done);
    }
    problems.iter().for_each(|problem| say(problem));
    let replayed = done.replayed;
    Err(FleetError::NotDone(format!(
        "shard {shard} is not done: {} objects could not be read; {replayed} bags were replayed; the sentence on each object says what helps, then start it again",
        problems.len()
    )))
}

/// Whether the bag needs no replay by this build: what failed for the object or a limit may be mended.
fn is_final(row: &Row) -> bool {
    let of = |name| row[place(VERDICTS, name)].as_text();
    of("verdict") != "error" || !matches!(of("message"), "object" | "limit")
}

fn says_same(one: &Row, other: &Row) -> bool {
    ["verdict", "message", "text"].iter().all(|name| {
        let place = place(VERDICTS, name);
        one[place] == other[place]
    })
}

fn too_large(bag: &str, bytes: u64, most: u64) -> Row {
    let (bytes, most) = (bytes.div_ceil(1 << 20), most >> 20);
    error_row(
        bag,
        "limit",
        &format!("the bag has {bytes} MB when it is unpacked, and --bag-mb-max allows {most}"),
    )
}

/// The verdict on a bag; whatever is wrong with the bag is a verdict, too.
pub fn judge(bag: &str, content: Bytes, bytes_max: u64, memo: &PlanMemo) -> Row {
    let begun = Instant::now();
    let unpacked = unpacked_bytes(&content);
    let mut row = if key_of(&content) == bag {
        if unpacked > bytes_max {
            return too_large(bag, unpacked, bytes_max);
        }
        // A bag that finds a fault in a core is evidence, and no reason to leave out the others.
        let replayed = std::panic::catch_unwind(|| replayed(bag, content, memo));
        replayed.unwrap_or_else(|_| {
            error_row(bag, "bag", "today's build panics on it: please report it")
        })
    } else {
        error_row(
            bag,
            "object",
            "the content of the object is not what its name says: it is damaged; push the bag again with --verify",
        )
    };
    row[place(VERDICTS, "seconds")] = Value::Real(begun.elapsed().as_secs_f64());
    row[place(VERDICTS, "memory_mb")] = memory_mb().map_or(Value::Null, Value::Real);
    row
}

fn replayed(bag: &str, content: Bytes, memo: &PlanMemo) -> Row {
    let name = bag_object(bag);
    let mut opened = match Bag::open(&name, Cursor::new(content)) {
        Ok(opened) => opened,
        Err(error) => return error_row(bag, "bag", &error.to_string()),
    };
    // Bags with the same contour, control and tools have one plan.
    let options = Options { memo: Some(memo), ..Options::default() };
    match replay_opened(&mut opened, &Level::ALL, options) {
        Ok(result) => verdict_row(bag, &result),
        Err(error) => error_row(bag, "bag", &error.to_string()),
    }
}

fn verdict_row(bag: &str, result: &ReplayResult) -> Row {
    let mut row = vec![Value::Null; VERDICTS.len()];
    let mut set = |name, value| row[place(VERDICTS, name)] = value;
    set("bag", Value::text(bag));
    let levels = result.comparisons();
    let count: usize = levels.iter().map(|(_, it)| it.differences.len()).sum();
    set("differences", Value::count(count));
    let first = levels.iter().find_map(|(level, it)| Some((level, it.differences.first()?)));
    let Some((level, first)) = first else {
        set("verdict", Value::text("reproduced"));
        return row;
    };
    set("verdict", Value::text("different"));
    set("level", Value::text(level.name()));
    set("message", Value::text(kind(&first.message)));
    set("field", Value::text(&first.field));
    set("text", Value::text(&first.text));
    if first.place.line > 0 {
        set("line", Value::count(first.place.line));
    }
    if let Some([x, y, z]) = first.place.position {
        set("x_mm", Value::real(x));
        set("y_mm", Value::real(y));
        set("z_mm", Value::real(z));
    }
    set("distance_mm", first.place.distance_mm.map_or(Value::Null, Value::real));
    row
}

fn error_row(bag: &str, what: &str, why: &str) -> Row {
    let mut row = vec![Value::Null; VERDICTS.len()];
    row[place(VERDICTS, "bag")] = Value::text(bag);
    row[place(VERDICTS, "verdict")] = Value::text("error");
    row[place(VERDICTS, "message")] = Value::text(what);
    row[place(VERDICTS, "text")] = Value::text(why);
    row
}

/// The most that this process has taken, MB.
pub fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().trim_end_matches(" kB").trim().parse::<f64>().ok().map(|kb| kb / 1024.0)
}
