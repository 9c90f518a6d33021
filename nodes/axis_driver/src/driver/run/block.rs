//! Which lines are one block, for a machine that stops after every block.
//!
//! Knows lines and elements; when the machine stops, `stream` decides.

use super::job::Job;
use crate::encoder::EncodedLine;
use cnc_msgs::contour::Source;
use cnc_msgs::path::Role;

/// The block that a line belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::driver) struct BlockOfLine {
    source: Source,
    element: Option<usize>,
    role: Role,
    /// The controller stops by itself after the line.
    is_stop: bool,
}

impl BlockOfLine {
    pub(in crate::driver) fn of(line: &EncodedLine) -> Self {
        let EncodedLine { source, element, role, .. } = *line;
        Self { source, element, role, is_stop: line.text == "M0" }
    }

    /// The block of a function of the user.
    pub(in crate::driver) fn of_function(source: Source) -> Self {
        Self { source, element: None, role: Role::None, is_stop: false }
    }

    /// Whether a single block ends between the two: between any two elements, those
    /// that were generated included (S10), and between two blocks of the program.
    pub(in crate::driver) fn ends_before(&self, next: &Self) -> bool {
        let is_next_element = self.element.is_some() && self.element != next.element;
        let is_own_function = next.element.is_none() && self.source.line == next.source.line;
        let is_next_line = self.source.line != next.source.line;
        !self.is_stop && (is_next_line || is_next_element && !is_own_function)
    }

    /// `line 12, lead-on, in o<pocket>, called from line 40`
    pub(in crate::driver) fn text(&self, job: &Job) -> String {
        let calls = job.request.path.calls.after(self.source);
        match self.role {
            Role::None => format!("line {}{calls}", self.source.line),
            role => format!("line {}, {}{calls}", self.source.line, role.name()),
        }
    }
}
