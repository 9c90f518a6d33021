//! The value of a ROS parameter, with its type.

use std::fmt;

/// A value, and with it the type.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterValue {
    Bool(bool),
    Integer(i64),
    Double(f64),
    String(String),
    BoolArray(Vec<bool>),
    IntegerArray(Vec<i64>),
    DoubleArray(Vec<f64>),
    StringArray(Vec<String>),
}

impl ParameterValue {
    /// The type with its article, for messages.
    pub fn type_name(&self) -> &'static str {
        match self {
            Self::Bool(_) => "a bool",
            Self::Integer(_) => "an integer",
            Self::Double(_) => "a double",
            Self::String(_) => "a string",
            Self::BoolArray(_) => "an array of bools",
            Self::IntegerArray(_) => "an array of integers",
            Self::DoubleArray(_) => "an array of doubles",
            Self::StringArray(_) => "an array of strings",
        }
    }

    pub fn is_array(&self) -> bool {
        matches!(
            self,
            Self::BoolArray(_)
                | Self::IntegerArray(_)
                | Self::DoubleArray(_)
                | Self::StringArray(_)
        )
    }

    pub fn is_empty_array(&self) -> bool {
        self.is_array() && *self == self.emptied()
    }

    /// The empty array of the same type; other values as they are.
    pub fn emptied(&self) -> Self {
        match self {
            Self::BoolArray(_) => Self::BoolArray(Vec::new()),
            Self::IntegerArray(_) => Self::IntegerArray(Vec::new()),
            Self::DoubleArray(_) => Self::DoubleArray(Vec::new()),
            Self::StringArray(_) => Self::StringArray(Vec::new()),
            // Not an array: an empty array of any type does not fit.
            _ => Self::StringArray(Vec::new()),
        }
    }
}

impl fmt::Display for ParameterValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Double(value) => write!(f, "{value:?}"),
            Self::String(value) => f.write_str(value),
            Self::BoolArray(values) => write!(f, "{values:?}"),
            Self::IntegerArray(values) => write!(f, "{values:?}"),
            Self::DoubleArray(values) => write!(f, "{values:?}"),
            Self::StringArray(values) => write!(f, "{values:?}"),
        }
    }
}

macro_rules! from {
    ($($kind:ty => $variant:ident),*) => {
        $(impl From<$kind> for ParameterValue {
            fn from(value: $kind) -> Self {
                Self::$variant(value)
            }
        }
        impl TryFrom<ParameterValue> for $kind {
            /// The value is of another type; here it is.
            type Error = ParameterValue;
            fn try_from(value: ParameterValue) -> Result<Self, ParameterValue> {
                match value {
                    ParameterValue::$variant(value) => Ok(value),
                    other => Err(other),
                }
            }
        })*
    };
}
from!(bool => Bool, i64 => Integer, f64 => Double, String => String,
    Vec<bool> => BoolArray, Vec<i64> => IntegerArray, Vec<f64> => DoubleArray,
    Vec<String> => StringArray);

impl From<&str> for ParameterValue {
    fn from(value: &str) -> Self {
        Self::String(value.to_owned())
    }
}
