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
        let count = match (word.is_analog, word.reads()) {
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
            PortUse::Read { seconds, .. } if !(0.0..=DWELL_S_MAX).contains(&seconds) => {
                Err(EncodeProblem::Dwell { value: seconds, max: DWELL_S_MAX })
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
        if let Some(word) = PortWord::of(action) {
            return self.encode_port(&word, action, source);
        }
        match self.allowed_overrides.after(action) {
            Some(allowed) => {
                self.allow_overrides(allowed?, source);
                Ok(())
            }
            None => Err(EncodeProblem::not_here(action)),
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
            PortUse::Read { seconds } => {
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
                let Some(at_once) = word.at_once() else { return Ok(()) };
                let text = as_sent(&at_once);
                if !with_motion {
                    return self.switch(&[text], source);
                }
                self.outputs.push(HeldOutput { word: action.text(), text, source });
                Ok(())
            }
        }
    }

    /// Switches what waits for the motion that comes now, as a part of its block.
    pub(super) fn push_outputs(&mut self, source: Source) -> Result<(), EncodeProblem> {
        let outputs = std::mem::take(&mut self.outputs);
        let texts: Vec<String> = outputs.into_iter().map(|held| held.text).collect();
        self.switch(&texts, source)
    }

    /// M64 and its like act as soon as they are read, so the motion before has to end first. M62 would not need that, but
    /// what it has not switched yet at a reset is switched at the first motion after it, or crashes the firmware.
    /// The report: docs/upstream/grblhal-output-commands.md.
    fn switch(&mut self, texts: &[String], source: Source) -> Result<(), EncodeProblem> {
        if !texts.is_empty() {
            let waits = LineKind::Dwell { milliseconds: 0 };
            self.push_action("G4P0".into(), waits, false, source)?;
        }
        for text in texts {
            self.push_action(text.clone(), LineKind::Slow, false, source)?;
        }
        Ok(())
    }

    /// What waits for a motion at the end of the path, if none can follow: after a stretch one may.
    pub(super) fn useless_output(&mut self) -> Option<HeldOutput> {
        let goes_on = matches!(
            self.path.events.last().map(|event| event.action),
            Some(Action::Stretch { .. })
        );
        self.outputs.pop().filter(|_| !goes_on)
    }
}

/// An output that is switched when the next motion begins.
#[derive(Debug, Clone)]
pub(super) struct HeldOutput {
    /// As the program says it: `M62 P1`.
    pub(super) word: String,
    /// As it is sent: `M64P1`.
    text: String,
    pub(super) source: Source,
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
