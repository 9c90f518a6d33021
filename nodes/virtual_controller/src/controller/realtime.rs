//! Single bytes, switches, resets and alarms: what acts out of turn.

use super::report::Cadence;
use super::{Controller, Door, State};
use crate::codes::Alarm;
use crate::gcode::{Coolant, ParserState, Spindle};
use crate::motion::{Overrides, mm_from_steps};
use crate::receive::{LineReader, OverrideChange, Realtime};

/// Until the spindle is up to speed after a door, seconds.
const DOOR_SPINDLE_S: f64 = 4.0;
/// Until the coolant runs after a door, seconds.
const DOOR_COOLANT_S: f64 = 1.0;

impl Controller {
    pub(super) fn act(&mut self, command: Realtime) {
        if matches!(self.state, State::Alarm { is_deaf: true }) && command != Realtime::SoftReset {
            return;
        }
        match command {
            Realtime::SoftReset => self.soft_reset(),
            Realtime::StatusReport => match self.state {
                State::Homing(_) => self.has_pending_report = true,
                _ if self.is_transmit_full() => self.has_pending_report = true,
                _ => self.report_status(),
            },
            Realtime::CycleStart => self.cycle_start(),
            Realtime::FeedHold => self.feed_hold(),
            Realtime::SafetyDoor => self.open_door(),
            Realtime::JogCancel => {
                if let State::Jog { is_cancelled } = &mut self.state {
                    *is_cancelled = true;
                }
            }
            Realtime::Override(change) => self.change_override(change),
            Realtime::SpindleStop => {
                if matches!(self.state, State::Hold { is_stopped: true }) {
                    self.is_spindle_stopped = !self.is_spindle_stopped;
                    self.cadence.overrides_changed();
                }
            }
            Realtime::FloodToggle => self.toggle_coolant(|coolant| &mut coolant.flood),
            Realtime::MistToggle if self.build.has_mist => {
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
            self.cadence.overrides_changed();
        }
    }

    fn change_override(&mut self, change: OverrideChange) {
        let by = |percent: u8, by: i16| (i16::from(percent) + by).clamp(10, 200) as u8;
        let mut overrides = self.planner.overrides();
        let mut spindle = self.spindle_percent;
        match change {
            OverrideChange::FeedReset => overrides.feed_percent = 100,
            OverrideChange::FeedBy(step) => {
                overrides.feed_percent = by(overrides.feed_percent, step);
            }
            OverrideChange::Rapid(percent) => overrides.rapid_percent = percent,
            OverrideChange::SpindleReset => spindle = 100,
            OverrideChange::SpindleBy(step) => spindle = by(spindle, step),
        }
        if overrides != self.planner.overrides() || spindle != self.spindle_percent {
            self.planner.set_overrides(overrides);
            self.spindle_percent = spindle;
            self.cadence.overrides_changed();
        }
    }

    pub(super) fn feed_hold(&mut self) {
        match &mut self.state {
            State::Idle => self.state = State::Hold { is_stopped: true },
            State::Run => self.state = State::Hold { is_stopped: false },
            State::Jog { is_cancelled } => *is_cancelled = true,
            State::Homing(_) => self.has_pending_hold = true,
            _ => {}
        }
    }

    fn cycle_start(&mut self) {
        match self.state {
            State::Idle | State::Hold { is_stopped: true } => {
                self.is_spindle_stopped = false;
                self.resume();
            }
            State::Door(Door::Stopped) if !self.plant.is_door_open => {
                let spindle = if self.spindle == Spindle::Off { 0.0 } else { DOOR_SPINDLE_S };
                let coolant = if self.coolant == Coolant::default() { 0.0 } else { DOOR_COOLANT_S };
                self.state = State::Door(Door::Resuming { left_s: spindle + coolant });
            }
            _ => {}
        }
    }

    /// Goes on with what is queued.
    pub(super) fn resume(&mut self) {
        let is_at_rest = self.planner.is_empty() && self.probing.is_none();
        self.state = if is_at_rest { State::Idle } else { State::Run };
    }

    pub(super) fn open_door(&mut self) {
        let is_moving = match &self.state {
            State::Alarm { .. } | State::Check | State::Sleep | State::SoftLimit => return,
            State::Door(Door::Stopping { .. } | Door::Stopped) => return,
            State::Homing(_) => return self.fail_homing(Alarm::HomingDoor),
            State::Door(Door::Resuming { .. }) | State::Idle => false,
            State::Hold { is_stopped } => !is_stopped,
            State::Run | State::Jog { .. } => true,
        };
        self.message("Check Door");
        let is_jog = matches!(self.state, State::Jog { .. });
        self.state = State::Door(if is_moving { Door::Stopping { is_jog } } else { Door::Stopped });
    }

    /// A limit switch closed while hard limits are on.
    pub(super) fn hit_limit(&mut self) {
        if !matches!(self.state, State::Alarm { .. }) {
            self.critical(Alarm::HardLimit);
        }
    }

    /// Stops dead and stays deaf until a reset.
    pub(super) fn critical(&mut self, alarm: Alarm) {
        self.planner.clear(&self.memory.settings);
        self.probing = None;
        self.spindle = Spindle::Off;
        self.coolant = Coolant::default();
        self.state = State::Alarm { is_deaf: true };
        self.alarm(alarm);
        self.message("Reset to continue");
    }

    pub(super) fn fail_homing(&mut self, alarm: Alarm) {
        self.alarm(alarm);
        self.restart(true);
    }

    /// 0x18.
    fn soft_reset(&mut self) {
        let alarm = match self.state {
            State::Homing(_) => Some(Alarm::HomingReset),
            State::Run | State::Jog { .. } | State::SoftLimit => Some(Alarm::AbortedInMotion),
            State::Hold { is_stopped: false } | State::Door(Door::Stopping { .. }) => {
                Some(Alarm::AbortedInMotion)
            }
            _ => None,
        };
        let is_locked = matches!(self.state, State::Alarm { .. } | State::Sleep);
        if let Some(alarm) = alarm {
            self.alarm(alarm);
        }
        self.restart(is_locked || alarm.is_some());
    }

    /// Begins again; a line in work is answered `ok` on the way, as the firmware does.
    pub(super) fn restart(&mut self, is_locked: bool) {
        if let State::Homing(homing) = &self.state {
            let at = homing.position(&self.plant, &self.memory.settings);
            let steps = crate::motion::steps_from_mm(at, &self.memory.settings);
            self.planner.clear(&self.memory.settings);
            self.planner.set_position_steps(steps);
        }
        if self.script.iter().any(super::Action::is_answer) {
            self.print("ok\r\n");
        }
        self.state = if is_locked { State::Alarm { is_deaf: false } } else { State::Idle };
        self.initialise();
    }

    /// Power-up: as a restart, but locked when homing is on.
    pub(super) fn boot(&mut self) {
        if self.memory.settings.homing_enabled() {
            self.state = State::Alarm { is_deaf: false };
        }
        self.initialise();
    }

    fn initialise(&mut self) {
        let settings = &self.memory.settings;
        self.planner.clear(settings);
        let at = mm_from_steps(self.planner.position_steps(settings), settings);
        self.plant.stop_at_ends(at, settings);
        self.planner.set_overrides(Overrides::default());
        self.receive_buffer.clear();
        self.reader = LineReader::default();
        self.script.clear();
        self.probing = None;
        self.spindle = Spindle::Off;
        self.spindle_rpm = 0.0;
        self.spindle_percent = 100;
        self.is_spindle_stopped = false;
        self.coolant = Coolant::default();
        self.cadence = Cadence::default();
        self.has_pending_report = false;
        self.has_pending_hold = false;
        self.parser = ParserState::default();
        self.parser.position_in_machine = at;
        self.print("\r\nGrbl 1.1h ['$' for help]\r\n");
        let is_pressed = self.plant.pressed(self.position(), &self.memory.settings).contains(&true);
        if self.memory.settings.hard_limits() && is_pressed {
            self.state = State::Alarm { is_deaf: false };
            self.message("Check Limits");
        }
        if matches!(self.state, State::Alarm { .. }) {
            self.message("'$H'|'$X' to unlock");
        } else {
            if self.plant.is_door_open {
                self.open_door();
            }
            self.queue_startup_lines();
        }
    }
}
