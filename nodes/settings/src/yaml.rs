//! Reads YAML files; errors have file, line and column.
//!
//! For tool tables, profiles and parameter files. `intake` limits the size of a text; its
//! meaning is up to the caller.

use intake::yaml::{Limits, YamlError};
use serde::de::DeserializeOwned;
use std::path::Path;

/// What is wrong with a file, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FileError {
    #[error("cannot read {file}: {reason}")]
    Unreadable { file: String, reason: String },
    #[error("{file}{}{}: {reason}", place(*line), place(*column))]
    Content {
        file: String,
        /// 1-based, where known.
        line: Option<usize>,
        /// 1-based, where known.
        column: Option<usize>,
        reason: String,
    },
}

fn place(number: Option<usize>) -> String {
    number.map(|number| format!(":{number}")).unwrap_or_default()
}

impl FileError {
    /// An error in the content of a file.
    pub fn new(file: &str, line: Option<usize>, reason: impl Into<String>) -> Self {
        Self::Content { file: file.to_owned(), line, column: None, reason: reason.into() }
    }

    fn of(error: YamlError, file: &str) -> Self {
        let YamlError { line, column, reason } = error;
        Self::Content { file: file.to_owned(), line, column, reason }
    }

    /// The same error, with what the reader of this file would say where it knows better.
    pub(crate) fn reworded(self, better: impl FnOnce(&str) -> Option<String>) -> Self {
        match self {
            Self::Content { file, line, column, reason } => {
                let reason = better(&reason).unwrap_or(reason);
                Self::Content { file, line, column, reason }
            }
            unreadable => unreadable,
        }
    }
}

/// Reads a value from YAML text of the operator; `file` names it in errors.
///
/// # Errors
/// It is not YAML, does not fit `T`, or is larger than any real file.
pub fn from_yaml_str<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, FileError> {
    intake::yaml::from_str(text, &Limits::FILE).map_err(|error| FileError::of(error, file))
}

/// Reads a value from YAML text of a peer, or of a file that a peer named.
///
/// # Errors
/// As [`from_yaml_str`], with limits for text from the network. The reason quotes nothing of
/// the text: the peer may have no right to read the file.
pub(crate) fn from_foreign_yaml<T: DeserializeOwned>(
    text: &str,
    file: &str,
) -> Result<T, FileError> {
    intake::yaml::from_str(text, &Limits::MESSAGE)
        .map_err(|error| FileError::of(error.without_content(), file))
}

/// Reads a value from a YAML file.
///
/// # Errors
/// The file cannot be read, is not UTF-8, is not YAML, or does not fit `T`.
pub fn from_yaml_file<T: DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    from_yaml_str(&read_text(path)?, &path.display().to_string())
}

/// Reads a text file, as long as YAML of the operator may be.
///
/// # Errors
/// It is no regular file, cannot be read, is too long, or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    let name = path.display().to_string();
    let bytes = intake::file::read(path, Limits::FILE.bytes as u64)
        .map_err(|error| FileError::Unreadable { file: name.clone(), reason: error.to_string() })?;
    utf8(bytes, &name)
}

pub(crate) fn utf8(bytes: Vec<u8>, name: &str) -> Result<String, FileError> {
    String::from_utf8(bytes).map_err(|error| {
        let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + good.iter().filter(|byte| **byte == b'\n').count();
        FileError::new(name, Some(line), "a byte here is not UTF-8")
    })
}

/// The 1-based line of the innermost key that can be found, in block style.
pub fn line_of(text: &str, path: &[String]) -> Option<usize> {
    let mut lines = text.lines().enumerate();
    let mut parent_indent = None;
    let mut found = None;
    for key in path {
        let hit = lines.find(|(_, line)| {
            let content = line.trim_start();
            let indent = line.len() - content.len();
            let content = content.trim_start_matches(['"', '\'']);
            let is_key = content.strip_prefix(key.as_str()).is_some_and(|rest| {
                rest.trim_start_matches(['"', '\'']).trim_start().starts_with(':')
            });
            is_key && parent_indent.is_none_or(|parent| indent > parent)
        });
        match hit {
            Some((index, line)) => {
                parent_indent = Some(line.len() - line.trim_start().len());
                found = Some(index + 1);
            }
            None => break,
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Tool {
        diameter_mm: f64,
    }

    #[test]
    fn errors_name_file_line_and_column() {
        let table = [
            ("diameter_mm: 1.0\nlength: 2\n", "t.yaml:2:1: unknown field `length`"),
            ("diameter_mm: wide\n", "t.yaml:1:14: "),
            ("diameter_mm: [1\n", "t.yaml:"),
            ("\tx", "t.yaml:1:"),
        ];
        for (text, start) in table {
            let error = from_yaml_str::<Tool>(text, "t.yaml").expect_err(text).to_string();
            assert!(error.starts_with(start), "{error}");
            assert!(!error.contains(" at line "), "{error}");
        }
    }

    #[test]
    fn files_that_cannot_be_read_say_why() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = from_yaml_file::<Tool>(&folder.path().join("none.yaml")).expect_err("none");
        assert!(missing.to_string().starts_with("cannot read /"), "{missing}");
        assert!(missing.to_string().contains("none.yaml: No such file"), "{missing}");
        let binary = folder.path().join("binary.yaml");
        std::fs::write(&binary, b"diameter_mm: 1\n# \xff\n").expect("written");
        let error = from_yaml_file::<Tool>(&binary).expect_err("not UTF-8");
        assert!(matches!(error, FileError::Content { line: Some(2), .. }), "{error}");
        assert!(from_yaml_file::<Tool>(folder.path()).is_err());
    }
}
