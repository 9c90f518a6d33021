//! A decoded message as a tree, and the paths that name its parts.
//!
//! Knows nothing of the wire; [`crate::decode`] makes trees, [`crate::diff`] compares them.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// One value of a message.
///
/// Floats of 32 bits are widened, which is exact. `uint8[]` and `byte[]` are
/// [`Value::Bytes`], so that a serial line in a message stays small.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    Bool(bool),
    Unsigned(u64),
    Signed(i64),
    Float(f64),
    Text(String),
    /// Also text that is not UTF-8.
    Bytes(Vec<u8>),
    List(Vec<Value>),
    Message(MessageValue),
}

/// The fields of a message, in wire order.
#[derive(Debug, Clone, PartialEq)]
pub struct MessageValue {
    /// `package/Type`.
    pub type_name: Arc<str>,
    pub fields: Vec<(Arc<str>, Value)>,
}

impl MessageValue {
    /// The field of this name.
    pub fn get(&self, name: &str) -> Option<&Value> {
        let mut fields = self.fields.iter();
        fields.find(|(field, _)| **field == *name).map(|(_, value)| value)
    }
}

impl Value {
    /// The part at a path such as `elements[3].end.x`.
    pub fn at(&self, path: &FieldPath) -> Option<&Value> {
        path.0.iter().try_fold(self, |value, step| match (value, step) {
            (Self::Message(message), Step::Field(name)) => message.get(name),
            (Self::List(list), Step::Index(index)) => list.get(*index),
            _ => None,
        })
    }

    /// [`Value::at`] for a path that is written out; `None` also if it is none.
    pub fn get(&self, path: &str) -> Option<&Value> {
        self.at(&path.parse().ok()?)
    }

    /// The number, if it is one; integers beyond 2^53 lose their last digits.
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Unsigned(value) => Some(*value as f64),
            Self::Signed(value) => Some(*value as f64),
            Self::Float(value) => Some(*value),
            _ => None,
        }
    }

    /// The count or number without sign, if it is one.
    pub fn as_u64(&self) -> Option<u64> {
        match self {
            Self::Unsigned(value) => Some(*value),
            Self::Signed(value) => u64::try_from(*value).ok(),
            _ => None,
        }
    }

    /// The text, if it is one.
    pub fn as_str(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The kind of the value, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Bool(_) => "bool",
            Self::Unsigned(_) | Self::Signed(_) => "integer",
            Self::Float(_) => "float",
            Self::Text(_) => "text",
            Self::Bytes(_) => "bytes",
            Self::List(_) => "list",
            Self::Message(_) => "message",
        }
    }
}

/// Writes on one line: `{x: 1.5, name: "a", data: 3 bytes 01ff00}`.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Unsigned(value) => write!(f, "{value}"),
            Self::Signed(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value:?}"),
            Self::Text(text) => write!(f, "{text:?}"),
            Self::Bytes(bytes) => {
                write!(f, "{} bytes", bytes.len())?;
                if !bytes.is_empty() {
                    f.write_str(" ")?;
                }
                let shown = bytes.iter().take(16);
                shown.into_iter().try_for_each(|byte| write!(f, "{byte:02x}"))?;
                f.write_str(if bytes.len() > 16 { "..." } else { "" })
            }
            Self::List(list) => {
                f.write_str("[")?;
                for (index, value) in list.iter().enumerate() {
                    f.write_str(if index > 0 { ", " } else { "" })?;
                    write!(f, "{value}")?;
                }
                f.write_str("]")
            }
            Self::Message(message) => {
                f.write_str("{")?;
                for (index, (name, value)) in message.fields.iter().enumerate() {
                    f.write_str(if index > 0 { ", " } else { "" })?;
                    write!(f, "{name}: {value}")?;
                }
                f.write_str("}")
            }
        }
    }
}

/// One step of a path.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// `.name`
    Field(Arc<str>),
    /// `[3]`
    Index(usize),
    /// `*`: any one field. Only in patterns.
    AnyField,
    /// `[*]`: any one element. Only in patterns.
    AnyIndex,
    /// `**`: any steps, none included. Only in patterns.
    AnySteps,
}

/// Names a part of a message: `elements[3].end.x`; empty for the whole.
///
/// As a pattern it may hold `*` for any field, `[*]` for any element and `**`
/// for any steps: `**.stamp`, `elements[*].end.*`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct FieldPath(pub Vec<Step>);

/// Text that is not a path.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "\"{path}\" is not a field path: {why} at character {at}; it should look like elements[3].end.x"
)]
pub struct PathError {
    pub path: String,
    /// 1-based.
    pub at: usize,
    pub why: &'static str,
}

impl FieldPath {
    /// Whether this pattern names the part at `path`.
    pub fn matches(&self, path: &FieldPath) -> bool {
        matches(&self.0, &path.0)
    }
}

fn matches(pattern: &[Step], path: &[Step]) -> bool {
    // Where to retry when a later step does not fit: after the last `**`, one step further.
    let (mut p, mut s) = (0, 0);
    let mut again = None;
    while s < path.len() {
        let fits = match (pattern.get(p), &path[s]) {
            (Some(Step::AnySteps), _) => {
                again = Some((p + 1, s));
                p += 1;
                continue;
            }
            (Some(Step::AnyField), Step::Field(_)) | (Some(Step::AnyIndex), Step::Index(_)) => true,
            (Some(step), at) => step == at,
            (None, _) => false,
        };
        if fits {
            (p, s) = (p + 1, s + 1);
        } else if let Some((after, from)) = again {
            again = Some((after, from + 1));
            (p, s) = (after, from + 1);
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|step| *step == Step::AnySteps)
}

impl FromStr for FieldPath {
    type Err = PathError;

    fn from_str(text: &str) -> Result<Self, PathError> {
        let mut steps = Vec::new();
        let mut at = 0;
        let error = |at: usize, why| PathError {
            path: text.to_owned(),
            at: text[..at].chars().count() + 1,
            why,
        };
        while at < text.len() {
            let rest = &text[at..];
            if let Some(inside) = rest.strip_prefix('[') {
                let end =
                    inside.find(']').ok_or_else(|| error(at, "the bracket does not close"))?;
                steps.push(match &inside[..end] {
                    "*" => Step::AnyIndex,
                    number => Step::Index(number.parse().map_err(|_| error(at + 1, "no number"))?),
                });
                at += end + 2;
                continue;
            }
            let name = match rest.strip_prefix('.') {
                Some(name) if !steps.is_empty() => {
                    at += 1;
                    name
                }
                None if steps.is_empty() => rest,
                _ => return Err(error(at, "a field needs one point before it, the first none")),
            };
            let end = name.find(['.', '[']).unwrap_or(name.len());
            steps.push(match &name[..end] {
                "*" => Step::AnyField,
                "**" => Step::AnySteps,
                word if is_field_name(word) => Step::Field(word.into()),
                _ => return Err(error(at, "no field name")),
            });
            at += end;
        }
        Ok(Self(steps))
    }
}

fn is_field_name(word: &str) -> bool {
    !word.is_empty() && word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
}

impl fmt::Display for FieldPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, step) in self.0.iter().enumerate() {
            let point = if index > 0 { "." } else { "" };
            match step {
                Step::Field(name) => write!(f, "{point}{name}")?,
                Step::Index(index) => write!(f, "[{index}]")?,
                Step::AnyField => write!(f, "{point}*")?,
                Step::AnyIndex => f.write_str("[*]")?,
                Step::AnySteps => write!(f, "{point}**")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(text: &str) -> FieldPath {
        text.parse().unwrap()
    }

    #[test]
    fn paths_are_written_as_they_are_read() {
        for text in ["", "a", "elements[3].end.x", "a[0][1].b_2", "**.stamp", "a[*].*"] {
            assert_eq!(path(text).to_string(), text);
        }
    }

    #[test]
    fn a_bad_path_says_where() {
        let cases = [(".a", 1), ("a..b", 3), ("a[", 2), ("a[x]", 3), ("a b", 1), ("a[1]b", 5)];
        for (text, at) in cases {
            let error = text.parse::<FieldPath>().unwrap_err();
            assert_eq!(error.at, at, "{error}");
        }
    }

    #[test]
    fn patterns_name_one_step_or_any_number_of_them() {
        let cases = [
            ("**.stamp", "stamp", true),
            ("**.stamp", "header.stamp", true),
            ("**.stamp", "list[2].header.stamp", true),
            ("**.stamp", "header.stamp.sec", false),
            ("**.stamp.**", "header.stamp.sec", true),
            ("**.a.**.b", "a.x.a.y.b", true),
            ("elements[*].end.*", "elements[7].end.x", true),
            ("elements[*].end.*", "elements[7].end", false),
            ("elements[1].end", "elements[2].end", false),
            ("*", "a", true),
            ("*", "a.b", false),
            ("**", "", true),
        ];
        for (pattern, name, expected) in cases {
            assert_eq!(path(pattern).matches(&path(name)), expected, "{pattern} {name}");
        }
    }
}
