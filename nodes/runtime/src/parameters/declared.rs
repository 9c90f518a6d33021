//! The declaration of a parameter: its type, range and description.
//!
//! Pure. Types are strict as in rclcpp: an integer is not a double. An error says how
//! to write the value.

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

/// The range of a number, both ends included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    Integer { from: i64, to: i64 },
    Double { from: f64, to: f64 },
}

/// A parameter that a node has.
#[derive(Debug, Clone, PartialEq)]
pub struct Declared {
    /// With dots for groups and the unit at the end: `limits.feed_mm_per_min`.
    pub name: String,
    /// The value without any file or argument; its type is the parameter's.
    pub default: ParameterValue,
    /// One sentence with unit and meaning.
    pub description: String,
    pub range: Option<Range>,
    /// The only strings it may be; empty: any.
    pub choices: Vec<String>,
    /// Set at the start, never while the node runs.
    pub read_only: bool,
    /// Its name in earlier versions; a file that uses it gets an error with the new name.
    pub formerly: Option<String>,
}

impl Declared {
    /// A parameter of any value of the default's type.
    pub fn new(name: &str, default: impl Into<ParameterValue>, description: &str) -> Self {
        Self {
            name: name.to_owned(),
            default: default.into(),
            description: description.to_owned(),
            range: None,
            choices: Vec::new(),
            read_only: false,
            formerly: None,
        }
    }

    /// Limits a double, or each of an array, to `from..=to`.
    #[must_use]
    pub fn within(mut self, from: f64, to: f64) -> Self {
        self.range = Some(Range::Double { from, to });
        self
    }

    /// Limits an integer, or each of an array, to `from..=to`.
    #[must_use]
    pub fn integer_within(mut self, from: i64, to: i64) -> Self {
        self.range = Some(Range::Integer { from, to });
        self
    }

    /// Limits a string to these.
    #[must_use]
    pub fn one_of(mut self, choices: &[&str]) -> Self {
        self.choices = choices.iter().map(|choice| (*choice).to_owned()).collect();
        self
    }

    /// Cannot be changed while the node runs.
    #[must_use]
    pub fn read_only(mut self) -> Self {
        self.read_only = true;
        self
    }

    /// Had another name before.
    #[must_use]
    pub fn formerly(mut self, name: &str) -> Self {
        self.formerly = Some(name.to_owned());
        self
    }

    /// A word of a file, read for the declared type: rcl reads YAML 1.1, where `yes` and
    /// `off` are bools.
    pub(crate) fn as_written(&self, value: &ParameterValue) -> ParameterValue {
        let (ParameterValue::Bool(_), ParameterValue::String(word)) = (&self.default, value) else {
            return value.clone();
        };
        match word.as_str() {
            "y" | "Y" | "yes" | "Yes" | "YES" | "on" | "On" | "ON" => ParameterValue::Bool(true),
            "n" | "N" | "no" | "No" | "NO" | "off" | "Off" | "OFF" => ParameterValue::Bool(false),
            _ => value.clone(),
        }
    }

    /// Whether `value` may be given to the parameter; the reason if not.
    pub(crate) fn check(&self, value: &ParameterValue) -> Result<(), String> {
        if value.type_name() != self.default.type_name() {
            let (given, needed) = (value.type_name(), self.default.type_name());
            let help = match (&self.default, value) {
                (ParameterValue::Double(_), ParameterValue::Integer(whole)) => {
                    format!(": write {whole}.0")
                }
                (
                    ParameterValue::String(_),
                    ParameterValue::Integer(_)
                    | ParameterValue::Double(_)
                    | ParameterValue::Bool(_),
                ) => format!(": write \"{value}\" in quotes"),
                (ParameterValue::Bool(_), _) => ": write true or false".to_owned(),
                (ParameterValue::DoubleArray(_), ParameterValue::IntegerArray(_)) => {
                    ": write each number with a decimal point".to_owned()
                }
                _ => String::new(),
            };
            return Err(format!("{value} is {given}, and {needed} is needed{help}"));
        }
        let doubles: &[f64] = match value {
            ParameterValue::Double(number) => std::slice::from_ref(number),
            ParameterValue::DoubleArray(numbers) => numbers,
            _ => &[],
        };
        let integers: &[i64] = match value {
            ParameterValue::Integer(number) => std::slice::from_ref(number),
            ParameterValue::IntegerArray(numbers) => numbers,
            _ => &[],
        };
        if doubles.iter().any(|number| number.is_nan()) {
            return Err("not a number (NaN) is refused".to_owned());
        }
        match self.range {
            Some(Range::Double { from, to }) => {
                if let Some(bad) = doubles.iter().find(|number| !(from..=to).contains(*number)) {
                    return Err(format!("{bad} is not between {from} and {to}"));
                }
            }
            Some(Range::Integer { from, to }) => {
                if let Some(bad) = integers.iter().find(|number| !(from..=to).contains(*number)) {
                    return Err(format!("{bad} is not between {from} and {to}"));
                }
            }
            None => {}
        }
        match value {
            ParameterValue::String(text)
                if !self.choices.is_empty() && !self.choices.contains(text) =>
            {
                Err(format!("\"{text}\" is not one of {}", self.choices.join(", ")))
            }
            _ => Ok(()),
        }
    }
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

    pub(crate) fn is_array(&self) -> bool {
        matches!(
            self,
            Self::BoolArray(_)
                | Self::IntegerArray(_)
                | Self::DoubleArray(_)
                | Self::StringArray(_)
        )
    }

    pub(crate) fn is_empty_array(&self) -> bool {
        self.is_array() && *self == self.emptied()
    }

    /// The empty array of the same type; other values as they are.
    pub(crate) fn emptied(&self) -> Self {
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
