//! Compares two decoded messages field by field: the basis of replay.
//!
//! Knows tolerances, fields to leave out, and how to report differences. The caller
//! decides which messages to compare.

use std::fmt;

use rosidl::field_path::{FieldPath, PathStep};
use rosidl::value::{MessageValue, Value};

/// How far two numbers may differ: by `absolute`, in the field's unit, or by
/// `relative` times the larger of the two.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tolerance {
    pub absolute: f64,
    pub relative: f64,
}

impl Tolerance {
    /// Not at all.
    pub const EXACT: Self = Self { absolute: 0.0, relative: 0.0 };

    /// By `absolute`, in the field's unit.
    pub const fn absolute(absolute: f64) -> Self {
        Self { absolute, relative: 0.0 }
    }

    /// Whether two numbers count as equal. NaN equals nothing, itself included;
    /// an infinity equals only itself.
    pub fn accepts(&self, a: f64, b: f64) -> bool {
        if a.is_nan() || b.is_nan() {
            return false;
        }
        if a.is_infinite() || b.is_infinite() {
            return a == b;
        }
        self.accepts_distance((a - b).abs(), a.abs().max(b.abs()))
    }

    fn accepts_distance(&self, distance: f64, largest: f64) -> bool {
        // Equal numbers have distance 0, which every tolerance accepts.
        distance <= self.absolute || distance <= self.relative * largest
    }
}

/// What counts as equal.
#[derive(Debug, Clone, Default)]
pub struct Rules {
    /// For floats that no entry of `fields` names. Integers are then compared exactly.
    pub floats: Tolerance,
    /// For numbers, integers too, whose path matches; the last match counts.
    pub fields: Vec<(FieldPath, Tolerance)>,
    /// Parts left out, with all below them: stamps, latencies, ids.
    pub ignored: Vec<FieldPath>,
}

impl Rules {
    fn ignores(&self, path: &FieldPath) -> bool {
        self.ignored.iter().any(|pattern| pattern.matches(path))
    }

    fn tolerance(&self, path: &FieldPath) -> Option<Tolerance> {
        let mut last_first = self.fields.iter().rev();
        last_first.find(|(pattern, _)| pattern.matches(path)).map(|(_, tolerance)| *tolerance)
    }
}

/// How one field differs.
#[derive(Debug, Clone, PartialEq)]
pub enum Difference {
    /// Numbers further apart than allowed, with their distance; NaN if one of them is NaN.
    Number { left: Value, right: Value, by: f64 },
    /// Other values.
    Value { left: Value, right: Value },
    /// Lists or bytes of different length. Their common part is compared as well.
    Length { left: usize, right: usize },
    /// The right side lacks the field.
    OnlyLeft { left: Value },
    /// The left side lacks the field.
    OnlyRight { right: Value },
    /// Values of different kinds: the definition has changed.
    Kind { left: &'static str, right: &'static str },
}

/// One field that differs.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldDifference {
    pub path: FieldPath,
    pub difference: Difference,
}

impl fmt::Display for FieldDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = &self.path;
        match &self.difference {
            Difference::Number { left, right, by } => {
                write!(f, "{path}: {left} became {right}, off by {by:?}")
            }
            Difference::Value { left, right } => {
                write!(f, "{path}: {} became {}", Short(left), Short(right))
            }
            Difference::Length { left, right } => {
                write!(f, "{path}: {left} elements became {right}")
            }
            Difference::OnlyLeft { left } => write!(f, "{path}: {} is gone", Short(left)),
            Difference::OnlyRight { right } => write!(f, "{path}: {} is new", Short(right)),
            Difference::Kind { left, right } => write!(f, "{path}: {left} became {right}"),
        }
    }
}

/// A value, cut to fit a line.
struct Short<'a>(&'a Value);

impl fmt::Display for Short<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = self.0.to_string();
        match text.char_indices().nth(80) {
            Some((end, _)) => write!(f, "{}...", &text[..end]),
            None => f.write_str(&text),
        }
    }
}

/// Lists what differs between two messages, in the order of the fields.
///
/// Fields are matched by name, so that messages of two versions of a type can be compared.
pub fn diff(left: &MessageValue, right: &MessageValue, rules: &Rules) -> Vec<FieldDifference> {
    let mut comparison = Comparison { rules, path: FieldPath::default(), found: Vec::new() };
    comparison.messages(left, right);
    comparison.found
}

struct Comparison<'a> {
    rules: &'a Rules,
    path: FieldPath,
    found: Vec<FieldDifference>,
}

impl Comparison<'_> {
    fn messages(&mut self, left: &MessageValue, right: &MessageValue) {
        for (name, value) in &left.fields {
            self.inside(PathStep::Field(name.clone()), |this| match right.get(name) {
                Some(other) => this.values(value, other),
                None => this.add(Difference::OnlyLeft { left: value.clone() }),
            });
        }
        for (name, value) in &right.fields {
            if left.get(name).is_none() {
                self.inside(PathStep::Field(name.clone()), |this| {
                    this.add(Difference::OnlyRight { right: value.clone() });
                });
            }
        }
    }

    fn values(&mut self, left: &Value, right: &Value) {
        match (left, right) {
            (Value::Message(left), Value::Message(right)) => self.messages(left, right),
            (Value::List(left), Value::List(right)) => {
                self.lengths(left.len(), right.len());
                for (index, (left, right)) in left.iter().zip(right).enumerate() {
                    self.inside(PathStep::Index(index), |this| this.values(left, right));
                }
            }
            (Value::Bytes(a), Value::Bytes(b)) if a.len() != b.len() => {
                self.lengths(a.len(), b.len());
            }
            (
                Value::Float(_) | Value::Unsigned(_) | Value::Signed(_),
                Value::Float(_) | Value::Unsigned(_) | Value::Signed(_),
            ) => self.numbers(left, right),
            _ if left.kind() != right.kind() => {
                self.add(Difference::Kind { left: left.kind(), right: right.kind() })
            }
            _ if left != right => {
                self.add(Difference::Value { left: left.clone(), right: right.clone() })
            }
            _ => {}
        }
    }

    fn numbers(&mut self, left: &Value, right: &Value) {
        let rule = self.rules.tolerance(&self.path);
        let (is_equal, by) = match (whole(left), whole(right)) {
            // Exact where floats would round.
            (Some(a), Some(b)) => {
                let by = (a - b).unsigned_abs() as f64;
                let largest = a.unsigned_abs().max(b.unsigned_abs()) as f64;
                let rule = rule.unwrap_or(Tolerance::EXACT);
                (a == b || rule.accepts_distance(by, largest), by)
            }
            _ => {
                let a = left.as_f64().unwrap_or(f64::NAN);
                let b = right.as_f64().unwrap_or(f64::NAN);
                (rule.unwrap_or(self.rules.floats).accepts(a, b), (a - b).abs())
            }
        };
        if !is_equal {
            self.add(Difference::Number { left: left.clone(), right: right.clone(), by });
        }
    }

    fn lengths(&mut self, left: usize, right: usize) {
        if left != right {
            self.add(Difference::Length { left, right });
        }
    }

    fn inside(&mut self, step: PathStep, compare: impl FnOnce(&mut Self)) {
        self.path.0.push(step);
        if !self.rules.ignores(&self.path) {
            compare(self);
        }
        self.path.0.pop();
    }

    fn add(&mut self, difference: Difference) {
        self.found.push(FieldDifference { path: self.path.clone(), difference });
    }
}

/// The integer, if it is one.
fn whole(value: &Value) -> Option<i128> {
    match value {
        Value::Unsigned(value) => Some((*value).into()),
        Value::Signed(value) => Some((*value).into()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(fields: &[(&str, Value)]) -> MessageValue {
        MessageValue {
            type_name: "a_msgs/A".into(),
            fields: fields.iter().map(|(name, value)| ((*name).into(), value.clone())).collect(),
        }
    }

    fn check(left: &[(&str, Value)], right: &[(&str, Value)], rules: &Rules) -> Vec<String> {
        let found = diff(&message(left), &message(right), rules);
        found.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn nan_equals_nothing_and_an_infinity_only_itself() {
        let tolerance = Tolerance { absolute: f64::INFINITY, relative: 1.0 };
        assert!(!tolerance.accepts(f64::NAN, f64::NAN));
        assert!(!tolerance.accepts(f64::NAN, 1.0));
        assert!(!tolerance.accepts(f64::INFINITY, 1.0));
        assert!(!tolerance.accepts(f64::INFINITY, f64::NEG_INFINITY));
        assert!(tolerance.accepts(f64::INFINITY, f64::INFINITY));
        assert!(tolerance.accepts(1.0, 1e300));
        let same = [("x", Value::Float(f64::NAN))];
        assert_eq!(check(&same, &same, &Rules::default()), ["x: NaN became NaN, off by NaN"]);
    }

    #[test]
    fn floats_have_a_tolerance_and_counts_have_none() {
        let rules = Rules { floats: Tolerance::absolute(0.01), ..Rules::default() };
        let left = [("x", Value::Float(1.0)), ("line", Value::Unsigned(1000))];
        let right = [("x", Value::Float(1.005)), ("line", Value::Unsigned(1001))];
        let found = check(&left, &right, &rules);
        assert_eq!(found, ["line: 1000 became 1001, off by 1.0"]);
    }

    #[test]
    fn a_rule_of_a_field_goes_before_the_general_one_and_the_last_counts() {
        let rules = Rules {
            floats: Tolerance::absolute(1.0),
            fields: vec![
                ("*".parse().unwrap(), Tolerance::EXACT),
                ("line".parse().unwrap(), Tolerance::absolute(2.0)),
            ],
            ..Rules::default()
        };
        let left = [("x", Value::Float(1.0)), ("line", Value::Unsigned(5))];
        let right = [("x", Value::Float(1.5)), ("line", Value::Unsigned(7))];
        assert_eq!(check(&left, &right, &rules), ["x: 1.0 became 1.5, off by 0.5"]);
    }

    #[test]
    fn large_integers_are_compared_to_the_last_digit() {
        let left = [("time", Value::Unsigned(1 << 60))];
        let right = [("time", Value::Unsigned((1 << 60) + 1))];
        assert_eq!(check(&left, &right, &Rules::default()).len(), 1);
        let rules = Rules {
            fields: vec![("time".parse().unwrap(), Tolerance::absolute(1.0))],
            ..Rules::default()
        };
        assert_eq!(check(&left, &right, &rules).len(), 0);
        let signed = [("time", Value::Signed(1 << 60))];
        assert_eq!(check(&left, &signed, &Rules::default()).len(), 0);
    }

    #[test]
    fn ignored_parts_are_left_out_with_all_below() {
        let stamp = |sec| Value::Message(message(&[("sec", Value::Signed(sec))]));
        let rules = Rules {
            ignored: vec!["**.stamp".parse().unwrap(), "id".parse().unwrap()],
            ..Rules::default()
        };
        let header = |sec| Value::Message(message(&[("stamp", stamp(sec))]));
        let left = [("header", header(1)), ("id", Value::Text("a".into()))];
        let right = [("header", header(2))];
        assert_eq!(check(&left, &right, &rules), Vec::<String>::new());
    }

    #[test]
    fn lists_are_compared_as_far_as_both_go() {
        let list =
            |values: &[u64]| Value::List(values.iter().map(|v| Value::Unsigned(*v)).collect());
        let left = [("a", list(&[1, 2, 3]))];
        let right = [("a", list(&[1, 5]))];
        assert_eq!(
            check(&left, &right, &Rules::default()),
            ["a: 3 elements became 2", "a[1]: 2 became 5, off by 3.0"]
        );
    }

    #[test]
    fn fields_that_came_went_or_changed_their_kind_are_named() {
        let left = [("old", Value::Bool(true)), ("x", Value::Float(1.0))];
        let right = [("x", Value::Text("1".into())), ("new", Value::Bytes(vec![1]))];
        assert_eq!(
            check(&left, &right, &Rules::default()),
            ["old: true is gone", "x: float became text", "new: 1 bytes 01 is new"]
        );
    }
}
