//! What is known of the machine, and what is not.
//!
//! In millimetres and revolutions per minute; [`Mode::Unknown`] is an answer.

use crate::contour::{CutterSide, SpindleMode};
use crate::geometry::Position;
use serde::{Deserialize, Serialize};

/// What the reason of a [`MachineState`] begins with while the driver has sent nothing yet of a
/// run that is to be recorded.
pub const WAITING_FOR_RECORDER: &str = "WAITING_FOR_RECORDER";

/// What the machine does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub enum Mode {
    /// Not known: the link is lost or nothing was heard yet.
    #[default]
    Unknown,
    /// No port is open.
    Disconnected,
    Idle,
    Run,
    Hold,
    Jog,
    Alarm,
    Door,
    Check,
    Home,
    Sleep,
    ToolChange,
}

impl Mode {
    /// The name as `kerf status` prints it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unknown => "UNKNOWN",
            Self::Disconnected => "DISCONNECTED",
            Self::Idle => "IDLE",
            Self::Run => "RUN",
            Self::Hold => "HOLD",
            Self::Jog => "JOG",
            Self::Alarm => "ALARM",
            Self::Door => "DOOR",
            Self::Check => "CHECK",
            Self::Home => "HOME",
            Self::Sleep => "SLEEP",
            Self::ToolChange => "TOOL_CHANGE",
        }
    }
}

/// How well it is noticed in a run that a line or an answer was lost or came twice. The
/// times are those of an undelayed line at the default intervals; docs/faults.md has the
/// measured bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub enum LinkWatch {
    /// Not known: no controller is connected.
    #[default]
    Unknown,
    /// When the machine next stands still, at the latest at the end of the program.
    Standstill,
    /// What is lost: half a second after it shows in the receive buffer. What comes twice:
    /// as [`Self::Standstill`].
    Buffer,
    /// When the lines that were under way have been read, and half a second more.
    Lines,
    /// As [`Self::Lines`], and what is lost as [`Self::Buffer`], whichever is first.
    LinesAndBuffer,
}

impl LinkWatch {
    /// What `kerf status` says of it.
    pub const fn describe(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Standstill => "lost or doubled lines and answers show at standstill only",
            Self::Buffer => "receive buffer compared with every report",
            Self::Lines => "checks among the lines",
            Self::LinesAndBuffer => "checks among the lines, receive buffer in every report",
        }
    }
}

/// The state of the machine as last heard.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MachineState {
    pub mode: Mode,
    /// Why it is in this mode, where that is not obvious: `LINK_LOST`, `FEED_HOLD`, an alarm's text.
    pub reason: String,
    /// Whether it may be moving without being heard: what is buffered is cut to its end.
    pub motion_possible: bool,
    /// Whether nothing can go on before somebody resets it.
    pub needs_reset: bool,
    /// In the machine frame, mm; `None` when nothing reliable was heard.
    pub machine_position: Option<Position>,
    /// In the work frame, mm; `None` until the offset is known too.
    pub work_position: Option<Position>,
    pub feed_mm_per_min: f64,
    pub spindle_rpm: f64,
    /// Which way the spindle turns, where the controller tells.
    pub spindle: Option<SpindleMode>,
    /// Coolant, where the controller tells.
    pub flood: bool,
    pub mist: bool,
    /// The work system in force: 1 to 6 are G54 to G59; 0 when it is not known.
    pub work_system: u8,
    /// The program that runs or ran last; empty when none.
    pub program_id: String,
    /// The revision of the path that is being run; 0 when none is.
    pub path_revision: u64,
    /// While a run stands in a hold: the elements of its path that have been sent or
    /// are about to be, so that only what comes after them can change; else 0.
    pub settled_elements: u64,
    /// The source line that is being cut; 0 when none.
    pub line: u32,
    /// The tool that is wanted in [`Mode::ToolChange`], else 0.
    pub tool_wanted: u32,
    /// The firmware's alarm, 0 when none.
    pub alarm_code: u16,
    /// Whether the position can be trusted since the last homing.
    pub is_homed: bool,
    /// The side of the element that is being cut; `None` when not compensated.
    pub compensation: Option<CutterSide>,
    /// Seconds since the last status report; infinite when there was none.
    pub link_age_s: f64,
    /// How well lost and doubled lines and answers are noticed.
    pub link_watch: LinkWatch,
    /// Feed, rapid and spindle override, percent.
    pub overrides_percent: [u8; 3],
    /// Input pins that are active, as the firmware letters them: `XZP`.
    pub pins: String,
}
