//! Rows that Kerf appends to the end of a program, as comments below a line that counts them.

use crate::without_filler;
use std::str::Lines;

/// Rows at the end of a text.
pub(crate) struct Appended<'t> {
    /// The text before them.
    pub(crate) program: &'t [u8],
    /// How many their first line announces.
    pub(crate) count: usize,
    pub(crate) rows: Lines<'t>,
}

/// The rows below a line that begins with `begin`, if the last line of the text begins with one of `last`.
pub(crate) fn find<'t>(text: &'t [u8], begin: &str, last: &[&str]) -> Option<Appended<'t>> {
    // Most programs have none, and end with something else.
    let line = text.strip_suffix(b"\n")?;
    let line = &line[memchr::memrchr(b'\n', line).map_or(0, |at| at + 1)..];
    if !last.iter().any(|word| line.starts_with(word.as_bytes())) {
        return None;
    }
    let at = memchr::memmem::rfind(text, begin.as_bytes())?;
    if at > 0 && text[at - 1] != b'\n' {
        return None;
    }
    let mut rows = std::str::from_utf8(&text[at..]).ok()?.lines();
    let count = rows.next()?.strip_prefix(begin)?.strip_suffix(')')?.parse().ok()?;
    Some(Appended { program: &text[..at], count, rows })
}

/// A program with so many rows below a line that begins with `begin`.
pub(crate) fn append(program: &[u8], begin: &str, count: usize, rows: &str) -> Vec<u8> {
    // What fills the last block of a sender would no longer be at the end.
    let mut all = without_filler(program).to_vec();
    if all.last().is_some_and(|&last| last != b'\n') {
        all.push(b'\n');
    }
    all.extend_from_slice(format!("{begin}{count})\n{rows}").as_bytes());
    all
}
