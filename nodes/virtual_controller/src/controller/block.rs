//! Turns a checked block into its actions, in the order of the firmware.

use super::action::Action;
use super::{Controller, ControllerState};
use crate::axes::Axes;
use crate::codes::ErrorCode;
use crate::gcode::{Checked, CommandKind, Effect, FeedMode, Flow, NonModal, Spindle, check};
use crate::motion::{Move, ProgrammedSpeed};

/// Of the fastest of Z: no thread is cut faster, along whatever axes.
const THREAD_SHARE: f64 = 0.9;

impl Controller {
    /// Checks a program line and queues its actions.
    pub(super) fn block(&mut self, text: &str) -> Result<(), ErrorCode> {
        let vocabulary = self.vocabulary();
        let block =
            check(text, CommandKind::Program, &vocabulary, &self.parser, &self.memory.systems)?;
        if let Effect::Thread { pitch, .. } = block.effect {
            self.check_thread(&block, pitch)?;
        }
        // In the order of the firmware: before the tool and the spindle.
        if let Some(port) = block.port {
            self.queue_port(port);
        }
        self.queue_accessories(&block);
        self.queue_offsets(&block);
        self.queue_motion(&block);
        match block.flow {
            Some(flow @ (Flow::Pause | Flow::OptionalPause)) => {
                let is_optional = flow == Flow::OptionalPause;
                self.script.extend([Action::Synchronize, Action::Pause { is_optional }]);
            }
            Some(Flow::End) => self.script.extend([Action::Synchronize, Action::ProgramEnd]),
            None => {}
        }
        if block.changes_tool && !self.memory.settings.ignores_tool_changes() {
            self.script.extend([Action::Synchronize, Action::ToolChange]);
        }
        // The coordinate system changes in its own action, after all motion has ended.
        let system = self.parser.modal.coordinate_system;
        self.parser.modal = block.modal;
        self.parser.modal.coordinate_system = system;
        self.parser.feed = block.feed;
        self.parser.spindle_rpm = block.spindle_rpm;
        self.parser.tool = block.tool;
        self.parser.line_number = block.line_number;
        Ok(())
    }

    /// Checks a `$J=` line and queues it.
    pub(super) fn jog(&mut self, text: &str) -> Result<(), ErrorCode> {
        let vocabulary = self.vocabulary();
        let block = check(text, CommandKind::Jog, &vocabulary, &self.parser, &self.memory.systems)?;
        let Effect::Line(mut target) = block.effect else { return Err(ErrorCode::NoAxisWords) };
        let settings = &self.memory.settings;
        if settings.soft_limits() && !settings.within_travel(target) {
            if !settings.clips_jogs() {
                return Err(ErrorCode::JogOutOfTravel);
            }
            let travel = settings.max_travel_mm();
            target = std::array::from_fn(|i| target[i].clamp(-travel[i], 0.0));
        }
        self.parser.position_in_machine = target;
        self.script.push_back(Action::Jog(Move {
            target_in_machine: target,
            speed: ProgrammedSpeed::Feed(block.feed),
            line_number: block.line_number,
            ignores_overrides: true,
            ends_motion: true,
        }));
        Ok(())
    }

    fn queue_accessories(&mut self, block: &Checked) {
        let is_on = self.parser.modal.spindle != Spindle::Off;
        let is_new_speed = block.spindle_rpm != self.parser.spindle_rpm;
        if is_on && (is_new_speed || self.must_set_laser(block)) {
            // A laser takes its power from the block that is being cut.
            let is_in_motion = self.memory.settings.is_laser() && block.moves_axes();
            if is_in_motion {
                self.script.push_back(Action::Power);
            } else {
                self.script
                    .extend([Action::Synchronize, Action::Spindle(self.parser.modal.spindle)]);
            }
        }
        if block.modal.spindle != self.parser.modal.spindle {
            self.script.extend([Action::Synchronize, Action::Spindle(block.modal.spindle)]);
        }
        if block.modal.coolant != self.parser.modal.coolant {
            self.script.extend([Action::Synchronize, Action::Coolant(block.modal.coolant)]);
        }
        if let Some(left_s) = block.dwell_s {
            self.script.extend([Action::Synchronize, Action::Dwell { left_s }]);
        }
    }

    /// Does a constant-power laser (M3) switch on or off because a line without axis words changes
    /// between cutting and rapid?
    fn must_set_laser(&self, block: &Checked) -> bool {
        let before = &self.parser.modal;
        self.memory.settings.is_laser()
            && before.spindle == Spindle::Clockwise
            && !block.moves_axes()
            && before.motion.cuts() != block.modal.motion.cuts()
    }

    fn queue_offsets(&mut self, block: &Checked) {
        let mut after_motion = |action| self.script.extend([Action::Synchronize, action]);
        if block.tool_length != self.parser.tool_length {
            after_motion(Action::SetToolLength(block.tool_length));
        }
        if block.modal.coordinate_system != self.parser.modal.coordinate_system {
            after_motion(Action::SelectSystem(block.modal.coordinate_system));
        }
        match &block.non_modal {
            Some(NonModal::SetWorkOffset { system, offset }) => {
                after_motion(Action::SetWorkOffset { system: *system, offset: *offset });
            }
            Some(NonModal::SetG92(offset)) => after_motion(Action::SetG92(*offset)),
            Some(NonModal::Store { g30 }) => {
                let at = self.parser.position_in_machine;
                after_motion(Action::StorePosition { g30: *g30, at });
            }
            Some(NonModal::GoTo { g30, over, named }) => {
                let systems = &self.memory.systems;
                let mut end = if *g30 { systems.g30 } else { systems.g28 };
                if let Some(over) = over {
                    for axis in (0..named.len()).filter(|axis| !named[*axis]) {
                        end[axis] = over[axis];
                    }
                    self.queue_line(*over, ProgrammedSpeed::Rapid, block.line_number);
                }
                self.queue_line(end, ProgrammedSpeed::Rapid, block.line_number);
            }
            None => {}
        }
    }

    fn queue_motion(&mut self, block: &Checked) {
        let vocabulary = self.vocabulary();
        let speed = match block.modal.feed_mode {
            FeedMode::UnitsPerMinute => ProgrammedSpeed::Feed(block.feed),
            FeedMode::InverseTime => ProgrammedSpeed::InverseTime(block.feed),
        };
        let line_number = block.line_number;
        match &block.effect {
            Effect::None => {}
            Effect::Rapid(target) => self.queue_line(*target, ProgrammedSpeed::Rapid, line_number),
            Effect::Line(target) => self.queue_line(*target, speed, line_number),
            Effect::Arc(arc) => {
                self.parser.position_in_machine = arc.end;
                let tolerance_mm = self.memory.settings.arc_tolerance_mm();
                let chords = arc.clone().chords(tolerance_mm, vocabulary.arc_precision);
                let speed = match speed {
                    ProgrammedSpeed::InverseTime(per_min) => {
                        ProgrammedSpeed::InverseTime(per_min * f64::from(chords.count))
                    }
                    other => other,
                };
                self.script.push_back(Action::Chords { chords, speed, line_number });
            }
            Effect::Thread { target, pitch } => {
                let motion = Move {
                    target_in_machine: *target,
                    speed: ProgrammedSpeed::Feed(block.spindle_rpm * pitch),
                    line_number,
                    ignores_overrides: true,
                    ends_motion: true,
                };
                self.parser.position_in_machine = *target;
                if self.state == ControllerState::Check {
                    return;
                }
                self.script.extend([
                    Action::Synchronize,
                    Action::await_index(block.spindle_rpm, self.planner.is_empty()),
                    Action::Thread(motion),
                    Action::Synchronize,
                    Action::FinishThread,
                ]);
            }
            Effect::Probe { target, away, miss_is_fine } => {
                let motion = Move {
                    target_in_machine: *target,
                    speed,
                    line_number,
                    ignores_overrides: true,
                    ends_motion: true,
                };
                if self.state == ControllerState::Check {
                    self.parser.position_in_machine = *target;
                }
                self.script.extend([
                    Action::Synchronize,
                    Action::Probe { motion, away: *away, miss_is_fine: *miss_is_fine },
                    Action::FinishProbe,
                ]);
            }
        }
    }

    /// Does the spindle turn, and slowly enough?
    fn check_thread(&self, block: &Checked, pitch: f64) -> Result<(), ErrorCode> {
        let feed = block.spindle_rpm * pitch;
        if self.spindle == Spindle::Off || feed == 0.0 {
            return Err(ErrorCode::SpindleNotRunning);
        }
        match feed > self.memory.settings.max_rate_mm_per_min()[2] * THREAD_SHARE {
            true => Err(ErrorCode::MaxFeedRateExceeded),
            false => Ok(()),
        }
    }

    fn queue_line(&mut self, target_in_machine: Axes, speed: ProgrammedSpeed, line_number: u32) {
        self.parser.position_in_machine = target_in_machine;
        self.script.push_back(Action::Move(Move {
            target_in_machine,
            speed,
            line_number,
            ignores_overrides: false,
            ends_motion: true,
        }));
    }
}
