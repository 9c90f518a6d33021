//! Single bytes and the door: what acts out of turn.

use super::{Controller, Door, State};
use crate::codes::Alarm;
use crate::firmware::{Feedback, Flush, Hearing};
use crate::gcode::{Coolant, Motion, Spindle};
use crate::receive::Realtime;

/// Until the spindle is up to speed after a door, seconds.
const DOOR_SPINDLE_S: f64 = 4.0;
/// Until the coolant runs after a door, seconds.
const DOOR_COOLANT_S: f64 = 1.0;

impl Controller {
    pub(super) fn act(&mut self, command: Realtime) {
        let is_deaf = match self.hearing() {
            Hearing::Nothing => true,
            Hearing::ResetOnly => command != Realtime::SoftReset,
            _ => false,
        };
        let is_starting = matches!(self.state, State::Starting { .. });
        if is_deaf || (is_starting && command != Realtime::StatusReport) {
            return;
        }
        match command {
            Realtime::SoftReset => self.soft_reset(),
            // With reports at an interval, asking is of no use.
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
                if matches!(self.state, State::Hold { is_stopped: true }) {
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
        if matches!(self.state, State::Idle | State::Run | State::Hold { .. }) {
            let flag = which(&mut self.coolant);
            *flag = !*flag;
            self.parser.modal.coolant = self.coolant;
            self.cadence.accessories_changed();
        }
    }

    fn cancel_jog(&mut self) {
        let is_jog = matches!(self.state, State::Jog { .. });
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
                // Nor is the jog answered that waits for room.
                self.script.clear();
            }
        }
        if let State::Jog { is_cancelled } = &mut self.state {
            *is_cancelled = true;
        }
    }

    /// grblHAL's 0x19: comes to rest and forgets what was to follow.
    fn stop(&mut self) {
        self.forget_input();
        self.sticky_error = None;
        match self.state {
            State::Alarm { .. } | State::Sleep | State::Check | State::SoftLimit => {}
            State::Homing(_) => self.fail_homing(Alarm::HOMING_RESET),
            State::Run | State::Jog { .. } | State::Hold { is_stopped: false } => {
                self.state = State::Stopping;
            }
            State::Door(Door::Stopping { .. }) | State::Stopping | State::Starting { .. } => {}
            _ => self.finish_stop(),
        }
    }

    /// At rest after 0x19: the position stays, modes begin anew.
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
            true => State::Door(Door::Stopped),
            false => State::Idle,
        };
        self.feedback(Feedback::Stop);
    }

    /// FluidNC's 0x87 and on; here a macro does nothing but say that it ran.
    fn run_macro(&mut self, number: u8) {
        match self.state {
            State::Idle => self.line_out(&format!("[MSG:INFO: Macro{number}]")),
            _ => self.line_out("[MSG:ERR: Macro can only be used in idle state]"),
        }
    }

    pub(super) fn feed_hold(&mut self) {
        match &mut self.state {
            State::Idle => {
                self.held_feed = 0.0;
                self.ran_empty_at_s = None;
                self.state = State::Hold { is_stopped: true };
            }
            State::Run => {
                self.held_feed = self.planner.speed_mm_per_min();
                self.state = State::Hold { is_stopped: false };
            }
            State::Jog { is_cancelled } => *is_cancelled = true,
            State::Homing(_) => self.has_pending_hold = true,
            _ => {}
        }
    }

    fn cycle_start(&mut self) {
        match self.state {
            State::Idle | State::Hold { is_stopped: true } => {
                if let (State::Hold { .. }, Some(feedback)) =
                    (&self.state, self.traits().resume_feedback)
                {
                    self.feedback(feedback);
                }
                self.is_spindle_stopped = false;
                self.resume();
            }
            State::Tool => {
                self.state = State::Idle;
                self.cadence.tool_changed();
                self.report_status();
            }
            State::Door(Door::Stopped) if !self.plant.is_door_open => self.leave_door(),
            _ => {}
        }
    }

    /// How long spindle and coolant take to be back, as far as they were on.
    pub(super) fn power_up_s(&self) -> f64 {
        let delays = self.memory.settings.door_delays_s();
        let (spindle_s, coolant_s) = delays.unwrap_or((DOOR_SPINDLE_S, DOOR_COOLANT_S));
        let spindle = if self.spindle == Spindle::Off { 0.0 } else { spindle_s };
        let coolant = if self.coolant == Coolant::default() { 0.0 } else { coolant_s };
        spindle + coolant
    }

    /// Goes on with what is queued.
    pub(super) fn resume(&mut self) {
        let is_at_rest = self.planner.is_empty() && self.probing.is_none();
        self.state = if is_at_rest { State::Idle } else { State::Run };
    }

    pub(super) fn open_door(&mut self) {
        let is_moving = match &self.state {
            State::Alarm { .. } | State::Check | State::Sleep | State::SoftLimit => return,
            State::Off | State::Starting { .. } | State::Tool | State::Stopping => return,
            State::Door(Door::Stopping { .. } | Door::Stopped | Door::Retracting) => return,
            State::Door(Door::Returning) => {
                self.feedback(Feedback::CheckDoor);
                return self.retract_again();
            }
            State::Homing(_) => return self.fail_homing(Alarm::HOMING_DOOR),
            State::Door(Door::Resuming { .. }) | State::Idle => false,
            State::Hold { is_stopped } => !is_stopped,
            State::Run | State::Jog { .. } => true,
        };
        self.feedback(Feedback::CheckDoor);
        let is_jog = matches!(self.state, State::Jog { .. });
        match is_moving {
            true => self.state = State::Door(Door::Stopping { is_jog }),
            false => self.retract(),
        }
    }
}
