//! Recorded messages beside the ones that today's cores make.
//!
//! What counts as equal is said in one table, [`rules`]; how a field is
//! compared is said in [`run_recorder::diff`].

use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use cnc_msgs::schema::TypeInfo;
use run_recorder::decode::decode;
use run_recorder::diff::{FieldDifference, Rules, Tolerance, diff};
use run_recorder::schema::MessageSchema;
use run_recorder::value::MessageValue;
use std::collections::BTreeMap;

/// What was compared at one level, and what differs.
#[derive(Debug, Default)]
pub(crate) struct Comparison {
    /// Messages compared, by what they are.
    pub(crate) compared: BTreeMap<String, usize>,
    /// One row a field or a missing message, in order.
    pub(crate) differences: Vec<Difference>,
}

/// One thing that is not as recorded.
#[derive(Debug, Clone)]
pub(crate) struct Difference {
    /// Which message: `compensated_path/chunks 3`.
    pub(crate) message: String,
    /// The field without indexes, for counting: `elements[].end.x`.
    pub(crate) field: String,
    /// What differs, for people.
    pub(crate) text: String,
}

/// Absolute, metres: a nanometre is noise of another libm, a micrometre is a change.
const LENGTH_TOLERANCE_M: f64 = 1e-9;
/// Fields that are allowed to differ, in every type: times, and checksums over floats.
const IGNORED: [&str; 4] = ["stamp", "header.stamp", "sha256", "crc32"];

fn rules() -> Rules {
    Rules {
        floats: Tolerance { absolute: LENGTH_TOLERANCE_M, relative: 1e-12 },
        fields: Vec::new(),
        ignored: IGNORED
            .iter()
            .map(|path| path.parse().expect("the table holds valid paths"))
            .collect(),
    }
}

impl Comparison {
    /// Compares one message; `name` says which it is.
    pub(crate) fn message<M: Message>(&mut self, name: &str, recorded: &M, now: &M) {
        *self.compared.entry(kind(name)).or_default() += 1;
        let (recorded, now) = (value(recorded), value(now));
        for FieldDifference { path, difference } in diff(&recorded, &now, &rules()) {
            let row = FieldDifference { path, difference };
            self.differences.push(Difference {
                message: name.to_owned(),
                field: without_indexes(&row.path.to_string()),
                text: row.to_string(),
            });
        }
    }

    /// Compares two runs of messages, number by number; counts come first.
    pub(crate) fn sequence<M: Message>(&mut self, name: &str, recorded: &[M], now: &[M]) {
        if recorded.len() != now.len() {
            self.differs(
                name,
                "count",
                format!("{} messages were recorded, {} are made now", recorded.len(), now.len()),
            );
        }
        for (index, (recorded, now)) in recorded.iter().zip(now).enumerate() {
            self.message(&format!("{name} {index}"), recorded, now);
        }
    }

    /// Notes that something was compared outside of messages.
    pub(crate) fn count(&mut self, what: &str, count: usize) {
        *self.compared.entry(what.to_owned()).or_default() += count;
    }

    /// Notes a difference that is not a field of a message.
    pub(crate) fn differs(&mut self, message: &str, field: &str, text: impl Into<String>) {
        self.differences.push(Difference {
            message: message.to_owned(),
            field: field.to_owned(),
            text: text.into(),
        });
    }
}

fn value<M: Message>(message: &M) -> MessageValue {
    let schema = MessageSchema::parse(M::TYPE_NAME, TypeInfo::of::<M>().schema_text)
        .expect("our own definitions are valid; a test in cnc_msgs reads them all");
    decode(&schema, &cdr::encapsulated(message))
        .expect("a message fits the definition that its struct was made of")
}

/// `compensated_path/chunks 3` is a `compensated_path/chunks`.
fn kind(name: &str) -> String {
    name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end().to_owned()
}

fn without_indexes(path: &str) -> String {
    let mut out = String::new();
    let mut is_index = false;
    for c in path.chars() {
        match c {
            '[' => {
                is_index = true;
                out.push_str("[]");
            }
            ']' => is_index = false,
            _ if is_index => {}
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::wire::cnc_msgs::msg::{PathChunk, PathElement};

    fn chunk(x: f64) -> PathChunk {
        let mut element = PathElement { kind: PathElement::KIND_LINE, ..PathElement::default() };
        element.end.x = x;
        PathChunk { elements: vec![element], ..PathChunk::default() }
    }

    fn differences(recorded: f64, now: f64) -> Vec<String> {
        let mut comparison = Comparison::default();
        comparison.message("compensated_path/chunks 0", &chunk(recorded), &chunk(now));
        assert_eq!(comparison.compared.get("compensated_path/chunks"), Some(&1));
        comparison.differences.into_iter().map(|difference| difference.field).collect()
    }

    #[test]
    fn a_micrometre_is_a_difference_and_a_picometre_is_none() {
        assert_eq!(differences(0.1, 0.1 + 1e-6), ["elements[].end.x"]);
        assert_eq!(differences(0.1, 0.1 + 1e-12), [""; 0]);
        assert_eq!(differences(f64::NAN, f64::NAN), ["elements[].end.x"]);
    }

    #[test]
    fn messages_that_are_not_made_any_more_are_counted() {
        let mut comparison = Comparison::default();
        comparison.sequence("chunks", &[chunk(0.0), chunk(1.0)], &[chunk(0.0)]);
        assert_eq!(comparison.differences.len(), 1);
        assert!(comparison.differences[0].text.contains("2 messages were recorded, 1 are made"));
    }
}
