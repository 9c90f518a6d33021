//! Index and verdicts of a store, read whole; a file that cannot be read is named, and the rest is read.
//!
//! Each push adds a part to the index. [`join_index`] makes few of many, so that a shop whose recorders push each
//! run does not read ten thousand files for ten thousand runs.

use crate::FleetError;
use crate::core::key::{
    INDEX as INDEX_FOLDER, VERDICTS as VERDICTS_FOLDER, build_of_object, index_part, part_name,
    verdicts_of,
};
use crate::core::schema::{Column, INDEX, Row, VERDICTS, Value, place};
use crate::core::shard::Shard;
use crate::store::{Listed, Missing, Store};
use crate::table::{Texts, from_parquet, has_only, to_parquet};
use bytes::Bytes;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::time::SystemTime;

/// Rows in one part of the index.
pub const PART_ROWS: usize = 1_000;
/// A part of the index below this size may be joined with others, bytes: some hundred rows.
const SMALL_BYTES: u64 = 64 << 10;
/// So many small parts are joined.
const SMALL_PARTS: usize = 32;
/// Written and removed before parts are joined, which shows whether objects may be removed here.
const TRIAL: &str = "index/joining";

/// Rows by bag, and what could not be read.
#[derive(Debug, Default)]
pub struct Read {
    /// The row of each bag that holds: the newest of the index, a verdict rather than an error.
    pub rows: BTreeMap<String, Row>,
    /// A sentence for each file that is left out.
    pub problems: Vec<String>,
}

/// Reads columns of the index.
pub fn index(store: &Store, wanted: &[&str]) -> Result<Read, FleetError> {
    let wanted = with(wanted, "pushed");
    let advice =
        "remove it and push its bags again; `kerf fleet report` lists them as bags without a row";
    read(store, INDEX_FOLDER, INDEX, &wanted, &is_newer, advice)
}

/// Of two rows of a bag the newest holds.
fn is_newer(new: &Row, old: &Row) -> bool {
    let pushed = place(INDEX, "pushed");
    new[pushed].as_integer() > old[pushed].as_integer()
}

/// Reads columns of the verdicts of a build.
pub fn verdicts(store: &Store, build: &str, wanted: &[&str]) -> Result<Read, FleetError> {
    let wanted = with(wanted, "verdict");
    let verdict = place(VERDICTS, "verdict");
    let holds = |_: &Row, old: &Row| old[verdict].as_text() == "error";
    let advice = "remove it; the next worker replays its bags";
    read(store, &verdicts_of(build), VERDICTS, &wanted, &holds, advice)
}

/// The builds that have verdicts, with the time of their first, in the order of these times.
pub fn builds(store: &Store) -> Result<Vec<(String, SystemTime)>, FleetError> {
    let mut first: BTreeMap<String, SystemTime> = BTreeMap::new();
    for listed in store.list(VERDICTS_FOLDER)? {
        let Some(build) = build_of_object(&listed.object) else { continue };
        let at = first.entry(build.to_owned()).or_insert(listed.modified);
        *at = listed.modified.min(*at);
    }
    let mut builds: Vec<_> = first.into_iter().collect();
    builds.sort_by_key(|(_, at)| *at);
    Ok(builds)
}

/// Columns with one more, each once.
fn with<'a>(wanted: &[&'a str], name: &'a str) -> Vec<&'a str> {
    let more = (!wanted.contains(&name)).then_some(name);
    wanted.iter().copied().chain(more).collect()
}

fn read(
    store: &Store,
    folder: &str,
    columns: &[Column],
    wanted: &[&str],
    holds: &dyn Fn(&Row, &Row) -> bool,
    advice: &str,
) -> Result<Read, FleetError> {
    let mut read = Read::default();
    let mut texts = Texts::default();
    // Objects that were asked for; true for those that were removed in the meantime.
    let mut asked: BTreeMap<String, bool> = BTreeMap::new();
    loop {
        let listed = parts(store, folder)?;
        let mut new = listed.iter().filter(|it| !asked.contains_key(&it.object)).peekable();
        if new.peek().is_none() {
            let gone = listed.iter().filter(|it| asked.get(&it.object) == Some(&true));
            read.problems.extend(gone.map(|Listed { object, .. }| {
                format!("{object} is listed and cannot be read: its rows may be missing; try again")
            }));
            return Ok(read);
        }
        // A listing is not of one moment: what was written meanwhile is in the next one.
        let new: Vec<String> = new.map(|it| it.object.clone()).collect();
        for object in new {
            let content = store.get(&object);
            asked.insert(object.clone(), matches!(content, Err(Missing::Absent)));
            let content = match content {
                Ok(content) => content,
                // Its rows are in another part.
                Err(Missing::Absent) => continue,
                Err(Missing::Failed(error)) => {
                    read.problems.push(error.to_string());
                    continue;
                }
            };
            match from_parquet(content, columns, wanted, &mut texts) {
                Err(why) => {
                    read.problems.push(format!("{object}: {why}; it is left out: {advice}"));
                }
                Ok(rows) => rows.into_iter().for_each(|row| keep(&mut read.rows, row, holds)),
            }
        }
    }
}

/// The files of a folder and below.
fn parts(store: &Store, folder: &str) -> Result<Vec<Listed>, FleetError> {
    let mut parts = store.list(folder)?;
    parts.retain(|it| it.object.ends_with(".parquet"));
    Ok(parts)
}

/// Keeps a row, unless there is one of its bag that holds.
fn keep(rows: &mut BTreeMap<String, Row>, row: Row, holds: &dyn Fn(&Row, &Row) -> bool) {
    let bag = row[0].as_text().to_owned();
    if bag.is_empty() {
        return;
    }
    match rows.entry(bag) {
        Entry::Vacant(free) => {
            free.insert(row);
        }
        Entry::Occupied(mut old) if holds(&row, old.get()) => {
            old.insert(row);
        }
        Entry::Occupied(_) => {}
    }
}

/// Joins the small parts of the index, when there are many; how many it has removed.
///
/// A part is named by its content and never changes, and the joined rows can be read before a part is removed. So
/// whatever ends this, and whoever pushes at the same time, no row is lost. Parts of builds that named them otherwise stay.
///
/// # Errors
/// The store does not answer, or nothing may be removed in it: the parts stay as they were.
pub fn join_index(store: &Store) -> Result<usize, FleetError> {
    let mut small = parts(store, INDEX_FOLDER)?;
    small.retain(|it| it.bytes < SMALL_BYTES);
    if small.len() < SMALL_PARTS {
        return Ok(0);
    }
    store.put(TRIAL, &Bytes::new())?;
    store.remove(TRIAL)?;
    let all: Vec<&str> = INDEX.iter().map(|(name, ..)| *name).collect();
    let mut texts = Texts::default();
    let mut joined: BTreeMap<String, BTreeMap<String, Row>> = BTreeMap::new();
    for Listed { object, .. } in small {
        let content = match store.get(&object) {
            Ok(content) => content,
            // Another push joins them.
            Err(Missing::Absent) => return Ok(0),
            Err(Missing::Failed(error)) => return Err(error),
        };
        // Builds of before write other content under a name that they had used. A part of a later build may have
        // columns that this one would drop.
        if index_part(&content) != object || !has_only(content.clone(), INDEX) {
            continue;
        }
        if let Ok(read) = from_parquet(content, INDEX, &all, &mut texts) {
            let rows = joined.entry(object).or_default();
            read.into_iter().for_each(|row| keep(rows, row, &is_newer));
        }
    }
    if joined.len() < SMALL_PARTS {
        return Ok(0);
    }
    let mut rows = BTreeMap::new();
    joined
        .values()
        .flat_map(BTreeMap::values)
        .for_each(|row| keep(&mut rows, row.clone(), &is_newer));
    // Where a join was broken off, one part has all rows; every build keeps the same one.
    let whole = joined.iter().find(|(_, part)| **part == rows).map(|(object, _)| object.clone());
    let mut stays: Vec<String> = whole.into_iter().collect();
    if stays.is_empty() {
        let rows: Vec<Row> = rows.into_values().collect();
        for rows in rows.chunks(PART_ROWS) {
            let (object, content) = index_object(rows);
            store.put(&object, &content)?;
            match store.get(&object) {
                Ok(there) if there == content => {}
                Ok(_) | Err(Missing::Absent) => {
                    let why = format!("--store {}: {object} is not what was written", store.name());
                    return Err(FleetError::NotDone(why));
                }
                Err(Missing::Failed(error)) => return Err(error),
            }
            stays.push(object);
        }
    }
    joined.retain(|object, _| !stays.contains(object));
    store.check()?;
    joined.keys().try_for_each(|object| store.remove(object))?;
    Ok(joined.len())
}

/// Writes rows of the index.
pub fn write_index(store: &Store, rows: &[Row]) -> Result<(), FleetError> {
    let (object, content) = index_object(rows);
    store.put(&object, &content)
}

/// A part of the index, and its name.
fn index_object(rows: &[Row]) -> (String, Bytes) {
    let content = Bytes::from(to_parquet(INDEX, rows));
    (index_part(&content), content)
}

/// Writes verdicts of a build.
pub fn write_verdicts(
    store: &Store,
    build: &str,
    shard: Shard,
    rows: &[Row],
) -> Result<(), FleetError> {
    let folder = verdicts_of(build);
    let part = part_name(rows.iter().map(|row| row[0].as_text()));
    let object = format!("{folder}/shard={}/{part}.parquet", shard.name());
    store.put(&object, &Bytes::from(to_parquet(VERDICTS, rows)))
}

/// A row from an object of JSON, as the journal keeps it.
pub fn row_from_json(columns: &[Column], json: &serde_json::Value) -> Row {
    let value = |name: &str| match json.get(name) {
        Some(serde_json::Value::String(text)) => Value::text(text),
        Some(serde_json::Value::Number(number)) => match number.as_i64() {
            Some(number) => Value::Integer(number),
            None => number.as_f64().map_or(Value::Null, Value::real),
        },
        _ => Value::Null,
    };
    columns
        .iter()
        .map(|(name, kind, _)| match (kind, value(name)) {
            // JSON has 2 for 2.0.
            (crate::core::schema::Kind::Real, Value::Integer(number)) => Value::Real(number as f64),
            (_, value) => value,
        })
        .collect()
}

/// A row as an object of JSON; empty values are left out.
pub fn row_to_json(columns: &[Column], row: &Row) -> serde_json::Value {
    let pairs = columns.iter().zip(row).filter_map(|((name, ..), value)| {
        let json = match value {
            Value::Null => return None,
            Value::Text(text) => text.as_ref().into(),
            Value::Integer(number) => (*number).into(),
            Value::Real(number) => (*number).into(),
        };
        Some(((*name).to_owned(), json))
    });
    serde_json::Value::Object(pairs.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_comes_back_from_json() {
        let mut row = vec![Value::Null; VERDICTS.len()];
        row[0] = Value::text("a");
        row[6] = Value::Integer(7);
        row[7] = Value::Real(2.0);
        row[8] = Value::Real(-0.1);
        let json = row_to_json(VERDICTS, &row).to_string();
        assert_eq!(json, r#"{"bag":"a","line":7,"x_mm":2.0,"y_mm":-0.1}"#);
        let read = serde_json::from_str(&json).expect("JSON");
        assert_eq!(row_from_json(VERDICTS, &read), row);
    }
}
