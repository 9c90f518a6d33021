//! Index and verdicts of a store, read whole; a file that cannot be read is named, and the rest is read.

use crate::FleetError;
use crate::core::key::{
    INDEX as INDEX_FOLDER, VERDICTS as VERDICTS_FOLDER, build_of_object, part_name, verdicts_of,
};
use crate::core::schema::{Column, INDEX, Row, VERDICTS, Value, place};
use crate::core::shard::Shard;
use crate::store::{Missing, Store};
use crate::table::{Texts, from_parquet, to_parquet};
use bytes::Bytes;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::time::SystemTime;

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
    let pushed = place(INDEX, "pushed");
    let holds = |new: &Row, old: &Row| new[pushed].as_integer() > old[pushed].as_integer();
    let advice =
        "remove it and push its bags again; `kerf fleet report` lists them as bags without a row";
    read(store, INDEX_FOLDER, INDEX, &wanted, &holds, advice)
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
    for listed in store.list(folder)?.iter().filter(|it| it.object.ends_with(".parquet")) {
        let object = &listed.object;
        let content = match store.get(object) {
            Ok(content) => content,
            Err(Missing::Absent) => continue,
            Err(Missing::Failed(error)) => {
                read.problems.push(error.to_string());
                continue;
            }
        };
        match from_parquet(content, columns, wanted, &mut texts) {
            Err(why) => read.problems.push(format!("{object}: {why}; it is left out: {advice}")),
            Ok(rows) => {
                for row in rows {
                    let bag = row[0].as_text().to_owned();
                    if bag.is_empty() {
                        continue;
                    }
                    match read.rows.entry(bag) {
                        Entry::Vacant(free) => {
                            free.insert(row);
                        }
                        Entry::Occupied(mut old) if holds(&row, old.get()) => {
                            old.insert(row);
                        }
                        Entry::Occupied(_) => {}
                    }
                }
            }
        }
    }
    Ok(read)
}

/// Writes rows of the index; the same rows make the same object.
pub fn write_index(store: &Store, rows: &[Row]) -> Result<(), FleetError> {
    let object = format!("{INDEX_FOLDER}/{}.parquet", part_of(rows));
    store.put(&object, &Bytes::from(to_parquet(INDEX, rows)))
}

/// Writes verdicts of a build.
pub fn write_verdicts(
    store: &Store,
    build: &str,
    shard: Shard,
    rows: &[Row],
) -> Result<(), FleetError> {
    let folder = verdicts_of(build);
    let object = format!("{folder}/shard={}/{}.parquet", shard.name(), part_of(rows));
    store.put(&object, &Bytes::from(to_parquet(VERDICTS, rows)))
}

fn part_of(rows: &[Row]) -> String {
    part_name(rows.iter().map(|row| row[0].as_text()))
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
