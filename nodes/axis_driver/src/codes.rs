//! What the numbers of `error:N` and `ALARM:N` mean, in our words.
//!
//! Codes 1 to 17 and 20 to 37, and alarms 1 to 9, mean the same on grbl 1.1,
//! grblHAL and FluidNC; the others belong to one firmware each and have a column
//! of their own. A code that nobody lists keeps its bare number.

use crate::report::Firmware;

/// Whose code it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Shared,
    Only(Firmware),
}

type Row = (u16, Column, &'static str);

const GRBL: Column = Column::Only(Firmware::Grbl);

#[rustfmt::skip]
const ERRORS: &[Row] = &[
    (1, Column::Shared, "a word has no letter"),
    (2, Column::Shared, "a word has no number, or one that cannot be read"),
    (3, Column::Shared, "this $ command is not known"),
    (4, Column::Shared, "a value that must be positive is negative"),
    (5, Column::Shared, "homing is switched off in the settings ($22)"),
    (6, Column::Shared, "the step pulse would be too short"),
    (7, Column::Shared, "the stored settings were unreadable and have been replaced by defaults"),
    (8, Column::Shared, "this $ command is only taken while the machine is idle"),
    (9, Column::Shared, "motion is locked by an alarm or a jog"),
    (10, Column::Shared, "soft limits need homing to be enabled"),
    (11, Column::Shared, "the line is too long for the controller"),
    (12, Column::Shared, "the setting asks for more steps per second than the controller can make"),
    (13, Column::Shared, "the safety door is open"),
    (14, Column::Shared, "the text is too long to be stored"),
    (15, Column::Shared, "the jog would leave the travel of the machine"),
    (16, Column::Shared, "the jog command is malformed or holds a word that is not allowed in one"),
    (17, Column::Shared, "laser mode needs a PWM output"),
    (20, Column::Shared, "a G or M word that this controller does not know"),
    (21, Column::Shared, "two words of one modal group in a line"),
    (22, Column::Shared, "no feed rate was given"),
    (23, Column::Shared, "a word needs a whole number"),
    (24, Column::Shared, "two commands in a line both want the axis words"),
    (25, Column::Shared, "a word is given twice"),
    (26, Column::Shared, "the command needs an axis word"),
    (27, Column::Shared, "the line number is out of range"),
    (28, Column::Shared, "a word that the command needs is missing"),
    (29, Column::Shared, "work systems beyond G59 are not supported"),
    (30, Column::Shared, "G53 goes with G0 and G1 only"),
    (31, Column::Shared, "axis words that no command uses"),
    (32, Column::Shared, "an arc without an axis word in its plane"),
    (33, Column::Shared, "the target of the motion cannot be: start, end and centre of the arc disagree"),
    (34, Column::Shared, "the radius of the arc cannot be"),
    (35, Column::Shared, "an arc without an offset to its centre in its plane"),
    (36, Column::Shared, "words that no command uses"),
    (37, Column::Shared, "the tool length offset is for another axis"),
    (38, GRBL, "the tool number is too high"),
];

#[rustfmt::skip]
const ALARMS: &[Row] = &[
    (1, Column::Shared, "a limit switch was hit; the position is probably lost: reset, then home"),
    (2, Column::Shared, "the target lies outside the travel of the machine; the position is kept: reset, then unlock"),
    (3, Column::Shared, "reset while moving; the position is probably lost: home"),
    (4, Column::Shared, "the probe was not in its initial state before probing"),
    (5, Column::Shared, "the probe touched nothing within its travel"),
    (6, Column::Shared, "homing was interrupted by a reset"),
    (7, Column::Shared, "the safety door was opened while homing"),
    (8, Column::Shared, "pulling off did not clear the limit switch: increase the pull-off ($27) or check the wiring"),
    (9, Column::Shared, "no limit switch was found within the search distance: check travel ($130 to $132), pull-off ($27) and wiring"),
    (10, GRBL, "the second switch of a dual axis was not found after the first"),
];

fn lookup(rows: &[Row], firmware: Firmware, code: u16) -> Option<&'static str> {
    rows.iter()
        .find(|(number, column, _)| {
            *number == code && (*column == Column::Shared || *column == Column::Only(firmware))
        })
        .map(|(_, _, text)| *text)
}

/// What `error:N` means, or `None` when this firmware's number is not listed.
pub fn error_text(firmware: Firmware, code: u16) -> Option<&'static str> {
    lookup(ERRORS, firmware, code)
}

/// What `ALARM:N` means, or `None` when this firmware's number is not listed.
pub fn alarm_text(firmware: Firmware, code: u16) -> Option<&'static str> {
    lookup(ALARMS, firmware, code)
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
pub const fn is_position_lost(alarm: u16) -> bool {
    matches!(alarm, 1 | 3 | 6..=10)
}

/// Whether grbl hears nothing but a reset after this alarm, not even `?`.
pub const fn is_deaf(alarm: u16) -> bool {
    matches!(alarm, 1 | 2)
}

/// Why a command was refused or a run ended: the driver's hundred.
pub mod error_code {
    /// No port is open.
    pub const NOT_CONNECTED: u16 = 301;
    /// The controller is still being identified.
    pub const CONNECTING: u16 = 302;
    /// What the controller has still to answer is not known; a soft reset settles it.
    pub const NEEDS_RESET: u16 = 303;
    /// The controller is in alarm.
    pub const ALARM: u16 = 304;
    /// The machine does something else.
    pub const BUSY: u16 = 305;
    /// The tool is not where the path begins.
    pub const START_POSITION: u16 = 306;
    /// The path holds something that the controller cannot do.
    pub const NOT_ENCODABLE: u16 = 307;
    /// The run cannot begin at this line.
    pub const START_LINE: u16 = 308;
    /// The controller refused a line.
    pub const CONTROLLER_ERROR: u16 = 309;
    /// The controller restarted.
    pub const RESTARTED: u16 = 310;
    /// The controller does not answer, or the port is gone.
    pub const LINK_LOST: u16 = 311;
    /// Answers and lines do not match.
    pub const PROTOCOL: u16 = 312;
    /// Stopped by a cancel.
    pub const CANCELED: u16 = 313;
    /// Stopped because the driver shuts down.
    pub const SHUTDOWN: u16 = 314;
    /// Stopped by a soft reset.
    pub const SOFT_RESET: u16 = 315;
    /// There is nothing that this command could act on.
    pub const NOTHING_TO_DO: u16 = 316;
    /// Homing is switched off in the controller.
    pub const NO_HOMING: u16 = 317;
    /// No answer in time.
    pub const NO_ANSWER: u16 = 318;
    /// The probe touched, or let go, nowhere on its way.
    pub const PROBE_FAILED: u16 = 319;
    /// The tool is not in the table, or the path was made with another.
    pub const TOOL: u16 = 321;
    /// The loader or the planner refused a single block.
    pub const BLOCK_REFUSED: u16 = 322;
    /// A number or a name in the request is out of range.
    pub const INVALID_REQUEST: u16 = 323;
    /// Nothing records, and the parameters ask for it.
    pub const NOT_RECORDING: u16 = 324;
    /// The commander's sign of life stayed away.
    pub const COMMANDER_LOST: u16 = 325;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_codes_read_the_same_on_every_firmware() {
        for firmware in [Firmware::Grbl, Firmware::GrblHal, Firmware::FluidNc] {
            assert!(error_text(firmware, 22).unwrap().contains("feed"));
            assert!(alarm_text(firmware, 1).unwrap().contains("limit switch"));
        }
    }

    #[test]
    fn a_firmwares_own_code_is_not_read_with_anothers_column() {
        assert!(error_text(Firmware::Grbl, 38).is_some());
        assert_eq!(error_text(Firmware::FluidNc, 38), None);
        assert_eq!(describe_alarm(Firmware::GrblHal, 10), "ALARM:10");
    }

    #[test]
    fn every_code_of_grbl_has_one_row() {
        let wanted: Vec<u16> = (1..=17).chain(20..=38).collect();
        let have: Vec<u16> = ERRORS.iter().map(|row| row.0).collect();
        assert_eq!(have, wanted);
        assert_eq!(
            ALARMS.iter().map(|row| row.0).collect::<Vec<_>>(),
            (1..=10).collect::<Vec<_>>()
        );
    }
}
