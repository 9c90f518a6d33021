//! Lines that begin with `/`: executed, or skipped where the operator has switched that on.

use super::Reader;
use crate::line::Line;
use crate::no_effect::{EXECUTED, SKIPPED};

impl Reader<'_> {
    #[inline]
    pub(super) fn is_deleted(&mut self, line: Line<'_>) -> bool {
        let starts = line.text.first().is_some_and(|first| !first.is_ascii_alphanumeric());
        starts && self.slash(line)
    }

    /// Whether a line begins with `/` and is skipped for that.
    fn slash(&mut self, line: Line<'_>) -> bool {
        let visible = line.text.trim_ascii_start();
        // Where `//` begins a comment there are no such lines.
        if visible.first() != Some(&b'/') || self.rules.dialect.lexer.calls {
            return false;
        }
        let start = line.text.len() - visible.len();
        match self.options.block_delete {
            true => {
                let source = line.source(None, start, start + visible.trim_ascii_end().len());
                self.deleted.add(0, SKIPPED, source, || "this line".to_owned());
            }
            false => {
                let source = line.source(None, start, start + 1);
                self.deleted.add(0, EXECUTED, source, || "/".to_owned());
            }
        }
        self.options.block_delete
    }
}
