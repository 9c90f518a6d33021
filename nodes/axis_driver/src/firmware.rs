//! What the driver has to know of each firmware: one table for each, in a file of its own.
//!
//! A new firmware is a row of the list below and a file with its [`Traits`]. Nothing else asks which firmware it is:
//! what differs is a field here. Numbers and texts that all of them share are in [`crate::codes`].

mod fluidnc;
mod grbl;
mod grblhal;

// No other of them threads.
pub(crate) use grblhal::{THREAD_SHARE, THREAD_WAIT_S_MAX, thread_wait_s};
use serde::{Deserialize, Serialize};

/// Makes the enum, its list and its tables from one row for each firmware.
macro_rules! firmwares {
    ($($(#[$note:meta])* $variant:ident: $file:ident,)+) => {
        /// The family of the firmware, as far as its texts show it.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
        pub enum Firmware {
            $($(#[$note])* $variant,)+
        }

        impl Firmware {
            pub const ALL: [Self; [$(stringify!($file)),+].len()] = [$(Self::$variant),+];

            /// What is special about it.
            pub const fn traits(self) -> &'static Traits {
                match self {
                    $(Self::$variant => &$file::TRAITS,)+
                }
            }
        }
    };
}

firmwares! {
    #[default]
    Grbl: grbl,
    GrblHal: grblhal,
    FluidNc: fluidnc,
}

/// A code and what it means.
pub type CodeRow = (u16, &'static str);

/// Number, name and unit of a setting; a mask has one bit for each axis or option.
pub type SettingRow = (u16, &'static str, &'static str);

/// A field of the status report, and what the driver does with it.
#[derive(Debug, Clone, Copy)]
pub struct ReportField {
    /// Of the mask `$10`.
    pub bit: u32,
    pub gives: &'static str,
}

/// Where the travel of an axis that is homed lies in the machine frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TravelRule {
    /// Nobody reports it.
    Unreported { because: &'static str },
    /// From minus the travel to 0, or from the switches where `$I` has this letter (`system_check_travel_limits` of grbl).
    Whole { letter_of_zero_at_switches: char },
    /// The same without the pull-off (`$27`) where hard and soft limits are on; from the switches where `$22` has this
    /// bit (`limits_set_work_envelope` of grblHAL).
    WithoutPullOff { zero_at_switches: u32 },
}

/// How one firmware differs from the others.
#[derive(Debug)]
pub struct Traits {
    /// What it is called, and a word of its start message.
    pub name: &'static str,
    /// How its start message begins, or its own part of one that begins as grbl's; lower case.
    pub banner_beginning: &'static str,
    /// How it names itself in `[FIRMWARE:...]`.
    pub firmware_message: Option<&'static str>,
    /// What its `[VER:...]` contains, and that of no other.
    pub version_word: Option<&'static str>,
    /// `ALARM:N`, besides the numbers that all share.
    pub alarms: &'static [CodeRow],
    /// `error:N`, besides the numbers that all share.
    pub errors: &'static [CodeRow],
    /// `$n`, where they differ from grbl's, and what it adds.
    pub settings: &'static [SettingRow],
    /// Its settings have numbers below this, those that builds add included.
    pub settings_below: u16,
    /// Axes that have settings.
    pub axes: usize,
    /// Where the travel of an axis lies.
    pub travel: TravelRule,
    /// Builds of it may limit jerk (`$800` and up).
    pub may_have_jerk: bool,
    /// The axes may keep pace with its spindle (G33).
    pub may_thread: bool,
    /// Boards with it may have outputs and inputs for programs (M62 to M68).
    pub may_have_ports: bool,
    /// G54 to G59.3; else to G59.
    pub has_nine_work_systems: bool,
    /// With kinematics other than a delta it cuts feeds into short segments, and rapids not.
    pub bows_rapids: bool,
    /// The start message that begins a session over a network is a greeting, and no restart.
    pub greets_each_session: bool,
    /// Blocks of the planner of a firmware that never reports how many it has.
    pub unreported_planner_blocks: Option<u16>,
    /// Alarms after which the position is good, besides those that all share.
    pub position_kept_after: &'static [u16],
    /// Alarms after which it hears nothing but a reset, not even `?`.
    pub deaf_after: &'static [u16],
    /// Alarms after which it takes no line, not even `$X` or `$H`, until it is reset.
    pub reset_needed_after: &'static [u16],
    /// After an error it answers every line with the same error until it reads an empty one.
    pub error_lasts: bool,
    /// It has an M6 of its own.
    pub has_tool_change: bool,
    /// A request of its own brings what ordinary reports may leave out.
    pub has_full_report: bool,
    /// It homes the axes one by one on demand, whatever its options say.
    pub homes_one_by_one: bool,
    /// A control character may have switched an echo on, which has to be switched off.
    pub echoes_after_control_characters: bool,
    /// Spindle and coolant are printed in the report also when they are off. The others leave them
    /// out then, next to the overrides.
    pub prints_accessories_when_off: bool,
    /// How many equal override bytes it takes between two reports.
    pub overrides_in_a_round: i16,
    /// Fields of the report that the driver uses.
    pub report_fields: &'static [ReportField],
    /// Used where the driver sends line numbers.
    pub line_number_field: Option<ReportField>,
    /// Why there is none of use, where there is none.
    pub no_field_because: &'static str,
}

/// The planner and receive buffer.
const BUFFER: ReportField = ReportField {
    bit: 1,
    gives: "Bf (planner and receive buffer): a lost line or answer is noticed within half a \
            second, however long the lines are",
};

/// Bytes of a kind in a round, where the firmware queues them. The queue of grblHAL takes 15,
/// rapids among them.
pub(crate) const QUEUED_MAX: i16 = 6;

impl Firmware {
    /// Of a start message: `Grbl 1.1h ['$' for help]`, `GrblHAL 1.1f ['$' or '$HELP' for help]`,
    /// `Grbl 3.9 [FluidNC v3.9.5 (wifi) '$' for help]`. FluidNC lets its owner word the line, so
    /// the name alone counts.
    pub(crate) fn of_banner(text: &str) -> Option<Self> {
        Self::of_version(text).or_else(|| {
            let mut words = text.split(' ');
            words.find_map(|word| {
                Self::ALL.into_iter().find(|it| it.traits().name.eq_ignore_ascii_case(word))
            })
        })
    }

    /// Of `[FIRMWARE:...]`.
    pub(crate) fn of_firmware_message(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|it| it.traits().firmware_message == Some(name))
    }

    /// Of `[VER:...]`.
    pub(crate) fn of_version(text: &str) -> Option<Self> {
        let is_named = |it: &Self| it.traits().version_word.is_some_and(|word| text.contains(word));
        Self::ALL.into_iter().find(is_named)
    }
}
