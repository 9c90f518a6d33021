//! The `$` commands.

use super::action::Action;
use super::{Controller, ControllerState};
use crate::codes::ErrorCode;
use crate::firmware::Feedback;
use crate::gcode::{CoordinateSystems, Digits, read_number};
use crate::homing::Homing;
use crate::settings::Settings;

/// Characters of a stored line.
const STORED_CHARACTERS_MAX: usize = 79;

impl Controller {
    /// Executes the command after a `$`; the caller answers.
    pub(super) fn system_command(&mut self, command: &str) -> Result<(), ErrorCode> {
        if self.state == (ControllerState::Alarm { is_critical: true }) && !is_harmless(command) {
            return Err(ErrorCode::CriticalEvent);
        }
        match command {
            "" => {
                self.report_help();
                return Ok(());
            }
            "$" if matches!(self.state, ControllerState::Run) => return Err(ErrorCode::NotIdle),
            "$" => {
                self.report_settings();
                return Ok(());
            }
            "G" => {
                self.report_parser_state();
                return Ok(());
            }
            "C" => return self.toggle_check(),
            "X" => return self.unlock(),
            _ => {}
        }
        if let Some(jog) = command.strip_prefix('J') {
            if !matches!(self.state, ControllerState::Idle | ControllerState::Jog { .. }) {
                return Err(ErrorCode::NotIdle);
            }
            let text = jog.strip_prefix('=').ok_or(ErrorCode::InvalidStatement)?;
            return self.jog(text);
        }
        if matches!(command.as_bytes()[0], b'$' | b'G' | b'C' | b'X') {
            return Err(ErrorCode::InvalidStatement);
        }
        if !matches!(self.state, ControllerState::Idle | ControllerState::Alarm { .. }) {
            return Err(ErrorCode::NotIdle);
        }
        match command {
            "#" => self.report_offsets(),
            "H" => return self.start_homing(),
            "SLP" if !(self.traits().may_sleep)(&self.memory.settings) => {
                return Err(ErrorCode::InvalidStatement);
            }
            "SLP" => self.script.push_back(Action::Sleep),
            "I" => self.report_build(),
            "N" => self.report_startup_lines(),
            _ if command.starts_with("I=") => {
                self.memory.build_info = stored(&command[2..])?;
            }
            _ if command.starts_with("RST=") => return self.restore(&command[4..]),
            _ if command.starts_with('N') => return self.store_startup_line(&command[1..]),
            _ => return self.store_setting(command),
        }
        Ok(())
    }

    fn toggle_check(&mut self) -> Result<(), ErrorCode> {
        match self.state {
            ControllerState::Check => {
                self.feedback(Feedback::CheckOff);
                self.script.push_back(Action::Restart);
            }
            ControllerState::Idle => {
                self.state = ControllerState::Check;
                self.feedback(Feedback::CheckOn);
            }
            _ => return Err(ErrorCode::NotIdle),
        }
        Ok(())
    }

    fn unlock(&mut self) -> Result<(), ErrorCode> {
        if matches!(self.state, ControllerState::Alarm { .. }) {
            if self.plant.is_door_open {
                return Err(ErrorCode::DoorOpen);
            }
            if self.memory.settings.homing_required() && !self.is_homed {
                return Err(ErrorCode::HomingRequired);
            }
            self.feedback(Feedback::Unlocked);
            self.alarm = None;
            self.state = ControllerState::Idle;
        }
        Ok(())
    }

    fn start_homing(&mut self) -> Result<(), ErrorCode> {
        if !self.memory.settings.homing_enabled() {
            return Err(ErrorCode::HomingDisabled);
        }
        if self.plant.is_door_open {
            return Err(ErrorCode::DoorOpen);
        }
        self.state = ControllerState::Homing(Homing::new(self.axes(), &self.memory.settings));
        if self.traits().announces_homing {
            self.report_status_now();
        }
        self.queue_startup_lines();
        Ok(())
    }

    /// `$RST=`: settings, offsets, or everything; then a reset.
    fn restore(&mut self, what: &str) -> Result<(), ErrorCode> {
        let (settings, offsets) = match what {
            "$" => (true, false),
            "#" => (false, true),
            "*" => (true, true),
            _ => return Err(ErrorCode::InvalidStatement),
        };
        if settings {
            self.memory.settings = self.build.settings.clone();
        }
        if offsets {
            self.memory.systems = CoordinateSystems::default();
        }
        if settings && offsets {
            self.memory.startup = Default::default();
            self.memory.build_info.clear();
        }
        self.feedback(Feedback::RestoringDefaults);
        self.script.push_back(Action::Restart);
        Ok(())
    }

    /// `$n=v`.
    fn store_setting(&mut self, command: &str) -> Result<(), ErrorCode> {
        if !command.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) {
            return Err(self.traits().unknown_command);
        }
        let (number, value) = parse_setting(command, self.vocabulary().digits)?;
        let steps_before = self.memory.settings.steps_per_mm();
        self.memory.settings.set(number, value)?;
        if self.memory.settings.steps_per_mm() != steps_before {
            // The step counts stay; the millimetres they stand for have changed.
            self.sync_parser();
        }
        Ok(())
    }

    /// `$N0=` and `$N1=`: the line is executed, then stored.
    fn store_startup_line(&mut self, command: &str) -> Result<(), ErrorCode> {
        if self.state != ControllerState::Idle {
            return Err(ErrorCode::NotIdle);
        }
        let (number, rest) =
            read_number(command, self.vocabulary().digits).ok_or(ErrorCode::BadNumber)?;
        let text = rest.strip_prefix('=').ok_or(ErrorCode::InvalidStatement)?;
        let index = match number.trunc() as i64 {
            0 => 0,
            1 => 1,
            _ => return Err(ErrorCode::InvalidStatement),
        };
        let text = stored(text)?;
        self.block(&text)?;
        self.script.push_back(Action::StoreStartup { index, text });
        Ok(())
    }

    pub(super) fn queue_startup_lines(&mut self) {
        let lines = (0..self.memory.startup.len()).filter(|&i| !self.memory.startup[i].is_empty());
        self.script.extend(lines.map(Action::Startup));
    }

    pub(super) fn run_startup_line(&mut self, index: usize) {
        let text = self.memory.startup[index].clone();
        let later = std::mem::take(&mut self.script);
        let answer = self.block(&text);
        self.script.push_back(Action::Echo { text, answer });
        self.script.extend(later);
    }
}

/// Does a `$` command only report something?
fn is_harmless(command: &str) -> bool {
    matches!(command, "" | "$" | "G" | "#" | "I" | "N")
}

fn stored(text: &str) -> Result<String, ErrorCode> {
    if text.len() > STORED_CHARACTERS_MAX {
        return Err(ErrorCode::StoredLineTooLong);
    }
    Ok(text.to_string())
}

/// Reads `n=v`.
fn parse_setting(text: &str, digits: Digits) -> Result<(u16, f64), ErrorCode> {
    let (number, rest) = read_number(text, digits).ok_or(ErrorCode::BadNumber)?;
    let value = rest.strip_prefix('=').ok_or(ErrorCode::InvalidStatement)?;
    let (value, rest) = read_number(value, digits).ok_or(ErrorCode::BadNumber)?;
    if !rest.is_empty() || !(0.0..=65535.0).contains(&number) {
        return Err(ErrorCode::InvalidStatement);
    }
    Ok((number.trunc() as u16, value))
}

impl Settings {
    /// Stores a line `$n=v`, blanks allowed.
    ///
    /// # Errors
    /// The firmware rejects the line; the code is what it would answer.
    pub fn set_line(&mut self, line: &str) -> Result<(), ErrorCode> {
        let line: String = line.chars().filter(|c| !c.is_whitespace()).collect();
        let text = line.strip_prefix('$').ok_or(ErrorCode::InvalidStatement)?;
        let digits = self.firmware().traits().vocabulary.digits;
        let (number, value) = parse_setting(text, digits)?;
        self.set(number, value)
    }
}
