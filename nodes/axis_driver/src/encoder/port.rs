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

    /// Whether a board with these has what a word needs.
    ///
    /// # Errors
    /// It has not.
    pub(crate) fn check(&self, word: &PortWord, action: &Action) -> Result<(), EncodeProblem> {
        let is_input = matches!(word.what, PortUse::Read { .. });
        let count = match (word.is_analog, is_input) {
            (false, true) => self.digital_in,
            (false, false) => self.digital_out,
            (true, true) => self.analog_in,
            (true, false) => self.analog_out,
        };
        if word.port < u32::from(count) {
            return Ok(());
        }
        Err(EncodeProblem::NoPort { word: action.text(), needs: word.name(), count })
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
        let mut text: String = action.text().split(' ').collect();
        let kind = match word.what {
            PortUse::Switch { with_motion: true, .. } if !self.moves_again() => {
                return Err(EncodeProblem::NoMotionAfter { word: action.text() });
            }
            // grblHAL keeps it for the next motion that it plans.
            PortUse::Switch { with_motion: true, .. } => {
                return self.push_action(text, LineKind::Slow, false, source);
            }
            PortUse::Switch { .. } => LineKind::Slow,
            PortUse::Read { seconds, .. } => {
                if !text.contains('L') {
                    text += "L0";
                }
                if !(0.0..=DWELL_S_MAX).contains(&seconds) {
                    return Err(EncodeProblem::Dwell { value: seconds, max: DWELL_S_MAX });
                }
                let kind = LineKind::Dwell { milliseconds: (seconds * 1e3) as u32 };
                self.push_action(text, kind, false, source)?;
                if let Some(EncoderStep::Line(line)) = self.pending.pop_back() {
                    self.pending.push_back(EncoderStep::ReadInput { line });
                }
                return Ok(());
            }
        };
        // It does it as soon as it has read the line: the motion before has to end first.
        let waits = LineKind::Dwell { milliseconds: 0 };
        self.push_action("G4P0".into(), waits, false, source)?;
        self.push_action(text, kind, false, source)
    }

    /// Whether the axes move after the event that is being encoded.
    fn moves_again(&self) -> bool {
        // G28 and G30 do not switch in grblHAL.
        let moves =
            |action: &Action| matches!(action, Action::MachineMove { .. } | Action::Further(_));
        self.next_element < self.path.elements.len()
            || self.path.events[self.next_event..].iter().any(|event| moves(&event.action))
    }
}
