//! A decoded message as a tree. Knows nothing of the wire.

use std::fmt;
use std::sync::Arc;

use crate::field_path::{FieldPath, PathStep};

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
            (Self::Message(message), PathStep::Field(name)) => message.get(name),
            (Self::List(list), PathStep::Index(index)) => list.get(*index),
            _ => None,
        })
    }

    /// [`Value::at`] for a path as text; `None` also if the text is not a path.
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

    /// The kind of the value, for error messages.
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
