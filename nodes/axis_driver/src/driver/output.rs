//! What the driver gives to the process around it.

use super::answer::Refusal;
use crate::encoder::{Ports, UserFunction};
use crate::firmware::Firmware;
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::Position;
use cnc_msgs::machine::MachineState;
use cnc_msgs::probing::Measured;
use serde::{Deserialize, Serialize};

/// What to do outside, in order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Output {
    /// Write these bytes now.
    Transmit(Vec<u8>),
    /// The answer to a command: what was done, or why not.
    Reply { id: u64, result: Result<String, Refusal> },
    /// What is known of the machine has changed.
    State(MachineState),
    /// How far the run is. Seconds at the present override.
    Progress { line: u32, fraction: f64, time_left_s: f64 },
    /// The accepted run is over.
    RunFinished(RunResult),
    /// The run waits until what follows is planned from what its probes have found.
    Probes(ProbesOfRun),
    /// The run waits until this is done.
    UserFunction(UserFunctionCall),
    /// The accepted jog or probe is over.
    MoveFinished(MoveResult),
    /// What the controller reported about itself, when it was connected and after a change.
    Settings(ControllerSettings),
    /// After [`Command::Shutdown`](super::Command::Shutdown): the port may be closed.
    ReadyToClose,
    /// Something for the log.
    Log { level: LogLevel, message: String },
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// The command that began it.
    pub id: u64,
    pub outcome: RunOutcome,
    /// 0 when it succeeded; see [`error_code`](crate::codes::error_code).
    pub error_code: u16,
    pub message: String,
    /// The source line that was being cut last, 0 when none was.
    pub last_line: u32,
    /// The source line of the block that the controller refused or stopped at, 0 when no
    /// block is to blame.
    pub blamed_line: u32,
    /// Which time the last line is run, from 1; 0: the only one.
    #[serde(default)]
    pub last_occurrence: u32,
}

/// What a run has measured so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProbesOfRun {
    pub program_id: String,
    pub revision: u64,
    /// The line that reads a result.
    pub line: u32,
    pub measured: Measured,
}

/// A function of the user that a run waits for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UserFunctionCall {
    /// The command that began the run, and the how many-th call of it this is.
    pub run: u64,
    pub call: u32,
    pub program_id: String,
    pub line: u32,
    pub function: UserFunction,
}

/// How a jog or a probe ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MoveResult {
    /// The command that began it.
    pub id: u64,
    pub outcome: RunOutcome,
    /// 0 when it succeeded; see [`error_code`](crate::codes::error_code).
    pub error_code: u16,
    pub message: String,
    /// Where the tool stands after a jog, or where the probe touched; machine frame, mm.
    pub machine_position: Option<Position>,
    /// The same in the work frame.
    pub work_position: Option<Position>,
    /// The same of the further axes; machine frame.
    pub further: FurtherAxes,
    /// Whether the probe touched, or released.
    pub found: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RunOutcome {
    Succeeded,
    Canceled,
    Aborted,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum LogLevel {
    Info,
    Warn,
    Error,
}

/// What a controller reports about itself.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ControllerSettings {
    pub firmware: Firmware,
    /// In its own words.
    pub version: String,
    pub options: String,
    pub planner_blocks: u16,
    /// `XYZA`: the letter of each axis, in the order of the settings.
    pub axes: String,
    pub receive_bytes: u16,
    /// The most that is sent before an answer, bytes.
    pub window: usize,
    /// `$number` and its value.
    pub settings: Vec<(u16, String)>,
    pub offsets: Vec<Offset>,
    /// Whether the axes can keep pace with the spindle, where it is known. Not published.
    #[serde(skip)]
    pub spindle_sync: Option<bool>,
    /// What programs can use, where it is known. Not published.
    #[serde(skip)]
    pub ports: Option<Ports>,
}

/// A stored position: G54 to G59.3, G28, G30, G92, TLO; machine frame, mm and degrees.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Offset {
    pub name: String,
    pub position: Position,
    /// Checkpoints of before have none.
    #[serde(default)]
    pub further: FurtherAxes,
}
