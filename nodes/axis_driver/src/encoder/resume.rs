//! Going on after a tool change in which something was done by hand: the words in force are
//! said again, and the tool goes back to where the run stopped.

use super::action::word_after;
use super::config::Board;
use super::{EncodeProblem, Encoder, EncoderStep, PREAMBLE_IN_FRAME};
use crate::link::LineKind;
use cnc_msgs::contour::{Action, CoolantMode, Source, work_system};
use cnc_msgs::geometry::{AxisSet, Plane, Position};
use cnc_msgs::path::{CompensatedPath, in_force};

/// Less than this is no move, mm.
const STEP_MM: f64 = 1e-4;

impl Encoder {
    /// The frame of these axes was set by hand: where they are in it the program has not
    /// said.
    pub(crate) fn forget_frame(&mut self, axes: AxisSet) {
        if !axes.is_empty() {
            self.modal.forget(axes, "the work offset that was set while the tool was changed");
        }
    }

    /// The controller as it is from here on: a work offset may have been set.
    pub(crate) fn take_board(&mut self, board: Board) {
        self.config.board = board;
    }

    /// The tool length that a block by hand has set last, if any has, stays in force.
    pub(crate) fn take_tool_length(&mut self, block: &CompensatedPath) {
        let set = block.events.iter().rev().find_map(|event| match event.action {
            Action::ToolLength { offset, length_mm, .. } => Some((offset, length_mm, event.action)),
            _ => None,
        });
        if let Some((offset, length_mm, action)) = set {
            self.modal.tool_length =
                offset.map(|_| tool_length_word(length_mm)).unwrap_or_default();
            self.modal.tool_length_mm = if offset.is_some() { length_mm } else { 0.0 };
            self.modal.forget(AxisSet::from_bits(0b100), &action.text());
        }
    }

    /// Says the words in force, before all that comes next; then goes back to a place of the
    /// machine frame from another, where one is given: Z up first if the place is higher, Z
    /// last if it is lower.
    pub(crate) fn go_on_after_change(
        &mut self,
        back: Option<(Position, Position)>,
    ) -> Result<(), EncodeProblem> {
        let next = std::mem::take(&mut self.pending);
        let pushed = self.push_words().and_then(|()| match back {
            Some((stood, at)) => self.push_return(stood, at),
            None => Ok(()),
        });
        match pushed {
            Ok(()) => self.pending.extend(next),
            Err(_) => self.pending = next,
        }
        pushed
    }

    fn push_words(&mut self) -> Result<(), EncodeProblem> {
        let source = self.source_of_change();
        let system = self.modal.work_system.max(1);
        let words = format!("{PREAMBLE_IN_FRAME}{}", work_system(system));
        self.push_action(words, LineKind::Motion, true, source)?;
        let length = match self.modal.tool_length.as_str() {
            "" => "G49".to_owned(),
            length => length.to_owned(),
        };
        self.push_action(length, LineKind::Motion, false, source)?;
        // The change has stopped the spindle; a block by hand may have started it.
        self.push_action("M5".into(), LineKind::Slow, false, source)?;
        let events = in_force(&self.path.events[..self.next_event], self.next_element);
        let mut is_dry = true;
        for event in events {
            match event.action {
                Action::SpindleSpeed { rpm } => {
                    self.push_action(word_after("", 'S', rpm), LineKind::Slow, false, source)?;
                }
                Action::Coolant(mode) if mode != CoolantMode::Off => {
                    is_dry = false;
                    self.encode_action(&event)?;
                }
                _ => {}
            }
        }
        if is_dry {
            self.push_action("M9".into(), LineKind::Slow, false, source)?;
        }
        // The next line says its motion, feed rate and plane.
        (self.modal.motion, self.modal.feed) = (None, None);
        self.modal.is_inverse_time = false;
        self.modal.plane = Plane::default();
        Ok(())
    }

    fn push_return(&mut self, stood: Position, at: Position) -> Result<(), EncodeProblem> {
        let source = self.source_of_change();
        let (unknown, since) = (self.modal.unknown, self.modal.unknown_since.clone());
        let off = |axis: usize| (stood[axis] - at[axis]).abs() > STEP_MM;
        let z = AxisSet::NONE.with(2);
        let across = (0..2).filter(|axis| off(*axis)).fold(AxisSet::NONE, AxisSet::with);
        let feed = self.plunge_feed(self.next_element);
        if off(2) && stood[2] > at[2] {
            self.encode_machine_move(stood, z, None, source)?;
        }
        self.encode_machine_move(stood, across, None, source)?;
        if off(2) && stood[2] < at[2] {
            self.encode_machine_move(stood, z, feed, source)?;
        }
        // It stands where the program has left it.
        (self.modal.unknown, self.modal.unknown_since) = (unknown, since);
        self.pending.push_back(EncoderStep::CheckReturn { stood });
        Ok(())
    }

    /// The event that was encoded last is the change.
    fn source_of_change(&self) -> Source {
        let last = self.next_event.checked_sub(1).and_then(|index| self.path.events.get(index));
        last.map(|event| event.source).unwrap_or_default()
    }
}

/// `G43.1Z12.5`
fn tool_length_word(length_mm: f64) -> String {
    word_after("G43.1", 'Z', length_mm)
}
