//! The declaration of a parameter: its type, range and description.
//!
//! Pure. Types are strict as in rclcpp: an integer is not a double. An error says how
//! to write the value.

use cnc_msgs::parameter::ParameterValue;

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
