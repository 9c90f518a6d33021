//! The main loop: reads lines from the receive buffer and executes them.
//!
//! Every line becomes a script of actions that ends with its answer. `action` executes them.

use super::{Controller, ControllerState};
use crate::codes::ErrorCode;
use crate::firmware::AcceptedInput;
use crate::line::Line;

impl Controller {
    /// Which input the controller accepts in its present state.
    pub(super) fn accepted_input(&self) -> AcceptedInput {
        match self.state {
            ControllerState::Alarm { is_critical: true } => self.traits().critical_alarm_input,
            ControllerState::Sleep => self.traits().sleep_input,
            ControllerState::Off => AcceptedInput::Nothing,
            ControllerState::Hold { .. }
            | ControllerState::Door(_)
            | ControllerState::Starting { .. }
            | ControllerState::Tool
            | ControllerState::SoftLimit
            | ControllerState::Stopping
            | ControllerState::Homing(_)
            | ControllerState::Jog { is_cancelled: true } => AcceptedInput::Realtime,
            _ => AcceptedInput::Lines,
        }
    }

    /// Does all work that takes no time.
    pub(super) fn work(&mut self) {
        while self.accepted_input() == AcceptedInput::Lines && !self.is_transmit_full() {
            if let Some(action) = self.script.pop_front() {
                if let Some(unfinished) = self.perform(action) {
                    self.script.push_front(unfinished);
                    break;
                }
            } else if let Some(byte) = self.receive_buffer.pop() {
                if let Some(line) = self.reader.take(byte, &mut self.transmit) {
                    self.line(line);
                }
            } else {
                break;
            }
        }
        if self.accepted_input() == AcceptedInput::RealtimeAndDiscard {
            self.receive_buffer.clear();
        }
        if self.state == ControllerState::Idle && !self.planner.is_empty() {
            self.state = ControllerState::Run;
        }
        self.switch_planned();
    }

    fn line(&mut self, line: Line) {
        self.counts.lines_read += 1;
        if self.build.echoes_lines {
            self.echo(&line);
        }
        let result = match line {
            Line::TooLong => Err(ErrorCode::LineTooLong),
            Line::Text(text) if text.is_empty() => Ok(()),
            Line::Remark => self.sticky_error.map_or(Ok(()), Err),
            Line::Text(text) => match text.strip_prefix('$') {
                Some(command) => self.system_command(command),
                None if self.is_locked() => Err(ErrorCode::Locked),
                None => match self.sticky_error {
                    Some(error) => Err(error),
                    None => self.block(&text),
                },
            },
        };
        if self.traits().errors_stick {
            self.sticky_error = result.err();
        }
        if result.is_err() {
            self.reader.line_was_wrong();
        }
        let at = self.script.iter().position(super::Action::comes_after_answer);
        let at = at.unwrap_or(self.script.len());
        self.script.insert(at, super::Action::Answer(result));
    }

    /// Is G-code locked out?
    fn is_locked(&self) -> bool {
        matches!(
            self.state,
            ControllerState::Alarm { .. } | ControllerState::Jog { .. } | ControllerState::Sleep
        )
    }
}
