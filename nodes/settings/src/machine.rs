//! Machine files and keep-out boxes as YAML.
//!
//! Errors name file and line. Whether the settings are those of a machine is asked of the
//! driver, which knows the firmwares.

use crate::yaml::{FileError, from_yaml_str, line_of, read_text};
use cnc_msgs::keep_out::{KeepOut, KeepOutError};
use cnc_msgs::machine_file::MachineFile;
use std::path::Path;

/// A machine file with its text, so that a setting can be found in it.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineText {
    pub machine: MachineFile,
    file: String,
    text: String,
}

/// Why keep-out boxes cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum KeepOutFileError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{file}{}: {error}", line.map(|line| format!(":{line}")).unwrap_or_default())]
    Content {
        file: String,
        /// Line of the box that is wrong, 1-based, if it can be found.
        line: Option<usize>,
        error: KeepOutError,
    },
}

impl MachineText {
    /// Reads a machine file.
    ///
    /// # Errors
    /// It cannot be read, or is not the settings of a controller.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        Self::from_yaml(read_text(path)?, &path.display().to_string())
    }

    /// The same from its text; `file` names it in errors.
    ///
    /// # Errors
    /// It is not the settings of a controller.
    pub fn from_yaml(text: String, file: &str) -> Result<Self, FileError> {
        if text.lines().any(|line| line.trim_start().starts_with("$0=")) {
            let line = text.lines().position(|line| line.trim_start().starts_with("$0="));
            let reason = "this is the output of $$, not a machine file: `kerf controller dump` \
                          writes one";
            return Err(FileError::new(file, line.map(|line| line + 1), reason));
        }
        let machine = from_yaml_str(&text, file)?;
        Ok(Self { machine, file: file.to_owned(), text })
    }

    /// An error about one of its values: these keys lead to it, the outermost first.
    pub fn error_at(&self, keys: &[String], reason: impl Into<String>) -> FileError {
        FileError::new(&self.file, line_of(&self.text, keys), reason)
    }
}

/// Reads and checks keep-out boxes.
///
/// # Errors
/// The file cannot be read, is not a list of boxes, or a box has no size.
pub fn load_keep_out(path: &Path) -> Result<KeepOut, KeepOutFileError> {
    keep_out_from_yaml(&read_text(path)?, &path.display().to_string())
}

/// Reads and checks keep-out boxes from their text; `file` names it in errors.
///
/// # Errors
/// As [`load_keep_out`].
pub fn keep_out_from_yaml(text: &str, file: &str) -> Result<KeepOut, KeepOutFileError> {
    let keep_out: KeepOut = from_yaml_str(text, file)?;
    keep_out.check().map_err(|error| {
        let name = error.name().map(str::to_owned);
        let keys: Vec<String> = std::iter::once("keep_out".to_owned()).chain(name).collect();
        KeepOutFileError::Content { file: file.to_owned(), line: line_of(text, &keys), error }
    })?;
    Ok(keep_out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::keep_out::Frame;

    #[test]
    fn a_box_that_is_none_is_reported_with_its_line() {
        let head = "keep_out:\n  vice: {frame: machine, min_mm: [0, 0, 0], max_mm: [1, 1, 1]}\n";
        for (row, expected) in [
            (
                "  clamp: {frame: G54, min_mm: [5, 0, 0], max_mm: [1, 1, 1]}\n",
                "k.yaml:3: \"clamp\" has no size in X: min_mm is 5, max_mm is 1; min_mm must be \
                 less than max_mm",
            ),
            (
                "  clamp: {frame: G54, min_mm: [0, 0, 0], max_mm: [1, 1, .nan]}\n",
                "k.yaml:3: Z of max_mm of \"clamp\" is NaN; it must be within 100000 mm",
            ),
            (
                "  clamp: {frame: G53, min_mm: [0, 0, 0], max_mm: [1, 1, 1]}\n",
                "k.yaml:3:10: keep_out.clamp: frame \"G53\" is not machine, nor G54 to G59.3",
            ),
            ("  clamp: {frame: G54, min_mm: [0, 0], max_mm: [1, 1, 1]}\n", "k.yaml:3:"),
            ("  clamp: {frame: G54, min: [0, 0, 0]}\n", "k.yaml:3:"),
            (
                "  vice: {frame: G54, min_mm: [0, 0, 0], max_mm: [1, 1, 1]}\n",
                "k.yaml:3:3: keep_out: duplicate entry: vice is written twice",
            ),
        ] {
            let text = format!("{head}{row}");
            let error = keep_out_from_yaml(&text, "k.yaml").expect_err(row).to_string();
            assert!(error.starts_with(expected), "{error}");
        }
        let read = keep_out_from_yaml(head, "k.yaml").expect("a box");
        assert_eq!(read.keep_out["vice"].frame, Frame::Machine);
        let none = "keep_out has no boxes: write at least one, or leave the file out";
        for (text, place) in [("{}", "k.yaml"), ("# G54\nkeep_out: {}\n", "k.yaml:2")] {
            let error = keep_out_from_yaml(text, "k.yaml").expect_err(text).to_string();
            assert_eq!(error, format!("{place}: {none}"));
        }
    }

    #[test]
    fn a_machine_file_is_read_and_anything_else_is_named() {
        let text =
            "firmware: grbl\nsettings:\n  130: 600\n  74: shop\noffsets_mm:\n  G54: [1, 2, 3]\n";
        let read = MachineText::from_yaml(text.into(), "m.yaml").expect("a machine file");
        assert_eq!(read.machine.offsets_mm["G54"], [1.0, 2.0, 3.0]);
        let error = read.error_at(&["settings".into(), "130".into()], "too short");
        assert_eq!(error.to_string(), "m.yaml:3: too short");
        for (text, expected) in [
            ("$0=10\n$1=25\n", "m.yaml:1: this is the output of $$"),
            ("tools:\n  1: {diameter_mm: 5}\n", "m.yaml:1:1: unknown field `tools`"),
            ("firmware: grbl\n", "m.yaml:1:1: missing field `settings`"),
            ("firmware: grbl\nsettings:\n  x: 1\n", "m.yaml:3:"),
            (
                "firmware: grbl\nsettings:\n  1: 1\n  1: 2\n",
                "m.yaml:4:3: settings: duplicate entry",
            ),
        ] {
            let error = MachineText::from_yaml(text.into(), "m.yaml").expect_err(text).to_string();
            assert!(error.starts_with(expected), "{error}");
        }
    }
}
