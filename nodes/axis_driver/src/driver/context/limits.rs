//! What the settings and offsets of the controller say about the machine, now.

use super::machine::Machine;
use crate::driver::output::ControllerSettings;
use crate::machine_limits::{LimitsProblem, MachineLimits, StoredOffsets};
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

/// The travel of all axes.
const TRAVEL_SETTINGS: std::ops::RangeInclusive<u16> = 130..=138;

impl CheckTravel {
    /// The words of the parameter.
    pub const WORDS: [(&'static str, Self); 3] =
        [("refuse", Self::Refuse), ("warn", Self::Warn), ("off", Self::Off)];
}

/// What a path is judged by.
#[derive(Debug)]
pub(in crate::driver) struct KnownLimits {
    /// As the machine is.
    pub(in crate::driver) now: MachineLimits,
    /// The same once it is homed.
    pub(in crate::driver) when_homed: MachineLimits,
    /// Why its travel cannot be read.
    pub(in crate::driver) unreadable: Option<String>,
}

impl Machine {
    /// What a path is judged by, as far as the controller has reported it.
    pub(in crate::driver) fn known_limits(&self) -> KnownLimits {
        let (mut limits, problems) = MachineLimits::as_far_as(&self.reported_settings());
        let is_of_travel = |problem: &&LimitsProblem| match problem {
            LimitsProblem::Missing { number, .. } | LimitsProblem::Range { number, .. } => {
                TRAVEL_SETTINGS.contains(number)
            }
            _ => false,
        };
        let mut unreadable = problems.iter().find(is_of_travel).map(ToString::to_string);
        if !self.has_units {
            // No length that it reports says anything.
            limits = MachineLimits { offsets: StoredOffsets::default(), ..limits };
            unreadable = Some("the controller has not reported its units ($13)".to_owned());
        }
        if let Some(name) = self.other_kinematics() {
            limits = limits.with_other_kinematics(name);
            unreadable = None;
        }
        let when_homed = limits.clone();
        let now = match self.is_homed {
            true => limits,
            false => limits.not_homed(),
        };
        KnownLimits { now, when_homed, unreadable }
    }

    /// The stored positions as they were reported; none without the units.
    pub(in crate::driver) fn known_offsets(&self) -> StoredOffsets {
        self.known_limits().now.offsets
    }

    fn reported_settings(&self) -> ControllerSettings {
        ControllerSettings {
            firmware: self.firmware,
            options: self.options.clone(),
            planner_blocks: self.blocks_that_are_planned(),
            axes: self.axis_letters(),
            settings: self.reported.iter().map(|(n, value)| (*n, value.clone())).collect(),
            offsets: self.stored_offsets(),
            spindle_sync: Some(self.has_spindle_sync),
            ports: Some(self.ports),
            ..ControllerSettings::default()
        }
    }

    /// The same for the time that a path takes.
    pub(in crate::driver) fn limits_for_time(&self) -> MachineLimits {
        let blocks = usize::from(self.blocks_that_are_planned());
        let limits = MachineLimits::of(&self.reported_settings());
        let limits = limits.unwrap_or_else(|_| MachineLimits::unknown(self.firmware, blocks));
        if self.is_homed { limits } else { limits.not_homed() }
    }

    /// Blocks of the planner, also of a firmware that does not report them.
    fn blocks_that_are_planned(&self) -> u16 {
        let usual = self.firmware.traits().unreported_planner_blocks;
        self.reported_planner_blocks().or(usual).unwrap_or(self.planner_blocks())
    }
}
