//! What is known about the machine, and what is not.
//!
//! In millimetres and revolutions per minute; [`Mode::Unknown`] is an answer.

use crate::contour::{CutterSide, SpindleMode};
use crate::further::FurtherAxes;
use crate::geometry::Position;
use serde::{Deserialize, Serialize};

/// What the reason of a [`MachineState`] begins with while a run waits for its recording and
/// the driver has sent nothing of it yet.
pub const WAITING_FOR_RECORDER: &str = "WAITING_FOR_RECORDER";

/// What the machine does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub enum Mode {
    /// Not known: the link is lost, or no report has arrived yet.
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

/// How soon a run notices that a line or an answer was lost or came twice. The
/// times are those of an undelayed line at the default intervals; docs/faults.md has the
/// measured bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
pub enum LinkWatch {
    /// Not known: no controller is connected.
    #[default]
    Unknown,
    /// When the machine next stands still; at the end of the program at the latest.
    Standstill,
    /// A loss: half a second after it shows in the receive buffer. A double:
    /// as [`Self::Standstill`].
    Buffer,
    /// Half a second after the lines under way have been read.
    Lines,
    /// As [`Self::Lines`]; a loss also as [`Self::Buffer`], whichever is first.
    LinesAndBuffer,
}

impl LinkWatch {
    /// What `kerf status` says about it.
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

/// The state of the machine as last reported.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MachineState {
    pub mode: Mode,
    /// Why it is in this mode, where that is not obvious: `LINK_LOST`, `FEED_HOLD`, an alarm's text.
    pub reason: String,
    /// Whether it may be moving without reporting: it cuts what is in its buffer to the end.
    pub motion_possible: bool,
    /// Whether it is blocked until it is reset.
    pub needs_reset: bool,
    /// In the machine frame, mm; `None` without a reliable report.
    pub machine_position: Option<Position>,
    /// In the work frame, mm; `None` until the offset is known too.
    pub work_position: Option<Position>,
    pub feed_mm_per_min: f64,
    pub spindle_rpm: f64,
    /// Which way the spindle turns, if the controller reports it.
    pub spindle: Option<SpindleMode>,
    /// Coolant, if the controller reports it.
    pub flood: bool,
    pub mist: bool,
    /// The work system in force: 1 to 9 are G54 to G59.3; 0 when it is not known.
    pub work_system: u8,
    /// The program that runs or ran last; empty when none.
    pub program_id: String,
    /// The revision of the path that is being run; 0 when none is.
    pub path_revision: u64,
    /// During a hold: the elements of the path that have been sent or are about to be
    /// sent, so that only later ones can change; else 0.
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
    /// How soon lost and doubled lines and answers are noticed.
    pub link_watch: LinkWatch,
    /// Feed, rapid and spindle override, percent.
    pub overrides_percent: [u8; 3],
    /// Input pins that are active, as the firmware letters them: `XZP`.
    pub pins: String,
    /// A, B, C, U, V and W; `None` where the controller reports none.
    #[serde(default)]
    pub further: Option<Box<FurtherPlaces>>,
}

impl MachineState {
    /// Where A, B, C, U, V and W are, as far as it is known.
    pub fn further(&self) -> FurtherPlaces {
        self.further.as_deref().copied().unwrap_or_default()
    }
}

/// Where the axes besides X, Y and Z are.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FurtherPlaces {
    /// In the machine frame.
    pub machine: FurtherAxes,
    /// In the work frame; none until the offset is known too.
    pub work: FurtherAxes,
}
