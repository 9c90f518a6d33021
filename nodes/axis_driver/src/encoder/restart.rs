//! Beginning in the middle of a program.
//!
//! A run may begin at the first element of a source line that is not under cutter
//! compensation. What the words before it have set is sent first: tool (to be
//! confirmed), work system, tool length, spindle, coolant. Dwells, stops and moves are
//! not repeated. The tool must stand where that element starts, in all axes, which is
//! looked at behind the words that move the frame; or, where a height is given at which
//! it is clear of everything, it is lifted there before anything else, goes over the
//! place, and down to it at feed rate.

use super::action::turns;
use super::{EncodeError, Encoder, EncoderConfig};
use cnc_msgs::contour::{Action, CoolantMode};
use cnc_msgs::path::{CompensatedPath, PathElement, PathEvent, Role};
use std::sync::Arc;

/// Why a run cannot begin at a line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StartProblem {
    #[error("the program has no motion from line {line} on; its last is in line {last}")]
    PastEnd { line: u32, last: u32 },
    #[error(
        "line {line} is under cutter compensation: the nearest lines to begin at are {}",
        nearest(*.before, *.after)
    )]
    UnderCompensation {
        line: u32,
        /// Where that begins, and the first behind its end.
        before: u32,
        after: Option<u32>,
    },
    #[error(transparent)]
    Encode(#[from] EncodeError),
}

/// An encoder that begins with the first element of `line` or after it, and the
/// index of that element. Lines 0 and 1 are the whole program.
pub fn start_at(
    path: Arc<CompensatedPath>,
    config: EncoderConfig,
    line: u32,
) -> Result<(Encoder, usize), StartProblem> {
    let mut encoder = Encoder::new(path.clone(), config);
    if line <= 1 {
        return Ok((encoder, 0));
    }
    let last = path.elements.iter().map(|element| element.source.line).max().unwrap_or(0);
    let Some(index) = path.elements.iter().position(|element| element.source.line >= line) else {
        return Err(StartProblem::PastEnd { line, last });
    };
    if !matches!(path.elements[index].role, Role::None | Role::LeadOn) {
        let before = path.elements[..index].iter().rfind(|element| element.role == Role::LeadOn);
        let before = before.map_or(1, |element| element.source.line);
        let is_free = |element: &&PathElement| {
            matches!(element.role, Role::None | Role::LeadOn) && element.source.line > line
        };
        let after = path.elements[index..].iter().find(is_free).map(|element| element.source.line);
        return Err(StartProblem::UnderCompensation { line, before, after });
    }
    encoder.next_element = index;
    encoder.next_event = path
        .events
        .iter()
        .position(|event| event.at_element > index || event.source.line >= line)
        .unwrap_or(path.events.len());
    let restored = in_force(&path.events[..encoder.next_event]);
    let source_place = path.elements[index].source;
    let pushed = match config.approach_z_mm {
        Some(height) => encoder.push_approach(height, &restored, index),
        None => encoder.push_restored(&restored),
    };
    pushed.map_err(|problem| StartProblem::Encode(EncodeError { source_place, problem }))?;
    Ok((encoder, index))
}

fn nearest(before: u32, after: Option<u32>) -> String {
    match after {
        Some(after) => format!("{before}, where it begins, and {after}, where it has ended"),
        None => format!("{before}, where it begins; it does not end before the program does"),
    }
}

/// The words that are still in force after these events, in the order to send them.
fn in_force(events: &[PathEvent]) -> Vec<PathEvent> {
    let mut slots: [Option<PathEvent>; 7] = [None; 7];
    for event in events {
        match event.action {
            Action::ChangeTool { .. } => slots[0] = Some(*event),
            Action::WorkOffset { .. } => slots[1] = Some(*event),
            Action::ToolLength { .. } => slots[2] = Some(*event),
            Action::SpindleSpeed { .. } => slots[3] = Some(*event),
            Action::Spindle(mode) => slots[4] = turns(mode).then_some(*event),
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
