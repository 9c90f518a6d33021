//! The firmware families, and every point in which they differ.
//!
//! grbl 1.1h is the reference. Where grblHAL or FluidNC differ, a value of their [`Traits`] says
//! how. The rest of the crate asks for a trait, never for a name. One file for each family.

mod fluidnc;
mod grbl;
mod grblhal;

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use crate::axes::AxisLetters;
use crate::codes::{Alarm, ErrorCode};
use crate::gcode::{ArcPrecision, Digits, PortCounts};
use crate::line::LineRules;
use crate::receive::Realtime;
use crate::settings::Settings;

/// Makes the enum, its list, its names and its tables from one row for each family.
macro_rules! families {
    ($($(#[$note:meta])* $variant:ident: $file:ident,)+) => {
        /// A family of firmware.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        pub enum Firmware {
            $($(#[$note])* $variant,)+
        }

        impl Firmware {
            /// All of them.
            pub const ALL: [Self; [$(stringify!($file)),+].len()] = [$(Self::$variant),+];

            /// The name on the command line and in scenarios, which is the name of its file.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => stringify!($file),)+
                }
            }

            pub(crate) fn traits(self) -> &'static Traits {
                match self {
                    $(Self::$variant => &$file::TRAITS,)+
                }
            }
        }
    };
}

families! {
    /// grbl 1.1h on an Arduino Uno.
    #[default]
    Grbl: grbl,
    /// grblHAL, as its simulator is built.
    GrblHal: grblhal,
    /// FluidNC on an ESP32.
    FluidNc: fluidnc,
}

/// A text that is not the name of a family.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown firmware `{0}`; use {known}",
    known = known_names()
)]
pub struct UnknownFirmware(String);

/// `grbl, grblhal or fluidnc`.
fn known_names() -> String {
    let [first @ .., last] = &Firmware::ALL.map(Firmware::name);
    format!("{} or {last}", first.join(", "))
}

impl fmt::Display for Firmware {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Firmware {
    type Err = UnknownFirmware;

    fn from_str(text: &str) -> Result<Self, UnknownFirmware> {
        let found = Self::ALL.into_iter().find(|firmware| firmware.name() == text);
        found.ok_or_else(|| UnknownFirmware(text.to_string()))
    }
}

/// The points in which a family may differ.
#[derive(Debug)]
pub(crate) struct Traits {
    /// Sent after an empty line at every reset.
    pub(crate) banner: &'static str,
    /// Said first in each session of a network port.
    #[cfg_attr(not(feature = "node"), expect(dead_code, reason = "ports belong to the node"))]
    pub(crate) greeting: Greeting,
    /// Which numbers its settings have.
    pub(crate) setting_numbers: SettingNumbers,
    /// `$30` and `$31` are printed with decimals.
    pub(crate) prints_rpm_decimals: bool,
    /// Sent before the banner at power-up.
    pub(crate) boot: Boot,
    /// Blocks that the planner holds.
    pub(crate) blocks_max: usize,
    /// Bytes of the receive buffer, as `$I` reports them if it does.
    pub(crate) receive_buffer_bytes: usize,
    /// Bytes of it that are never used: a ring of one more cell needs none.
    pub(crate) receive_buffer_spare: usize,
    /// Received bytes are read while a line executes: the buffer reports itself empty.
    pub(crate) reads_ahead: bool,
    pub(crate) line: LineRules,
    /// The real-time meaning of a byte; `None`: the byte belongs to a line.
    pub(crate) realtime: fn(u8) -> Option<Realtime>,
    pub(crate) vocabulary: Vocabulary,
    /// The whole line of a feedback message.
    pub(crate) feedback: fn(Feedback) -> &'static str,
    /// The fields of a status report; the flag: built with line numbers.
    pub(crate) fields: fn(&Settings, bool) -> Fields,
    /// The answer to `$I`.
    pub(crate) build_info: fn(&BuildFacts<'_>) -> Vec<String>,
    /// `$G` and `$#` name tool length mode, retract mode and scaling, and nine systems.
    pub(crate) has_long_listings: bool,
    /// Accessories are reported only when they change, not with every `Ov`.
    pub(crate) reports_accessories_alone: bool,
    /// After a reset, overrides are reported first and offsets second.
    pub(crate) reports_overrides_first: bool,
    /// Time between two checks of the override bits, where equal bytes in between count once;
    /// `None`: every byte counts.
    pub(crate) override_pass: Option<Duration>,
    /// Reports keep the last line number while the machine is idle.
    pub(crate) line_number_lingers: bool,
    /// In a completed hold, reports show the feed from before the hold.
    pub(crate) hold_shows_feed: bool,
    /// After an error every program line gets the same error, until an empty line or a valid `$`.
    pub(crate) errors_stick: bool,
    /// The error for a `$` command that does not exist.
    pub(crate) unknown_command: ErrorCode,
    /// A reset answers the line in work, between alarm and banner.
    pub(crate) reset_answers: bool,
    /// Sent when a hold or homing ends.
    pub(crate) resume_feedback: Option<Feedback>,
    /// Is the machine locked at power-up, with these settings?
    pub(crate) locks_at_boot: fn(&Settings) -> bool,
    /// Does a reset check the limit switches, with these settings?
    pub(crate) checks_limits: fn(&Settings) -> bool,
    /// The alarm if one is closed then; `None`: a message instead.
    pub(crate) limit_alarm: Option<Alarm>,
    /// Alarms that need a reset before anything else.
    pub(crate) critical_alarms: &'static [u8],
    /// The input accepted during a critical alarm.
    pub(crate) critical_alarm_input: AcceptedInput,
    /// The input accepted in sleep.
    pub(crate) sleep_input: AcceptedInput,
    /// What a jog cancel does with bytes that are not read yet.
    pub(crate) jog_cancel_flush: Flush,
    /// A report is sent when homing begins, even without a request.
    pub(crate) announces_homing: bool,
    /// Are reports sent while homing, with these settings?
    pub(crate) reports_while_homing: fn(&Settings) -> bool,
    /// N of `Door:N` while a jog that the door stopped is braking.
    pub(crate) door_jog: u8,
    /// N of `Door:N` while spindle and coolant come back.
    pub(crate) door_resuming: u8,
    /// Is `$SLP` allowed, with these settings?
    pub(crate) may_sleep: fn(&Settings) -> bool,
}

/// What a board says first in each session of a network port.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(not(feature = "node"), expect(dead_code, reason = "ports belong to the node"))]
pub(crate) struct Greeting {
    /// To a WebSocket, as frames of text.
    pub(crate) notices: &'static [&'static str],
    /// As a line, though nothing has restarted.
    pub(crate) line: Option<&'static str>,
}

/// How the settings are numbered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SettingNumbers {
    /// As grbl numbers them.
    Grbl,
    /// As grblHAL does, which has more of them and uses some numbers for wider ones.
    GrblHal,
}

/// How long a board takes to start, and what it prints meanwhile.
#[derive(Debug)]
pub(crate) struct Boot {
    pub(crate) seconds: f64,
    pub(crate) chatter: &'static [&'static str],
}

/// The parts of G-code in which families differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Vocabulary {
    /// The axes of the board.
    pub(crate) axes: AxisLetters,
    /// Letters in addition to grbl's that carry a value.
    pub(crate) more_letters: &'static [char],
    /// A character that counts as a letter, though it has no meaning.
    pub(crate) stray_letter: Option<char>,
    /// Work coordinate systems: G54 to G59, then G59.1 and on.
    pub(crate) systems: usize,
    /// The highest T.
    pub(crate) tool_max: f64,
    /// M6 is known.
    pub(crate) has_tool_change: bool,
    /// M1 stops.
    pub(crate) has_optional_stop: bool,
    /// M7 is known.
    pub(crate) has_mist: bool,
    /// G33 is known, and does something where the spindle has an encoder.
    pub(crate) has_spindle_sync: bool,
    /// M62 to M68: the most ports of each kind.
    pub(crate) ports: PortCounts,
    /// G2 and G3 with a centre and no target are a full circle.
    pub(crate) has_bare_circles: bool,
    /// Which digits of a number are read.
    pub(crate) digits: Digits,
    /// The precision of arcs.
    pub(crate) arc_precision: ArcPrecision,
}

/// What a feedback message is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Feedback {
    Nothing,
    Unlock,
    Unlocked,
    ResetToContinue,
    EmergencyStop,
    HomingRequired,
    CheckDoor,
    CheckLimits,
    ProgramEnd,
    CheckOn,
    CheckOff,
    Sleeping,
    RestoringDefaults,
    Stop,
}

/// Which fields a status report has when they are due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Fields {
    pub(crate) machine_position: bool,
    pub(crate) buffers: bool,
    pub(crate) line_number: bool,
    pub(crate) feed: bool,
    pub(crate) pins: bool,
    pub(crate) offsets: bool,
    pub(crate) overrides: bool,
    /// `[GC:...]` after a report when the parser state has changed.
    pub(crate) parser_state: bool,
    pub(crate) alarm_substate: bool,
    pub(crate) run_substate: bool,
    pub(crate) distance_to_go: bool,
}

/// The facts that `$I` reports.
#[derive(Debug)]
pub(crate) struct BuildFacts<'a> {
    pub(crate) note: &'a str,
    pub(crate) has_line_numbers: bool,
    pub(crate) has_mist: bool,
    pub(crate) has_spindle_sync: bool,
    pub(crate) ports: PortCounts,
    pub(crate) blocks_max: usize,
    pub(crate) receive_buffer_bytes: usize,
    pub(crate) settings: &'a Settings,
}

/// Which input the controller accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AcceptedInput {
    Nothing,
    /// A reset only.
    ResetOnly,
    /// Real-time bytes; lines stay in the buffer.
    Realtime,
    /// Real-time bytes; lines are dropped.
    RealtimeAndDiscard,
    /// Lines, too; they may still be rejected.
    Lines,
}

/// When bytes that are not read yet are dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flush {
    Never,
    WhileJogging,
    Always,
}

impl Fields {
    /// As in grbl, whose `$10` has two bits.
    fn classic(settings: &Settings, line_number: bool) -> Self {
        let mask = settings.report_mask();
        Self {
            machine_position: mask & 1 != 0,
            buffers: mask & 2 != 0,
            line_number,
            feed: true,
            pins: true,
            offsets: true,
            overrides: true,
            parser_state: false,
            alarm_substate: false,
            run_substate: false,
            distance_to_go: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_firmware_is_read_as_it_is_written_and_others_are_refused_with_the_list() {
        for firmware in Firmware::ALL {
            assert_eq!(firmware.to_string().parse(), Ok(firmware));
        }
        let error = "marlin".parse::<Firmware>().unwrap_err().to_string();
        assert!(error.contains("grbl, grblhal or fluidnc"), "{error}");
    }
}
