//! The calls and loop passes that led to a line of a program.
//!
//! A place in a program has one number: its row in a table. A row names the row around it, so that
//! a million passes of a loop share the calls that led to the loop.

use crate::contour::Source;
use crate::finding::Finding;
use std::sync::Arc;

/// One call of a subroutine, or one pass of a loop.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Call {
    /// What is called, as programs write it: `o<pocket>`, `O100`. `None` for a pass of a loop.
    pub name: Option<Arc<str>>,
    /// The line of the call, or the line that the loop begins with, from 1.
    pub line: u32,
    /// Which pass of the loop, or which repetition of the call, from 1.
    pub pass: u32,
    /// The row, from 1, of the call or pass around it; 0 in the main program, and in a chain.
    pub parent: u32,
    /// Calls and passes from the main program to this one, itself included.
    pub depth: u32,
}

/// Rows at each end of a chain that are shown.
const SHOWN_AT_EACH_END: usize = 4;

/// The table of a program.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Calls {
    /// Contour, path and their nodes share it.
    rows: Arc<Vec<Call>>,
}

impl Calls {
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// All rows, each after the one around it.
    pub fn rows(&self) -> &[Call] {
        &self.rows
    }

    /// The row of this number, from 1.
    pub fn get(&self, row: u32) -> Option<&Call> {
        self.rows.get((row as usize).checked_sub(1)?)
    }

    /// Adds a call or a pass inside the row `parent`; returns its number. A parent that the table
    /// does not have counts as the main program.
    pub fn push(&mut self, parent: u32, name: Option<Arc<str>>, line: u32, pass: u32) -> u32 {
        let around = self.get(parent);
        let (parent, depth) = around.map_or((0, 1), |around| (parent, around.depth + 1));
        let rows = Arc::make_mut(&mut self.rows);
        rows.push(Call { name, line, pass, parent, depth });
        u32::try_from(rows.len()).unwrap_or(u32::MAX)
    }

    /// The row and those around it, from the inside to the main program.
    pub fn around(&self, row: u32) -> impl Iterator<Item = (u32, &Call)> {
        let numbered = |row: u32| self.get(row).map(|call| (row, call));
        std::iter::successors(numbered(row), move |(_, call)| numbered(call.parent))
    }

    /// The calls and passes that led to a row, the innermost first. Of more than eight, the four at
    /// each end.
    pub fn chain(&self, row: u32) -> Vec<Call> {
        let depth = self.get(row).map_or(0, |call| call.depth as usize);
        let is_shown =
            |index: &usize| *index < SHOWN_AT_EACH_END || index + SHOWN_AT_EACH_END >= depth;
        let rows = self.around(row).enumerate().filter(|(index, _)| is_shown(index));
        rows.map(|(_, (_, call))| Call { parent: 0, ..call.clone() }).collect()
    }

    /// `in o<pocket>, called from line 40, pass 3 of the loop in line 38`; empty without calls.
    pub fn text(&self, row: u32) -> String {
        chain_text(&self.chain(row), |line| format!("line {line}"))
    }

    /// What follows a line in a message: `, in o<pocket>, called from line 40`; empty without calls.
    pub fn after(&self, source: Source) -> String {
        match self.text(source.call).as_str() {
            "" => String::new(),
            text => format!(", {text}"),
        }
    }

    /// Gives findings that have none yet the chains of their places.
    pub fn explain(&self, findings: &mut [Finding]) {
        if self.is_empty() {
            return;
        }
        for finding in findings {
            if finding.calls.is_empty() {
                finding.calls = self.chain(finding.source.call);
            }
            if let Some(other) = finding.other
                && finding.other_calls.is_empty()
            {
                finding.other_calls = self.chain(other.call);
            }
        }
    }

    /// Drops the rows that no place uses. Returns the new number of each old row, 0 for those that
    /// are dropped, beginning with row 0.
    pub fn keep(&mut self, used: impl Iterator<Item = u32>) -> Vec<u32> {
        let mut numbers = vec![0_u32; self.rows.len() + 1];
        for row in used {
            numbers[row as usize] = 1;
        }
        for (index, call) in self.rows.iter().enumerate().rev() {
            numbers[call.parent as usize] |= numbers[index + 1];
        }
        numbers[0] = 0;
        let mut last = 0;
        for number in numbers.iter_mut().filter(|number| **number > 0) {
            last += 1;
            *number = last;
        }
        let mut index = 0;
        Arc::make_mut(&mut self.rows).retain_mut(|call| {
            index += 1;
            call.parent = numbers[call.parent as usize];
            numbers[index] > 0
        });
        numbers
    }
}

/// What follows the line of a finding in a message; empty without calls.
pub fn chain_after(chain: &[Call]) -> String {
    match chain {
        [] => String::new(),
        chain => format!(", {}", chain_text(chain, |line| format!("line {line}"))),
    }
}

/// The text of a chain; `place` writes a line of the program.
pub fn chain_text(chain: &[Call], place: impl Fn(u32) -> String) -> String {
    let mut parts = Vec::new();
    let mut depth_before = None;
    for call in chain {
        if let Some(before) = depth_before {
            push_left_out(&mut parts, before, call.depth);
        }
        depth_before = Some(call.depth);
        parts.push(match &call.name {
            None => format!("pass {} of the loop in {}", call.pass, place(call.line)),
            Some(name) if call.pass > 1 => {
                format!("in {name}, called from {}, pass {}", place(call.line), call.pass)
            }
            Some(name) => format!("in {name}, called from {}", place(call.line)),
        });
    }
    push_left_out(&mut parts, depth_before.unwrap_or(1), 0);
    parts.join(", ")
}

fn push_left_out(parts: &mut Vec<String>, inner: u32, outer: u32) {
    match inner.saturating_sub(outer).saturating_sub(1) {
        0 => {}
        more => parts.push(format!("{more} more")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> Option<Arc<str>> {
        Some(text.into())
    }

    #[test]
    fn a_place_names_its_calls_and_passes_from_the_inside() {
        let mut calls = Calls::default();
        let outer = calls.push(0, None, 38, 3);
        let pocket = calls.push(outer, name("o<pocket>"), 40, 1);
        let program = calls.push(0, name("O100"), 5, 2);
        for (row, expected) in [
            (0, ""),
            (outer, "pass 3 of the loop in line 38"),
            (pocket, "in o<pocket>, called from line 40, pass 3 of the loop in line 38"),
            (program, "in O100, called from line 5, pass 2"),
            (99, ""),
        ] {
            assert_eq!(calls.text(row), expected, "row {row}");
        }
    }

    #[test]
    fn a_deep_recursion_shows_both_ends_and_counts_the_rest() {
        let mut calls = Calls::default();
        let deepest = (1..=100).fold(0, |parent, line| calls.push(parent, name("o1"), line, 1));
        let chain = calls.chain(deepest);
        let lines: Vec<u32> = chain.iter().map(|call| call.line).collect();
        assert_eq!(lines, [100, 99, 98, 97, 4, 3, 2, 1]);
        let text = calls.text(deepest);
        assert!(
            text.contains("called from line 97, 92 more, in o1, called from line 4,"),
            "{text}"
        );
        // Eight rows need no gap.
        assert!(!calls.text(8).contains("more"), "{}", calls.text(8));
    }

    #[test]
    fn rows_that_no_place_uses_are_dropped_with_their_numbers() {
        let mut calls = Calls::default();
        let rows: Vec<u32> = (1..=5).map(|pass| calls.push(0, None, 7, pass)).collect();
        let inside = calls.push(rows[2], name("o9"), 8, 1);
        let numbers = calls.keep([inside, rows[4], 0].into_iter());
        assert_eq!(numbers, [0, 0, 0, 1, 0, 2, 3]);
        let left: Vec<_> = calls.rows().iter().map(|call| (call.pass, call.parent)).collect();
        assert_eq!(left, [(3, 0), (5, 0), (1, 1)]);
        assert_eq!(calls.text(3), "in o9, called from line 8, pass 3 of the loop in line 7");
    }
}
