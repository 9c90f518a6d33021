//! What the numbers of the firmware mean, in our words.
//!
//! `error:N` and `ALARM:N` are worded here and distinguished by what follows from them;
//! `$n` is named in [`settings`]. Errors 1 to 17 and 20 to 37 and alarms 1 to 9 mean the
//! same on grbl 1.1, grblHAL and FluidNC; the others belong to one firmware each and are
//! read with its column alone. A number that nobody lists stays a number.

mod alarms;
pub mod error_code;
mod errors;
pub mod settings;

pub use settings::setting_name;

use crate::firmware::{CodeRow, Firmware};

fn find(shared: &'static [CodeRow], own: &'static [CodeRow], code: u16) -> Option<&'static str> {
    let mut rows = shared.iter().chain(own);
    rows.find(|(number, _)| *number == code).map(|(_, text)| *text)
}

/// What `error:N` means, or `None` when this firmware's number is not listed.
pub fn error_text(firmware: Firmware, code: u16) -> Option<&'static str> {
    find(errors::SHARED, firmware.traits().errors, code)
}

/// What `ALARM:N` means, or `None` when this firmware's number is not listed.
pub fn alarm_text(firmware: Firmware, code: u16) -> Option<&'static str> {
    find(alarms::SHARED, firmware.traits().alarms, code)
}

/// `error:20 (a G or M word that this controller does not know)`
pub fn describe_error(firmware: Firmware, code: u16) -> String {
    describe("error", error_text(firmware, code), code)
}

/// `ALARM:3 (reset while moving; ...)`
pub fn describe_alarm(firmware: Firmware, code: u16) -> String {
    describe("ALARM", alarm_text(firmware, code), code)
}

fn describe(word: &str, text: Option<&str>, code: u16) -> String {
    match text {
        Some(text) => format!("{word}:{code} ({text})"),
        None => format!("{word}:{code}"),
    }
}

/// Whether the position is in doubt after this alarm.
///
/// It is unless the alarm is known to leave it alone: a target outside of the travel
/// stops with a hold, a probe that fails stands still, and grblHAL waits for its spindle
/// while nothing moves. A number that nobody lists is in doubt too.
pub fn is_position_lost(firmware: Firmware, alarm: u16) -> bool {
    !matches!(alarm, 2 | 4 | 5) && !firmware.traits().position_kept_after.contains(&alarm)
}

/// Whether the controller hears nothing but a reset after this alarm, not even `?`.
pub fn is_deaf(firmware: Firmware, alarm: u16) -> bool {
    firmware.traits().deaf_after.contains(&alarm)
}

/// Whether the controller takes no line after this alarm, not even `$X` or `$H`, until
/// it is reset; grblHAL and FluidNC answer `?` meanwhile.
pub fn needs_reset(firmware: Firmware, alarm: u16) -> bool {
    firmware.traits().reset_needed_after.contains(&alarm)
}

#[cfg(test)]
mod tests;
