//! The settings by number, and where each firmware has its machine zero.

use super::{HOMING_ON, LimitsProblem, MachineZero};
use crate::codes::setting_name;
use crate::driver::ControllerSettings;
use crate::firmware::{Firmware, TravelRule};
use std::collections::BTreeMap;

/// The least rate, acceleration and resolution: controllers print three decimals. Of much less no time can
/// be computed.
const SETTING_MIN: f64 = 0.001;

fn what(firmware: Firmware, number: u16) -> String {
    match setting_name(firmware, number) {
        Some((name, "")) => name.to_owned(),
        Some((name, unit)) => format!("{name}, {unit}"),
        None => "a setting".to_owned(),
    }
}

/// What a number may be.
#[derive(Debug, Clone, Copy)]
pub(super) enum Range {
    ZeroOrMore,
    More,
}

/// The settings by number.
pub(super) struct Table<'a> {
    firmware: Firmware,
    values: BTreeMap<u16, &'a str>,
}

impl<'a> Table<'a> {
    pub(super) fn of(settings: &'a ControllerSettings) -> Self {
        let rows = settings.settings.iter().map(|(number, value)| (*number, value.trim()));
        Self { firmware: settings.firmware, values: rows.collect() }
    }

    pub(super) fn optional(&self, number: u16, range: Range) -> Result<Option<f64>, LimitsProblem> {
        let Some(text) = self.values.get(&number) else { return Ok(None) };
        let words = match range {
            Range::ZeroOrMore => "of at least 0",
            Range::More => "of at least 0.001",
        };
        let fits = |value: &f64| match range {
            Range::ZeroOrMore => value.is_finite() && *value >= 0.0,
            Range::More => value.is_finite() && *value >= SETTING_MIN,
        };
        match text.parse().ok().filter(fits) {
            Some(value) => Ok(Some(value)),
            None => Err(LimitsProblem::Range {
                number,
                what: what(self.firmware, number),
                value: (*text).to_owned(),
                range: words,
            }),
        }
    }

    pub(super) fn needed(&self, number: u16, range: Range) -> Result<f64, LimitsProblem> {
        self.optional(number, range)?.ok_or_else(|| LimitsProblem::Missing {
            number,
            what: what(self.firmware, number),
            firmware: self.firmware.traits().name,
        })
    }

    pub(super) fn mask(&self, number: u16) -> u32 {
        self.values.get(&number).and_then(|text| text.parse().ok()).unwrap_or(0)
    }

    pub(super) fn flag(&self, number: u16) -> bool {
        self.mask(number) != 0
    }

    /// Where the travel lies, as the check of each firmware has it.
    /// An axis whose travel is not readable has none.
    pub(super) fn zero(
        &self,
        settings: &ControllerSettings,
        travel: [Option<f64>; 3],
    ) -> MachineZero {
        if self.mask(22) & HOMING_ON == 0 {
            let because = "homing is switched off ($22=0)";
            return MachineZero::Unknown { because };
        }
        if let TravelRule::Unreported { because } = settings.firmware.traits().travel {
            return MachineZero::Unplaced { because };
        }
        let bounds = |axis: usize| {
            self.is_axis_homed(axis)
                .then(|| self.bounds(settings, axis, travel[axis].unwrap_or(0.0)))
        };
        MachineZero::Placed { bounds_mm: std::array::from_fn(bounds) }
    }

    /// Whether homing takes in an axis. grblHAL says so (`$44` and up, one mask for each pass); the
    /// others home X, Y and Z.
    pub(super) fn is_axis_homed(&self, axis: usize) -> bool {
        match self.values.contains_key(&44) {
            true => (44..=49).any(|pass| self.mask(pass) >> axis & 1 == 1),
            false => axis < 3,
        }
    }

    /// Least and greatest coordinate of an axis that is homed, as the check of the firmware has it.
    pub(super) fn bounds(
        &self,
        settings: &ControllerSettings,
        axis: usize,
        travel: f64,
    ) -> [f64; 2] {
        let is_negative_homing = self.mask(23) >> axis & 1 == 1;
        let is_kept = match settings.firmware.traits().travel {
            TravelRule::WithoutPullOff { .. } => self.flag(20) && self.flag(21),
            TravelRule::Whole { .. } | TravelRule::Unreported { .. } => false,
        };
        let reported = self.values.get(&27).and_then(|text| text.parse().ok());
        let pull_off: f64 = reported.filter(|_| is_kept).unwrap_or(0.0);
        match (self.zero_is_at_the_switches(settings), is_negative_homing) {
            (true, true) => [0.0, travel - pull_off],
            (true, false) => [pull_off - travel, 0.0],
            (false, _) => [pull_off - travel, 0.0 - pull_off],
        }
    }

    /// Whether homing makes the places of the switches the machine zero.
    fn zero_is_at_the_switches(&self, settings: &ControllerSettings) -> bool {
        match settings.firmware.traits().travel {
            TravelRule::Unreported { .. } => false,
            TravelRule::Whole { letter_of_zero_at_switches } => {
                settings.options.contains(letter_of_zero_at_switches)
            }
            TravelRule::WithoutPullOff { zero_at_switches } => {
                self.mask(22) & zero_at_switches != 0
            }
        }
    }

    /// Where homing leaves an axis, machine frame, as `limits_go_home` of grbl and
    /// `limits_set_machine_positions` of grblHAL have it: off its switch by the pull-off (`$27`), and
    /// at 0 where that is the zero. FluidNC does not report it.
    pub(super) fn home(
        &self,
        settings: &ControllerSettings,
        axis: usize,
        travel: Option<f64>,
    ) -> Option<f64> {
        let is_homed = self.mask(22) & HOMING_ON != 0 && self.is_axis_homed(axis);
        let is_reported =
            !matches!(settings.firmware.traits().travel, TravelRule::Unreported { .. });
        if !is_homed || !is_reported {
            return None;
        }
        if self.zero_is_at_the_switches(settings) {
            return Some(0.0);
        }
        let pull_off = self.optional(27, Range::ZeroOrMore).ok()??;
        match self.mask(23) >> axis & 1 == 1 {
            true => Some(pull_off - travel?),
            false => Some(0.0 - pull_off),
        }
    }

    pub(super) fn has(&self, number: u16) -> bool {
        self.values.contains_key(&number)
    }

    pub(super) fn is(&self, number: u16, value: &str) -> bool {
        self.values.get(&number) == Some(&value)
    }
}
