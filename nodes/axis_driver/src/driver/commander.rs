//! Whether somebody is still there who began the run.
//!
//! Only a commander that gave a sign of life can stay away: a program needs nobody.

use super::command::Answer;
use super::{Driver, LogLevel, Phase, RunOutcome};
use crate::codes::error_code;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What is done when a commander's signs of life stay away during a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnCommanderLoss {
    /// The run goes on.
    Continue,
    /// The machine holds until somebody resumes or cancels.
    #[default]
    Hold,
    /// It holds, stands, and the run is over.
    HoldThenAbort,
}

/// How the reason of a hold begins that is due to it.
pub const COMMANDER_LOST: &str = "COMMANDER_LOST";

impl OnCommanderLoss {
    /// The words of the parameter.
    pub const WORDS: [(&'static str, Self); 3] = [
        ("continue", Self::Continue),
        ("hold", Self::Hold),
        ("hold_then_abort", Self::HoldThenAbort),
    ];
}

impl Driver {
    /// One that stayed away before this was begun has not begun it.
    pub(super) fn forget_old_commander(&mut self) {
        let patience = Duration::from_millis(u64::from(self.config.commander_timeout_ms));
        self.commander_heard = self.commander_heard.filter(|heard| self.now < *heard + patience);
    }

    /// A commander lives.
    pub(super) fn hear_commander(&mut self) -> Answer {
        self.commander_heard = Some(self.now);
        Some(Ok("heard".into()))
    }

    /// When the commander counts as lost.
    pub(super) fn commander_deadline(&self) -> Option<Duration> {
        let patience = Duration::from_millis(u64::from(self.config.commander_timeout_ms));
        let heard = self.commander_heard.filter(|_| !self.excuses_commander())?;
        matches!(self.phase, Phase::Running(_) | Phase::Manual(_)).then_some(heard + patience)
    }

    pub(super) fn watch_commander(&mut self) {
        if self.commander_deadline().is_none_or(|deadline| self.now < deadline) {
            return;
        }
        // It has to give another sign before it can be missed again.
        self.commander_heard = None;
        let patience = self.config.commander_timeout_ms;
        let text = format!("{COMMANDER_LOST}: no sign of life for {patience} ms");
        self.log(LogLevel::Warn, text.clone());
        match (self.config.on_commander_loss, &mut self.phase) {
            (OnCommanderLoss::Continue, _) => {}
            (OnCommanderLoss::HoldThenAbort, Phase::Running(_)) => {
                self.stop_run(RunOutcome::Aborted, error_code::COMMANDER_LOST, text);
            }
            _ => self.hold_unattended(error_code::COMMANDER_LOST, &text),
        }
    }

    /// Holds what moves, because nobody is there to watch it.
    pub(super) fn hold_unattended(&mut self, error_code: u16, text: &str) {
        match &mut self.phase {
            Phase::Running(run) if run.is_stopping() => {}
            // Nothing was sent yet, and nobody waits for it any more.
            Phase::Running(run) if !run.has_begun() => {
                self.stop_run(RunOutcome::Aborted, error_code, text.to_owned());
            }
            Phase::Running(_) => self.hold_run(text),
            // A hold ends a jog; homing does not listen to it.
            Phase::Manual(operation) if operation.task.moves() => self.send_hold(),
            _ => {}
        }
    }
}
