//! What can be asked of the driver, and what it says to it at once.

use super::config::START_TOLERANCE_MM;
use super::deactivate::NOT_ACTIVE;
use super::manual_lines::{JogRequest, OffsetRequest, ProbeRequest};
use super::overrides::Overrides;
use super::proof::{Check, Proof};
use super::replan::ReplanRequest;
use super::run::Run;
use super::{Driver, Phase, RunOutcome};
use crate::codes::error_code;
use crate::encoder::{EncoderConfig, StartProblem, start_at};
use cnc_msgs::contour::Action;
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position};
use cnc_msgs::path::{CompensatedPath, StartInSpan};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A request.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Runs a path, or only proves that it could be sent. Answered when the whole path
    /// is proven; [`super::Output::RunFinished`] follows when it was accepted.
    RunProgram(RunRequest),
    /// Hold, standstill, reset: the rest of the program is dropped, the position kept.
    /// Only of the run or check with the id `run`, if one is given.
    CancelRun { run: Option<u64> },
    /// Decelerates and keeps what is under way. The spindle keeps turning.
    FeedHold,
    /// Goes on after a hold or a program stop.
    Resume,
    /// Resets the controller at once. While moving the position is lost.
    SoftReset,
    /// Ends an alarm without homing.
    Unlock,
    /// Homes all axes.
    Home,
    /// Moves axes by hand; [`super::Output::MoveFinished`] follows when it was accepted.
    Jog(JogRequest),
    /// Looks for the workpiece; [`super::Output::MoveFinished`] follows when it was accepted.
    Probe(ProbeRequest),
    /// Says what a place is called.
    SetWorkOffset(OffsetRequest),
    /// Says which setting of the controller would improve the watch over the link, or
    /// writes it and reads it back.
    Configure { write: bool },
    /// Faster or slower than programmed.
    SetOverrides(Overrides),
    /// Holds as an opened door does: spindle and coolant are switched off, and on again
    /// by a resume.
    DoorHold,
    /// Puts the controller to sleep; a soft reset wakes it.
    Sleep,
    /// A commander's sign of life.
    Heartbeat,
    /// What the recorder says of this run: whether all of it is in the bag so far.
    Recorder { is_whole: bool, reason: String },
    /// The tool that was asked for is in the spindle; `objection` says why the path
    /// must not be cut with it.
    ConfirmToolChange { objection: Option<String> },
    /// Goes on with another path for what is left, while the machine stands in a hold.
    Replan(ReplanRequest),
    /// Runs the path of a single block, from idle; answered as a run is.
    ExecuteMdi { path: Arc<CompensatedPath> },
    /// Whether the machine stops behind every block. It takes effect at the end of
    /// the block up to which lines have been sent; a machine that stands goes on with
    /// a resume in any case.
    SetSingleBlock(bool),
    /// Begins what it is asked for, from now on.
    Activate,
    /// Brings everything to a stop as a cancel does, and begins nothing more. Answered
    /// when the machine stands, or does not.
    Deactivate,
    /// Brings everything to a stop as a cancel does; then the port may be closed.
    Shutdown,
    /// Whether the driver can be reached over ROS.
    RosFace { is_there: bool },
}

impl Command {
    /// Whether it is somebody's wish that nothing moves on.
    pub fn stops_whatever_moves(&self) -> bool {
        matches!(
            self,
            Self::CancelRun { run: None }
                | Self::FeedHold
                | Self::DoorHold
                | Self::SoftReset
                | Self::Sleep
                | Self::Deactivate
                | Self::Shutdown
        )
    }
}

/// What the state calls the program of a single block of manual data input.
pub const MDI: &str = "mdi";

/// What to run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRequest {
    pub program_id: String,
    /// The revision of the path of that program.
    pub revision: u64,
    pub path: Arc<CompensatedPath>,
    /// The source line to begin at; 0 and 1 are the whole program.
    pub start_line: u32,
    /// What the control of the program says of a start under cutter compensation.
    pub in_span: StartInSpan,
    /// Nothing moves: the path is encoded from end to end for this controller, and
    /// read by its own check mode where the configuration says so.
    pub check_only: bool,
}

/// Why a command was not followed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[error("{message}")]
pub struct Refusal {
    /// See [`error_code`].
    pub error_code: u16,
    pub message: String,
}

impl RunRequest {
    /// The path of a single block.
    fn mdi(path: Arc<CompensatedPath>) -> Self {
        let program_id = MDI.to_owned();
        let in_span = StartInSpan::Refused;
        Self { program_id, revision: 0, path, start_line: 0, in_span, check_only: false }
    }

    /// Whether it has a bag: a block by hand has none.
    pub(super) fn is_recorded(&self) -> bool {
        self.program_id != MDI
    }
}

impl Refusal {
    pub(super) fn new(error_code: u16, message: impl Into<String>) -> Self {
        Self { error_code, message: message.into() }
    }
}

/// What to answer now; `None` when the answer comes later.
pub(super) type Answer = Option<Result<String, Refusal>>;

pub(super) fn done(text: &str) -> Answer {
    Some(Ok(text.to_owned()))
}

pub(super) fn refused(code: u16, text: impl Into<String>) -> Answer {
    Some(Err(Refusal::new(code, text)))
}

impl Driver {
    pub(super) fn on_command(&mut self, id: u64, command: Command) {
        let is_start = matches!(
            command,
            Command::RunProgram(_)
                | Command::ExecuteMdi { .. }
                | Command::Home
                | Command::Unlock
                | Command::Jog(_)
                | Command::Probe(_)
                | Command::SetWorkOffset(_)
                | Command::Configure { write: true }
                | Command::Sleep
        );
        if is_start {
            self.forget_old_commander();
        }
        let moves =
            is_start || matches!(command, Command::Resume | Command::ConfirmToolChange { .. });
        let answer = if is_start && self.is_shutting_down() {
            refused(error_code::SHUTDOWN, "the driver is shutting down")
        } else if moves && !self.is_active {
            refused(error_code::NOT_ACTIVE, NOT_ACTIVE)
        } else {
            match command {
                Command::RunProgram(request) => self.run_program(id, request),
                Command::CancelRun { run } => self.cancel_run(run),
                Command::FeedHold => self.feed_hold(),
                Command::Resume => self.resume(),
                Command::SoftReset => self.soft_reset(id),
                Command::Unlock => self.unlock(id),
                Command::Home => self.home(id),
                Command::Jog(request) => self.jog(id, request),
                Command::Probe(request) => self.probe(id, request),
                Command::SetWorkOffset(request) => self.set_work_offset(id, request),
                Command::SetOverrides(wanted) => self.set_overrides(id, wanted),
                Command::Configure { write } => self.configure(id, write),
                Command::DoorHold => self.door_hold(),
                Command::Sleep => self.sleep(id),
                Command::Heartbeat => self.hear_commander(),
                Command::Recorder { is_whole, reason } => self.hear_recorder(is_whole, &reason),
                Command::ConfirmToolChange { objection } => self.confirm_tool_change(objection),
                Command::Replan(request) => self.replan(id, request),
                Command::ExecuteMdi { path } => self.run_program(id, RunRequest::mdi(path)),
                Command::SetSingleBlock(is_on) => self.set_single_block(is_on),
                Command::Activate => self.activate(),
                Command::Deactivate => self.deactivate(id),
                Command::Shutdown => self.shut_down(id),
                Command::RosFace { is_there } => self.hear_ros_face(is_there),
            }
        };
        if let Some(result) = answer {
            self.reply(id, result);
        }
    }

    fn run_program(&mut self, id: u64, request: RunRequest) -> Answer {
        if self.check.is_some() {
            return refused(error_code::BUSY, "another program is being checked");
        }
        let is_only_encoded = request.check_only && !self.config.check_in_controller;
        let is_in_change = request.is_by_hand() && self.is_tool_awaited();
        if is_in_change && let Err(refusal) = Self::check_block(&request.path) {
            return Some(Err(refusal));
        }
        if !is_only_encoded
            && !is_in_change
            && let Some(refusal) = self.obstacle()
        {
            return Some(Err(refusal));
        }
        if !is_only_encoded && let Some(refusal) = self.frame_obstacle(&request) {
            return Some(Err(refusal));
        }
        let config = EncoderConfig {
            has_mist: self.config.encoder.has_mist || self.machine.has_mist,
            homing: self.machine.homing(),
            board: self.machine.board(),
            // The others have no M6: the driver waits for the tool.
            controller_changes_tools: self.config.encoder.controller_changes_tools
                && self.machine.firmware.traits().has_tool_change,
            // A height means nothing before the axes are home.
            approach_z_mm: self.config.encoder.approach_z_mm.filter(|_| self.machine.is_homed),
            ..self.config.encoder
        };
        let started = start_at(request.path.clone(), config, request.start_line, request.in_span);
        let (encoder, first_element) = match started {
            Ok(started) => started,
            Err(StartProblem::Encode(problem)) => {
                return refused(error_code::NOT_ENCODABLE, problem.to_string());
            }
            Err(problem) => return refused(error_code::START_LINE, problem.to_string()),
        };
        let proof = Proof::new(encoder.clone(), self.machine.rates(), &request.path, first_element);
        if is_only_encoded {
            self.check = Some(Check { id, path: request.path, proof });
            return None;
        }
        // Where the words in force are those that the run begins with, this can be said at
        // once; else it is looked at again when they have been sent.
        let run = Run::new(id, request, encoder, first_element, proof, &self.machine);
        if !is_in_change
            && !run.encoder.checks_start()
            && self.machine.work_system == Some(1)
            && self.machine.has_tool_length == Some(false)
            && let Some(at) = self.machine.work_position()
            && let Err(refusal) = check_start(at, run.start(), run.assumed_axes())
        {
            return Some(Err(refusal));
        }
        self.pause_run();
        self.phase = Phase::Running(Box::new(run));
        None
    }

    /// Why a path cannot be run where the machine's zero is not known: it goes to places of
    /// the machine frame before it homes.
    fn frame_obstacle(&self, request: &RunRequest) -> Option<Refusal> {
        let path = &request.path;
        let first = path.events.iter().find_map(|event| match event.action {
            Action::Home { axes } if axes == AxisSet::ALL => Some(None),
            Action::MachineMove { .. } => Some(Some(("G53", event.source.line))),
            Action::Reference { second, .. } => {
                Some(Some((if second { "G30" } else { "G28" }, event.source.line)))
            }
            _ => None,
        });
        let (word, line) = first??;
        self.machine.home_obstacle(&format!("{word} in line {line}"))
    }

    fn cancel_run(&mut self, run: Option<u64>) -> Answer {
        if let Some(answer) = self.cancel_paused(run) {
            return answer;
        }
        let is_meant = |id: u64| run.is_none_or(|run| run == id);
        let check = self.check.take_if(|check| is_meant(check.id));
        if let Some(check) = &check {
            let text = "canceled while being checked";
            self.reply(check.id, Err(Refusal::new(error_code::CANCELED, text)));
        }
        match (&self.phase, check) {
            (Phase::Running(run), _) if is_meant(run.id()) => {}
            (Phase::Manual(operation), None)
                if is_meant(operation.id) && operation.task.moves() =>
            {
                self.stop_move(Refusal::new(error_code::CANCELED, "canceled"));
                return done("the move is being stopped");
            }
            (_, Some(_)) => return done("the check was canceled"),
            (_, None) => return refused(error_code::NOTHING_TO_DO, "no such program is running"),
        }
        self.stop_run(RunOutcome::Canceled, error_code::CANCELED, "canceled".into());
        done("the run is being stopped")
    }

    fn set_single_block(&mut self, is_on: bool) -> Answer {
        self.is_single_block = is_on;
        done(match (is_on, &self.phase) {
            (true, Phase::Running(_)) => {
                "single block is on: what has been sent is cut first, then every block waits"
            }
            (true, _) => "single block is on: every block waits for a resume",
            (false, Phase::Running(run)) if run.is_at_block_end() => {
                "single block is off: resume goes on"
            }
            (false, _) => "single block is off",
        })
    }
}

/// Whether the tool is where a path relies on it to be; work frame, mm.
pub(super) fn check_start(at: Position, start: Position, axes: AxisSet) -> Result<(), Refusal> {
    let is_off = |axis: &usize| (at[*axis] - start[*axis]).abs() > START_TOLERANCE_MM + 1e-9;
    if !(0..3).filter(|axis| axes.contains(*axis)).any(|axis| is_off(&axis)) {
        return Ok(());
    }
    let show = |position: Position| {
        let words = (0..3).filter(|axis| axes.contains(*axis));
        words.map(|axis| format!("{}{:.3}", AXIS_LETTERS[axis], position[axis])).collect::<Vec<_>>()
    };
    let message = format!(
        "the path begins at {} but the tool is at {} in the work frame: move it there first",
        show(start).join(" "),
        show(at).join(" ")
    );
    Err(Refusal::new(error_code::START_POSITION, message))
}
