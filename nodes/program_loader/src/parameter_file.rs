//! LinuxCNC's parameter file: a number and a value in each line.
//!
//! Its values are appended to the text of the program, as files of subroutines are, so that what
//! was loaded is one text with one hash: it is recorded whole and replayed without the file. The
//! file itself is never written.

use crate::limits::PROGRAM_BYTES_MAX;
use crate::parameters::NUMBER_MAX;
use cnc_msgs::profile::Profile;
use std::fmt::Write;

/// Bytes of a parameter file; each of its numbers takes less than 40.
pub const PARAMETER_FILE_BYTES_MAX: u64 = 1 << 20;
/// The line before the values.
const BEGIN: &str = "(parameter file ";

/// Why a parameter file cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BadParameterFile {
    #[error("line {line}: {text:?} is not the number of a parameter and its value: 5221 12.5")]
    Line { line: usize, text: String },
    #[error("line {line}: there is no parameter {number}; they are 1 to {NUMBER_MAX}")]
    Number { line: usize, number: u32 },
    #[error("with it the program is too long")]
    TooLong,
}

/// Appends the values of a parameter file to a program.
///
/// # Errors
/// A line is not a number and a value.
pub fn with_parameters(
    mut text: Vec<u8>,
    profile: &Profile,
    name: &str,
    file: &[u8],
) -> Result<Vec<u8>, BadParameterFile> {
    if !crate::dialect::of(profile.language.dialect).lexer.parameters {
        return Ok(text);
    }
    let name: String = name.chars().filter(|letter| !"()\n\r".contains(*letter)).collect();
    let mut section = format!("%\n{BEGIN}{name})\n");
    for (line, row) in String::from_utf8_lossy(file).lines().enumerate().map(|(n, it)| (n + 1, it))
    {
        let row = row.trim();
        if row.is_empty() || row.starts_with('#') {
            continue;
        }
        let mut words = row.split_whitespace();
        let number = words.next().and_then(|word| word.parse::<u32>().ok());
        let value = words.next().and_then(|word| word.parse::<f64>().ok());
        let (Some(number), Some(value), None) = (number, value, words.next()) else {
            let text = row.chars().take(40).collect();
            return Err(BadParameterFile::Line { line, text });
        };
        if !value.is_finite() {
            return Err(BadParameterFile::Line { line, text: row.chars().take(40).collect() });
        }
        if !(1..=NUMBER_MAX).contains(&number) {
            return Err(BadParameterFile::Number { line, number });
        }
        if value != 0.0 || is_of_the_machine(number) {
            let _ = writeln!(section, "(#{number}={value})");
        }
    }
    if text.last().is_some_and(|&last| last != b'\n') {
        text.push(b'\n');
    }
    if text.len() + section.len() > PROGRAM_BYTES_MAX {
        return Err(BadParameterFile::TooLong);
    }
    text.extend_from_slice(section.as_bytes());
    Ok(text)
}

/// The values that have been appended to a text.
pub(crate) fn values_of(text: &[u8]) -> Vec<(u32, f64)> {
    // The section is the last one, and no longer than its file.
    let tail = &text[text.len().saturating_sub(PARAMETER_FILE_BYTES_MAX as usize * 2)..];
    let Some(at) = memchr::memmem::rfind(tail, BEGIN.as_bytes()) else { return Vec::new() };
    if at > 0 && tail[at - 1] != b'\n' {
        return Vec::new();
    }
    let rows = String::from_utf8_lossy(&tail[at..]);
    let value = |row: &str| {
        let (number, value) = row.strip_prefix("(#")?.strip_suffix(')')?.split_once('=')?;
        Some((number.parse().ok()?, value.parse().ok()?))
    };
    rows.lines().skip(1).filter_map(value).collect()
}

/// A stored position, or a work offset.
pub(crate) const fn is_of_the_machine(number: u32) -> bool {
    matches!(number, 5161..=5199 | 5221..=5390)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assemble(text: &str, file: &str) -> Result<String, BadParameterFile> {
        let profile = settings::load_profile("rs274").expect("a shipped profile");
        let text =
            with_parameters(text.as_bytes().to_vec(), &profile, "x(1).var", file.as_bytes())?;
        Ok(String::from_utf8(text).expect("text"))
    }

    #[test]
    fn values_follow_the_program_and_come_back() {
        let text = assemble("G0 X1\nM2", "31\t0.1\n32 0\n\n5221 0.000000\n5400 -3.5e2 \n");
        let text = text.expect("a good file");
        let wanted = "G0 X1\nM2\n%\n(parameter file x1.var)\n(#31=0.1)\n(#5221=0)\n(#5400=-350)\n";
        assert_eq!(text, wanted);
        assert_eq!(values_of(text.as_bytes()), [(31, 0.1), (5221, 0.0), (5400, -350.0)]);
        assert_eq!(values_of(b"G0 X1 (parameter file x)\n(#31=1)\n"), []);
        assert_eq!(values_of(b""), []);
    }

    #[test]
    fn a_line_that_is_no_number_and_value_is_named() {
        for (file, wanted) in [
            (
                "31 1\nx 2",
                "line 2: \"x 2\" is not the number of a parameter and its value: 5221 12.5",
            ),
            ("31", "line 1: \"31\" is not the number of a parameter and its value: 5221 12.5"),
            (
                "31 1 2",
                "line 1: \"31 1 2\" is not the number of a parameter and its value: 5221 12.5",
            ),
            (
                "31 nan",
                "line 1: \"31 nan\" is not the number of a parameter and its value: 5221 12.5",
            ),
            ("9999 1", "line 1: there is no parameter 9999; they are 1 to 5602"),
        ] {
            assert_eq!(assemble("M2", file).expect_err("bad").to_string(), wanted, "{file}");
        }
    }
}
