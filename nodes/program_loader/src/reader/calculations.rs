//! Where R parameters may be set.

use super::Reader;
use crate::line::Line;
use cnc_msgs::finding::{Code, Finding};

impl Reader<'_> {
    /// Checks a block that sets R parameters: no other words but a call, and no compensation.
    #[cold]
    pub(super) fn check_calculation(&mut self, line: Line<'_>) {
        let source = line.source(self.block.number, self.block.start, self.block.end);
        let (code, message, help) = if let Some(since) = self.interpreter.compensated_since() {
            // It would be one of the blocks between two moves (S61), which no event tells.
            (
                Code::ForbiddenUnderCompensation,
                format!(
                    "a calculation under cutter radius compensation, which is on since line {}",
                    since.line
                ),
                "calculate before G41 or G42, or after G40 and its move",
            )
        } else if self.block.words.iter().any(|word| !matches!(word.letter, b'L' | b'P')) {
            (
                Code::ModalConflict,
                "a calculation in a block with other words".to_owned(),
                "write it into a block of its own, before the one that needs it",
            )
        } else {
            return;
        };
        self.block.is_damaged = true;
        self.findings.push(Finding::error(code, source, message).help(help));
    }
}
