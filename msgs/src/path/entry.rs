//! Where a run enters a path when it begins at a line of its program.
//!
//! Knows which element and which functions come next, and which words before them are
//! still in force. The planner decides whether a control begins there; the driver decides
//! what to send.

use super::{CompensatedPath, PathEvent, Role};
use crate::contour::{Action, CoolantMode, SpindleMode};
use serde::{Deserialize, Serialize};

/// The place in a path at which a run begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// The first element that is cut.
    pub element: usize,
    /// The first event that happens; of the earlier ones only words stay in force.
    pub event: usize,
}

/// No element is at or after the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the program has no motion from line {line} on; its last is in line {last}")]
pub struct PastEnd {
    pub line: u32,
    pub last: u32,
}

/// Whether a run may begin under cutter compensation, and how the tool gets there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartInSpan {
    /// It must not.
    #[default]
    Refused,
    /// The tool has to stand on the path: Z is in the plane of compensation, and moving down
    /// along Z would cut.
    Standing,
    /// The tool may come down to the path: Z is its axis, so the plunge removes only what
    /// the path removes at that point too. (Not with a cutter that is wider than its shank;
    /// the tool table cannot describe those.)
    FromAbove,
}

impl CompensatedPath {
    /// Where a run that begins at a line enters the path: at the first element of that
    /// line or of a later one, the corner that belongs to its block included.
    ///
    /// # Errors
    /// No element is of that line or of a later one.
    pub fn entry(&self, line: u32) -> Result<Entry, PastEnd> {
        let element = self.elements.iter().position(|element| element.source.line >= line);
        let Some(element) = element else {
            let last = self.elements.iter().map(|element| element.source.line).max();
            return Err(PastEnd { line, last: last.unwrap_or(0) });
        };
        let is_left = |event: &PathEvent| event.at_element > element || event.source.line >= line;
        let event = self.events.iter().position(is_left).unwrap_or(self.events.len());
        Ok(Entry { element, event })
    }

    /// Whether an element begins at an offset: compensation is on before it.
    pub fn begins_in_span(&self, element: usize) -> bool {
        !matches!(self.elements[element].role, Role::None | Role::LeadOn)
    }
}

/// The words that are still in force after these events, in the order to send them.
pub fn in_force(events: &[PathEvent]) -> Vec<PathEvent> {
    let mut slots: [Option<PathEvent>; 7] = [None; 7];
    for event in events {
        match event.action {
            Action::ChangeTool { .. } => slots[0] = Some(*event),
            Action::WorkOffset { .. } => slots[1] = Some(*event),
            Action::ToolLength { .. } => slots[2] = Some(*event),
            Action::SpindleSpeed { .. } => slots[3] = Some(*event),
            Action::Spindle(mode) => slots[4] = (mode != SpindleMode::Off).then_some(*event),
            Action::Coolant(CoolantMode::Mist) => slots[5] = Some(*event),
            Action::Coolant(CoolantMode::Flood) => slots[6] = Some(*event),
            Action::Coolant(CoolantMode::Off) => (slots[5], slots[6]) = (None, None),
            _ => {}
        }
        if matches!(event.action, Action::ChangeTool { .. }) {
            // The change stops the spindle.
            slots[4] = None;
        }
    }
    slots.into_iter().flatten().collect()
}
