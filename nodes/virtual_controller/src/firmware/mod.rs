//! The families of firmware, and everything in which they differ.
//!
//! grbl 1.1h is the trunk. What grblHAL and FluidNC do in another way is a value
//! of their [`Traits`]: the rest of the crate asks for a trait and never for a
//! name. One file for each family.

mod fluidnc;
mod grbl;
mod grblhal;

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use crate::codes::{Alarm, ErrorCode};
use crate::gcode::{ArcPrecision, Digits};
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

            /// As the command line and scenarios spell it: the name of its file.
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

/// A text that names no family.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is no firmware this controller speaks; there are {known}",
    known = known_names()
)]
pub struct UnknownFirmware(String);

/// `grbl, grblhal and fluidnc`.
fn known_names() -> String {
    let [first @ .., last] = &Firmware::ALL.map(Firmware::name);
    format!("{} and {last}", first.join(", "))
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

/// What a family does in its own way.
#[derive(Debug)]
pub(crate) struct Traits {
    /// Said after an empty line by every reset.
    pub(crate) banner: &'static str,
    /// What comes before the banner when the supply comes on.
    pub(crate) boot: Boot,
    /// Blocks the planner holds.
    pub(crate) blocks_max: usize,
    /// Bytes of the receive buffer, as `$I` tells where it tells them.
    pub(crate) receive_buffer_bytes: usize,
    /// Bytes of it that are never used: a ring of one more cell needs none.
    pub(crate) receive_buffer_spare: usize,
    /// Received bytes are taken out of it while a line executes: it reports itself empty.
    pub(crate) reads_ahead: bool,
    pub(crate) line: LineRules,
    /// What a byte means out of turn; `None`: it belongs to a line.
    pub(crate) realtime: fn(u8) -> Option<Realtime>,
    pub(crate) vocabulary: Vocabulary,
    /// A feedback message, whole.
    pub(crate) feedback: fn(Feedback) -> &'static str,
    /// The fields of a status report; the flag: built with line numbers.
    pub(crate) fields: fn(&Settings, bool) -> Fields,
    /// The answer to `$I`.
    pub(crate) build_info: fn(&BuildFacts<'_>) -> Vec<String>,
    /// `$G` and `$#` name tool length mode, retract mode and scaling, and nine systems.
    pub(crate) has_long_listings: bool,
    /// Accessories are reported when they change and then alone, not beside overrides.
    pub(crate) reports_accessories_alone: bool,
    /// Overrides come first after a reset, offsets second.
    pub(crate) reports_overrides_first: bool,
    /// Time between two looks at the overrides, where equal bytes between them count once;
    /// `None`: every byte counts.
    pub(crate) override_pass: Option<Duration>,
    /// The last line number stays in reports when the machine stands.
    pub(crate) line_number_lingers: bool,
    /// In a finished hold the feed is the one from before it.
    pub(crate) hold_shows_feed: bool,
    /// After an error every program line gets the same, until an empty line or a `$` that works.
    pub(crate) errors_stick: bool,
    /// A `$` command that does not exist.
    pub(crate) unknown_command: ErrorCode,
    /// A reset answers the line in work, between alarm and banner.
    pub(crate) reset_answers: bool,
    /// Said when a hold or homing ends.
    pub(crate) resume_feedback: Option<Feedback>,
    /// When the supply comes on, is the machine locked?
    pub(crate) locks_at_boot: fn(&Settings) -> bool,
    /// Does a reset look at the limit switches, with these settings?
    pub(crate) checks_limits: fn(&Settings) -> bool,
    /// What it raises when one is closed, instead of telling how to unlock.
    pub(crate) limit_alarm: Option<Alarm>,
    /// Alarms that take a reset before anything else.
    pub(crate) critical_alarms: &'static [u8],
    /// What is heard during one of them.
    pub(crate) critical_hearing: Hearing,
    /// What is heard asleep.
    pub(crate) sleep_hearing: Hearing,
    /// What a jog cancel does to bytes that are not read yet.
    pub(crate) jog_cancel_flush: Flush,
    /// A report is sent when homing begins, asked for or not.
    pub(crate) announces_homing: bool,
    /// Is a report given while homing, with these settings?
    pub(crate) reports_while_homing: fn(&Settings) -> bool,
    /// N of `Door:N` while a jog that the door ended comes to rest.
    pub(crate) door_jog: u8,
    /// N of `Door:N` while spindle and coolant come back.
    pub(crate) door_resuming: u8,
    /// `$SLP`, with these settings.
    pub(crate) may_sleep: fn(&Settings) -> bool,
}

/// How long a board takes to come up, and what it chats.
#[derive(Debug)]
pub(crate) struct Boot {
    pub(crate) seconds: f64,
    pub(crate) chatter: &'static [&'static str],
}

/// G-code in which families differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Vocabulary {
    /// Letters beyond grbl's that carry a value.
    pub(crate) more_letters: &'static [char],
    /// A sign that counts as a letter, though it means nothing.
    pub(crate) stray_letter: Option<char>,
    /// Work coordinate systems: G54 to G59, then G59.1 and on.
    pub(crate) systems: usize,
    /// T may not be larger.
    pub(crate) tool_max: f64,
    /// M6.
    pub(crate) has_tool_change: bool,
    /// M1 stops.
    pub(crate) has_optional_stop: bool,
    /// M7.
    pub(crate) has_mist: bool,
    /// G2 and G3 with a centre alone are a full circle.
    pub(crate) has_bare_circles: bool,
    /// Which digits of a number are read.
    pub(crate) digits: Digits,
    /// How exactly an arc is computed.
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

/// What `$I` tells.
#[derive(Debug)]
pub(crate) struct BuildFacts<'a> {
    pub(crate) note: &'a str,
    pub(crate) has_line_numbers: bool,
    pub(crate) has_mist: bool,
    pub(crate) blocks_max: usize,
    pub(crate) receive_buffer_bytes: usize,
    pub(crate) settings: &'a Settings,
}

/// What gets through in a state that shuts the ears.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hearing {
    Nothing,
    /// A reset, and nothing else.
    ResetOnly,
    /// Real-time bytes; lines stay where they are.
    Realtime,
    /// Real-time bytes; lines are thrown away.
    RealtimeAndDiscard,
    /// Lines, too; what they ask for may be refused.
    Lines,
}

/// When bytes that are not read yet are thrown away.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flush {
    Never,
    WhileJogging,
    Always,
}

impl Fields {
    /// grbl's: `$10` has two bits.
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
        assert!(error.contains("grbl, grblhal and fluidnc"), "{error}");
    }
}
