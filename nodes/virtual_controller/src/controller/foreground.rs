//! The main loop: takes lines from the receive buffer and has them worked off.
//!
//! Every line becomes a script of actions that ends with its answer. What an
//! action does is in `action`.

use super::{Controller, State};
use crate::codes::ErrorCode;
use crate::firmware::Hearing;
use crate::line::Line;

impl Controller {
    /// What gets through to the controller as it is now.
    pub(super) fn hearing(&self) -> Hearing {
        match self.state {
            State::Alarm { is_critical: true } => self.traits().critical_hearing,
            State::Sleep => self.traits().sleep_hearing,
            State::Off => Hearing::Nothing,
            State::Hold { .. }
            | State::Door(_)
            | State::Starting { .. }
            | State::Tool
            | State::SoftLimit
            | State::Stopping
            | State::Homing(_)
            | State::Jog { is_cancelled: true } => Hearing::Realtime,
            _ => Hearing::Lines,
        }
    }

    /// Does everything that can be done without time passing.
    pub(super) fn work(&mut self) {
        while self.hearing() == Hearing::Lines && !self.is_transmit_full() {
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
        if self.hearing() == Hearing::RealtimeAndDiscard {
            self.receive_buffer.clear();
        }
        if self.state == State::Idle && !self.planner.is_empty() {
            self.state = State::Run;
        }
    }

    fn line(&mut self, line: Line) {
        self.counts.lines_read += 1;
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
        matches!(self.state, State::Alarm { .. } | State::Jog { .. } | State::Sleep)
    }
}
