//! LinuxCNC's parameter file: a number and a value in each line.
//!
//! Its values are appended to the text of the program, as files of subroutines are, so that what
//! was loaded is one text with one hash: it is recorded whole and replayed without the file. What a
//! program has set when it ends is put into the file after a run of it; [`runs`] knows which run.

pub mod runs;

use crate::limits::{APPENDED, PROGRAM_BYTES_MAX};
use crate::parameters::NUMBER_MAX;
use cnc_msgs::profile::Profile;
use std::collections::BTreeMap;
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
    Line { line: u32, text: String },
    #[error("line {line}: there is no parameter {number}; they are 1 to {NUMBER_MAX}")]
    Number { line: u32, number: u32 },
    #[error("line {line}: parameter {number} comes twice, in line {first} as well; delete one")]
    Twice { line: u32, number: u32, first: u32 },
    #[error("#{number} is {now} in it, and the program began with {began}; load the program again")]
    Changed { number: u32, now: f64, began: f64 },
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

/// The values of a parameter file at the end of a text.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Section {
    /// Of the file.
    pub(crate) name: String,
    pub(crate) values: Vec<Stored>,
}

/// A parameter that a program has used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    pub number: u32,
    /// Its value when the program was loaded.
    pub began: f64,
    /// Its value when the program has ended.
    pub value: f64,
    /// The program has read it before it set it: all that it leaves depends on `began`.
    pub is_read: bool,
}

/// The text of a parameter file after a run of a program: rows with other numbers, comments and the
/// order stay. LinuxCNC wants the numbers to rise, so a new row comes after the last lower one. A row
/// that is missing is 0.
///
/// # Errors
/// The file cannot be read, or the program has begun with a value that is not in the file any more:
/// somebody has changed it, or a program that counts was run a second time.
pub fn after_run(file: &[u8], left: &[Left]) -> Result<Vec<u8>, BadParameterFile> {
    let end = if file.ends_with(b"\r\n") { "\r\n" } else { "\n" };
    let rows = rows(file)?;
    // By the index of a line: a text before it, and then one in its place.
    let mut edits: BTreeMap<(usize, bool), String> = BTreeMap::new();
    for &Left { number, began, value, is_read } in left {
        let row = rows.iter().find(|row| row.number == number);
        let now = row.map_or(0.0, |row| row.value);
        if is_read && now != began {
            return Err(BadParameterFile::Changed { number, now, began });
        }
        let place = match (row, rows.iter().rfind(|row| row.number < number)) {
            _ if now == value => continue,
            (Some(row), _) => (row.line as usize - 1, true),
            (None, Some(lower)) => (lower.line as usize, false),
            (None, None) => (rows.first().map_or(usize::MAX, |row| row.line as usize - 1), false),
        };
        let _ = write!(edits.entry(place).or_default(), "{number}\t{value:?}{end}");
    }
    let mut text = Vec::with_capacity(file.len() + 40 * left.len());
    for (index, line) in file.split_inclusive(|&byte| byte == b'\n').enumerate() {
        text.extend(edits.remove(&(index, false)).unwrap_or_default().into_bytes());
        match edits.remove(&(index, true)) {
            Some(row) => text.extend(row.into_bytes()),
            None => text.extend_from_slice(line),
        }
    }
    if !edits.is_empty() && text.last().is_some_and(|&last| last != b'\n') {
        text.extend_from_slice(end.as_bytes());
    }
    text.extend(edits.into_values().flat_map(String::into_bytes));
    Ok(text)
}

/// The rows of a file, each with its line from 1.
fn rows(file: &[u8]) -> Result<Vec<Stored>, BadParameterFile> {
    let mut rows = Vec::new();
    let mut lines = BTreeMap::new();
    for (line, row) in (1..).zip(String::from_utf8_lossy(file).lines()) {
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
        rows.push(Stored { number, value, line });
    }
    Ok(rows)
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
    if section_of(&text).is_some() {
        return Err(BadParameterFile::Already);
    }
    let (mut rows, mut count) = (String::new(), 0);
    for Stored { number, value, .. } in self::rows(file)? {
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

/// The values that have been appended to a text, if any were. A program that has something like them is read
/// as it is: they are the end of the text, whole, and as many as their first line says.
pub(crate) fn section_of(text: &[u8]) -> Option<Section> {
    let tail = &text[text.len().saturating_sub(SECTION_BYTES_MAX)..];
    let at = memchr::memmem::rfind(tail, BEGIN.as_bytes())?;
    let before = tail[..at].strip_suffix(b"\n")?.strip_suffix(APPENDED.as_bytes())?;
    if before.last().is_some_and(|&last| last != b'\n') {
        return None;
    }
    let (begin, rows) = std::str::from_utf8(&tail[at..]).ok()?.split_once('\n')?;
    let (count, name) = begin.strip_prefix(BEGIN)?.strip_suffix(')')?.split_once(", ")?;
    let first = text.len() - rows.len();
    let first_line = memchr::memchr_iter(b'\n', &text[..first]).count() as u32 + 1;
    let rows = rows.strip_suffix('\n').unwrap_or(rows).split('\n').filter(|_| !rows.is_empty());
    let mut values: Vec<Stored> = Vec::new();
    for (line, row) in (first_line..).zip(rows) {
        let (number, value) = row.strip_prefix("(#")?.strip_suffix(')')?.split_once('=')?;
        let (number, value) = (number.parse().ok()?, value.parse().ok()?);
        values.push(Stored { number, value, line });
    }
    (count.parse() == Ok(values.len())).then(|| Section { name: name.to_owned(), values })
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
        let section = section_of(text.as_bytes()).unwrap_or_default();
        assert_eq!(section.name, "x1.var");
        let values: Vec<_> =
            section.values.iter().map(|it| (it.number, it.value, it.line)).collect();
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
            assert_eq!(section_of(text.as_bytes()), None, "{text}");
        }
        let text = format!("{APPENDED}\n{BEGIN}1, x)\n(#100=50)\n");
        assert_eq!(section_of(text.as_bytes()).map(|it| it.values.len()), Some(1));
    }

    #[test]
    fn a_run_changes_its_own_rows_and_no_other() {
        /// Number, value at first and at the end, whether it was read before it was set.
        type Rows<'r> = &'r [(u32, f64, f64, bool)];
        // The file, what the program has used, and the file after its run or why it stays.
        let table: [(&str, Rows<'_>, Result<&str, &str>); 20] = [
            ("31 7\n", &[(31, 7.0, 8.0, true)], Ok("31\t8.0\n")),
            ("31 7.000\n", &[(31, 7.0, 7.0, true)], Ok("31 7.000\n")),
            ("50 1\n31 7\n", &[], Ok("50 1\n31 7\n")),
            // A new row comes after the last lower one, before comments that stand there.
            (
                "# ours\n31\t7.0\n# machine\n\n5161 3\n5220 1.0\n",
                &[(40, 0.0, 0.1, false), (41, 0.0, 2.0, true)],
                Ok("# ours\n31\t7.0\n40\t0.1\n41\t2.0\n# machine\n\n5161 3\n5220 1.0\n"),
            ),
            ("# ours\n\n40 1\n", &[(31, 0.0, 2.0, false)], Ok("# ours\n\n31\t2.0\n40 1\n")),
            ("# ours\n", &[(31, 0.0, 2.0, false)], Ok("# ours\n31\t2.0\n")),
            ("", &[(31, 0.0, 1e300, false), (100, 0.0, 0.5, false)], Ok("31\t1e300\n100\t0.5\n")),
            // Rows that do not rise are somebody's own order.
            (
                "50 1\n31 7\n",
                &[(31, 7.0, 8.0, true), (40, 0.0, 1.0, false), (60, 0.0, 2.0, false)],
                Ok("50 1\n31\t8.0\n40\t1.0\n60\t2.0\n"),
            ),
            ("31 7", &[(32, 0.0, 1.0, false)], Ok("31 7\n32\t1.0\n")),
            (
                "31 7\r\n33 1\r\n",
                &[(32, 0.0, 1.0, false), (33, 1.0, 2.0, true)],
                Ok("31 7\r\n32\t1.0\r\n33\t2.0\r\n"),
            ),
            // A row that is missing is 0.
            ("31 7\n", &[(32, 0.0, 0.0, true), (33, 0.0, 0.0, false)], Ok("31 7\n")),
            (
                "",
                &[(31, 7.0, 8.0, true)],
                Err("#31 is 0 in it, and the program began with 7; load the program again"),
            ),
            // It counts and was run twice, or another one has counted, or it was changed by hand.
            (
                "31 8\n",
                &[(31, 7.0, 8.0, true)],
                Err("#31 is 8 in it, and the program began with 7; load the program again"),
            ),
            (
                "31 9.5\n",
                &[(31, 7.0, 7.0, true)],
                Err("#31 is 9.5 in it, and the program began with 7; load the program again"),
            ),
            // What was only read decides too: here #32=[#31+1].
            (
                "31 8\n",
                &[(31, 7.0, 7.0, true), (32, 0.0, 8.0, false)],
                Err("#31 is 8 in it, and the program began with 7; load the program again"),
            ),
            // #31=0 sets it to 0, whatever it has been, and as often as it is run.
            ("31 9\n", &[(31, 0.0, 0.0, false)], Ok("31\t0.0\n")),
            ("31 5\n", &[(31, 7.0, 5.0, false)], Ok("31 5\n")),
            // A file that no program could begin with.
            (
                "31 7\n31 8\n",
                &[(31, 7.0, 8.0, true)],
                Err("line 2: parameter 31 comes twice, in line 1 as well; delete one"),
            ),
            (
                "31 7 x\n",
                &[(40, 0.0, 8.0, false)],
                Err("line 1: \"31 7 x\" is not the number of a parameter and its value: 5221 12.5"),
            ),
            ("31 -0\n", &[(31, 0.0, 1.0, true)], Ok("31\t1.0\n")),
        ];
        for (file, used, wanted) in table {
            let left: Vec<Left> = used
                .iter()
                .map(|&(number, began, value, is_read)| Left { number, began, value, is_read })
                .collect();
            let text = after_run(file.as_bytes(), &left)
                .map(|text| String::from_utf8(text).expect("text"))
                .map_err(|why| why.to_string());
            assert_eq!(text, wanted.map(Into::into).map_err(Into::into), "{file:?} {used:?}");
        }
    }

    #[test]
    fn the_longest_file_comes_back_whole() {
        let longest = -f64::MIN_POSITIVE / 3.0;
        let file: String = (1..=NUMBER_MAX).map(|n| format!("{n} {longest:?}\n")).collect();
        let text = assemble("M2", &file).expect("a good file");
        assert_eq!(
            section_of(text.as_bytes()).map(|it| it.values.len()),
            Some(NUMBER_MAX as usize)
        );
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
