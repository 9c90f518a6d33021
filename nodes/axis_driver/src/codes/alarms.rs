//! What `ALARM:N` means: why the controller locked itself, and how to go on.

use super::Texts;

#[rustfmt::skip]
pub(super) const TEXTS: Texts = Texts {
    shared: &[
        (1, "a limit switch was hit; the position is probably lost: reset, then home"),
        (2, "the target lies outside the travel of the machine; the position is kept: reset, then unlock"),
        (3, "reset while moving; the position is probably lost: home"),
        (4, "the probe was not in its initial state before probing: check its wiring and what it touches"),
        (5, "the probe touched nothing within its travel"),
        (6, "homing was interrupted by a reset: home again"),
        (7, "the safety door was opened while homing: close it and home again"),
        (8, "pulling off did not clear the limit switch: increase the pull-off ($27) or check the wiring"),
        (9, "no limit switch was found within the search distance: check travel ($130 to $132), pull-off ($27) and wiring"),
    ],
    grbl: &[
        (10, "the second switch of a dual axis was not found after the first: check its wiring"),
    ],
    grbl_hal: &[
        (10, "the machine's emergency stop is active: release it, then reset"),
        (11, "the machine must be homed before anything else"),
        (12, "a limit switch is engaged: move the axis off it"),
        (13, "the probe was touched outside of probing: clear it"),
        (14, "the spindle did not reach its speed in time"),
        (15, "the second switch of an axis with two motors was not found: check travel, pull-off ($27) and wiring"),
        (16, "the controller failed its own test at power-up: switch it off and on"),
        (17, "a motor driver reports a fault: clear it, then reset and home"),
        (18, "homing is not configured as it must be: check $22 and $44 to $46"),
        (19, "a Modbus device did not answer as it should: check the spindle drive and its cable"),
        (20, "the controller lost its input and output expander: reset"),
        (21, "the memory for settings failed: check all settings"),
        (22, "more was sent than the controller could take"),
    ],
    fluid_nc: &[
        (10, "the spindle did not follow its command: check its drive and cable"),
        (11, "an input is active that must not be at the start: check its pin and polarity"),
        (12, "two limit switches report at once and it is not clear which: clear both"),
        (13, "a stop that acts at once was asked for; the position is probably lost: reset, then home"),
        (14, "the machine must be homed before anything else"),
        (15, "the controller starts locked: home or unlock"),
        (16, "the controller's input and output expander restarted: reset, then home"),
        (17, "a line of a job was refused"),
        (18, "the probe was touched where it must not be; the position is probably lost: home"),
    ],
};
