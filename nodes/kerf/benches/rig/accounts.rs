//! The accounts of a run: what a bag says was sent and answered, compared with the program.

use super::machine::messages;
use super::whole::spiral;
use cnc_msgs::wire::cnc_msgs::msg::{ControllerTraffic, TrafficEntry};
use std::collections::BTreeMap;
use std::path::Path;

/// What the driver stores of an entry in addition to its data, bytes.
const ENTRY_BYTES: usize = 13;

/// Lines and answers of some traffic.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Books {
    /// Entries, and the numbers that are missing between the first and the last.
    pub(crate) entries: usize,
    pub(crate) missing: u64,
    /// Their approximate memory in the driver.
    pub(crate) bytes: usize,
    /// Lines that were sent, and how many of them name a position.
    pub(crate) lines: u64,
    pub(crate) moves: u64,
    /// Answers.
    pub(crate) oks: u64,
    pub(crate) errors: u64,
    /// The first move that is not the next of the program, and what was sent.
    pub(crate) wrong: Option<(u64, String)>,
}

impl Books {
    /// The accounts of a bag whose run cut a spiral with segments of this length.
    pub(crate) fn of_bag(bag: &Path, length_mm: f64) -> Self {
        let traffic = messages::<ControllerTraffic>(bag).into_iter();
        Self::of(traffic.flat_map(|traffic| traffic.entries), length_mm)
    }

    /// The accounts of entries, which may be repeated and in any order.
    pub(crate) fn of(entries: impl Iterator<Item = TrafficEntry>, length_mm: f64) -> Self {
        let entries: BTreeMap<u64, TrafficEntry> =
            entries.map(|entry| (entry.sequence, entry)).collect();
        let mut books = Self { entries: entries.len(), ..Self::default() };
        let (first, last) = (entries.keys().next(), entries.keys().next_back());
        if let (Some(first), Some(last)) = (first, last) {
            books.missing = last - first + 1 - entries.len() as u64;
        }
        let (mut sent, mut received) = (Vec::new(), Vec::new());
        let mut at = [0, 0];
        for entry in entries.into_values() {
            books.bytes += ENTRY_BYTES + entry.data.len();
            match entry.kind {
                TrafficEntry::KIND_TRANSMITTED => {
                    // Real-time bytes are not part of a line.
                    let is_text = |byte: &u8| byte.is_ascii_graphic() || b" \n".contains(byte);
                    let bytes = entry.data.into_iter().filter(|byte| !b"?!~".contains(byte));
                    each_line(&mut sent, bytes.filter(is_text), |line| {
                        books.send(line, &mut at, length_mm);
                    });
                }
                TrafficEntry::KIND_RECEIVED => {
                    each_line(&mut received, entry.data.into_iter(), |line| match line.trim() {
                        "ok" => books.oks += 1,
                        line if line.starts_with("error:") => books.errors += 1,
                        _ => {}
                    });
                }
                _ => {}
            }
        }
        books
    }

    fn send(&mut self, line: &str, at: &mut [i64; 2], length_mm: f64) {
        self.lines += 1;
        let words = [word(line, 'X'), word(line, 'Y')];
        if line.starts_with('$') || words == [None, None] {
            return;
        }
        *at = [words[0].unwrap_or(at[0]), words[1].unwrap_or(at[1])];
        let index = usize::try_from(self.moves).expect("a program fits into memory");
        // The first move goes to the start of the program.
        if self.wrong.is_none() && *at != spiral(index, length_mm) {
            self.wrong = Some((self.moves, line.to_owned()));
        }
        self.moves += 1;
    }
}

/// A coordinate in thousandths.
fn word(line: &str, letter: char) -> Option<i64> {
    let (_, rest) = line.split_once(letter)?;
    let end = rest.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(rest.len());
    let mm: f64 = rest[..end].trim().parse().ok()?;
    Some((mm * 1e3).round() as i64)
}

fn each_line(rest: &mut Vec<u8>, bytes: impl Iterator<Item = u8>, mut take: impl FnMut(&str)) {
    for byte in bytes {
        if byte == b'\n' {
            take(&String::from_utf8_lossy(rest));
            rest.clear();
        } else {
            rest.push(byte);
        }
    }
}
