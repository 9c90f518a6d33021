//! What the probes of a run have found, appended to the text of its program.
//!
//! A program that computes with the result of a probe is planned up to there; when the run has come so
//! far, the results so far are appended, and the same text is read again. So what is planned on is one
//! text with one hash, as with subroutines and parameter files: it is recorded whole and replayed without
//! the machine.

use crate::without_filler;
use cnc_msgs::geometry::Position;
use cnc_msgs::probing::ProbeResult;
use std::fmt::Write;

/// The line before the results begins so, and goes on with their number.
const BEGIN: &str = "(results of probes, appended by Kerf: ";

/// The text with these results, in the order of the run, in place of those that it has.
pub fn with_results(text: &[u8], results: &[ProbeResult]) -> Vec<u8> {
    let (program, _) = split(text);
    if results.is_empty() {
        return program.to_vec();
    }
    // What fills the last block of a sender would no longer be at the end.
    let mut all = without_filler(program).to_vec();
    if all.last().is_some_and(|&last| last != b'\n') {
        all.push(b'\n');
    }
    let mut section = format!("{BEGIN}{})\n", results.len());
    for ProbeResult { has_touched, contact, stands } in results {
        let [x, y, z] = contact;
        let _ = write!(
            section,
            "({} {x:?} {y:?} {z:?}",
            if *has_touched { "touched" } else { "missed" }
        );
        let [x, y, z] = stands;
        let _ = writeln!(section, ", stands {x:?} {y:?} {z:?})");
    }
    all.extend_from_slice(section.as_bytes());
    all
}

/// The program, and the results at the end of its text. Something like them that is not whole belongs to
/// the program.
pub(crate) fn split(text: &[u8]) -> (&[u8], Vec<ProbeResult>) {
    section(text).unwrap_or((text, Vec::new()))
}

fn section(text: &[u8]) -> Option<(&[u8], Vec<ProbeResult>)> {
    // Most programs have none, and end with something else.
    let last = text.strip_suffix(b"\n")?;
    let last = &last[memchr::memrchr(b'\n', last).map_or(0, |at| at + 1)..];
    if !(last.starts_with(b"(touched ") || last.starts_with(b"(missed ")) {
        return None;
    }
    let at = memchr::memmem::rfind(text, BEGIN.as_bytes())?;
    if at > 0 && text[at - 1] != b'\n' {
        return None;
    }
    let mut rows = std::str::from_utf8(&text[at..]).ok()?.lines();
    let count = rows.next()?.strip_prefix(BEGIN)?.strip_suffix(')')?;
    let results: Option<Vec<ProbeResult>> = rows.map(result).collect();
    let results = results.filter(|results| count.parse() == Ok(results.len()))?;
    Some((&text[..at], results))
}

fn result(row: &str) -> Option<ProbeResult> {
    let (found, stands) = row.strip_prefix('(')?.strip_suffix(')')?.split_once(", stands ")?;
    let (word, contact) = found.split_once(' ')?;
    let has_touched = match word {
        "touched" => true,
        "missed" => false,
        _ => return None,
    };
    Some(ProbeResult { has_touched, contact: position(contact)?, stands: position(stands)? })
}

fn position(text: &str) -> Option<Position> {
    let values: Option<Vec<f64>> = text.split(' ').map(|word| word.parse().ok()).collect();
    let values: Position = values?.try_into().ok()?;
    values.iter().all(|value| value.is_finite()).then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(has_touched: bool, z: f64) -> ProbeResult {
        ProbeResult { has_touched, contact: [1.0, -2.5, z], stands: [1.0, -2.5, z - 0.01] }
    }

    #[test]
    fn results_are_read_as_they_were_written_and_replaced_as_a_whole() {
        let results = [found(true, -3.0), found(false, 0.1 + 0.2)];
        for program in
            ["G38.2 Z-5\nM2\n", "G38.2 Z-5\nM2", "G38.2 Z-5\n\x1A", "G38.2 Z-5\n\0\0", ""]
        {
            let text = with_results(program.as_bytes(), &results[..1]);
            let text = with_results(&text, &results);
            let (before, read) = split(&text);
            let filled = without_filler(program.as_bytes());
            assert_eq!(before.trim_ascii_end(), filled.trim_ascii_end());
            assert_eq!(read, results);
            assert_eq!(with_results(&text, &[]), before);
        }
    }

    #[test]
    fn what_only_looks_like_results_belongs_to_the_program() {
        let whole = String::from_utf8(with_results(b"M2\n", &[found(true, -3.0)])).expect("text");
        for (from, to) in [
            (": 1)", ": 2)"),
            ("-3.0", "inf"),
            (", stands", " stands"),
            ("(touched", "(seen"),
            ("M2\n(results", "M2 (results"),
            ("-3.01)\n", "-3.01)"),
        ] {
            let spoiled = whole.replacen(from, to, 1);
            assert_ne!(spoiled, whole, "{from}");
            assert_eq!(split(spoiled.as_bytes()), (spoiled.as_bytes(), Vec::new()), "{from}");
        }
    }
}
