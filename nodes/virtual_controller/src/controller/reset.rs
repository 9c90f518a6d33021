//! Resets, alarms and switching on.

use super::overrides::OverrideFlags;
use super::report::Cadence;
use super::{Controller, ControllerState, Door};
use crate::codes::Alarm;
use crate::firmware::{AcceptedInput, Feedback};
use crate::gcode::{Coolant, ParserState, Spindle};
use crate::motion::{Overrides, mm_from_steps};

impl Controller {
    pub(super) fn switch_off(&mut self) {
        self.spindle = Spindle::Off;
        self.coolant = Coolant::default();
    }

    /// A limit switch closed while hard limits are on.
    pub(super) fn hit_limit(&mut self) {
        if !matches!(self.state, ControllerState::Off | ControllerState::Alarm { .. }) {
            self.critical(Alarm::HARD_LIMIT);
        }
    }

    /// Stops dead; nothing but a reset is accepted afterwards.
    pub(super) fn critical(&mut self, alarm: Alarm) {
        self.stop_dead();
        self.state = ControllerState::Alarm { is_critical: true };
        if self.accepted_input() != AcceptedInput::ResetOnly {
            // Lines that were still queued are never answered.
            self.forget_input();
        }
        self.alarm(alarm);
        self.feedback(match alarm {
            Alarm::EMERGENCY_STOP => Feedback::EmergencyStop,
            _ => Feedback::ResetToContinue,
        });
    }

    /// Raises `ALARM:N` as the firmware does: some are critical, some reset, all lock.
    pub fn raise_alarm(&mut self, number: u8) {
        let alarm = Alarm(number);
        if matches!(self.state, ControllerState::Off | ControllerState::Alarm { is_critical: true })
        {
            return;
        }
        if self.traits().critical_alarms.contains(&number) {
            return self.critical(alarm);
        }
        let begins_again = matches!(
            alarm,
            Alarm::ABORTED_IN_MOTION
                | Alarm::HOMING_RESET
                | Alarm::HOMING_DOOR
                | Alarm::HOMING_PULL_OFF
                | Alarm::HOMING_APPROACH
        );
        if begins_again {
            self.alarm(alarm);
            return self.restart(true);
        }
        self.stop_dead();
        self.sync_parser();
        // The line in work ends here and gets its answer.
        self.script.retain(super::Action::is_answer);
        self.state = ControllerState::Alarm { is_critical: false };
        self.alarm(alarm);
        self.work();
    }

    /// Stops steps, spindle and coolant at once.
    fn stop_dead(&mut self) {
        self.forget_motion();
        self.probing = None;
        self.switch_off();
    }

    /// Drops what has been received and not answered.
    pub(super) fn forget_input(&mut self) {
        self.script.clear();
        self.receive_buffer.clear();
        self.reader.clear();
    }

    pub(super) fn fail_homing(&mut self, alarm: Alarm) {
        self.alarm(alarm);
        self.restart(true);
    }

    /// 0x18.
    pub(super) fn soft_reset(&mut self) {
        let alarm = match self.state {
            ControllerState::Homing(_) => Some(Alarm::HOMING_RESET),
            ControllerState::Run
            | ControllerState::Jog { .. }
            | ControllerState::SoftLimit
            | ControllerState::Stopping => Some(Alarm::ABORTED_IN_MOTION),
            ControllerState::Hold { is_stopped: false }
            | ControllerState::Door(Door::Stopping { .. }) => Some(Alarm::ABORTED_IN_MOTION),
            ControllerState::Door(Door::Retracting | Door::Returning)
                if self.speed_mm_per_min() > 0.0 =>
            {
                Some(Alarm::ABORTED_IN_MOTION)
            }
            _ => None,
        };
        let is_locked =
            matches!(self.state, ControllerState::Alarm { .. } | ControllerState::Sleep);
        let is_position_lost = alarm.is_some() || self.alarm == Some(Alarm::HARD_LIMIT);
        if is_position_lost && self.memory.settings.forgets_homing() {
            self.is_homed = false;
        }
        if let Some(alarm) = alarm {
            self.alarm(alarm);
        }
        self.restart(is_locked || alarm.is_some());
    }

    /// Restarts the firmware; grbl first answers a line in work with `ok`.
    pub(super) fn restart(&mut self, is_locked: bool) {
        if let ControllerState::Homing(homing) = &self.state {
            let at = homing.position(&self.plant, &self.memory.settings);
            let steps = crate::motion::steps_from_mm(at, &self.memory.settings);
            self.forget_motion();
            self.planner.set_position_steps(steps);
        }
        if self.traits().reset_answers && self.script.iter().any(super::Action::is_answer) {
            self.counts.oks += 1;
            self.print("ok\r\n");
        }
        self.state = if is_locked {
            ControllerState::Alarm { is_critical: false }
        } else {
            ControllerState::Idle
        };
        self.initialise();
    }

    /// Power-up: the board needs time to start, and may be locked.
    pub(super) fn boot(&mut self) {
        let interval =
            self.memory.settings.report_interval_s().map(std::time::Duration::from_secs_f64);
        self.report_interval = interval;
        self.report_due = interval.map(|interval| self.now + interval);
        let boot = &self.traits().boot;
        for line in boot.chatter {
            self.line_out(line);
        }
        if boot.seconds > 0.0 {
            self.state = ControllerState::Starting { left_s: boot.seconds };
        } else {
            self.finish_boot();
        }
    }

    pub(super) fn finish_boot(&mut self) {
        self.state = match (self.traits().locks_at_boot)(&self.memory.settings) {
            true => ControllerState::Alarm { is_critical: false },
            false => ControllerState::Idle,
        };
        self.initialise();
    }

    fn initialise(&mut self) {
        self.forget_motion();
        let settings = &self.memory.settings;
        let at = mm_from_steps(self.planner.position_steps(settings), settings);
        self.plant.stop_at_ends(at, settings);
        self.planner.set_overrides(Overrides::default());
        self.forget_input();
        self.forget_ports();
        self.sticky_error = None;
        self.probing = None;
        self.switch_off();
        self.spindle_rpm = 0.0;
        self.spindle_percent = 100;
        self.override_flags = OverrideFlags::default();
        self.is_spindle_stopped = false;
        self.held_feed = 0.0;
        self.cadence = Cadence::new(self.traits());
        self.has_pending_report = false;
        self.parser = ParserState::default();
        self.parser.position_in_machine = at.map(|coordinate| f64::from(coordinate as f32));
        self.print("\r\n");
        self.line_out(self.traits().banner);
        self.check_machine();
    }

    /// Checks the machine after a reset, and decides whether startup lines run.
    fn check_machine(&mut self) {
        let settings = &self.memory.settings;
        let is_pressed = self.plant.pressed(self.axes(), settings).contains(&true);
        if settings.homing_required() && !self.is_homed {
            self.state = ControllerState::Alarm { is_critical: false };
            self.alarm(Alarm::HOMING_REQUIRED);
            return self.feedback(Feedback::HomingRequired);
        }
        if (self.traits().checks_limits)(settings) && is_pressed {
            self.state = ControllerState::Alarm { is_critical: false };
            if let Some(alarm) = self.traits().limit_alarm {
                self.alarm(alarm);
                return self.feedback(Feedback::CheckLimits);
            }
            self.feedback(Feedback::CheckLimits);
        }
        if matches!(self.state, ControllerState::Alarm { .. }) {
            self.feedback(Feedback::Unlock);
        } else {
            self.alarm = None;
            if self.plant.is_door_open {
                self.open_door();
            }
            self.queue_startup_lines();
        }
    }
}
