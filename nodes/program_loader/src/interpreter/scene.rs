//! One block during its execution, and the places of its words.

use crate::block::Block;
use crate::findings::Findings;
use crate::line::Line;
use crate::rules::Rules;
use cnc_msgs::contour::Source;
use cnc_msgs::geometry::Plane;

/// One block during its execution.
#[derive(Debug)]
pub(super) struct Scene<'s> {
    pub(super) line: Line<'s>,
    pub(super) block: &'s Block,
    pub(super) rules: &'s Rules<'s>,
    pub(super) findings: &'s mut Findings,
    /// Where compensation was selected, if it is on when the block begins.
    pub(super) under_compensation: Option<Source>,
    /// The plane when the block begins.
    pub(super) plane: Plane,
}

impl Scene<'_> {
    /// The place of a word in the program.
    pub(super) fn source_of(&self, word: usize) -> Source {
        let word = self.block.words[word];
        self.line.source(self.block.number, usize::from(word.start), usize::from(word.end))
    }

    /// The place of the whole block in the program.
    #[inline]
    pub(super) fn source(&self) -> Source {
        if !self.block.has_remark {
            // Words are ASCII: a byte is a character.
            return Source {
                line: self.line.number,
                block: self.block.number,
                column: (self.block.start + 1) as u16,
                length: (self.block.end - self.block.start) as u16,
                call: self.line.call,
            };
        }
        self.line.source(self.block.number, self.block.start, self.block.end)
    }

    /// A word as the program has it.
    pub(super) fn quote(&self, word: usize) -> String {
        let word = self.block.words[word];
        self.line.quote(usize::from(word.start), usize::from(word.end))
    }
}
