//! What `ALARM:N` means: why the controller locked itself, and how to go on.
//!
//! The numbers that all firmwares share; the others are in [`crate::firmware`].

use crate::firmware::CodeRow;

#[rustfmt::skip]
pub(super) const SHARED: &[CodeRow] = &[
    (1, "a limit switch was hit; the position is probably lost: reset, then home"),
    (2, "the target lies outside the travel of the machine; the position is kept: reset, then unlock"),
    (3, "reset while moving; the position is probably lost: home"),
    (4, "the probe was not in its initial state before probing: check its wiring and what it touches"),
    (5, "the probe touched nothing within its travel"),
    (6, "homing was interrupted by a reset: home again"),
    (7, "the safety door was opened while homing: close it and home again"),
    (8, "pulling off did not clear the limit switch: increase the pull-off ($27) or check the wiring"),
    (9, "no limit switch was found within the search distance: check travel ($130 to $132), pull-off ($27) and wiring"),
];
