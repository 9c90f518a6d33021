//! LinuxCNC's parameter file: a number and a value in each line.
//!
//! Its values are appended to the text of the program, as files of subroutines are, so that what
//! was loaded is one text with one hash: it is recorded whole and replayed without the file. What a
//! program has changed when it ends is put into the file after a run of it, and only then.

use crate::limits::{APPENDED, PROGRAM_BYTES_MAX};
use crate::parameters::NUMBER_MAX;
use cnc_msgs::profile::Profile;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Bytes of a parameter file; each of its numbers takes less than 40.
pub const PARAMETER_FILE_BYTES_MAX: u64 = 1 << 20;
/// The line before the values begins so, and goes on with their number and the name of the file.
const BEGIN: &str = "(values of a parameter file, appended by Kerf: ";
/// Letters of the name of a file that are kept.
const NAME_LETTERS_MAX: usize = 200;
/// Bytes of all rows: each number comes once, in a row of at most 35 bytes.
const SECTION_BYTES_MAX: usize = 1024 + NUMBER_MAX as usize * 40;

/// Why a parameter file cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BadParameterFile {
    #[error("line {line}: {text:?} is not the number of a parameter and its value: 5221 12.5")]
    Line { line: usize, text: String },
    #[error("line {line}: there is no parameter {number}; they are 1 to {NUMBER_MAX}")]
    Number { line: usize, number: u32 },
    #[error("line {line}: parameter {number} comes twice, in line {first} as well; delete one")]
    Twice { line: usize, number: u32, first: usize },
    #[error("with it the program is too long")]
    TooLong,
    #[error("the program has the values of a parameter file at its end already")]
    Already,
}

/// A value of a parameter file, and its line in the text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stored {
    pub(crate) number: u32,
    pub(crate) value: f64,
    pub(crate) line: u32,
}

/// A value that a program leaves to the next one: mm or degrees in work offsets. `None`: the program
/// has made it one that only the machine knows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    pub number: u32,
    pub value: Option<f64>,
}

/// The text of a parameter file after a program that has ended: other rows, comments and the order
/// stay. LinuxCNC wants the numbers to rise, so a new row comes before the first higher one. A row
/// whose value only the machine knows is taken out.
pub fn after_run(file: &[u8], left: &[Left]) -> Vec<u8> {
    let number = |row: &[u8]| {
        let row = String::from_utf8_lossy(row);
        row.split_whitespace().next().and_then(|word| word.parse::<u32>().ok())
    };
    let rows = || file.split_inclusive(|&byte| byte == b'\n');
    let known: BTreeSet<u32> = rows().filter_map(number).collect();
    let (known, mut new): (BTreeMap<_, _>, BTreeMap<_, _>) =
        left.iter().map(|it| (it.number, it.value)).partition(|(it, _)| known.contains(it));
    let mut text = Vec::with_capacity(file.len() + 40 * left.len());
    let mut end = "\n";
    for row in rows() {
        end = if row.ends_with(b"\r\n") { "\r\n" } else { "\n" };
        let Some(number) = number(row) else {
            text.extend_from_slice(row);
            continue;
        };
        let higher = new.split_off(&number);
        add_rows(&mut text, std::mem::replace(&mut new, higher), end);
        match known.get(&number) {
            Some(value) => add_rows(&mut text, BTreeMap::from([(number, *value)]), end),
            None => text.extend_from_slice(row),
        }
    }
    add_rows(&mut text, new, end);
    text
}

fn add_rows(text: &mut Vec<u8>, rows: BTreeMap<u32, Option<f64>>, end: &str) {
    for (number, value) in rows.into_iter().filter_map(|(number, value)| Some((number, value?))) {
        if text.last().is_some_and(|&last| last != b'\n') {
            text.extend_from_slice(end.as_bytes());
        }
        text.extend_from_slice(format!("{number}\t{value:?}{end}").as_bytes());
    }
}

/// Appends the values of a parameter file to a program.
///
/// # Errors
/// A line is not a number and a value, or a number comes twice.
pub fn with_parameters(
    mut text: Vec<u8>,
    profile: &Profile,
    name: &str,
    file: &[u8],
) -> Result<Vec<u8>, BadParameterFile> {
    if !crate::dialect::of(profile.language.dialect).lexer.parameters {
        return Ok(text);
    }
    if !values_of(&text).is_empty() {
        return Err(BadParameterFile::Already);
    }
    let (mut rows, mut count) = (String::new(), 0);
    let mut lines = BTreeMap::new();
    for (line, row) in String::from_utf8_lossy(file).lines().enumerate().map(|(n, it)| (n + 1, it))
    {
        let row = row.trim();
        if row.is_empty() || row.starts_with('#') {
            continue;
        }
        let mut words = row.split_whitespace();
        let number = words.next().and_then(|word| word.parse::<u32>().ok());
        let value = words.next().and_then(|word| word.parse::<f64>().ok());
        let value = value.filter(|value| value.is_finite());
        let (Some(number), Some(value), None) = (number, value, words.next()) else {
            let text = row.chars().take(40).collect();
            return Err(BadParameterFile::Line { line, text });
        };
        if !(1..=NUMBER_MAX).contains(&number) {
            return Err(BadParameterFile::Number { line, number });
        }
        if let Some(first) = lines.insert(number, line) {
            return Err(BadParameterFile::Twice { line, number, first });
        }
        if value != 0.0 || is_of_the_machine(number) {
            let _ = writeln!(rows, "(#{number}={value:?})");
            count += 1;
        }
    }
    let is_kept = |letter: &char| !"()".contains(*letter) && !letter.is_control();
    let name: String = name.chars().filter(is_kept).take(NAME_LETTERS_MAX).collect();
    let section = format!("{APPENDED}\n{BEGIN}{count}, {name})\n{rows}");
    // DOS ended texts with it.
    if text.last() == Some(&b'\x1A') {
        text.pop();
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

/// The values that have been appended to a text. A program that has something like them is read as
/// it is: they are the end of the text, whole, and as many as their first line says.
pub(crate) fn values_of(text: &[u8]) -> Vec<Stored> {
    section(text).unwrap_or_default()
}

fn section(text: &[u8]) -> Option<Vec<Stored>> {
    let tail = &text[text.len().saturating_sub(SECTION_BYTES_MAX)..];
    let at = memchr::memmem::rfind(tail, BEGIN.as_bytes())?;
    let before = tail[..at].strip_suffix(b"\n")?.strip_suffix(APPENDED.as_bytes())?;
    if before.last().is_some_and(|&last| last != b'\n') {
        return None;
    }
    let (begin, rows) = std::str::from_utf8(&tail[at..]).ok()?.split_once('\n')?;
    let (count, _) = begin.strip_prefix(BEGIN)?.strip_suffix(')')?.split_once(", ")?;
    let first = text.len() - rows.len();
    let first_line = memchr::memchr_iter(b'\n', &text[..first]).count() as u32 + 1;
    let rows = rows.strip_suffix('\n').unwrap_or(rows).split('\n').filter(|_| !rows.is_empty());
    let mut values: Vec<Stored> = Vec::new();
    for (line, row) in (first_line..).zip(rows) {
        let (number, value) = row.strip_prefix("(#")?.strip_suffix(')')?.split_once('=')?;
        let (number, value) = (number.parse().ok()?, value.parse().ok()?);
        values.push(Stored { number, value, line });
    }
    (count.parse() == Ok(values.len())).then_some(values)
}

/// The user's parameters that the file keeps.
pub(crate) const OF_THE_USER: std::ops::RangeInclusive<u32> = 31..=5000;

/// Whether LinuxCNC keeps a parameter in its file.
pub(crate) const fn is_kept(number: u32) -> bool {
    matches!(number, 31..=5000 | 5161..=5169 | 5181..=5189 | 5210..=5390)
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
        let wanted = format!(
            "G0 X1\nM2\n{APPENDED}\n{BEGIN}3, x1.var)\n(#31=0.1)\n(#5221=0.0)\n(#5400=-350.0)\n"
        );
        assert_eq!(text, wanted);
        let values: Vec<_> =
            values_of(text.as_bytes()).iter().map(|it| (it.number, it.value, it.line)).collect();
        assert_eq!(values, [(31, 0.1, 5), (5221, 0.0, 6), (5400, -350.0, 7)]);
        assert_eq!(assemble(&text, "31 1"), Err(BadParameterFile::Already));
        assert_eq!(assemble("M2\x1A", "31 0").expect("good"), assemble("M2", "").expect("good"));
    }

    #[test]
    fn comments_that_look_like_values_are_comments() {
        for text in [
            String::new(),
            "(parameter file for the pocket)\n(#100=50)\n".to_owned(),
            format!("{BEGIN}1, x)\n(#100=50)\n"),
            format!("%\n{BEGIN}1, x)\n(#100=50)\n"),
            format!("M2 {APPENDED}\n{BEGIN}1, x)\n(#100=50)\n"),
            format!("{APPENDED}\n\n{BEGIN}1, x)\n(#100=50)\n"),
            format!("{APPENDED}\n{BEGIN}1, x)\n(#100=50)\nG0 X1\n"),
            format!("{APPENDED}\n{BEGIN}1, x)\n(#100=50)\n\n"),
            format!("{APPENDED}\n{BEGIN}1, x)\n(100=50)\n"),
            format!("{APPENDED}\n{BEGIN}2, x)\n(#100=50)\n"),
            format!("{APPENDED}\n{BEGIN}1, x\n(#100=50)\n"),
            format!("{APPENDED}\n (values{BEGIN}1, x)\n(#100=50)\n"),
        ] {
            assert_eq!(values_of(text.as_bytes()), [], "{text}");
        }
        let text = format!("{APPENDED}\n{BEGIN}1, x)\n(#100=50)\n");
        assert_eq!(values_of(text.as_bytes()).len(), 1);
    }

    #[test]
    fn a_run_changes_its_own_rows_and_no_other() {
        type Rows<'r> = &'r [(u32, Option<f64>)];
        let left = |rows: Rows<'_>| -> Vec<Left> {
            rows.iter().map(|&(number, value)| Left { number, value }).collect()
        };
        // The file, what the program has left, and the file after its run.
        let table: [(&str, Rows<'_>, &str); 8] = [
            ("31 7\n", &[(31, Some(8.0))], "31\t8.0\n"),
            (
                "# ours\n31\t7.000000\n\n5161 3\n5220 1.000000\n",
                &[(40, Some(0.1)), (5161, None), (5221, Some(-2.5))],
                "# ours\n31\t7.000000\n\n40\t0.1\n5220 1.000000\n5221\t-2.5\n",
            ),
            ("", &[(100, Some(1e300)), (31, Some(0.0))], "31\t0.0\n100\t1e300\n"),
            ("31 7", &[(32, Some(1.0))], "31 7\n32\t1.0\n"),
            ("31 7\r\n33 1\r\n", &[(32, Some(1.0))], "31 7\r\n32\t1.0\r\n33 1\r\n"),
            ("31 7\n", &[(5161, None)], "31 7\n"),
            // Rows that do not rise are somebody's own order.
            ("50 1\n31 7\n", &[(31, Some(8.0)), (60, Some(2.0))], "50 1\n31\t8.0\n60\t2.0\n"),
            ("50 1\n31 7\n", &[], "50 1\n31 7\n"),
        ];
        for (file, rows, wanted) in table {
            let text = after_run(file.as_bytes(), &left(rows));
            assert_eq!(String::from_utf8(text).expect("text"), wanted, "{file:?}");
        }
    }

    #[test]
    fn the_longest_file_comes_back_whole() {
        let longest = -f64::MIN_POSITIVE / 3.0;
        let file: String = (1..=NUMBER_MAX).map(|n| format!("{n} {longest:?}\n")).collect();
        let text = assemble("M2", &file).expect("a good file");
        assert_eq!(values_of(text.as_bytes()).len(), NUMBER_MAX as usize);
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
            (
                "100 5\n31 1\n100 0",
                "line 3: parameter 100 comes twice, in line 1 as well; delete one",
            ),
            ("9999 1", "line 1: there is no parameter 9999; they are 1 to 5602"),
        ] {
            assert_eq!(assemble("M2", file).expect_err("bad").to_string(), wanted, "{file}");
        }
    }
}
