//! The commands of the driver, and who handles each.

use super::Driver;
use super::answer::{Answer, done, refused};
use super::context::config::DriverConfig;
use super::context::overrides::Overrides;
use super::deactivate::NOT_ACTIVE;
use super::manual::lines::{JogRequest, OffsetRequest, ProbeRequest};
use super::run::replan::ReplanRequest;
use super::run::request::RunRequest;
use crate::codes::error_code;
use cnc_msgs::path::CompensatedPath;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What can be asked of the driver.
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
    /// Moves axes without a program; [`super::Output::MoveFinished`] follows when it was accepted.
    Jog(JogRequest),
    /// Looks for the workpiece; [`super::Output::MoveFinished`] follows when it was accepted.
    Probe(ProbeRequest),
    /// Sets a work offset from the tool position, or from an origin.
    SetWorkOffset(OffsetRequest),
    /// Says which setting of the controller would improve the supervision of the link, or
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
    /// What follows is begun by somebody else than the commander whose sign of life was the last.
    ForgetCommander,
    /// What the recorder says of this run: whether all of it is in the bag so far.
    Recorder { is_whole: bool, reason: String },
    /// The tool that was asked for is in the spindle; `objection` says why the path
    /// must not be cut with it.
    ConfirmToolChange { objection: Option<String> },
    /// Goes on with another path for what is left, while the machine stands in a hold.
    Replan(ReplanRequest),
    /// The program of the run that waits in revision `of` has been read on from what its probes have
    /// found: its id with that, or why it is refused.
    ProgramContinued { of: u64, answer: Result<String, String> },
    /// A function that this run has called (its number `call`) is done, with what is to be said of it, or
    /// why it is not.
    UserFunctionEnded { run: u64, call: u32, answer: Result<String, String> },
    /// Runs the path of a single block, from idle; answered as a run is.
    ExecuteMdi {
        path: Arc<CompensatedPath>,
        /// By T number, mm, for keep-out boxes; empty where there are none.
        tool_diameters_mm: BTreeMap<u32, f64>,
    },
    /// Whether the machine stops after every block. It takes effect at the end of
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
    /// Goes on with other parameters, at rest.
    SetConfig(Box<DriverConfig>),
    /// Whether the driver can be reached over ROS.
    RosFace { is_there: bool },
}

impl Command {
    /// Whether it asks that nothing moves on.
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
            self.context.forget_old_commander();
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
                Command::Heartbeat => self.context.on_heartbeat(),
                Command::ForgetCommander => self.forget_commander(),
                Command::Recorder { is_whole, reason } => self.on_recorder(is_whole, &reason),
                Command::ConfirmToolChange { objection } => self.confirm_tool_change(objection),
                Command::Replan(request) => self.replan(id, request),
                Command::ProgramContinued { of, answer } => self.on_program_continued(of, answer),
                Command::UserFunctionEnded { run, call, answer } => {
                    self.on_user_function((run, call), answer)
                }
                Command::ExecuteMdi { path, tool_diameters_mm } => {
                    self.run_program(id, RunRequest::mdi(path, tool_diameters_mm))
                }
                Command::SetSingleBlock(is_on) => self.set_single_block(is_on),
                Command::Activate => self.activate(),
                Command::Deactivate => self.deactivate(id),
                Command::Shutdown => self.shut_down(id),
                Command::SetConfig(config) => self.set_config(*config),
                Command::RosFace { is_there } => self.on_ros_face(is_there),
            }
        };
        if let Some(result) = answer {
            self.context.reply(id, result);
        }
    }

    /// Goes on with other parameters. What was opened with the port stays as it is.
    fn set_config(&mut self, config: DriverConfig) -> Answer {
        if self.phase.is_at_work() || self.check.is_some() {
            return refused(error_code::BUSY, "parameters are taken when nothing is under way");
        }
        let DriverConfig { baud, is_networked, receive_buffer_bytes, .. } = self.context.config;
        self.context.config = DriverConfig { baud, is_networked, receive_buffer_bytes, ..config };
        self.context.link.set_config(self.context.config.link());
        done("taken")
    }
}
