//! YAML with bounded work: all YAML of this project is read here.
//!
//! The YAML parser spends memory on each token (400 bytes) and, in brackets, time on each level
//! of nesting. So a text is measured first, in one pass and without memory of its own, and is
//! rejected when it is larger than any real one. [`measure`] is that pass.

mod scanner;

use serde::de::DeserializeOwned;

/// What a text may cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    pub bytes: usize,
    /// Lists and maps within each other.
    pub depth: usize,
    /// Values, keys and punctuation marks.
    pub tokens: usize,
    /// `*aliases`, which repeat earlier values, and `%directives`.
    pub aliases: usize,
}

impl Limits {
    /// A file that the operator names: a tool table of 4000 full rows, the parameters of a
    /// hundred nodes, the metadata of a bag with 2000 topics.
    pub const FILE: Self = Self { bytes: 4 << 20, depth: 48, tokens: 200_000, aliases: 10 };
    /// A text from a message or a bag: a profile of this project has 4 kB and 400 tokens.
    pub const MESSAGE: Self = Self { bytes: 64 << 10, depth: 24, tokens: 8_000, aliases: 0 };
}

/// What a text would cost the parser.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cost {
    pub depth: usize,
    pub tokens: usize,
    pub aliases: usize,
}

/// Why a text was rejected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct YamlError {
    /// 1-based, where known.
    pub line: Option<usize>,
    /// 1-based, where known.
    pub column: Option<usize>,
    pub reason: String,
}

/// Measures a text; stops at the first limit that it exceeds.
///
/// # Errors
/// The limit that was exceeded, and where.
pub fn measure(text: &str, limits: &Limits) -> Result<Cost, YamlError> {
    if text.len() > limits.bytes {
        let reason =
            format!("the text has {} bytes; at most {} are read", text.len(), limits.bytes);
        return Err(YamlError { line: None, column: None, reason });
    }
    scanner::Scanner::new(text, limits).run()
}

/// Reads a value from a text within limits.
///
/// # Errors
/// The text exceeds a limit, is not YAML, or does not match `T`. The reason may quote the text.
pub fn from_str<T: DeserializeOwned>(text: &str, limits: &Limits) -> Result<T, YamlError> {
    measure(text, limits)?;
    serde_yaml::from_str(text).map_err(|error| {
        let location = error.location();
        let message = error.to_string();
        // Line and column have fields of their own.
        let reason = match message.rfind(" at line ") {
            Some(end) if location.is_some() => message[..end].to_owned(),
            _ => message,
        };
        YamlError {
            line: location.as_ref().map(serde_yaml::Location::line),
            column: location.as_ref().map(serde_yaml::Location::column),
            reason,
        }
    })
}

impl YamlError {
    /// The same error without any text of the file: the sender may not be allowed to read it.
    #[must_use]
    pub fn without_content(self) -> Self {
        const KINDS: [&str; 8] = [
            "invalid type",
            "invalid value",
            "invalid length",
            "unknown field",
            "unknown variant",
            "missing field",
            "duplicate field",
            "duplicate entry",
        ];
        // A path in the struct may precede the kind; its keys are from the text, too.
        let kind = KINDS.iter().filter_map(|kind| Some((self.reason.find(kind)?, *kind))).min();
        let Some((_, kind)) = kind else {
            return Self { reason: "not YAML of the expected form".to_owned(), ..self };
        };
        // What follows ", expected " is from `T`; what precedes it may be from the text.
        let expected = match self.reason.rfind(", expected ") {
            Some(start) => &self.reason[start..],
            None => "",
        };
        Self { reason: format!("{kind}{expected}"), ..self }
    }
}

#[cfg(test)]
mod tests;
