//! Where a run enters a path when it begins at a line of its program.
//!
//! Knows which element and which functions come next, and which words before them are
//! still in force. The planner decides whether a control begins there; the driver decides
//! what to send.

use super::runs::{self, Place, RunOfLine};
use super::{CompensatedPath, PathEvent, Role};
use crate::contour::{Action, CoolantMode, Source, SpindleMode};
use crate::port_word::PortWord;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The place in a path at which a run begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// The first element that is cut.
    pub element: usize,
    /// The first event that happens; of the earlier ones only words stay in force.
    pub event: usize,
    /// In a program with calls or loops.
    pub run: Option<RunOfLine>,
}

/// Why a run cannot enter a path at a line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoEntry {
    /// No element is at or after the line.
    #[error("the program has no motion from line {line} on{}", last_of(*last))]
    PastEnd { line: u32, last: u32 },
    /// A to W alone move there, and a run enters a path at an element.
    #[error(
        "from line {line} on the program turns A to W alone, and a run cannot begin there; the last line that moves X, Y or Z is {last}"
    )]
    TurnsAlone { line: u32, last: u32 },
    #[error("line {line} is run {count} times: {times}")]
    SeveralTimes { line: u32, count: usize, times: String },
    #[error("line {line} is run {}, and the start asks for number {occurrence}", times(*count))]
    TooFew { line: u32, count: usize, occurrence: u32 },
    #[error("the start asks for time {occurrence} of a line, and names no line")]
    NoLine { occurrence: u32 },
    /// With one result less, each would be taken for that of the probe before.
    #[error(
        "line {line} comes after the probe or M66 in line {probed}, and the program goes on from what is measured"
    )]
    SkippedProbe { line: u32, probed: u32 },
}

impl NoEntry {
    /// What to do about it.
    pub fn help(&self) -> String {
        match self {
            Self::PastEnd { last: 0, .. } | Self::TurnsAlone { last: 0, .. } => {
                "begin at the start of the program (kerf run)".into()
            }
            Self::PastEnd { last, .. } | Self::TurnsAlone { last, .. } => {
                format!("begin at line {last} or before")
            }
            Self::SeveralTimes { count, .. } | Self::TooFew { count, .. } => {
                format!("say which one, from 1 to {count}: --occurrence, or occurrence of the goal")
            }
            Self::NoLine { .. } => "say which line: --start-line, or start_line of the goal".into(),
            Self::SkippedProbe { probed, .. } => format!("begin at line {probed} or before"),
        }
    }
}

fn last_of(last: u32) -> String {
    if last == 0 { String::new() } else { format!("; its last is in line {last}") }
}

fn times(count: usize) -> String {
    if count == 1 { "once".into() } else { format!("{count} times") }
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
    /// line or of a later one, the corner that belongs to its block included. `occurrence` says
    /// which time that a program with calls or loops runs the line, from 1; 0: the only one.
    ///
    /// # Errors
    /// No element is of that line or of a later one, or the line is not run so often, or several
    /// times where none of them was asked for; or a probe comes before it, and the program goes on with
    /// the results of probes.
    pub fn entry(&self, line: u32, occurrence: u32) -> Result<Entry, NoEntry> {
        let entry = self.find_entry(line, occurrence);
        let skipped = match &entry {
            Ok(entry) => &self.events[..entry.event],
            Err(NoEntry::PastEnd { .. } | NoEntry::TurnsAlone { .. }) => &self.events[..],
            Err(_) => &[],
        };
        let is_stretch = |event: &PathEvent| matches!(event.action, Action::Stretch { .. });
        let is_input = |action: &Action| PortWord::of(action).is_some_and(|it| it.reads());
        let is_probe = |event: &&PathEvent| {
            matches!(event.action, Action::Probe(_)) || is_input(&event.action)
        };
        match skipped.iter().find(is_probe).filter(|_| self.events.iter().any(is_stretch)) {
            Some(probe) => Err(NoEntry::SkippedProbe { line, probed: probe.source.line }),
            None => entry,
        }
    }

    fn find_entry(&self, line: u32, occurrence: u32) -> Result<Entry, NoEntry> {
        if line == 0 && occurrence > 1 {
            return Err(NoEntry::NoLine { occurrence });
        }
        if !self.calls.is_empty() {
            return self.entry_in_calls(line, occurrence);
        }
        if occurrence > 1 {
            return Err(NoEntry::TooFew { line, count: 1, occurrence });
        }
        let element = self.elements.iter().position(|element| element.source.line >= line);
        let Some(element) = element else { return Err(self.past_end(line)) };
        let is_left = |event: &PathEvent| event.at_element > element || event.source.line >= line;
        let event = self.events.iter().position(is_left).unwrap_or(self.events.len());
        Ok(Entry { element, event, run: None })
    }

    fn past_end(&self, line: u32) -> NoEntry {
        let last = self.elements.iter().map(|element| element.source.line).max().unwrap_or(0);
        let turns = self
            .events
            .iter()
            .any(|event| matches!(event.action, Action::Further(_)) && event.source.line >= line);
        match turns {
            true => NoEntry::TurnsAlone { line, last },
            false => NoEntry::PastEnd { line, last },
        }
    }

    fn entry_in_calls(&self, line: u32, occurrence: u32) -> Result<Entry, NoEntry> {
        let Some((line, runs)) = runs::runs_from(line, self.in_order(), &self.calls) else {
            return Err(self.past_end(line));
        };
        let count = runs.len();
        let (run, Place { element, event }) = match (occurrence, runs.as_slice()) {
            (0, [only]) => *only,
            (0, _) => {
                let times = runs::text(&runs, &self.calls);
                return Err(NoEntry::SeveralTimes { line, count, times });
            }
            (number, runs) => {
                let run = runs.get(number as usize - 1);
                *run.ok_or(NoEntry::TooFew { line, count, occurrence })?
            }
        };
        let (element, event) = (element as usize, event as usize);
        match element < self.elements.len() {
            true => Ok(Entry { element, event, run: Some(run) }),
            false => Err(self.past_end(line)),
        }
    }

    /// Which time the line of something in this path is run there, from 1, as [`Self::entry`] counts; 0: the
    /// only one, or it is not in the path.
    pub fn occurrence(&self, source: Source) -> u32 {
        self.occurrence_where(source.line, |(run, _)| run.row() == source.call)
    }

    /// The last time that a line is run no later than where a run enters, or at all; 0: the only one,
    /// or there is none.
    pub fn last_occurrence(&self, line: u32, until: Option<&Entry>) -> u32 {
        let until = until.map(|entry| (entry.element, entry.event));
        self.occurrence_where(line, |(_, Place { element, event })| {
            until.is_none_or(|until| (*element as usize, *event as usize) <= until)
        })
    }

    fn occurrence_where(&self, line: u32, is_meant: impl Fn(&(RunOfLine, Place)) -> bool) -> u32 {
        if self.calls.is_empty() {
            return 0;
        }
        let runs = runs::runs_from(line, self.in_order(), &self.calls);
        let runs = runs.map(|(_, runs)| runs).filter(|runs| runs.len() > 1).unwrap_or_default();
        runs.iter().rposition(is_meant).map_or(0, |index| index as u32 + 1)
    }

    /// Events and elements in the order in which they happen.
    fn in_order(&self) -> impl Iterator<Item = (Place, Source)> {
        let mut here = Place { element: 0, event: 0 };
        std::iter::from_fn(move || {
            let place = here;
            let (element, event) = (here.element as usize, here.event as usize);
            let next = self.events.get(event).filter(|next| next.at_element <= element);
            let source = match (next, self.elements.get(element)) {
                (Some(next), _) => {
                    here.event += 1;
                    next.source
                }
                (None, Some(next)) => {
                    here.element += 1;
                    next.source
                }
                (None, None) => return None,
            };
            Some((place, source))
        })
    }

    /// Whether an element begins at an offset: compensation is on before it.
    pub fn begins_in_span(&self, element: usize) -> bool {
        !matches!(self.elements[element].role, Role::None | Role::LeadOn)
    }
}

/// The words that are still in force after these events, in the order to send them, before an element. Outputs
/// follow tool and frame; one that is switched with that element keeps its word.
pub fn in_force(events: &[PathEvent], element: usize) -> Vec<PathEvent> {
    let mut slots: [Option<PathEvent>; 7] = [None; 7];
    let mut outputs: BTreeMap<(bool, u32), PathEvent> = BTreeMap::new();
    for event in events {
        match event.action {
            Action::ChangeTool { .. } => slots[0] = Some(*event),
            Action::WorkOffset { .. } => slots[1] = Some(*event),
            Action::ToolLength { .. } => slots[2] = Some(*event),
            Action::SpindleSpeed { .. } => slots[3] = Some(*event),
            // G96: the speed follows from X.
            Action::Auxiliary { letter: 'G', number: 96.0, .. } => slots[3] = None,
            Action::Spindle(mode) => slots[4] = (mode != SpindleMode::Off).then_some(*event),
            Action::Coolant(CoolantMode::Mist) => slots[5] = Some(*event),
            Action::Coolant(CoolantMode::Flood) => slots[6] = Some(*event),
            Action::Coolant(CoolantMode::Off) => (slots[5], slots[6]) = (None, None),
            _ => {
                if let Some(word) = PortWord::of(&event.action)
                    && let Some(action) = word.at_once()
                {
                    let waits = word.is_with_motion() && event.at_element == element;
                    let action = if waits { event.action } else { action };
                    outputs.insert((word.is_analog, word.port), PathEvent { action, ..*event });
                }
            }
        }
        if matches!(event.action, Action::ChangeTool { .. }) {
            // The change stops the spindle.
            slots[4] = None;
        }
    }
    let [tool, system, length, others @ ..] = slots;
    let frame = [tool, system, length].into_iter().flatten();
    frame.chain(outputs.into_values()).chain(others.into_iter().flatten()).collect()
}
