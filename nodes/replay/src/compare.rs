//! Compares recorded messages with the ones that today's cores make.
//!
//! One table, [`super::tolerances`], defines what counts as equal; [`run_recorder::diff`] defines
//! how a field is compared.

use super::migration::Definitions;
use super::tolerances::{Rule, Tolerances};
use cnc_msgs::cdr;
use cnc_msgs::geometry::Position;
use cnc_msgs::interface::Message;
use cnc_msgs::units::mm_from_m;
use rosidl::decode::decode;
use rosidl::field_path::PathStep;
use rosidl::schema::MessageSchema;
use rosidl::value::{MessageValue, Value};
use run_recorder::diff::{FieldDifference, diff};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What was compared at one level, and the differences.
#[derive(Debug, Default)]
pub struct Comparison {
    /// Number of compared messages, by kind.
    pub compared: BTreeMap<String, usize>,
    /// One row for each field or missing message that differs, in order.
    pub differences: Vec<Difference>,
    /// What is not as recorded, but does not count as a difference.
    pub remarks: Vec<Difference>,
    tolerances: Tolerances,
    /// The definitions of the bag's types.
    definitions: Arc<Definitions>,
}

/// One difference from the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// The message: `compensated_path/chunks 3`.
    pub message: String,
    /// The field without indexes, for counting: `elements[].end.x`.
    pub field: String,
    /// The difference, for people.
    pub text: String,
    /// Where in the program and on the part, if that is known.
    pub place: DifferencePlace,
}

/// Where two values differ, and by how much.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DifferencePlace {
    /// The line of the program; 0 when there is none.
    pub line: u32,
    /// In the work frame, mm.
    pub position: Option<Position>,
    /// The distance between both, mm.
    pub distance_mm: Option<f64>,
}

impl DifferencePlace {
    /// ` (line 7, X1.000 Y2.000 Z0.000, 0.001000 mm apart)`, or the part of it that is known.
    pub fn text(&self) -> String {
        let mut parts = Vec::new();
        if self.line > 0 {
            parts.push(format!("line {}", self.line));
        }
        if let Some([x, y, z]) = self.position {
            parts.push(format!("X{x:.6} Y{y:.6} Z{z:.6}"));
        }
        if let Some(distance_mm) = self.distance_mm {
            parts.push(format!("{distance_mm:.6} mm apart"));
        }
        if parts.is_empty() { String::new() } else { format!(" ({})", parts.join(", ")) }
    }
}

impl Comparison {
    /// For a bag with these definitions: fields that were added later are not compared.
    pub(crate) fn new(definitions: Arc<Definitions>) -> Self {
        Self { definitions, ..Self::default() }
    }

    /// An empty comparison for the same bag.
    pub fn another(&self) -> Self {
        Self::new(Arc::clone(&self.definitions))
    }

    /// Compares one message; `name` identifies it in the report.
    pub fn message<M: Message + PartialEq>(&mut self, name: &str, recorded: &M, now: &M) {
        *self.compared.entry(kind(name).to_owned()).or_default() += 1;
        // NaN is not equal to itself, so equal messages hold no NaN.
        if recorded == now {
            return;
        }
        let rules = self.tolerances.of::<M>();
        let recorded = value(&rules.schema, recorded);
        let now = value(&rules.schema, &self.definitions.forget(now.clone()));
        for found in diff(&recorded, &now, &rules.rules) {
            let row = Difference {
                message: name.to_owned(),
                field: without_indexes(&found.path.to_string()),
                text: found.to_string(),
                place: place(&recorded, &found),
            };
            match rules.rule(&found.path) {
                Rule::Remark => self.remarks.push(row),
                _ => self.differences.push(row),
            }
        }
    }

    /// Compares two sequences of messages, one by one; a different count is the first difference.
    pub fn sequence<M: Message + PartialEq>(&mut self, name: &str, recorded: &[M], now: &[M]) {
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

    /// Adds the results of another comparison.
    pub fn take(&mut self, other: Self) {
        for (what, count) in other.compared {
            self.count(&what, count);
        }
        self.differences.extend(other.differences);
        self.remarks.extend(other.remarks);
    }

    /// Whether nothing was compared and no difference reports that.
    pub fn is_empty(&self) -> bool {
        self.differences.is_empty() && self.compared.values().all(|count| *count == 0)
    }

    /// Counts something that was compared outside of messages.
    pub fn count(&mut self, what: &str, count: usize) {
        *self.compared.entry(what.to_owned()).or_default() += count;
    }

    /// Adds a difference that is not a field of a message.
    pub fn differs(&mut self, message: &str, field: &str, text: impl Into<String>) {
        self.differs_at(message, field, text, DifferencePlace::default());
    }

    /// Adds a difference with its place.
    pub fn differs_at(
        &mut self,
        message: &str,
        field: &str,
        text: impl Into<String>,
        place: DifferencePlace,
    ) {
        let (message, field) = (message.to_owned(), field.to_owned());
        self.differences.push(Difference { message, field, text: text.into(), place });
    }

    /// Adds a remark: not as recorded, but not a difference.
    pub fn remark(&mut self, message: &str, text: impl Into<String>) {
        self.remarks.push(Difference {
            message: message.to_owned(),
            field: String::new(),
            text: text.into(),
            place: DifferencePlace::default(),
        });
    }
}

fn value<M: Message>(schema: &MessageSchema, message: &M) -> MessageValue {
    decode(schema, &cdr::encapsulated(message))
        .expect("a message fits the definition that its struct was made of")
}

/// The line and the end position of the element or event that a field belongs to.
fn place(message: &MessageValue, found: &FieldDifference) -> DifferencePlace {
    let [PathStep::Field(list), PathStep::Index(index), ..] = &found.path.0[..] else {
        return DifferencePlace::default();
    };
    let item = match message.get(list) {
        Some(Value::List(items)) => items.get(*index),
        _ => None,
    };
    let Some(Value::Message(item)) = item else { return DifferencePlace::default() };
    let part = |name: &str| item.get(name);
    let line = part("line").and_then(Value::as_u64).and_then(|line| u32::try_from(line).ok());
    let position = part("end").and_then(|end| {
        let [x, y, z] = ["x", "y", "z"].map(|axis| end.get(axis).and_then(Value::as_f64));
        Some([mm_from_m(x?), mm_from_m(y?), mm_from_m(z?)])
    });
    DifferencePlace { line: line.unwrap_or(0), position, distance_mm: None }
}

/// The kind of a message: `compensated_path/chunks 3` is a `compensated_path/chunks`.
pub fn kind(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end()
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
    use cnc_msgs::wire::cnc_msgs::msg::{CompensatedPath, PathChunk, PathElement};

    fn chunk(x: f64) -> PathChunk {
        let mut element =
            PathElement { kind: PathElement::KIND_LINE, line: 7, ..PathElement::default() };
        element.end.x = x;
        PathChunk { elements: vec![element], ..PathChunk::default() }
    }

    fn compared(recorded: &PathChunk, now: &PathChunk) -> Comparison {
        let mut comparison = Comparison::default();
        comparison.message("compensated_path/chunks 0", recorded, now);
        assert_eq!(comparison.compared.get("compensated_path/chunks"), Some(&1));
        comparison
    }

    fn differences(recorded: f64, now: f64) -> Vec<String> {
        let comparison = compared(&chunk(recorded), &chunk(now));
        comparison.differences.into_iter().map(|difference| difference.field).collect()
    }

    #[test]
    fn a_micrometre_is_a_difference_and_a_picometre_is_not() {
        assert_eq!(differences(0.1, 0.1 + 1e-6), ["elements[].end.x"]);
        assert_eq!(differences(0.1, 0.1 + 1e-12), [""; 0]);
        assert_eq!(differences(f64::NAN, f64::NAN), ["elements[].end.x"]);
        assert_eq!(differences(f64::INFINITY, f64::INFINITY), [""; 0]);
    }

    #[test]
    fn a_difference_in_an_element_has_its_line_and_place() {
        let comparison = compared(&chunk(0.1), &chunk(0.2));
        let place = &comparison.differences[0].place;
        assert_eq!((place.line, place.position), (7, Some([100.0, 0.0, 0.0])));
        assert_eq!(place.text(), " (line 7, X100.000000 Y0.000000 Z0.000000)");
    }

    #[test]
    fn a_checksum_over_the_last_bits_is_a_remark() {
        let now = PathChunk { crc32: 5, ..chunk(0.1) };
        let comparison = compared(&chunk(0.1), &now);
        assert_eq!((comparison.differences.len(), comparison.remarks.len()), (0, 0));
        let manifest =
            |sha256: &str| CompensatedPath { sha256: sha256.into(), ..Default::default() };
        let mut comparison = Comparison::default();
        comparison.message("compensated_path", &manifest("a"), &manifest("b"));
        assert_eq!((comparison.differences.len(), comparison.remarks.len()), (0, 1));
        assert_eq!(comparison.remarks[0].field, "sha256");
    }

    #[test]
    fn a_comparison_of_nothing_is_empty() {
        let mut comparison = Comparison::default();
        assert!(comparison.is_empty());
        // Neither a remark nor a difference counts as compared.
        comparison.remark("bag", "a gap");
        comparison.count("transmissions", 0);
        assert!(comparison.is_empty());
        comparison.differs("loader", "nothing", "nothing was compared");
        assert!(!comparison.is_empty());
        let mut comparison = Comparison::default();
        comparison.message("compensated_path/chunks 0", &chunk(0.1), &chunk(0.1));
        assert!(!comparison.is_empty());
    }

    #[test]
    fn messages_that_are_no_longer_made_are_counted() {
        let mut comparison = Comparison::default();
        comparison.sequence("chunks", &[chunk(0.0), chunk(1.0)], &[chunk(0.0)]);
        assert_eq!(comparison.differences.len(), 1);
        assert!(comparison.differences[0].text.contains("2 messages were recorded, 1 are made"));
    }
}
