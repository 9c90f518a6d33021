//! What the probes of a run have found and its M66 have read, appended to the text of its program.
//!
//! A program that computes with such a result is planned up to there; when the run has come so
//! far, the results so far are appended, and the same text is read again. So what is planned on is one
//! text with one hash, as with subroutines and parameter files: it is recorded whole and replayed without
//! the machine.

use crate::appended::{Appended, append, find};
use cnc_msgs::geometry::Position;
use cnc_msgs::probing::{Measured, ProbeResult};
use std::fmt::Write;

/// The line before the results begins so, and goes on with their number.
const BEGIN: &str = "(results of probes, appended by Kerf: ";

/// The text with these results, each kind in the order of the run, in place of those that it has.
pub fn with_results(text: &[u8], Measured { probes, inputs }: &Measured) -> Vec<u8> {
    let (program, _) = split(text);
    let count = probes.len() + inputs.len();
    if count == 0 {
        return program.to_vec();
    }
    let mut rows = String::new();
    for ProbeResult { has_touched, contact, stands } in probes {
        let [x, y, z] = contact;
        let _ =
            write!(rows, "({} {x:?} {y:?} {z:?}", if *has_touched { "touched" } else { "missed" });
        let [x, y, z] = stands;
        let _ = writeln!(rows, ", stands {x:?} {y:?} {z:?})");
    }
    for value in inputs {
        let _ = writeln!(rows, "(read {value})");
    }
    append(program, BEGIN, count, &rows)
}

/// The program, and the results at the end of its text. Something like them that is not whole belongs to
/// the program.
pub(crate) fn split(text: &[u8]) -> (&[u8], Measured) {
    section(text).unwrap_or((text, Measured::default()))
}

fn section(text: &[u8]) -> Option<(&[u8], Measured)> {
    let Appended { program, count, rows } =
        find(text, BEGIN, &["(touched ", "(missed ", "(read "])?;
    let mut measured = Measured::default();
    for row in rows {
        match row.strip_prefix("(read ") {
            Some(value) => measured.inputs.push(value.strip_suffix(')')?.parse().ok()?),
            // They come first.
            None if measured.inputs.is_empty() => measured.probes.push(result(row)?),
            None => return None,
        }
    }
    let is_whole = count == measured.probes.len() + measured.inputs.len();
    is_whole.then_some((program, measured))
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
    use crate::without_filler;

    fn found(has_touched: bool, z: f64) -> ProbeResult {
        ProbeResult { has_touched, contact: [1.0, -2.5, z], stands: [1.0, -2.5, z - 0.01] }
    }

    #[test]
    fn results_are_read_as_they_were_written_and_replaced_as_a_whole() {
        let results = Measured {
            probes: vec![found(true, -3.0), found(false, 0.1 + 0.2)],
            inputs: vec![1, -1, 512],
        };
        let first = Measured { probes: results.probes[..1].to_vec(), inputs: Vec::new() };
        let inputs = Measured { probes: Vec::new(), inputs: vec![0] };
        for program in
            ["G38.2 Z-5\nM2\n", "G38.2 Z-5\nM2", "G38.2 Z-5\n\x1A", "G38.2 Z-5\n\0\0", ""]
        {
            let text = with_results(program.as_bytes(), &first);
            let text = with_results(&text, &inputs);
            assert_eq!(split(&text).1, inputs);
            let text = with_results(&text, &results);
            let (before, read) = split(&text);
            let filled = without_filler(program.as_bytes());
            assert_eq!(before.trim_ascii_end(), filled.trim_ascii_end());
            assert_eq!(read, results);
            assert_eq!(with_results(&text, &Measured::default()), before);
        }
    }

    #[test]
    fn what_only_looks_like_results_belongs_to_the_program() {
        let measured = Measured { probes: vec![found(true, -3.0)], inputs: vec![1] };
        let whole = String::from_utf8(with_results(b"M2\n", &measured)).expect("text");
        for (from, to) in [
            (": 2)", ": 1)"),
            ("-3.0", "inf"),
            (", stands", " stands"),
            ("(touched", "(seen"),
            ("M2\n(results", "M2 (results"),
            ("(read 1)\n", "(read 1)"),
            ("(read 1)", "(read 1.5)"),
            ("(read 1)", "(saw 1)"),
        ] {
            let spoiled = whole.replacen(from, to, 1);
            assert_ne!(spoiled, whole, "{from}");
            assert_eq!(
                split(spoiled.as_bytes()),
                (spoiled.as_bytes(), Measured::default()),
                "{from}"
            );
        }
    }
}
