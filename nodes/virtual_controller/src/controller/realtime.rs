//! Real-time bytes and the door: input that acts at once, outside the line queue.

use super::action::Action;
use super::{Controller, ControllerState, Door};
use crate::codes::Alarm;
use crate::firmware::{AcceptedInput, Feedback, Flush};
use crate::gcode::{Coolant, Motion, Spindle};
use crate::receive::Realtime;

/// Time until the spindle is up to speed after a door, seconds.
const DOOR_SPINDLE_S: f64 = 4.0;
/// Time until the coolant runs after a door, seconds.
const DOOR_COOLANT_S: f64 = 1.0;

impl Controller {
    pub(super) fn act(&mut self, command: Realtime) {
        let is_ignored = match self.accepted_input() {
            AcceptedInput::Nothing => true,
            AcceptedInput::ResetOnly => command != Realtime::SoftReset,
            _ => false,
        };
        let is_starting = matches!(self.state, ControllerState::Starting { .. });
        if is_ignored || (is_starting && command != Realtime::StatusReport) {
            return;
        }
        match command {
            Realtime::SoftReset => self.soft_reset(),
            // With automatic reports, `?` has no effect.
            Realtime::StatusReport if self.report_due.is_some() => {}
            Realtime::StatusReport => self.report_status(),
            Realtime::FullReport => self.report_everything(),
            Realtime::ParserReport => self.report_parser_state(),
            Realtime::AutoReportToggle => {
                self.report_due = match self.report_due {
                    None => self.report_interval.map(|interval| self.now + interval),
                    Some(_) => None,
                };
            }
            Realtime::OptionalStopToggle => self.skips_optional_stops = !self.skips_optional_stops,
            Realtime::Macro(number) => self.run_macro(number),
            Realtime::Stop => self.stop(),
            Realtime::CycleStart => self.cycle_start(),
            Realtime::FeedHold => self.feed_hold(),
            Realtime::SafetyDoor => self.open_door(),
            Realtime::JogCancel => self.cancel_jog(),
            Realtime::Override(change) => self.ask_override(change),
            Realtime::SpindleStop => {
                if matches!(self.state, ControllerState::Hold { is_stopped: true }) {
                    self.is_spindle_stopped = !self.is_spindle_stopped;
                    self.cadence.accessories_changed();
                }
            }
            Realtime::FloodToggle => self.toggle_coolant(|coolant| &mut coolant.flood),
            Realtime::MistToggle if self.vocabulary().has_mist => {
                self.toggle_coolant(|coolant| &mut coolant.mist);
            }
            Realtime::MistToggle | Realtime::Unknown => {}
        }
    }

    fn toggle_coolant(&mut self, which: impl Fn(&mut Coolant) -> &mut bool) {
        if matches!(
            self.state,
            ControllerState::Idle | ControllerState::Run | ControllerState::Hold { .. }
        ) {
            let flag = which(&mut self.coolant);
            *flag = !*flag;
            self.parser.modal.coolant = self.coolant;
            self.cadence.accessories_changed();
        }
    }

    fn cancel_jog(&mut self) {
        let is_jog = matches!(self.state, ControllerState::Jog { .. });
        let flushes = match self.traits().jog_cancel_flush {
            Flush::Never => false,
            Flush::WhileJogging => is_jog,
            Flush::Always => true,
        };
        if flushes {
            self.receive_buffer.clear();
            self.reader.clear();
            self.sticky_error = None;
            if is_jog {
                // A jog that waits for room is not answered either.
                self.script.clear();
            }
        }
        if let ControllerState::Jog { is_cancelled } = &mut self.state {
            *is_cancelled = true;
        }
    }

    /// grblHAL's 0x19: stops and drops everything queued.
    fn stop(&mut self) {
        self.forget_input();
        self.sticky_error = None;
        match self.state {
            ControllerState::Alarm { .. }
            | ControllerState::Sleep
            | ControllerState::Check
            | ControllerState::SoftLimit => {}
            ControllerState::Homing(_) => self.fail_homing(Alarm::HOMING_RESET),
            ControllerState::Run
            | ControllerState::Jog { .. }
            | ControllerState::Hold { is_stopped: false } => {
                self.state = ControllerState::Stopping;
            }
            ControllerState::Door(Door::Stopping { .. })
            | ControllerState::Stopping
            | ControllerState::Starting { .. } => {}
            _ => self.finish_stop(),
        }
    }

    /// At rest after 0x19: the position stays, modes are reset.
    pub(super) fn finish_stop(&mut self) {
        self.forget_motion();
        self.probing = None;
        self.sync_parser();
        self.parser.modal.motion = Motion::Rapid;
        self.parser.modal.spindle = Spindle::Off;
        self.parser.modal.coolant = Coolant::default();
        self.parser.feed = 0.0;
        self.switch_off();
        self.cadence.accessories_changed();
        self.state = match self.plant.is_door_open {
            true => ControllerState::Door(Door::Stopped),
            false => ControllerState::Idle,
        };
        self.feedback(Feedback::Stop);
    }

    /// FluidNC's 0x87 and following; here a macro only reports that it ran.
    fn run_macro(&mut self, number: u8) {
        match self.state {
            ControllerState::Idle => self.line_out(&format!("[MSG:INFO: Macro{number}]")),
            _ => self.line_out("[MSG:ERR: Macro can only be used in idle state]"),
        }
    }

    pub(super) fn feed_hold(&mut self) {
        if self.is_threading || self.awaits_index() {
            self.has_pending_hold = true;
            return;
        }
        match &mut self.state {
            ControllerState::Idle => {
                self.held_feed = 0.0;
                self.ran_empty_at_s = None;
                self.state = ControllerState::Hold { is_stopped: true };
            }
            ControllerState::Run => {
                self.held_feed = self.planner.speed_mm_per_min();
                self.state = ControllerState::Hold { is_stopped: false };
            }
            ControllerState::Jog { is_cancelled } => *is_cancelled = true,
            ControllerState::Homing(_) => self.has_pending_hold = true,
            _ => {}
        }
    }

    fn cycle_start(&mut self) {
        match self.state {
            ControllerState::Idle | ControllerState::Hold { is_stopped: true } => {
                if let (ControllerState::Hold { .. }, Some(feedback)) =
                    (&self.state, self.traits().resume_feedback)
                {
                    self.feedback(feedback);
                }
                self.is_spindle_stopped = false;
                self.resume();
            }
            ControllerState::Tool => {
                self.state = ControllerState::Idle;
                self.cadence.tool_changed();
                self.report_status();
            }
            ControllerState::Door(Door::Stopped) if !self.plant.is_door_open => self.leave_door(),
            _ => {}
        }
    }

    /// Seconds until spindle and coolant are back, if they were on.
    pub(super) fn power_up_s(&self) -> f64 {
        let delays = self.memory.settings.door_delays_s();
        let (spindle_s, coolant_s) = delays.unwrap_or((DOOR_SPINDLE_S, DOOR_COOLANT_S));
        let spindle = if self.spindle == Spindle::Off { 0.0 } else { spindle_s };
        let coolant = if self.coolant == Coolant::default() { 0.0 } else { coolant_s };
        spindle + coolant
    }

    /// Continues with the queued motion.
    pub(super) fn resume(&mut self) {
        let is_at_rest = self.planner.is_empty() && self.probing.is_none();
        self.state = if is_at_rest { ControllerState::Idle } else { ControllerState::Run };
        if self.is_threading && !is_at_rest {
            self.script.push_front(Action::await_index(self.spindle_rpm, true));
        }
    }

    pub(super) fn open_door(&mut self) {
        let is_moving = match &self.state {
            ControllerState::Alarm { .. }
            | ControllerState::Check
            | ControllerState::Sleep
            | ControllerState::SoftLimit => return,
            ControllerState::Off
            | ControllerState::Starting { .. }
            | ControllerState::Tool
            | ControllerState::Stopping => return,
            ControllerState::Door(Door::Stopping { .. } | Door::Stopped | Door::Retracting) => {
                return;
            }
            ControllerState::Door(Door::Returning) => {
                self.feedback(Feedback::CheckDoor);
                return self.retract_again();
            }
            ControllerState::Homing(_) => return self.fail_homing(Alarm::HOMING_DOOR),
            ControllerState::Door(Door::Resuming { .. }) | ControllerState::Idle => false,
            ControllerState::Hold { is_stopped } => !is_stopped,
            ControllerState::Run | ControllerState::Jog { .. } => true,
        };
        self.feedback(Feedback::CheckDoor);
        let is_jog = matches!(self.state, ControllerState::Jog { .. });
        match is_moving {
            true => self.state = ControllerState::Door(Door::Stopping { is_jog }),
            false => self.retract(),
        }
    }
}
