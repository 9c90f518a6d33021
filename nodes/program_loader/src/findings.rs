//! Collects the findings of a program, up to a limit.
//!
//! Knows the limits, not the texts.

use crate::limits::{BLOCK_DIAGNOSTICS_MAX, DIAGNOSTICS_MAX};
use cnc_msgs::calls::Calls;
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding, Severity};
use intake::text::one_line;
use std::borrow::Cow;

/// How many findings there were at some moment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mark {
    listed: usize,
    in_block: u32,
    dropped: u32,
    dropped_an_error: bool,
}

#[derive(Debug, Default)]
pub(crate) struct Findings {
    list: Vec<Finding>,
    in_block: u32,
    dropped: u32,
    dropped_an_error: bool,
}

impl Findings {
    /// Starts a new block.
    #[inline]
    pub(crate) fn begin_block(&mut self) {
        self.in_block = 0;
    }

    pub(crate) fn push(&mut self, mut finding: Finding) {
        // Message and help may quote the program.
        for text in [&mut finding.message, &mut finding.help] {
            if let Cow::Owned(shown) = one_line(text) {
                *text = shown;
            }
        }
        self.in_block += 1;
        if self.list.len() >= DIAGNOSTICS_MAX || self.in_block > BLOCK_DIAGNOSTICS_MAX {
            self.dropped = self.dropped.saturating_add(1);
            self.dropped_an_error |= finding.is_error();
        } else {
            self.list.push(finding);
        }
    }

    /// How many findings of this block would still be listed.
    pub(crate) fn room(&self) -> usize {
        let in_block = BLOCK_DIAGNOSTICS_MAX.saturating_sub(self.in_block) as usize;
        in_block.min(DIAGNOSTICS_MAX - self.list.len().min(DIAGNOSTICS_MAX))
    }

    /// Counts warnings that need not be built, as there is no room for them.
    pub(crate) fn leave_out(&mut self, warnings: usize) {
        self.dropped = self.dropped.saturating_add(u32::try_from(warnings).unwrap_or(u32::MAX));
    }

    /// How many findings are listed.
    pub(crate) fn count(&self) -> usize {
        self.list.len()
    }

    /// What there is now, for [`Self::back_to`].
    #[inline]
    pub(crate) fn mark(&self) -> Mark {
        let &Self { in_block, dropped, dropped_an_error, .. } = self;
        Mark { listed: self.list.len(), in_block, dropped, dropped_an_error }
    }

    /// Forgets all that has come since.
    pub(crate) fn back_to(&mut self, mark: Mark) {
        let Mark { listed, in_block, dropped, dropped_an_error } = mark;
        self.list.truncate(listed);
        (self.in_block, self.dropped, self.dropped_an_error) =
            (in_block, dropped, dropped_an_error);
    }

    /// Whether an error has come since a mark.
    pub(crate) fn has_error_since(&self, mark: Mark) -> bool {
        let has_dropped = self.dropped_an_error && !mark.dropped_an_error;
        has_dropped || self.list[mark.listed..].iter().any(Finding::is_error)
    }

    /// Whether any of the listed findings is an error.
    pub(crate) fn has_error(&self) -> bool {
        self.dropped_an_error || self.list.iter().any(Finding::is_error)
    }

    /// Changes the findings from an index on; those for which `keep` returns false are dropped.
    pub(crate) fn revise(&mut self, from: usize, mut keep: impl FnMut(&mut Finding) -> bool) {
        let mut later = self.list.split_off(from.min(self.list.len()));
        later.retain_mut(|finding| keep(finding));
        self.list.append(&mut later);
    }

    /// Gives each finding the calls and passes that led to it.
    pub(crate) fn explain(&mut self, calls: &Calls) {
        calls.explain(&mut self.list);
    }

    /// All findings in the order of the program, and a note on how many were left out.
    pub(crate) fn finish(mut self) -> Vec<Finding> {
        // Within a block the interpreter reports by group; people read from left to right.
        self.list.sort_by_key(|found| (found.source.line, found.source.column));
        if self.dropped > 0 {
            let message = format!("{} more findings are not listed", self.dropped);
            let mut note = Finding::warning(Code::Limit, Source::default(), message);
            if self.dropped_an_error {
                note.severity = Severity::Error;
            }
            self.list.push(note.help("correct what is listed and load the program again"));
        }
        self.list
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_line(line: u32) -> Finding {
        Finding::error(
            Code::Syntax,
            Source { line, column: 1, ..Source::default() },
            "no block reads like this",
        )
    }

    #[test]
    fn after_a_thousand_findings_the_rest_is_counted() {
        let mut findings = Findings::default();
        for line in 1..=1500 {
            findings.begin_block();
            findings.push(at_line(line));
        }
        let list = findings.finish();
        assert_eq!(list.len(), DIAGNOSTICS_MAX + 1);
        let note = &list[DIAGNOSTICS_MAX];
        assert_eq!(note.code, Code::Limit);
        assert!(note.is_error() && note.message.starts_with("500 more"), "{}", note.message);
    }

    #[test]
    fn findings_without_room_are_counted_without_being_built() {
        let mut findings = Findings::default();
        findings.begin_block();
        assert_eq!(findings.room(), BLOCK_DIAGNOSTICS_MAX as usize);
        for line in 1..=1000 {
            findings.begin_block();
            findings.push(at_line(line));
        }
        assert_eq!(findings.room(), 0);
        findings.leave_out(7);
        let list = findings.finish();
        assert!(list[DIAGNOSTICS_MAX].message.starts_with("7 more"));
    }

    #[test]
    fn one_block_cannot_use_up_the_limit_of_findings() {
        let mut findings = Findings::default();
        findings.begin_block();
        for _ in 0..100 {
            findings.push(at_line(1));
        }
        findings.begin_block();
        findings.push(at_line(2));
        let lines: Vec<u32> = findings.finish().iter().map(|found| found.source.line).collect();
        assert_eq!(lines, [1, 1, 1, 1, 1, 1, 1, 1, 2, 0]);
    }
}
