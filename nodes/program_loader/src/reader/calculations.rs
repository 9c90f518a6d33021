//! Where R parameters may be set.

use super::Reader;
use crate::line::Line;
use cnc_msgs::finding::{Code, Finding};

impl Reader<'_> {
    /// Checks a block that sets R parameters: no other words but a call. Under compensation it is
    /// one of the blocks between two moves (S61).
    #[cold]
    pub(super) fn check_calculation(&mut self, line: Line<'_>) {
        let source = line.source(self.block.number, self.block.start, self.block.end);
        if self.block.words.iter().any(|word| !matches!(word.letter, b'L' | b'P')) {
            self.block.is_damaged = true;
            let message = "a calculation in a block with other words".to_owned();
            let help = "write it into a block of its own, before the one that needs it";
            self.findings.push(Finding::error(Code::ModalConflict, source, message).help(help));
        } else if !self.block.assignments.is_empty() {
            self.interpreter.calculate(source);
        }
    }
}
