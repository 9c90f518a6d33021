//! Parts of a contour that are taken while the program is still being read.

use super::Reader;
use crate::line::Line;
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::finding::{Code, Finding};

/// How a contour is taken in parts.
pub(crate) struct Parts<'t> {
    /// The least events of a part.
    pub(crate) least: usize,
    /// The most events that wait for a place where nothing is compensated.
    pub(crate) most: usize,
    pub(crate) take: &'t mut dyn FnMut(&mut ProgrammedContour),
}

impl Reader<'_> {
    /// Offers the events so far, unless a contour is under way. Those of a program that is refused are dropped.
    pub(super) fn give(&mut self, parts: &mut Parts<'_>, line: Line<'_>) {
        let is_between = !self.interpreter.is_compensating();
        if is_between && !self.findings.has_error() {
            self.interpreter.give(parts.take);
        }
        let is_too_much = self.interpreter.event_count() >= parts.most;
        if is_too_much && !self.findings.has_error() {
            let message = format!(
                "the contour has {} events here since nothing was compensated; at most {} are planned at once",
                self.interpreter.event_count(),
                parts.most
            );
            let help = "end the compensation with G40 between contours, or split the program";
            let source = line.source(None, 0, line.text.trim_ascii_end().len());
            self.findings.push(Finding::error(Code::Limit, source, message).help(help));
        }
        if (is_between || is_too_much) && self.findings.has_error() {
            self.interpreter.give(&mut |contour| contour.events.clear());
        }
    }
}
