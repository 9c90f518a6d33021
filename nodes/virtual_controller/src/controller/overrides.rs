//! Overrides: when their bytes take effect, and how they add up.
//!
//! grblHAL and FluidNC queue the bytes. grbl 1.1h sets a bit for each kind of byte and checks
//! the bits once in each pass of its main loop. So equal bytes between two passes count once,
//! and the bits take effect in a fixed order, whatever the order of the bytes was. It adds in
//! eight bits: a result below zero wraps to 255, which is then limited to 200 percent.
//! Source: `protocol_exec_rt_system` of grbl 1.1h, `override.c` of grblHAL.

use std::time::Duration;

use super::Controller;
use crate::receive::OverrideChange::{self, FeedBy, FeedReset, Rapid, SpindleBy, SpindleReset};

/// The order in which grbl 1.1h executes override bits.
const ORDER: [OverrideChange; 13] = [
    FeedReset,
    FeedBy(10),
    FeedBy(-10),
    FeedBy(1),
    FeedBy(-1),
    Rapid(100),
    Rapid(50),
    Rapid(25),
    SpindleReset,
    SpindleBy(10),
    SpindleBy(-10),
    SpindleBy(1),
    SpindleBy(-1),
];
/// The limits of all overrides, percent.
const PERCENT_MIN: u8 = 10;
const PERCENT_MAX: u8 = 200;

/// Flags that wait for the next pass of the main loop.
#[derive(Debug, Clone, Default)]
pub(super) struct OverrideFlags {
    set: Vec<OverrideChange>,
    pub(super) due: Option<Duration>,
}

impl Controller {
    /// Receives an override byte.
    pub(super) fn ask_override(&mut self, change: OverrideChange) {
        let Some(pass) = self.traits().override_pass else {
            return self.change_overrides(&[change]);
        };
        let OverrideFlags { set, due } = &mut self.override_flags;
        if !set.contains(&change) {
            set.push(change);
        }
        due.get_or_insert(self.now + pass);
    }

    /// A pass of the main loop: executes the flags.
    pub(super) fn look_at_overrides(&mut self) {
        let OverrideFlags { set, .. } = std::mem::take(&mut self.override_flags);
        let ordered: Vec<_> = ORDER.into_iter().filter(|change| set.contains(change)).collect();
        self.change_overrides(&ordered);
    }

    fn change_overrides(&mut self, changes: &[OverrideChange]) {
        let mut overrides = self.planner.overrides();
        let mut spindle = self.spindle_percent;
        for change in changes {
            match *change {
                FeedReset => overrides.feed_percent = 100,
                FeedBy(by) => add(&mut overrides.feed_percent, by),
                Rapid(percent) => overrides.rapid_percent = percent,
                SpindleReset => spindle = 100,
                SpindleBy(by) => add(&mut spindle, by),
            }
        }
        overrides.feed_percent = overrides.feed_percent.clamp(PERCENT_MIN, PERCENT_MAX);
        spindle = spindle.clamp(PERCENT_MIN, PERCENT_MAX);
        if overrides != self.planner.overrides() || spindle != self.spindle_percent {
            self.planner.set_overrides(overrides);
            self.spindle_percent = spindle;
            self.cadence.overrides_changed();
        }
    }
}

/// Adds in eight bits, as grbl 1.1h does.
fn add(percent: &mut u8, by: i16) {
    *percent = percent.wrapping_add_signed(i8::try_from(by).unwrap_or_default());
}
