//! M62 to M68: outputs and inputs of the board, as grblHAL has them.

use super::action::DWELL_S_MAX;
use super::{EncodeProblem, Encoder, EncoderStep, UserFunction};
use crate::link::LineKind;
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::port_word::{PortUse, PortWord};
use serde::{Deserialize, Serialize};

/// How many of each a board has for programs: `[AUX IO:2,4,0,1]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Ports {
    pub digital_in: u8,
    pub digital_out: u8,
    pub analog_in: u8,
    pub analog_out: u8,
}

impl From<[u8; 4]> for Ports {
    fn from([digital_in, digital_out, analog_in, analog_out]: [u8; 4]) -> Self {
        Self { digital_in, digital_out, analog_in, analog_out }
    }
}

impl Ports {
    pub(crate) fn are_none(&self) -> bool {
        *self == Self::default()
    }

    /// Whether a board with these does what a word says.
    ///
    /// # Errors
    /// It does not.
    pub(crate) fn check(&self, word: &PortWord, action: &Action) -> Result<(), EncodeProblem> {
        let is_input = matches!(word.what, PortUse::Read { .. });
        let count = match (word.is_analog, is_input) {
            (false, true) => self.digital_in,
            (false, false) => self.digital_out,
            (true, true) => self.analog_in,
            (true, false) => self.analog_out,
        };
        if word.port >= u32::from(count) {
            return Err(EncodeProblem::NoPort { word: action.text(), needs: word.name(), count });
        }
        match word.what {
            PortUse::Switch { value, .. } if value != f64::from(value as i32) => {
                let (word, takes) = (action.text(), value as i32);
                Err(EncodeProblem::WholeOutput { word, takes })
            }
            _ => Ok(()),
        }
    }
}

impl Encoder {
    /// A word that only the machine understands.
    pub(super) fn encode_auxiliary(
        &mut self,
        action: &Action,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        if let Some(function) = UserFunction::of(action) {
            return self.encode_user_function(function, source);
        }
        match PortWord::of(action) {
            Some(word) => self.encode_port(&word, action, source),
            None => Err(EncodeProblem::Unsupported { word: action.text() }),
        }
    }

    fn encode_port(
        &mut self,
        word: &PortWord,
        action: &Action,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        self.config.board.ports.check(word, action)?;
        match word.what {
            PortUse::Read { seconds, .. } => {
                if !(0.0..=DWELL_S_MAX).contains(&seconds) {
                    return Err(EncodeProblem::Dwell { value: seconds, max: DWELL_S_MAX });
                }
                let mut text = as_sent(action);
                if !text.contains('L') {
                    text += "L0";
                }
                let kind = LineKind::Dwell { milliseconds: (seconds * 1e3) as u32 };
                self.push_action(text, kind, false, source)?;
                if let Some(EncoderStep::Line(line)) = self.pending.pop_back() {
                    self.pending.push_back(EncoderStep::ReadInput { line });
                }
                Ok(())
            }
            PortUse::Switch { with_motion, .. } => {
                if with_motion && !self.moves_again() {
                    return Err(EncodeProblem::NoMotionAfter { word: action.text() });
                }
                let text = word.at_once().map(|at_once| as_sent(&at_once));
                let output = text.map(|text| HeldOutput { text, source });
                if !with_motion {
                    return self.switch(output.into_iter().collect());
                }
                self.outputs.extend(output);
                Ok(())
            }
        }
    }

    /// Switches what waits for the motion that comes now.
    pub(super) fn push_outputs(&mut self) -> Result<(), EncodeProblem> {
        let outputs = std::mem::take(&mut self.outputs);
        self.switch(outputs)
    }

    /// M64 and its like act as soon as they are read, so the motion before has to end first. M62 would not need that, but
    /// what it has not switched yet at a reset is switched at the first motion after it, or crashes the firmware.
    /// The report: docs/upstream/grblhal-output-commands.md.
    fn switch(&mut self, outputs: Vec<HeldOutput>) -> Result<(), EncodeProblem> {
        if let Some(first) = outputs.first() {
            let waits = LineKind::Dwell { milliseconds: 0 };
            self.push_action("G4P0".into(), waits, false, first.source)?;
        }
        for HeldOutput { text, source } in outputs {
            self.push_action(text, LineKind::Slow, false, source)?;
        }
        Ok(())
    }

    /// Whether the axes move after the event that is being encoded.
    fn moves_again(&self) -> bool {
        self.next_element < self.path.elements.len()
            || self.path.events[self.next_event..].iter().any(|event| begins_motion(&event.action))
    }
}

/// An output that is switched when the next motion begins.
#[derive(Debug, Clone)]
pub(super) struct HeldOutput {
    /// `M64P1`
    text: String,
    source: Source,
}

/// Whether an action is a motion, or the first part of one. G28 and G30 switch no outputs in grblHAL.
pub(super) fn begins_motion(action: &Action) -> bool {
    matches!(
        action,
        Action::MachineMove { .. }
            | Action::Further(_)
            | Action::Probe(_)
            | Action::SpindleSync { .. }
            | Action::Relative { .. }
    )
}

/// `M64P1`
fn as_sent(action: &Action) -> String {
    action.text().split(' ').collect()
}
