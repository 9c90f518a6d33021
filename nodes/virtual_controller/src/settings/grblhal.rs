//! What the settings of grblHAL mean; in other firmware they count as zero.

use super::Settings;

/// `$42` and `$56` to `$59`: the parking axis, its positions and its feeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ParkingSettings {
    pub(crate) axis: usize,
    pub(crate) pull_out_mm: f64,
    pub(crate) pull_out_mm_per_min: f64,
    /// Machine coordinate of the axis, mm.
    pub(crate) target_mm: f64,
    pub(crate) fast_mm_per_min: f64,
}

impl Settings {
    fn bit(&self, number: u16, bit: u32) -> bool {
        self.extra(number) as u16 & (1 << bit) != 0
    }

    /// `$21` bit 1: a closed limit switch at a reset is an alarm.
    pub(crate) fn checks_limits_at_reset(&self) -> bool {
        self.hard_limits() && self.bit(21, 1)
    }

    /// `$22` bit 1: `$HX` and similar.
    pub(crate) fn homes_single_axes(&self) -> bool {
        self.bit(22, 1)
    }

    /// `$22` bit 2: only homing unlocks after switching on.
    pub(crate) fn homing_required(&self) -> bool {
        self.homing_enabled() && self.bit(22, 2)
    }

    /// `$39`: `!`, `?` and `~` take effect within comments and `$` lines, too.
    pub(crate) fn legacy_realtime(&self) -> bool {
        self.get(39).is_none_or(|value| value != 0.0)
    }

    /// `$40`: jogs are shortened to the travel instead of rejected.
    pub(crate) fn clips_jogs(&self) -> bool {
        self.extra(40) != 0.0
    }

    /// `$41` bit 0.
    pub(crate) fn parks(&self) -> bool {
        self.bit(41, 0)
    }

    /// `$42` and `$56` to `$59`.
    pub(crate) fn parking(&self) -> ParkingSettings {
        ParkingSettings {
            axis: self.extra(42) as usize,
            pull_out_mm: self.extra(56),
            pull_out_mm_per_min: self.extra(57),
            target_mm: self.extra(58),
            fast_mm_per_min: self.extra(59),
        }
    }

    /// `$62`.
    pub(crate) fn sleep_enabled(&self) -> bool {
        self.extra(62) != 0.0
    }

    /// `$64`: locked after switching on.
    pub(crate) fn forces_initial_alarm(&self) -> bool {
        self.extra(64) != 0.0
    }

    /// `$341=4`: M6 has no effect.
    pub(crate) fn ignores_tool_changes(&self) -> bool {
        (self.extra(341) - 4.0).abs() < 0.5
    }

    /// `$392` and `$393`, seconds: until spindle and coolant are back after a door.
    pub(crate) fn door_delays_s(&self) -> Option<(f64, f64)> {
        Some((self.get(392)?, self.get(393)?))
    }

    /// `$398`: blocks of the planner from the next power-up on.
    pub(crate) fn planner_blocks(&self) -> Option<usize> {
        self.get(398).map(|blocks| blocks as usize)
    }

    /// `$481`, seconds between automatic reports; `None`: there are none.
    pub(crate) fn report_interval_s(&self) -> Option<f64> {
        Some(self.extra(481) / 1000.0).filter(|seconds| *seconds > 0.0)
    }

    /// `$676` bit 0: a reset that loses the position forgets that the axes were homed.
    pub(crate) fn forgets_homing(&self) -> bool {
        self.get(676).is_none_or(|value| value as u16 & 1 != 0)
    }
}
