//! What the numbers of the firmware mean, in our words.
//!
//! `error:N` and `ALARM:N` are worded here and told apart by what they leave behind;
//! `$n` is named in [`settings`]. Errors 1 to 17 and 20 to 37 and alarms 1 to 9 mean the
//! same on grbl 1.1, grblHAL and FluidNC; the others belong to one firmware each and are
//! read with its column alone. A number that nobody lists stays a number.

mod alarms;
pub mod error_code;
mod errors;
pub mod settings;

pub use settings::setting_name;

use crate::report::Firmware;

type Row = (u16, &'static str);

/// The texts of one sort of number.
struct Texts {
    /// What they all agree on.
    shared: &'static [Row],
    grbl: &'static [Row],
    grbl_hal: &'static [Row],
    fluid_nc: &'static [Row],
}

impl Texts {
    const fn own(&self, firmware: Firmware) -> &'static [Row] {
        match firmware {
            Firmware::Grbl => self.grbl,
            Firmware::GrblHal => self.grbl_hal,
            Firmware::FluidNc => self.fluid_nc,
        }
    }

    fn find(&self, firmware: Firmware, code: u16) -> Option<&'static str> {
        let mut rows = self.shared.iter().chain(self.own(firmware));
        rows.find(|(number, _)| *number == code).map(|(_, text)| *text)
    }
}

/// What `error:N` means, or `None` when this firmware's number is not listed.
pub fn error_text(firmware: Firmware, code: u16) -> Option<&'static str> {
    errors::TEXTS.find(firmware, code)
}

/// What `ALARM:N` means, or `None` when this firmware's number is not listed.
pub fn alarm_text(firmware: Firmware, code: u16) -> Option<&'static str> {
    alarms::TEXTS.find(firmware, code)
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
pub const fn is_position_lost(firmware: Firmware, alarm: u16) -> bool {
    let is_kept =
        matches!(alarm, 2 | 4 | 5) || matches!((firmware, alarm), (Firmware::GrblHal, 14));
    !is_kept
}

/// Whether the controller hears nothing but a reset after this alarm, not even `?`.
pub const fn is_deaf(firmware: Firmware, alarm: u16) -> bool {
    matches!((firmware, alarm), (Firmware::Grbl, 1 | 2))
}

/// Whether the controller takes no line after this alarm, not even `$X` or `$H`, until
/// it is reset; grblHAL and FluidNC answer `?` meanwhile.
pub const fn needs_reset(firmware: Firmware, alarm: u16) -> bool {
    match firmware {
        Firmware::Grbl => matches!(alarm, 1 | 2),
        Firmware::GrblHal => matches!(alarm, 1 | 2 | 10 | 17 | 20),
        Firmware::FluidNc => matches!(alarm, 1 | 2 | 13 | 16),
    }
}

#[cfg(test)]
mod tests;
