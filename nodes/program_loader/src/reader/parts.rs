//! Parts of a contour that are taken while the program is still being read.

use super::Reader;
use cnc_msgs::contour::ProgrammedContour;

impl Reader<'_> {
    /// Offers the events so far, unless a contour is under way or the program is refused.
    pub(super) fn give(&mut self, take: &mut dyn FnMut(&mut ProgrammedContour)) {
        if !self.interpreter.is_compensating() && !self.findings.has_error() {
            self.interpreter.give(take);
        }
    }
}
