//! Lines that need the result of a probe: each begins a stretch, or is the last that is read.

use super::Reader;
use crate::findings::Mark;
use crate::interpreter::{After, Interpreter};
use crate::line::Line;

impl<'r> Reader<'r> {
    /// Executes a block that relies on where a probe has ended: again, at the beginning of a stretch. A
    /// line with errors is left at that.
    #[cold]
    pub(super) fn execute_in_stretch(
        &mut self,
        line: Line<'_>,
        (line_begins, (before, events)): (Mark, (Mark, usize)),
        state: Interpreter<'r>,
        after: After,
    ) -> After {
        if self.findings.has_error_since(line_begins) {
            self.interpreter.forget_stretch();
            return after;
        }
        self.interpreter.back_to(state);
        // Its warnings stay where it is to be read on.
        let place = (self.findings.mark(), events);
        if !self.stretch(line, place) {
            return After::Probe;
        }
        self.findings.back_to(before);
        self.interpreter.execute(line, &self.block, &mut self.findings)
    }

    /// Begins a stretch at a line that needs the result of a probe, in place of what the line has come to
    /// since; returns whether the result is there.
    #[cold]
    pub(super) fn stretch(&mut self, line: Line<'_>, (findings, events): (Mark, usize)) -> bool {
        let source = line.source(None, 0, line.text.trim_ascii_end().len());
        let is_known = self.interpreter.begin_stretch(source, events);
        if !is_known {
            self.findings.back_to(findings);
            self.awaits = Some(source);
        }
        is_known
    }
}
