//! The driver at rest, written down, so that a record can begin there.
//!
//! A record of a whole day would be needed otherwise to play the last run again.
//! Only a driver that waits for orders is written: nothing is under way then, and
//! what it knows of the controller is all there is.

use super::machine::Machine;
use super::overrides::OverrideWatch;
use super::ros_loss::RosLoss;
use super::stop::HoldWatch;
use super::{Driver, DriverConfig, Phase};
use crate::link::{Link, LinkAtRest};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::time::Duration;

#[derive(Debug, Serialize, Deserialize)]
struct Checkpoint {
    config: DriverConfig,
    now: Duration,
    link: LinkAtRest,
    machine: Machine,
    hold: Option<HoldWatch>,
    #[serde(default)]
    overrides: Option<OverrideWatch>,
    #[serde(default)]
    commander_heard: Option<Duration>,
    #[serde(default)]
    is_single_block: bool,
    #[serde(default = "active")]
    is_active: bool,
    #[serde(default)]
    ros_loss: Option<RosLoss>,
}

/// Records of before could not say otherwise.
fn active() -> bool {
    true
}

/// The same, borrowed.
#[derive(Debug, Serialize)]
struct CheckpointRef<'a> {
    config: &'a DriverConfig,
    now: Duration,
    link: LinkAtRest,
    machine: &'a Machine,
    hold: Option<&'a HoldWatch>,
    overrides: Option<&'a OverrideWatch>,
    commander_heard: Option<Duration>,
    is_single_block: bool,
    is_active: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    ros_loss: Option<RosLoss>,
}

impl Driver {
    /// The driver as JSON; `None` unless it waits for orders with nothing under way.
    ///
    /// Outputs have to be taken before.
    pub fn checkpoint(&self) -> Option<String> {
        let is_at_rest = matches!(self.phase, Phase::Ready)
            && self.check.is_none()
            && self.leaving.is_none()
            && self.outputs.is_empty();
        let checkpoint = CheckpointRef {
            config: &self.config,
            now: self.now,
            link: self.link.at_rest().filter(|_| is_at_rest)?,
            machine: &self.machine,
            hold: self.hold.as_ref(),
            overrides: self.overrides.as_ref(),
            commander_heard: self.commander_heard,
            is_single_block: self.is_single_block,
            is_active: self.is_active,
            ros_loss: self.ros_loss,
        };
        let text = serde_json::to_string(&checkpoint);
        Some(text.expect("a struct of numbers and texts is always JSON"))
    }

    /// A driver that goes on from a checkpoint.
    pub fn from_checkpoint(json: &[u8]) -> Result<Self, serde_json::Error> {
        let Checkpoint {
            config,
            now,
            link,
            machine,
            hold,
            overrides,
            commander_heard,
            is_single_block,
            is_active,
            ros_loss,
        } = serde_json::from_slice(json)?;
        let mut driver = Self {
            link: Link::from_rest(config.link(), link),
            config,
            now,
            phase: Phase::Ready,
            machine,
            check: None,
            paused: None,
            hold,
            overrides,
            shift_before: [0.0; 3],
            commander_heard,
            is_single_block,
            is_active,
            ros_loss,
            leaving: None,
            outputs: VecDeque::new(),
            published: None,
        };
        driver.published = Some(driver.compose());
        Ok(driver)
    }
}
