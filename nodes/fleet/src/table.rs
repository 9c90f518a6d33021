//! Rows as Parquet and back, without a store.

use crate::core::schema::{Column, Kind, Row, VERSION, Value};
use bytes::Bytes;
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::collections::BTreeSet;
use std::sync::Arc;

/// The key under which a file names its version.
const VERSION_KEY: &str = "kerf_fleet";
/// Values that are read at once.
const BATCH: usize = 4096;

/// Writes rows as one file.
pub fn to_parquet(columns: &[Column], rows: &[Row]) -> Vec<u8> {
    write(columns, rows)
        .expect("rows have the columns of their schema, and memory takes every byte")
}

fn write(columns: &[Column], rows: &[Row]) -> ParquetResult<Vec<u8>> {
    let fields = columns.iter().map(|(name, kind, _)| field(name, *kind).map(Arc::new));
    let fields = fields.collect::<ParquetResult<_>>()?;
    let schema = Type::group_type_builder("row").with_fields(fields).build()?;
    let version = KeyValue::new(VERSION_KEY.to_owned(), VERSION.to_string());
    let properties =
        WriterProperties::builder().set_key_value_metadata(Some(vec![version])).build();
    let mut file = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties))?;
    let mut group = file.next_row_group()?;
    for (place, (_, kind, _)) in columns.iter().enumerate() {
        let Some(mut to) = group.next_column()? else { break };
        let values = || rows.iter().map(|row| &row[place]);
        let is_there: Vec<i16> = values().map(|it| i16::from(*it != Value::Null)).collect();
        match kind {
            Kind::Text => {
                let texts = values().filter(|it| **it != Value::Null);
                let texts: Vec<ByteArray> = texts.map(|it| it.as_text().into()).collect();
                to.typed::<ByteArrayType>().write_batch(&texts, Some(&is_there), None)?;
            }
            Kind::Integer | Kind::Time => {
                let numbers: Vec<i64> = values().filter_map(Value::as_integer).collect();
                to.typed::<Int64Type>().write_batch(&numbers, Some(&is_there), None)?;
            }
            Kind::Real => {
                let numbers: Vec<f64> = values().filter_map(Value::as_real).collect();
                to.typed::<DoubleType>().write_batch(&numbers, Some(&is_there), None)?;
            }
        }
        to.close()?;
    }
    group.close()?;
    file.into_inner()
}

fn field(name: &str, kind: Kind) -> ParquetResult<Type> {
    let (physical, logical) = match kind {
        Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Kind::Integer => (Physical::INT64, None),
        Kind::Real => (Physical::DOUBLE, None),
        Kind::Time => {
            let unit = TimeUnit::MICROS;
            (Physical::INT64, Some(LogicalType::timestamp(true, unit)))
        }
    };
    let builder = Type::primitive_type_builder(name, physical);
    builder.with_repetition(Repetition::OPTIONAL).with_logical_type(logical).build()
}

/// Texts that occur in many rows, once each.
#[derive(Debug, Default)]
pub struct Texts(BTreeSet<Arc<str>>);

impl Texts {
    fn shared(&mut self, text: &str) -> Value {
        if text.is_empty() {
            return Value::Null;
        }
        if let Some(known) = self.0.get(text) {
            return Value::Text(Arc::clone(known));
        }
        let new: Arc<str> = text.into();
        self.0.insert(Arc::clone(&new));
        Value::Text(new)
    }
}

/// Reads the rows of a file: a value for each of `columns`, of which only `wanted` are read.
///
/// # Errors
/// It is not Parquet, is damaged, is of a later version, or a column holds something else.
pub fn from_parquet(
    content: Bytes,
    columns: &[Column],
    wanted: &[&str],
    texts: &mut Texts,
) -> Result<Vec<Row>, String> {
    // The reader has checks of its own, but a damaged file must not end the command.
    let read = std::panic::AssertUnwindSafe(|| read(content, columns, wanted, texts));
    match std::panic::catch_unwind(read) {
        Ok(rows) => rows.map_err(|error| match error {
            ParquetError::General(why) => why,
            other => other.to_string(),
        }),
        Err(_) => Err("the Parquet file is damaged".to_owned()),
    }
}

/// Whether a file has no other columns than these.
pub fn has_only(content: Bytes, columns: &[Column]) -> bool {
    let read = || SerializedFileReader::new(content);
    let Ok(Ok(file)) = std::panic::catch_unwind(std::panic::AssertUnwindSafe(read)) else {
        return false;
    };
    let schema = file.metadata().file_metadata().schema_descr();
    let mut there = schema.columns().iter().map(|it| it.name());
    there.all(|name| columns.iter().any(|(known, ..)| *known == name))
}

fn read(
    content: Bytes,
    columns: &[Column],
    wanted: &[&str],
    texts: &mut Texts,
) -> ParquetResult<Vec<Row>> {
    let file = SerializedFileReader::new(content)?;
    let metadata = file.metadata().file_metadata();
    let pairs = metadata.key_value_metadata().map_or(&[][..], |pairs| pairs);
    let version = pairs.iter().find(|pair| pair.key == VERSION_KEY);
    let version = version.and_then(|pair| pair.value.as_deref()?.parse::<u32>().ok());
    match version {
        None => return Err(general("it was not written by kerf fleet: no version is in it")),
        Some(version) if version > VERSION => {
            return Err(general(format!(
                "it has version {version} of the table, and this build reads up to {VERSION}; use a newer kerf-fleet"
            )));
        }
        Some(_) => {}
    }
    let schema = metadata.schema_descr();
    let there: Vec<String> = schema.columns().iter().map(|it| it.name().to_owned()).collect();
    let mut rows: Vec<Row> = Vec::new();
    for group in 0..file.num_row_groups() {
        let group = file.get_row_group(group)?;
        let begin = rows.len();
        let count = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        rows.extend((0..count).map(|_| vec![Value::Null; columns.len()]));
        for (place, (name, kind, _)) in
            columns.iter().enumerate().filter(|(_, it)| wanted.contains(&it.0))
        {
            let Some(from) = there.iter().position(|it| it == name) else { continue };
            let to = &mut rows[begin..];
            match (kind, group.get_column_reader(from)?) {
                (Kind::Text, ColumnReader::ByteArrayColumnReader(from)) => {
                    values(from, to, place, |text| text.as_utf8().map(|text| texts.shared(text)))?;
                }
                (Kind::Integer | Kind::Time, ColumnReader::Int64ColumnReader(from)) => {
                    values(from, to, place, |number| Ok(Value::Integer(*number)))?;
                }
                (Kind::Real, ColumnReader::DoubleColumnReader(from)) => {
                    values(from, to, place, |number| Ok(Value::Real(*number)))?;
                }
                _ => return Err(general(format!("its column {name} is of another type"))),
            }
        }
    }
    Ok(rows)
}

/// Reads one column of a row group into its place of each row.
fn values<T: DataType>(
    mut from: ColumnReaderImpl<T>,
    rows: &mut [Row],
    place: usize,
    mut value: impl FnMut(&T::T) -> ParquetResult<Value>,
) -> ParquetResult<()> {
    let mut row = 0;
    while row < rows.len() {
        let (mut is_there, mut read) = (Vec::new(), Vec::new());
        let (records, ..) = from.read_records(BATCH, Some(&mut is_there), None, &mut read)?;
        if records == 0 {
            return Err(general("a column ends before the others"));
        }
        let mut read = read.iter();
        // A column that may not be empty has no levels.
        let levels = (0..records).map(|index| is_there.get(index).is_none_or(|level| *level > 0));
        for (level, row) in levels.zip(&mut rows[row..]) {
            if level && let Some(next) = read.next() {
                row[place] = value(next)?;
            }
        }
        row += records;
    }
    Ok(())
}

fn general(why: impl Into<String>) -> ParquetError {
    ParquetError::General(why.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::schema::{INDEX, VERDICTS};

    const COLUMNS: &[Column] = &[
        ("bag", Kind::Text, ""),
        ("count", Kind::Integer, ""),
        ("length", Kind::Real, ""),
        ("start", Kind::Time, ""),
    ];

    fn rows() -> Vec<Row> {
        let text = Value::text;
        let mut rows = vec![
            vec![text("a"), Value::Integer(-1), Value::Real(0.1), Value::Integer(1)],
            vec![Value::Null, Value::Null, Value::Null, Value::Null],
            vec![text("ü\n"), Value::Integer(i64::MAX), Value::Real(-0.0), Value::Integer(0)],
        ];
        rows.extend(
            (0..10_000).map(|it| vec![text("a"), Value::Integer(it), Value::Null, Value::Null]),
        );
        rows
    }

    fn read(content: &[u8], columns: &[Column], wanted: &[&str]) -> Result<Vec<Row>, String> {
        from_parquet(Bytes::copy_from_slice(content), columns, wanted, &mut Texts::default())
    }

    #[test]
    fn rows_come_back_as_they_were() {
        let all = ["bag", "count", "length", "start"];
        for rows in [rows(), Vec::new()] {
            let file = to_parquet(COLUMNS, &rows);
            assert_eq!(read(&file, COLUMNS, &all), Ok(rows.clone()));
            assert_eq!(file, to_parquet(COLUMNS, &rows), "equal rows, equal bytes");
        }
        for columns in [INDEX, VERDICTS] {
            let row = vec![vec![Value::Null; columns.len()]];
            let wanted: Vec<&str> = columns.iter().map(|(name, ..)| *name).collect();
            assert_eq!(read(&to_parquet(columns, &row), columns, &wanted), Ok(row));
        }
    }

    #[test]
    fn only_wanted_columns_are_read_and_missing_ones_are_empty() {
        let file = to_parquet(COLUMNS, &rows()[..1]);
        let later: &[Column] =
            &[("new", Kind::Text, ""), ("count", Kind::Integer, ""), ("bag", Kind::Text, "")];
        let read = read(&file, later, &["new", "bag"]);
        assert_eq!(read, Ok(vec![vec![Value::Null, Value::Null, Value::text("a")]]));
        for (columns, expected) in [(COLUMNS, true), (&COLUMNS[1..], false), (later, false)] {
            assert_eq!(has_only(Bytes::from(file.clone()), columns), expected);
        }
        assert!(!has_only(Bytes::from_static(b"PAR1"), COLUMNS));
    }

    #[test]
    fn what_is_no_table_of_ours_is_an_error() {
        let file = to_parquet(COLUMNS, &rows());
        let other: &[Column] = &[("bag", Kind::Integer, "")];
        assert_eq!(
            read(&file, other, &["bag"]),
            Err("its column bag is of another type".to_owned())
        );
        assert!(read(b"PAR1", COLUMNS, &["bag"]).is_err());
        assert!(read(b"", COLUMNS, &["bag"]).is_err());
        for cut in [1, 100, file.len() / 2] {
            assert!(read(&file[..file.len() - cut], COLUMNS, &["bag"]).is_err(), "{cut}");
        }
        // A byte that is wrong is an error or another value, and never ends the process.
        for at in (0..file.len()).step_by(997) {
            let mut file = file.clone();
            file[at] ^= 0x55;
            let _ = read(&file, COLUMNS, &["bag", "count", "length", "start"]);
        }
        let small = to_parquet(COLUMNS, &rows()[..1]);
        for (from, to, expected) in [
            (
                &b"kerf_fleet"[..],
                &b"other_name"[..],
                "it was not written by kerf fleet: no version is in it",
            ),
            (
                b"kerf_fleet\x18\x011",
                b"kerf_fleet\x18\x019",
                "it has version 9 of the table, and this build reads up to 1; use a newer kerf-fleet",
            ),
        ] {
            let at =
                small.windows(from.len()).position(|it| it == from).expect("the version is there");
            let mut other = small.clone();
            other[at..at + to.len()].copy_from_slice(to);
            assert_eq!(read(&other, COLUMNS, &["bag"]), Err(expected.to_owned()));
        }
    }
}
