//! The driver at rest as JSON, so that a record can begin there.
//!
//! Without it, playing the last run again would need the record of a whole day. Only a
//! driver that waits for commands is written: nothing is under way then, and the context
//! is all its state.

use super::context::Context;
use super::context::hold::HoldWatch;
use super::context::machine::Machine;
use super::context::overrides::OverrideWatch;
use super::context::ros_loss::RosLoss;
use super::{Driver, DriverConfig, Phase};
use crate::link::{Link, LinkAtRest};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

/// The state of a driver at rest.
#[derive(Debug, Serialize, Deserialize)]
struct Checkpoint {
    config: DriverConfig,
    now: Duration,
    link: LinkAtRest,
    machine: Machine,
    hold: Option<HoldWatch>,
    #[serde(default)]
    overrides: Option<OverrideWatch>,
    #[serde(default, rename = "commander_heard")]
    commander_seen: Option<Duration>,
    #[serde(default)]
    is_single_block: bool,
    #[serde(default = "active")]
    is_active: bool,
    #[serde(default)]
    ros_loss: Option<RosLoss>,
}

/// Older records have no such field.
fn active() -> bool {
    true
}

/// The same, borrowed. The order of the fields is that of the JSON.
#[derive(Debug, Serialize)]
struct CheckpointRef<'a> {
    config: &'a DriverConfig,
    now: Duration,
    link: LinkAtRest,
    machine: &'a Machine,
    hold: Option<&'a HoldWatch>,
    overrides: Option<&'a OverrideWatch>,
    #[serde(rename = "commander_heard")]
    commander_seen: Option<Duration>,
    is_single_block: bool,
    is_active: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    ros_loss: Option<RosLoss>,
}

impl Driver {
    /// Gives the driver as JSON; `None` unless it waits for commands with nothing under way.
    ///
    /// Outputs have to be taken before.
    pub fn checkpoint(&self) -> Option<String> {
        let is_at_rest = matches!(self.phase, Phase::Ready)
            && self.check.is_none()
            && self.leaving.is_none()
            && self.context.outputs.is_empty();
        let context = &self.context;
        let checkpoint = CheckpointRef {
            config: &context.config,
            now: context.now,
            link: context.link.at_rest().filter(|_| is_at_rest)?,
            machine: &context.machine,
            hold: context.hold.as_ref(),
            overrides: context.overrides.as_ref(),
            commander_seen: context.commander_seen,
            is_single_block: context.is_single_block,
            is_active: self.is_active,
            ros_loss: context.ros_loss,
        };
        let text = serde_json::to_string(&checkpoint);
        Some(text.expect("a struct of numbers and texts is always JSON"))
    }

    /// Gives a driver that goes on from a checkpoint.
    pub fn from_checkpoint(json: &[u8]) -> Result<Self, serde_json::Error> {
        let Checkpoint {
            config,
            now,
            link,
            machine,
            hold,
            overrides,
            commander_seen,
            is_single_block,
            is_active,
            ros_loss,
        } = serde_json::from_slice(json)?;
        let context = Context {
            link: Link::from_rest(config.link(), link),
            config,
            now,
            machine,
            hold,
            overrides,
            commander_seen,
            ros_loss,
            is_single_block,
            // A run clears it when it begins.
            not_checked: BTreeSet::new(),
            outputs: VecDeque::new(),
        };
        let mut driver = Self {
            context,
            phase: Phase::Ready,
            check: None,
            paused: None,
            is_active,
            leaving: None,
            published: None,
        };
        driver.published = Some(driver.compose());
        Ok(driver)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::Input;

    const IDLE: &str = "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>";

    /// What a driver writes that is connected and hears these lines, the last of them after a checkpoint if
    /// `is_restored`.
    fn written(lines: &[&str], is_restored: bool) -> Vec<Vec<u8>> {
        let connect = [IDLE, "Grbl 1.1h ['$' for help]", "ok", "ok", "ok", "ok", IDLE];
        let mut driver = Driver::new(DriverConfig::default());
        let mut now = Duration::ZERO;
        let mut hear = |driver: &mut Driver, input| {
            now += Duration::from_millis(7);
            driver.handle(now, input);
            let outputs = std::iter::from_fn(|| driver.poll_output());
            outputs
                .filter_map(|output| match output {
                    crate::driver::Output::Transmit(bytes) => Some(bytes),
                    _ => None,
                })
                .collect::<Vec<_>>()
        };
        hear(&mut driver, Input::PortOpened);
        let (last, before) = lines.split_last().expect("a line");
        let received = |line: &str| Input::Received(format!("{line}\r\n").into_bytes());
        for line in connect.iter().chain(before) {
            hear(&mut driver, received(line));
        }
        if is_restored {
            let json = driver.checkpoint().expect("a driver at rest");
            driver = Driver::from_checkpoint(json.as_bytes()).expect("it was written just now");
        }
        hear(&mut driver, received(last))
    }

    #[test]
    fn a_driver_of_a_checkpoint_asks_for_offsets_no_more_often_than_the_one_before() {
        const ASKS: &[&[u8]] = &[b"$#\n"];
        const SET: &str = "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:5.000,0.000,0.000>";
        for (lines, expected) in [
            // No stored offset explains the one in force.
            (&[IDLE][..], ASKS),
            // It was asked about.
            (&[IDLE, "ok", IDLE], &[]),
            // Another one, in two reports.
            (&[IDLE, "ok", SET, SET], ASKS),
        ] {
            assert_eq!(written(lines, false), expected, "{lines:?}");
            assert_eq!(written(lines, true), expected, "{lines:?} from a checkpoint");
        }
    }
}
