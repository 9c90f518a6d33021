//! Whether anybody can be reached over ROS.
//!
//! The ROS face of the driver is a process of its own, which is started again when it ends.
//! Meanwhile the line is served, and this says what becomes of what moves.

use super::command::{Answer, done};
use super::{Driver, LogLevel, Phase};
use crate::codes::error_code;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What is done while nobody can be reached over ROS.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnRosLoss {
    /// A commander that gave signs of life counts as lost when they stay away; else the run
    /// goes on.
    #[default]
    AsCommander,
    /// What was begun goes on to its end.
    Finish,
    /// The machine holds when nobody could be reached for a time.
    Hold,
}

impl OnRosLoss {
    /// The words of the parameter.
    pub const WORDS: [(&'static str, Self); 3] =
        [("as_commander", Self::AsCommander), ("finish", Self::Finish), ("hold", Self::Hold)];
}

/// How the reason of a hold begins that is due to it.
pub const ROS_LOST: &str = "ROS_LOST";

/// Nobody can be reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct RosLoss {
    since: Duration,
    /// What there was to do about it was done.
    is_answered: bool,
}

impl Driver {
    /// The ROS face has come or gone.
    pub(super) fn hear_ros_face(&mut self, is_there: bool) -> Answer {
        match (is_there, self.ros_loss) {
            (false, None) => {
                self.ros_loss = Some(RosLoss { since: self.now, is_answered: false });
            }
            (true, Some(_)) => {
                self.ros_loss = None;
                // A commander could not be heard, and has to find the face first.
                if self.config.on_ros_loss == OnRosLoss::Finish {
                    self.commander_heard = self.commander_heard.map(|_| self.now);
                }
            }
            _ => {}
        }
        done("noted")
    }

    /// Whether a commander that is not heard may be there all the same.
    pub(super) fn excuses_commander(&self) -> bool {
        self.ros_loss.is_some() && self.config.on_ros_loss == OnRosLoss::Finish
    }

    /// When the machine is held because nobody can be reached.
    pub(super) fn ros_deadline(&self) -> Option<Duration> {
        let loss = self.ros_loss.filter(|loss| !loss.is_answered)?;
        let patience = Duration::from_millis(u64::from(self.config.ros_loss_timeout_ms));
        let moves = matches!(self.phase, Phase::Running(_) | Phase::Manual(_));
        (moves && self.config.on_ros_loss == OnRosLoss::Hold).then_some(loss.since + patience)
    }

    pub(super) fn watch_ros(&mut self) {
        if self.ros_deadline().is_none_or(|deadline| self.now < deadline) {
            return;
        }
        if let Some(loss) = &mut self.ros_loss {
            loss.is_answered = true;
        }
        let patience = self.config.ros_loss_timeout_ms;
        let text = format!("{ROS_LOST}: nobody can be reached over ROS for {patience} ms");
        self.log(LogLevel::Warn, text.clone());
        self.hold_unattended(error_code::COMMANDER_LOST, &text);
    }
}
