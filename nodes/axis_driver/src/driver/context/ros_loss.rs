//! Watches whether the driver can be reached over ROS.
//!
//! The ROS side of the driver is a process of its own, which is restarted when it ends.
//! Meanwhile the line is served, and a parameter decides whether the machine holds.

use super::Context;
use crate::driver::answer::{Answer, done};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What is done while the driver cannot be reached over ROS.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnRosLoss {
    /// A commander that gave signs of life counts as lost when they stay away; else the run
    /// goes on.
    #[default]
    AsCommander,
    /// What is under way goes on to its end.
    Finish,
    /// The machine holds after a time.
    Hold,
}

impl OnRosLoss {
    /// The words of the parameter.
    pub const WORDS: [(&'static str, Self); 3] =
        [("as_commander", Self::AsCommander), ("finish", Self::Finish), ("hold", Self::Hold)];
}

/// The first word of the reason when a lost ROS side has caused the hold.
pub const ROS_LOST: &str = "ROS_LOST";

/// The driver cannot be reached over ROS.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::driver) struct RosLoss {
    since: Duration,
    /// The machine was held for it.
    is_answered: bool,
}

impl Context {
    /// The ROS side has come or gone.
    pub(in crate::driver) fn on_ros_face(&mut self, is_there: bool) -> Answer {
        match (is_there, self.ros_loss) {
            (false, None) => {
                self.ros_loss = Some(RosLoss { since: self.now, is_answered: false });
            }
            (true, Some(_)) => {
                self.ros_loss = None;
                // A commander could not be heard, and has to find the face first.
                if self.config.on_ros_loss == OnRosLoss::Finish {
                    self.commander_seen = self.commander_seen.map(|_| self.now);
                }
            }
            _ => {}
        }
        done("noted")
    }

    /// Whether a commander that is not heard counts as present.
    pub(in crate::driver) fn excuses_commander(&self) -> bool {
        self.ros_loss.is_some() && self.config.on_ros_loss == OnRosLoss::Finish
    }

    /// When the machine is held because it cannot be reached, if something is under way.
    pub(in crate::driver) fn ros_deadline(&self) -> Option<Duration> {
        let loss = self.ros_loss.filter(|loss| !loss.is_answered)?;
        let patience = Duration::from_millis(u64::from(self.config.ros_loss_timeout_ms));
        (self.config.on_ros_loss == OnRosLoss::Hold).then_some(loss.since + patience)
    }

    /// Takes ROS for lost; gives the reason.
    pub(in crate::driver) fn lose_ros(&mut self) -> String {
        if let Some(loss) = &mut self.ros_loss {
            loss.is_answered = true;
        }
        let patience = self.config.ros_loss_timeout_ms;
        format!("{ROS_LOST}: the ROS side of the driver has been away for {patience} ms")
    }
}
