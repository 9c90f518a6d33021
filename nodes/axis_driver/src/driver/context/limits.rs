//! What the settings and offsets of the controller say about the machine, now.

use super::machine::Machine;
use crate::driver::output::ControllerSettings;
use crate::machine_limits::{LimitsProblem, MachineLimits};
use serde::{Deserialize, Serialize};

/// What is done when a program leaves the travel of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CheckTravel {
    /// Nothing is compared. Drivers of before had no such check.
    #[default]
    Off,
    /// It is logged, and the run begins.
    Warn,
    /// The run is refused.
    Refuse,
}

impl CheckTravel {
    /// The words of the parameter.
    pub const WORDS: [(&'static str, Self); 3] =
        [("refuse", Self::Refuse), ("warn", Self::Warn), ("off", Self::Off)];
}

impl Machine {
    /// What a path is judged by; an error where the controller has not reported enough.
    pub(in crate::driver) fn limits(&self) -> Result<MachineLimits, LimitsProblem> {
        let limits = self.limits_when_homed()?;
        Ok(match self.is_homed {
            true => limits,
            false => limits.not_homed(),
        })
    }

    /// The same for a path that homes the machine before it moves.
    pub(in crate::driver) fn limits_when_homed(&self) -> Result<MachineLimits, LimitsProblem> {
        let settings = ControllerSettings {
            firmware: self.firmware,
            options: self.options.clone(),
            planner_blocks: self.blocks_that_are_planned(),
            axes: self.axis_letters(),
            settings: self.reported.iter().map(|(n, value)| (*n, value.clone())).collect(),
            offsets: self.stored_offsets(),
            spindle_sync: Some(self.has_spindle_sync),
            ports: Some(self.ports),
            ..ControllerSettings::default()
        };
        MachineLimits::of(&settings)
    }

    /// The same for the time that a path takes.
    pub(in crate::driver) fn limits_for_time(&self) -> MachineLimits {
        let blocks = usize::from(self.blocks_that_are_planned());
        self.limits().unwrap_or_else(|_| MachineLimits::unknown(self.firmware, blocks))
    }

    /// Blocks of the planner, also of a firmware that does not report them.
    fn blocks_that_are_planned(&self) -> u16 {
        let usual = self.firmware.traits().unreported_planner_blocks;
        self.reported_planner_blocks().or(usual).unwrap_or(self.planner_blocks())
    }
}
