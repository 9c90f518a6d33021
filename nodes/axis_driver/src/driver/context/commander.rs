//! Watches for a commander's signs of life.
//!
//! Only a commander that gave a sign of life can be lost: a program needs none.

use super::Context;
use crate::driver::answer::Answer;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What is done when a commander's signs of life stay away during a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnCommanderLoss {
    /// The run goes on.
    Continue,
    /// The machine holds until it is resumed or the run is canceled.
    #[default]
    Hold,
    /// The machine holds, comes to a standstill, and the run is over.
    HoldThenAbort,
}

/// The first word of the reason when a lost commander has caused the hold.
pub const COMMANDER_LOST: &str = "COMMANDER_LOST";

impl OnCommanderLoss {
    /// The words of the parameter.
    pub const WORDS: [(&'static str, Self); 3] = [
        ("continue", Self::Continue),
        ("hold", Self::Hold),
        ("hold_then_abort", Self::HoldThenAbort),
    ];
}

impl Context {
    fn commander_patience(&self) -> Duration {
        Duration::from_millis(u64::from(self.config.commander_timeout_ms))
    }

    /// Forgets a commander that was lost before this was begun: it has not begun it.
    pub(in crate::driver) fn forget_old_commander(&mut self) {
        let patience = self.commander_patience();
        self.commander_seen = self.commander_seen.filter(|seen| self.now < *seen + patience);
    }

    /// Takes a sign of life.
    pub(in crate::driver) fn on_heartbeat(&mut self) -> Answer {
        self.commander_seen = Some(self.now);
        Some(Ok("heard".into()))
    }

    /// When the commander counts as lost, if a run or a manual operation is under way.
    pub(in crate::driver) fn commander_deadline(&self) -> Option<Duration> {
        let seen = self.commander_seen.filter(|_| !self.excuses_commander())?;
        Some(seen + self.commander_patience())
    }

    /// Takes the commander for lost; gives the reason.
    pub(in crate::driver) fn lose_commander(&mut self) -> String {
        // It has to give another sign before it can be missed again.
        self.commander_seen = None;
        let patience = self.config.commander_timeout_ms;
        format!("{COMMANDER_LOST}: no sign of life for {patience} ms")
    }
}
