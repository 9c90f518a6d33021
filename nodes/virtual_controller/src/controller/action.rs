//! The actions of a line, executed one after the other.
//!
//! An action that cannot continue yet stays first in the queue, and all later actions wait: so
//! the `ok` of a line is withheld.

use super::ports::Waiting;
use super::{Controller, ControllerState, Drawn, Probing};
use crate::axes::{AXES, without_others};
use crate::codes::{Alarm, ErrorCode};
use crate::counts::UNDERRUN_S;
use crate::firmware::Feedback;
use crate::gcode::arc::Chords;
use crate::gcode::{Coolant, Distance, FeedMode, Motion, Plane, Spindle};
use crate::motion::{Move, Overrides, ProgrammedSpeed, Pushed, mm_from_steps, steps_from_mm};

/// One action that a line asks for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Action {
    /// Waits until all queued motion is done.
    Synchronize,
    Move(Move),
    Chords {
        chords: Chords,
        speed: ProgrammedSpeed,
        line_number: u32,
    },
    Jog(Move),
    Probe {
        motion: Move,
        away: bool,
        miss_is_fine: bool,
    },
    FinishProbe,
    /// Waits until the spindle has come around, and reports nothing meanwhile.
    AwaitIndex {
        left_s: f64,
        /// The spindle is too slow: the wait ends in an alarm.
        is_too_long: bool,
        is_answered: bool,
    },
    /// A motion at the pace of the spindle, which no hold stops.
    Thread(Move),
    FinishThread,
    Dwell {
        left_s: f64,
    },
    /// M66.
    AwaitInput(Waiting),
    Spindle(Spindle),
    /// The laser power from the next block on, without a stop.
    Power,
    Coolant(Coolant),
    SelectSystem(usize),
    SetWorkOffset {
        system: usize,
        offset: [f64; AXES],
    },
    StorePosition {
        g30: bool,
        at: [f64; AXES],
    },
    SetG92([f64; AXES]),
    SetToolLength(f64),
    /// M0, and M1 if optional stops are on.
    Pause {
        is_optional: bool,
    },
    ProgramEnd,
    /// Runs `$N` line 0 or 1.
    Startup(usize),
    StoreStartup {
        index: usize,
        text: String,
    },
    /// M6: the operator changes the tool now.
    ToolChange,
    Sleep,
    /// Ends with a soft reset.
    Restart,
    Answer(Result<(), ErrorCode>),
    /// The answer to a startup line, which is echoed.
    Echo {
        text: String,
        answer: Result<(), ErrorCode>,
    },
}

/// The longest wait for two turns of the spindle, s.
const INDEX_WAIT_S_MAX: f64 = 5.0;

impl Action {
    pub(super) fn await_index(spindle_rpm: f64, is_answered: bool) -> Self {
        let wait_s = 120.0 / spindle_rpm;
        Self::AwaitIndex {
            left_s: wait_s.min(INDEX_WAIT_S_MAX),
            is_too_long: wait_s > INDEX_WAIT_S_MAX,
            is_answered,
        }
    }

    pub(super) fn is_answer(&self) -> bool {
        matches!(self, Self::Answer(_))
    }

    /// Is the answer of this action's line sent before the action?
    pub(super) fn comes_after_answer(&self) -> bool {
        matches!(
            self,
            Self::Restart
                | Self::Sleep
                | Self::ToolChange
                | Self::Startup(_)
                | Self::AwaitIndex { is_answered: true, .. }
        )
    }
}

impl Controller {
    /// Executes an action; returns what is left of it, `None` when it is done.
    pub(super) fn perform(&mut self, action: Action) -> Option<Action> {
        let is_check = self.state == ControllerState::Check;
        match action {
            Action::Synchronize => {
                let is_done =
                    self.planner.is_empty() && !matches!(self.state, ControllerState::Jog { .. });
                if !is_done {
                    return Some(action);
                }
                // The program asked for this stop.
                self.ran_empty_at_s = None;
            }
            Action::Move(motion) => {
                if !self.is_within_limits(&motion) {
                    return Some(action);
                }
                if !is_check {
                    if self.planner.is_full() {
                        return Some(action);
                    }
                    self.plan(&motion);
                }
                self.note_drawn(&motion);
            }
            Action::Chords { mut chords, speed, line_number } => {
                if self.planner.is_full() {
                    return Some(Action::Chords { chords, speed, line_number });
                }
                if let Some(target_in_machine) = chords.next() {
                    let motion = Move {
                        target_in_machine,
                        speed,
                        line_number,
                        ignores_overrides: false,
                        ends_motion: chords.is_done(),
                    };
                    self.script.push_front(Action::Chords { chords, speed, line_number });
                    self.script.push_front(Action::Move(motion));
                }
            }
            Action::Jog(motion) => {
                if self.planner.is_full() {
                    return Some(action);
                }
                self.plan(&motion);
                if self.state == ControllerState::Idle && !self.planner.is_empty() {
                    self.state = ControllerState::Jog { is_cancelled: false };
                }
            }
            Action::Probe { motion, away, miss_is_fine } => {
                self.start_probe(&motion, away, miss_is_fine);
            }
            Action::FinishProbe => {
                if self.probing.is_some() {
                    return Some(action);
                }
            }
            Action::AwaitIndex { left_s, is_too_long, .. } => {
                if left_s > 0.0 && !is_check {
                    return Some(action);
                }
                if is_too_long && !is_check {
                    self.alarm(Alarm::SPINDLE);
                    self.script.retain(Action::is_answer);
                }
            }
            Action::Thread(motion) => {
                self.plan(&motion);
                self.note_drawn(&motion);
                // A hold during the wait stops it where it begins.
                if std::mem::take(&mut self.has_pending_hold) {
                    self.feed_hold();
                }
                self.is_threading = true;
            }
            Action::FinishThread => {
                self.is_threading = false;
                if std::mem::take(&mut self.has_pending_hold) {
                    self.feed_hold();
                }
            }
            Action::Dwell { left_s } => {
                if left_s > 0.0 && !is_check {
                    return Some(action);
                }
            }
            Action::AwaitInput(waiting) => return self.await_input(waiting),
            Action::Spindle(spindle) if !is_check => {
                self.spindle = spindle;
                self.spindle_rpm = self.parser.spindle_rpm;
                self.cadence.accessories_changed();
            }
            Action::Coolant(coolant) if !is_check => {
                self.coolant = coolant;
                self.cadence.accessories_changed();
            }
            Action::Power if !is_check => self.spindle_rpm = self.parser.spindle_rpm,
            Action::Spindle(_) | Action::Coolant(_) | Action::Power => {}
            Action::SelectSystem(system) => {
                self.parser.modal.coordinate_system = system;
                self.cadence.offsets_changed();
                self.cadence.system_changed();
            }
            Action::SetWorkOffset { system, offset } => {
                self.memory.systems.work[system] = offset;
                self.cadence.offsets_changed();
            }
            Action::StorePosition { g30: false, at } => self.memory.systems.g28 = at,
            Action::StorePosition { g30: true, at } => self.memory.systems.g30 = at,
            Action::SetG92(offset) => {
                self.parser.g92 = offset;
                self.cadence.offsets_changed();
            }
            Action::SetToolLength(length) => {
                self.parser.tool_length = length;
                self.cadence.offsets_changed();
            }
            Action::Pause { is_optional } => {
                let is_skipped = is_optional && self.skips_optional_stops;
                if !is_check && !is_skipped {
                    self.state = ControllerState::Hold { is_stopped: true };
                }
            }
            Action::ProgramEnd => self.end_program(),
            Action::Startup(index) => self.run_startup_line(index),
            Action::StoreStartup { index, text } => self.memory.startup[index] = text,
            Action::ToolChange if is_check => {}
            Action::ToolChange => {
                self.switch_off();
                self.cadence.accessories_changed();
                self.state = ControllerState::Tool;
            }
            Action::Sleep => {
                self.feedback(Feedback::Sleeping);
                self.switch_off();
                self.state = ControllerState::Sleep;
            }
            Action::Restart => {
                let is_locked = matches!(self.state, ControllerState::Alarm { .. });
                self.restart(is_locked);
            }
            Action::Answer(result) => {
                match result {
                    Ok(()) => self.counts.oks += 1,
                    Err(_) => self.counts.errors += 1,
                }
                self.answer(result);
            }
            Action::Echo { text, answer } => {
                self.print(&format!(">{text}:"));
                self.answer(answer);
            }
        }
        None
    }

    fn note_drawn(&mut self, motion: &Move) {
        if let Some(drawn) = &mut self.drawn {
            drawn.push(Drawn {
                end_in_machine: without_others(motion.target_in_machine),
                spindle_rpm: self.parser.spindle_rpm,
                spindle: match self.parser.modal.spindle {
                    Spindle::Off => 5,
                    Spindle::Clockwise => 3,
                    Spindle::Counterclockwise => 4,
                },
            });
        }
    }

    /// Queues a move in the planner.
    fn plan(&mut self, motion: &Move) {
        let ran_empty_at_s = self.ran_empty_at_s.take();
        match self.planner.push(motion, &self.memory.settings) {
            Pushed::LeftOut => {
                self.counts.motions_finished += u64::from(motion.ends_motion);
                self.ran_empty_at_s = ran_empty_at_s;
            }
            Pushed::Queued { comes_late } => {
                self.counts.blocks_planned += 1;
                self.plan_outputs();
                let waited = ran_empty_at_s.map(|at_s| self.instant_s - at_s);
                if comes_late && waited.is_some_and(|waited_s| waited_s <= UNDERRUN_S) {
                    self.counts.underruns += 1;
                }
            }
        }
    }

    /// Drops the planned motion; the axes rest where they are.
    pub(super) fn forget_motion(&mut self) {
        self.counts.blocks_discarded += self.planner.len() as u64;
        self.planner.clear(&self.memory.settings);
        self.ran_empty_at_s = None;
        self.forget_planned_outputs();
        (self.is_threading, self.has_pending_hold) = (false, false);
        if let Some(parking) = self.parking.take() {
            let steps = steps_from_mm(parking.position(), &self.memory.settings);
            self.planner.set_position_steps(steps);
        }
    }

    /// Checks a programmed move against the travel; starts to brake when the target is outside.
    fn is_within_limits(&mut self, motion: &Move) -> bool {
        let settings = &self.memory.settings;
        if !settings.soft_limits() || settings.within_travel(motion.target_in_machine) {
            return true;
        }
        match self.state {
            ControllerState::Run => self.state = ControllerState::SoftLimit,
            ControllerState::Idle if !self.planner.is_empty() => {
                self.state = ControllerState::SoftLimit
            }
            _ => self.critical(Alarm::SOFT_LIMIT),
        }
        false
    }

    fn start_probe(&mut self, motion: &Move, away: bool, miss_is_fine: bool) {
        if self.state == ControllerState::Check || !self.is_within_limits(motion) {
            return;
        }
        if self.plant.touches_probe(self.axes()) != away {
            self.sync_parser();
            self.state = ControllerState::Alarm { is_critical: false };
            self.alarm(Alarm::PROBE_INITIAL);
            return;
        }
        self.plan(motion);
        self.probing = Some(Probing { away, miss_is_fine, contact_steps: None });
        if self.planner.is_empty() {
            self.finish_probe();
        }
    }

    /// The probing move has come to rest.
    pub(super) fn finish_probe(&mut self) {
        let Some(probing) = self.probing.take() else { return };
        if !self.planner.is_empty() {
            // Contact ends the motion in the middle of its block.
            self.counts.motions_finished += 1;
        }
        self.forget_motion();
        self.sync_parser();
        self.state = ControllerState::Idle;
        match probing.contact_steps {
            Some(steps) => self.probed = (steps, true),
            None => {
                self.probed = (self.planner.position_steps(&self.memory.settings), false);
                if !probing.miss_is_fine {
                    self.state = ControllerState::Alarm { is_critical: false };
                    self.alarm(Alarm::PROBE_CONTACT);
                }
            }
        }
        self.report_probe();
    }

    /// Sets the parser's position to the real position of the axes.
    pub(super) fn sync_parser(&mut self) {
        let settings = &self.memory.settings;
        let at = mm_from_steps(self.planner.position_steps(settings), settings);
        self.parser.position_in_machine = at.map(|coordinate| f64::from(coordinate as f32));
    }

    /// M2 and M30.
    fn end_program(&mut self) {
        let modal = &mut self.parser.modal;
        modal.motion = Motion::Line;
        modal.plane = Plane::Xy;
        modal.distance = Distance::Absolute;
        modal.feed_mode = FeedMode::UnitsPerMinute;
        modal.coordinate_system = 0;
        modal.spindle = Spindle::Off;
        modal.coolant = Coolant::default();
        if self.state != ControllerState::Check {
            self.planner.set_overrides(Overrides::default());
            self.spindle_percent = 100;
            self.switch_off();
            self.cadence.offsets_changed();
            self.cadence.overrides_changed();
            self.cadence.accessories_changed();
        }
        self.feedback(Feedback::ProgramEnd);
    }
}
