//! What `$n` is and its unit.
//!
//! The settings of grbl 1.1, which FluidNC repeats in its `$$`, and those of grblHAL
//! that its core always has; boards and plugins of grblHAL add many more, which only
//! the controller itself can name (`$ES`). No setting is changed by knowing its name.

use crate::report::Firmware;

/// Number, name, unit; a mask has one bit for each axis or option.
type Row = (u16, &'static str, &'static str);

#[rustfmt::skip]
const GRBL: &[Row] = &[
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

/// Where grblHAL differs from grbl, and what it adds.
#[rustfmt::skip]
const GRBL_HAL: &[Row] = &[
    (4, "step enable invert", "mask"),
    (5, "limit pins invert", "mask"),
    (6, "probe pin invert", "mask"),
    (9, "PWM spindle options", "mask"),
    (14, "control pins invert", "mask"),
    (15, "coolant pins invert", "mask"),
    (17, "control pins pull-up off", "mask"),
    (18, "limit pins pull-up off", "mask"),
    (19, "probe pin pull-up off", "mask"),
    (20, "soft limits", "mask"),
    (21, "hard limits", "mask"),
    (22, "homing cycle", "mask"),
    (28, "G73 retract distance", "mm"),
    (29, "step pulse delay", "µs"),
    (32, "mode of operation: 0 normal, 1 laser, 2 lathe", ""),
    (33, "spindle PWM frequency", "Hz"),
    (34, "spindle PWM off value", "%"),
    (35, "spindle PWM minimum value", "%"),
    (36, "spindle PWM maximum value", "%"),
    (37, "steppers that stay enabled", "mask"),
    (39, "printable real-time bytes", "boolean"),
    (40, "jogs limited to the travel", "boolean"),
    (41, "parking cycle", "mask"),
    (42, "parking axis", ""),
    (43, "homing passes", ""),
    (44, "axes homed first", "mask"),
    (45, "axes homed second", "mask"),
    (46, "axes homed third", "mask"),
    (56, "parking pull-out distance", "mm"),
    (57, "parking pull-out rate", "mm/min"),
    (58, "parking target", "mm"),
    (59, "parking fast rate", "mm/min"),
    (60, "overrides restored by a reset", "boolean"),
    (61, "safety door options", "mask"),
    (62, "sleep", "boolean"),
    (63, "feed hold actions", "mask"),
    (64, "locked at start", "boolean"),
    (65, "probing options", "mask"),
    (341, "tool change mode", ""),
    (342, "tool change probing distance", "mm"),
    (343, "tool change locate feed rate", "mm/min"),
    (344, "tool change search seek rate", "mm/min"),
    (345, "tool change probe pull-off rate", "mm/min"),
    (346, "tool change options", "mask"),
    (384, "G92 forgotten at power-off", "boolean"),
    (392, "spindle on delay when a door closes", "s"),
    (393, "coolant on delay when a door closes", "s"),
    (394, "spindle on delay", "s"),
    (398, "planner buffer blocks", ""),
    (481, "automatic report interval", "ms"),
    (485, "tool number kept at power-off", "boolean"),
    (486, "work systems locked against changes", "mask"),
    (539, "spindle off delay", "s"),
    (673, "coolant on delay", "s"),
    (676, "what a reset clears", "mask"),
    (680, "stepper enable delay", "ms"),
];

/// Four settings for each axis, from these numbers on. A, B and C are in degrees
/// where the controller is told that they turn.
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

/// Axes of grbl 1.1.
const GRBL_AXES: usize = 3;

/// The name of `$number` on this firmware and its unit, empty where it has none;
/// `None` when nobody here knows it.
pub fn setting_name(firmware: Firmware, number: u16) -> Option<(&'static str, &'static str)> {
    let find = |rows: &[Row]| {
        let row = rows.iter().find(|row| row.0 == number);
        row.map(|(_, name, unit)| (*name, *unit))
    };
    let own = if firmware == Firmware::GrblHal { find(GRBL_HAL) } else { None };
    own.or_else(|| find(GRBL)).or_else(|| axis_setting(firmware, number))
}

fn axis_setting(firmware: Firmware, number: u16) -> Option<(&'static str, &'static str)> {
    let axes = if firmware == Firmware::Grbl { GRBL_AXES } else { AXES[0].1.len() };
    AXES.iter().find_map(|(first, names, linear, either)| {
        let axis = usize::from(number.checked_sub(*first)?);
        let unit = if axis < GRBL_AXES { linear } else { either };
        names[..axes].get(axis).map(|name| (*name, *unit))
    })
}
