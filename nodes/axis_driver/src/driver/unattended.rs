//! Holds what moves when the commander is lost, or when ROS is.

use super::answer::Answer;
use super::context::commander::OnCommanderLoss;
use super::output::LogLevel;
use super::run::exit::RunVerdict;
use super::{Driver, Phase};
use crate::codes::error_code;
use std::time::Duration;

impl Driver {
    /// When the commander counts as lost.
    pub(super) fn commander_deadline(&self) -> Option<Duration> {
        self.context.commander_deadline().filter(|_| self.phase.is_at_work())
    }

    /// When the machine is held because the driver cannot be reached over ROS.
    pub(super) fn ros_deadline(&self) -> Option<Duration> {
        self.context.ros_deadline().filter(|_| self.phase.is_at_work())
    }

    /// Whoever begins something is not watched by the signs of life of another. What is under way
    /// stays watched.
    pub(super) fn forget_commander(&mut self) -> Answer {
        if self.phase.is_at_work() {
            return Some(Ok("what is under way keeps its commander".into()));
        }
        self.context.commander_seen = None;
        Some(Ok("forgotten".into()))
    }

    pub(super) fn watch_commander(&mut self) {
        if self.commander_deadline().is_none_or(|deadline| self.context.now < deadline) {
            return;
        }
        let text = self.context.lose_commander();
        self.context.log(LogLevel::Warn, text.clone());
        match (self.context.config.on_commander_loss, &self.phase) {
            (OnCommanderLoss::Continue, _) => {}
            (OnCommanderLoss::HoldThenAbort, Phase::Running(_)) => {
                self.stop_run(RunVerdict::aborted(error_code::COMMANDER_LOST, text));
            }
            _ => self.hold_unattended(&text),
        }
    }

    pub(super) fn watch_ros(&mut self) {
        if self.ros_deadline().is_none_or(|deadline| self.context.now < deadline) {
            return;
        }
        let text = self.context.lose_ros();
        self.context.log(LogLevel::Warn, text.clone());
        self.hold_unattended(&text);
    }

    /// Holds what moves, because nobody is there to watch it.
    fn hold_unattended(&mut self, text: &str) {
        match &mut self.phase {
            // Nothing was sent yet, and nobody waits for it any more.
            Phase::Running(run) if !run.has_begun() => {
                self.stop_run(RunVerdict::aborted(error_code::COMMANDER_LOST, text));
            }
            Phase::Running(run) => run.hold(&mut self.context, text),
            // A hold ends a jog; homing does not react to it.
            Phase::Manual(operation) if operation.task.moves() => self.context.send_hold(),
            // A run that is being stopped is held already.
            _ => {}
        }
    }
}
