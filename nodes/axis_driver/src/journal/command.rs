//! Commands as they stand in a record.
//!
//! A path is not in the record: the entry of a run names program and revision, and
//! whoever plays the record again looks the path up. A single block carries its own.

use super::mdi;
use crate::driver::{
    Command, DriverConfig, JogRequest, OffsetRequest, Overrides, ProbeRequest, ReplanRequest,
    RunRequest,
};
use cnc_msgs::path::{CompensatedPath, StartInSpan};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A command, where whoever gives it need not have the path.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    Command(Command),
    Run(RunOrder),
    Replan(ReplanOrder),
}

/// [`RunRequest`] without its path.
#[derive(Debug, Clone, PartialEq)]
pub struct RunOrder {
    pub program_id: String,
    pub revision: u64,
    pub start_line: u32,
    pub occurrence: u32,
    pub in_span: StartInSpan,
    pub check_only: bool,
    pub tool_diameters_mm: BTreeMap<u32, f64>,
}

/// [`ReplanRequest`] without its path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReplanOrder {
    pub program_id: String,
    pub of: u64,
    pub revision: u64,
}

impl From<Command> for Order {
    fn from(command: Command) -> Self {
        Self::Command(command)
    }
}

impl Order {
    /// Whether it is somebody's wish that nothing moves on.
    pub fn stops_whatever_moves(&self) -> bool {
        matches!(self, Self::Command(command) if command.stops_whatever_moves())
    }
}

/// Writes an order in the form of [`command_to_json`].
pub fn order_to_json(id: u64, order: &Order) -> String {
    let command = match order {
        Order::Command(command) => return command_to_json(id, command),
        Order::Run(order) => CommandForm::RunProgram {
            program_id: order.program_id.clone(),
            revision: order.revision,
            start_line: order.start_line,
            occurrence: order.occurrence,
            in_span: order.in_span,
            check_only: order.check_only,
            tool_diameters_mm: pairs(&order.tool_diameters_mm),
        },
        Order::Replan(order) => CommandForm::Replan {
            program_id: order.program_id.clone(),
            of: order.of,
            revision: order.revision,
        },
    };
    written(id, command)
}

/// A command as it stands in an entry.
#[derive(Debug, Serialize, Deserialize)]
struct CommandRecord {
    id: u64,
    #[serde(flatten)]
    command: CommandForm,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "command", rename_all = "snake_case")]
enum CommandForm {
    RunProgram {
        program_id: String,
        revision: u64,
        start_line: u32,
        /// Which time that line is run; records from before there were calls say nothing.
        #[serde(default, skip_serializing_if = "is_zero")]
        occurrence: u32,
        /// Records from before it was asked say nothing: such a start was refused.
        #[serde(default, skip_serializing_if = "is_refused")]
        in_span: StartInSpan,
        check_only: bool,
        /// Only where there are keep-out boxes.
        /// Pairs: a flattened map cannot have numbers as keys.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        tool_diameters_mm: Vec<(u32, f64)>,
    },
    CancelRun {
        #[serde(default, skip_serializing_if = "Option::is_none")]
        run: Option<u64>,
    },
    FeedHold,
    Resume,
    SoftReset,
    Unlock,
    Home,
    Jog(JogRequest),
    Probe(ProbeRequest),
    SetWorkOffset(OffsetRequest),
    Configure {
        write: bool,
    },
    SetOverrides(Overrides),
    DoorHold,
    Sleep,
    Heartbeat,
    ForgetCommander,
    Recorder {
        is_whole: bool,
        reason: String,
    },
    ConfirmToolChange {
        #[serde(default, skip_serializing_if = "Option::is_none")]
        objection: Option<String>,
    },
    /// Bags have it under its first name.
    #[serde(rename = "take_rest")]
    Replan {
        program_id: String,
        of: u64,
        revision: u64,
    },
    ProgramContinued {
        of: u64,
        answer: Result<String, String>,
    },
    UserFunctionEnded {
        run: u64,
        call: u32,
        answer: Result<String, String>,
    },
    /// The path has no program that it could be found by.
    ExecuteMdi {
        #[serde(flatten)]
        path: mdi::PathRecord,
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        tool_diameters_mm: Vec<(u32, f64)>,
    },
    SetSingleBlock {
        on: bool,
    },
    Activate,
    Deactivate,
    Shutdown,
    SetConfig(Box<DriverConfig>),
    RosFace {
        is_there: bool,
    },
}

fn pairs(map: &BTreeMap<u32, f64>) -> Vec<(u32, f64)> {
    map.iter().map(|(number, value)| (*number, *value)).collect()
}

fn is_zero(number: &u32) -> bool {
    *number == 0
}

fn is_refused(in_span: &StartInSpan) -> bool {
    *in_span == StartInSpan::Refused
}

/// Writes a command: `{"id":7,"command":"feed_hold"}`.
pub fn command_to_json(id: u64, command: &Command) -> String {
    let command = match command {
        Command::RunProgram(request) => CommandForm::RunProgram {
            program_id: request.program_id.clone(),
            revision: request.revision,
            start_line: request.start_line,
            occurrence: request.occurrence,
            in_span: request.in_span,
            check_only: request.check_only,
            tool_diameters_mm: pairs(&request.tool_diameters_mm),
        },
        Command::CancelRun { run } => CommandForm::CancelRun { run: *run },
        Command::FeedHold => CommandForm::FeedHold,
        Command::Resume => CommandForm::Resume,
        Command::SoftReset => CommandForm::SoftReset,
        Command::Unlock => CommandForm::Unlock,
        Command::Home => CommandForm::Home,
        Command::Jog(request) => CommandForm::Jog(*request),
        Command::Probe(request) => CommandForm::Probe(*request),
        Command::SetWorkOffset(request) => CommandForm::SetWorkOffset(*request),
        Command::Configure { write } => CommandForm::Configure { write: *write },
        Command::SetOverrides(wanted) => CommandForm::SetOverrides(*wanted),
        Command::DoorHold => CommandForm::DoorHold,
        Command::Sleep => CommandForm::Sleep,
        Command::Heartbeat => CommandForm::Heartbeat,
        Command::ForgetCommander => CommandForm::ForgetCommander,
        Command::Recorder { is_whole, reason } => {
            CommandForm::Recorder { is_whole: *is_whole, reason: reason.clone() }
        }
        Command::ConfirmToolChange { objection } => {
            CommandForm::ConfirmToolChange { objection: objection.clone() }
        }
        Command::Replan(request) => CommandForm::Replan {
            program_id: request.program_id.clone(),
            of: request.of,
            revision: request.revision,
        },
        Command::ProgramContinued { of, answer } => {
            CommandForm::ProgramContinued { of: *of, answer: answer.clone() }
        }
        Command::UserFunctionEnded { run, call, answer } => {
            CommandForm::UserFunctionEnded { run: *run, call: *call, answer: answer.clone() }
        }
        Command::ExecuteMdi { path, tool_diameters_mm } => CommandForm::ExecuteMdi {
            path: mdi::PathRecord::of(path),
            tool_diameters_mm: pairs(tool_diameters_mm),
        },
        Command::SetSingleBlock(on) => CommandForm::SetSingleBlock { on: *on },
        Command::Activate => CommandForm::Activate,
        Command::Deactivate => CommandForm::Deactivate,
        Command::Shutdown => CommandForm::Shutdown,
        Command::SetConfig(config) => CommandForm::SetConfig(config.clone()),
        Command::RosFace { is_there } => CommandForm::RosFace { is_there: *is_there },
    };
    written(id, command)
}

fn written(id: u64, command: CommandForm) -> String {
    serde_json::to_string(&CommandRecord { id, command })
        .expect("a struct of numbers and texts is always JSON")
}

/// Reads a command back; paths come from `lookup`, by program and revision.
pub fn command_from_json(
    json: &[u8],
    lookup: &dyn Fn(&str, u64) -> Option<Arc<CompensatedPath>>,
) -> Result<(u64, Command), CommandError> {
    let record: CommandRecord = serde_json::from_slice(json)?;
    let command = match record.command {
        CommandForm::RunProgram {
            program_id,
            revision,
            start_line,
            occurrence,
            in_span,
            check_only,
            tool_diameters_mm,
        } => {
            let Some(path) = lookup(&program_id, revision) else {
                return Err(CommandError::UnknownPath { program_id, revision });
            };
            Command::RunProgram(RunRequest {
                program_id,
                revision,
                path,
                start_line,
                occurrence,
                in_span,
                check_only,
                tool_diameters_mm: tool_diameters_mm.into_iter().collect(),
            })
        }
        CommandForm::CancelRun { run } => Command::CancelRun { run },
        CommandForm::FeedHold => Command::FeedHold,
        CommandForm::Resume => Command::Resume,
        CommandForm::SoftReset => Command::SoftReset,
        CommandForm::Unlock => Command::Unlock,
        CommandForm::Home => Command::Home,
        CommandForm::Jog(request) => Command::Jog(request),
        CommandForm::Probe(request) => Command::Probe(request),
        CommandForm::SetWorkOffset(request) => Command::SetWorkOffset(request),
        CommandForm::Configure { write } => Command::Configure { write },
        CommandForm::SetOverrides(wanted) => Command::SetOverrides(wanted),
        CommandForm::DoorHold => Command::DoorHold,
        CommandForm::Sleep => Command::Sleep,
        CommandForm::Heartbeat => Command::Heartbeat,
        CommandForm::ForgetCommander => Command::ForgetCommander,
        CommandForm::Recorder { is_whole, reason } => Command::Recorder { is_whole, reason },
        CommandForm::ConfirmToolChange { objection } => Command::ConfirmToolChange { objection },
        CommandForm::Replan { program_id, of, revision } => {
            let Some(path) = lookup(&program_id, revision) else {
                return Err(CommandError::UnknownPath { program_id, revision });
            };
            Command::Replan(ReplanRequest { program_id, of, revision, path })
        }
        CommandForm::ProgramContinued { of, answer } => Command::ProgramContinued { of, answer },
        CommandForm::UserFunctionEnded { run, call, answer } => {
            Command::UserFunctionEnded { run, call, answer }
        }
        CommandForm::ExecuteMdi { path, tool_diameters_mm } => Command::ExecuteMdi {
            path: Arc::new(path.path()?),
            tool_diameters_mm: tool_diameters_mm.into_iter().collect(),
        },
        CommandForm::SetSingleBlock { on } => Command::SetSingleBlock(on),
        CommandForm::Activate => Command::Activate,
        CommandForm::Deactivate => Command::Deactivate,
        CommandForm::Shutdown => Command::Shutdown,
        CommandForm::SetConfig(config) => Command::SetConfig(config),
        CommandForm::RosFace { is_there } => Command::RosFace { is_there },
    };
    Ok((record.id, command))
}

/// Why a command cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    #[error("the command is not understood: {0}")]
    Json(#[from] serde_json::Error),
    #[error("the path of a single block is not whole: {0}")]
    Path(String),
    #[error("the path of program {program_id}, revision {revision}, is not available")]
    UnknownPath { program_id: String, revision: u64 },
}
