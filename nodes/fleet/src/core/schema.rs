//! The columns of index and verdicts, and the values in them.
//!
//! Every column may be empty: a bag that does not say something has no value there. A column that a file
//! lacks is empty, and one that it has besides is not read, so files of other versions stay readable.

use std::cmp::Ordering;
use std::fmt;
use std::sync::Arc;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Text,
    Integer,
    Real,
    /// Microseconds since the epoch, UTC.
    Time,
}

/// A column: its name, what it holds, and what that means.
pub type Column = (&'static str, Kind, &'static str);

/// The version of both tables, which each file names.
pub const VERSION: u32 = 1;

/// The index: one row for each bag.
pub const INDEX: &[Column] = &[
    ("bag", Kind::Text, "sha256 of the file, 64 digits; the bag is bags/BAG.mcap"),
    (
        "machine",
        Kind::Text,
        "`--machine`, else the namespace of the topics, else the host that pushed",
    ),
    ("run", Kind::Text, "id of the run"),
    ("program", Kind::Text, "file name of the program"),
    ("program_sha256", Kind::Text, "sha256 of its text"),
    ("control", Kind::Text, "name of the control profile"),
    ("tools_sha256", Kind::Text, "of the last tool table; equal tables have equal hashes"),
    ("firmware", Kind::Text, "grbl, grblHAL or FluidNC"),
    ("firmware_version", Kind::Text, "as the controller words it"),
    ("settings_sha256", Kind::Text, "of the firmware's settings"),
    ("build", Kind::Text, "the commit that recorded the bag"),
    ("start", Kind::Time, "time of the first message, UTC"),
    ("duration_s", Kind::Real, "from the first message to the last"),
    (
        "outcome",
        Kind::Text,
        "succeeded, canceled, aborted, checked (nothing was sent) or unknown (the driver has not said)",
    ),
    ("error_code", Kind::Integer, "of the result; 0 when it succeeded"),
    ("last_line", Kind::Integer, "the last line that was cut; 0 when none was"),
    ("alarms", Kind::Integer, "how often the machine went into ALARM"),
    ("alarm_code", Kind::Integer, "the first alarm's code"),
    ("holds", Kind::Integer, "how often it went into HOLD"),
    ("tool_changes", Kind::Integer, "how often it waited for a tool"),
    ("tools", Kind::Text, "the tools that were waited for, in order: 1,4"),
    (
        "least_clearance_mm",
        Kind::Real,
        "how far the radius may grow before a wall or lead ends the certificate, of those that it has not ended already; the least of all spans",
    ),
    (
        "certificate_slack_mm",
        Kind::Real,
        "how far the radius may change either way within its certificate; the least of all spans",
    ),
    ("wear_mm", Kind::Real, "the wear of largest amount in the tool table, as a radius"),
    (
        "feed_override_min",
        Kind::Real,
        "the least feed override while the machine ran; 1 is as programmed",
    ),
    ("feed_override_mean", Kind::Real, "its mean over the states while the machine ran"),
    (
        "commander",
        Kind::Text,
        "who sent the goal: the DDS participant, 24 digits. No bag names a person",
    ),
    ("bytes", Kind::Integer, "size of the file"),
    ("messages", Kind::Integer, "number of messages"),
    ("complete", Kind::Integer, "1 when nothing is known to be missing, else 0"),
    ("kept", Kind::Text, "why the bag was marked; empty when it was not"),
    ("problem", Kind::Text, "why the bag cannot be read as a run; empty when it can"),
    ("pushed", Kind::Time, "when this row was written, UTC; of two rows of a bag the newest holds"),
];

/// The verdicts: one row for each bag and build.
pub const VERDICTS: &[Column] = &[
    ("bag", Kind::Text, "as in the index"),
    ("verdict", Kind::Text, "reproduced, different, or error: it cannot be compared"),
    ("level", Kind::Text, "the first level that differs: loader, planner or driver"),
    (
        "message",
        Kind::Text,
        "kind of the message of the first difference; of an error what failed: object, limit, stop or bag",
    ),
    ("field", Kind::Text, "its field, without indexes"),
    ("text", Kind::Text, "the first difference or the error, for people"),
    ("line", Kind::Integer, "line of the program"),
    ("x_mm", Kind::Real, "where, in the work frame"),
    ("y_mm", Kind::Real, ""),
    ("z_mm", Kind::Real, ""),
    ("distance_mm", Kind::Real, "how far both are apart"),
    ("differences", Kind::Integer, "how many there are at all levels"),
    ("seconds", Kind::Real, "what the replay took"),
    ("memory_mb", Kind::Real, "the most that the worker had taken by then"),
];

/// The place of a column; the names are literals of this crate.
pub fn place(columns: &[Column], name: &str) -> usize {
    let found = columns.iter().position(|(it, ..)| *it == name);
    found.unwrap_or_else(|| panic!("{name} is a column"))
}

/// One value of a row.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Value {
    #[default]
    Null,
    /// Shared by all rows that have it.
    Text(Arc<str>),
    /// Times too.
    Integer(i64),
    Real(f64),
}

impl Value {
    /// A text; the empty one is none.
    pub fn text(text: &str) -> Self {
        if text.is_empty() { Self::Null } else { Self::Text(text.into()) }
    }

    /// A number; what is not finite is none.
    pub fn real(number: f64) -> Self {
        if number.is_finite() { Self::Real(number) } else { Self::Null }
    }

    /// A count.
    pub fn count(count: impl TryInto<i64>) -> Self {
        Self::Integer(count.try_into().unwrap_or(i64::MAX))
    }

    /// The text, or nothing.
    pub fn as_text(&self) -> &str {
        if let Self::Text(text) = self { text } else { "" }
    }

    /// The whole number, if it is one.
    pub fn as_integer(&self) -> Option<i64> {
        if let Self::Integer(number) = self { Some(*number) } else { None }
    }

    /// The number, if it is one.
    pub fn as_real(&self) -> Option<f64> {
        match self {
            Self::Real(number) => Some(*number),
            Self::Integer(number) => Some(*number as f64),
            _ => None,
        }
    }

    /// Texts with texts, numbers with numbers; else nothing.
    pub fn compare(&self, other: &Self) -> Option<Ordering> {
        match (self, other) {
            (Self::Text(one), Self::Text(other)) => Some(one.cmp(other)),
            (Self::Integer(one), Self::Integer(other)) => Some(one.cmp(other)),
            _ => self.as_real()?.partial_cmp(&other.as_real()?),
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Null => f.write_str("-"),
            Self::Text(text) => f.write_str(text),
            Self::Integer(number) => number.fmt(f),
            Self::Real(number) => number.fmt(f),
        }
    }
}

/// A row, with a value for each of the columns that it was read or made with.
pub type Row = Vec<Value>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_column_is_there_once_and_the_bag_is_first() {
        for columns in [INDEX, VERDICTS] {
            let mut names: Vec<&str> = columns.iter().map(|(name, ..)| *name).collect();
            assert_eq!(names[0], "bag");
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), columns.len());
        }
    }

    #[test]
    fn values_of_one_kind_have_an_order_and_others_have_none() {
        let text = Value::text;
        for (one, other, expected) in [
            (text("a"), text("b"), Some(Ordering::Less)),
            (Value::Integer(3), Value::Real(2.5), Some(Ordering::Greater)),
            (Value::Integer(i64::MAX), Value::Integer(i64::MAX - 1), Some(Ordering::Greater)),
            (Value::Integer(3), text("3"), None),
            (Value::Null, Value::Null, None),
            (Value::real(f64::NAN), Value::Real(1.0), None),
        ] {
            assert_eq!(one.compare(&other), expected, "{one} and {other}");
        }
    }
}
