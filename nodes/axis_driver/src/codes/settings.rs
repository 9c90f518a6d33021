//! What `$n` is and its unit.
//!
//! The settings of grbl 1.1, which FluidNC repeats in its `$$`. [`crate::firmware`] has those of
//! grblHAL that its core always has; its boards and plugins add many more, which only the
//! controller itself can name (`$ES`). No setting is changed by knowing its name.

use crate::firmware::{Firmware, SettingRow};

#[rustfmt::skip]
const GRBL: &[SettingRow] = &[
    (0, "step pulse time", "µs"),
    (1, "step idle delay", "ms"),
    (2, "step pulse invert", "mask"),
    (3, "step direction invert", "mask"),
    (4, "step enable invert", "boolean"),
    (5, "limit pins invert", "boolean"),
    (6, "probe pin invert", "boolean"),
    (10, "status report options", "mask"),
    (11, "junction deviation", "mm"),
    (12, "arc tolerance", "mm"),
    (13, "report in inches", "boolean"),
    (20, "soft limits", "boolean"),
    (21, "hard limits", "boolean"),
    (22, "homing cycle", "boolean"),
    (23, "homing direction invert", "mask"),
    (24, "homing locate feed rate", "mm/min"),
    (25, "homing search seek rate", "mm/min"),
    (26, "homing switch debounce delay", "ms"),
    (27, "homing switch pull-off distance", "mm"),
    (30, "maximum spindle speed", "rpm"),
    (31, "minimum spindle speed", "rpm"),
    (32, "laser mode", "boolean"),
];

/// Four settings for each axis, from these numbers on. A, B and C are in degrees
/// where the controller knows that they turn.
#[rustfmt::skip]
const AXES: [(u16, [&str; 6], &str, &str); 4] = [
    (100, [
        "X-axis travel resolution", "Y-axis travel resolution", "Z-axis travel resolution",
        "A-axis travel resolution", "B-axis travel resolution", "C-axis travel resolution",
    ], "step/mm", "step/mm or step/deg"),
    (110, [
        "X-axis maximum rate", "Y-axis maximum rate", "Z-axis maximum rate",
        "A-axis maximum rate", "B-axis maximum rate", "C-axis maximum rate",
    ], "mm/min", "mm/min or deg/min"),
    (120, [
        "X-axis acceleration", "Y-axis acceleration", "Z-axis acceleration",
        "A-axis acceleration", "B-axis acceleration", "C-axis acceleration",
    ], "mm/s²", "mm/s² or deg/s²"),
    (130, [
        "X-axis maximum travel", "Y-axis maximum travel", "Z-axis maximum travel",
        "A-axis maximum travel", "B-axis maximum travel", "C-axis maximum travel",
    ], "mm", "mm or deg"),
];

/// The axes that never turn.
const LINEAR_AXES: usize = 3;

/// The name of `$number` on this firmware and its unit, empty where it has none;
/// `None` when nobody here knows it.
pub fn setting_name(firmware: Firmware, number: u16) -> Option<(&'static str, &'static str)> {
    let find = |rows: &'static [SettingRow]| {
        let row = rows.iter().find(|row| row.0 == number);
        row.map(|(_, name, unit)| (*name, *unit))
    };
    find(firmware.traits().settings)
        .or_else(|| find(GRBL))
        .or_else(|| axis_setting(firmware, number))
}

fn axis_setting(firmware: Firmware, number: u16) -> Option<(&'static str, &'static str)> {
    let axes = firmware.traits().axes;
    AXES.iter().find_map(|(first, names, linear, either)| {
        let axis = usize::from(number.checked_sub(*first)?);
        let unit = if axis < LINEAR_AXES { linear } else { either };
        names[..axes].get(axis).map(|name| (*name, *unit))
    })
}
