//! The state machine that owns the machine.
//!
//! It is handed inputs (the port, bytes, commands) with the time they came at, and
//! gives outputs (bytes, replies, states). Its outputs are a function of the sequence
//! of inputs and times, so that a recorded run can be played again. Policy: a hold is
//! written at once, in any state; nothing resumes, homes or unlocks by itself; what
//! is not known is reported as unknown. It knows no ROS, no port and no clock.
//!
//! None of this is a safety function.

mod block;
mod board;
mod buttons;
mod checkpoint;
mod command;
mod commander;
mod config;
mod configure;
mod connect;
mod deactivate;
mod events;
mod machine;
mod manual_lines;
mod manual_operation;
mod obstacles;
mod offsets;
mod overrides;
mod place;
mod proof;
mod replan;
mod restart;
mod ros_loss;
mod run;
mod run_progress;
mod stop;
mod stream;
mod tool_change;

pub use buttons::STILL_STOPPING;
pub use command::{Command, MDI, Refusal, RunRequest};
pub use commander::{COMMANDER_LOST, OnCommanderLoss};
pub use config::DriverConfig;
pub use machine::{ControllerSettings, Offset};
pub use manual_lines::{JogFrame, JogRequest, OffsetRequest, ProbeRequest};
pub use manual_operation::MoveResult;
pub use overrides::Overrides;
pub use replan::ReplanRequest;
pub use ros_loss::{OnRosLoss, ROS_LOST};

use crate::link::Link;
use cnc_msgs::geometry::Position;
use cnc_msgs::machine::MachineState;
use connect::Connecting;
use machine::Machine;
use manual_operation::ManualOperation;
use proof::Check;
use run::Run;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::time::Duration;
use tool_change::Paused;

/// What happened outside.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// A port was opened; nothing is known of what is behind it.
    PortOpened,
    /// There is no port (any more).
    PortClosed { reason: String },
    /// Bytes came from the controller.
    Received(Vec<u8>),
    /// Time has passed; nothing else happened.
    Timer,
    /// Somebody wants something; `id` comes back with the answer.
    Command { id: u64, command: Command },
}

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
    /// The accepted jog or probe is over.
    MoveFinished(MoveResult),
    /// What the controller said of itself, when it was connected and after a change.
    Settings(ControllerSettings),
    /// After [`Command::Shutdown`]: the port may be closed.
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
    /// 0 when it succeeded; see [`error_code`].
    pub error_code: u16,
    pub message: String,
    /// The source line that was being cut last, 0 when none was.
    pub last_line: u32,
    /// The source line of the block that the controller refused or stopped at, 0 when no
    /// block is to blame.
    pub blamed_line: u32,
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

/// Where a line that is under way comes from.
#[derive(Debug, Clone, PartialEq)]
enum Origin {
    Query(usize),
    /// Of what is done by hand.
    Manual,
    /// Of a program that homes.
    Home,
    /// Switches the controller's check mode on.
    CheckMode,
    Preamble,
    /// Of the program, with its text for messages.
    Program {
        text: String,
        source_line: u32,
        element: Option<usize>,
    },
    Sync,
}

/// What the driver is about. Each state owns what belongs to it.
#[derive(Debug)]
enum Phase {
    /// No port.
    Closed {
        reason: String,
    },
    /// Finding out what is behind the port.
    Connecting(Connecting),
    /// What the controller has still to answer is not known: only a soft reset helps.
    Adrift {
        reason: String,
    },
    Ready,
    /// Something by hand.
    Manual(Box<ManualOperation>),
    Running(Box<Run>),
}

/// The driver of one controller.
#[derive(Debug)]
pub struct Driver {
    config: DriverConfig,
    now: Duration,
    link: Link<Origin>,
    phase: Phase,
    machine: Machine,
    check: Option<Check>,
    /// A run that waits for its tool while something is done by hand.
    paused: Option<Paused>,
    hold: Option<stop::HoldWatch>,
    overrides: Option<overrides::OverrideWatch>,
    /// What G92 shifted by before a reset.
    shift_before: Position,
    /// When a commander gave its last sign of life.
    commander_heard: Option<Duration>,
    /// The machine stops behind every block and waits for a resume.
    is_single_block: bool,
    /// Whether it begins what it is asked for.
    is_active: bool,
    /// Nobody can be reached over ROS.
    ros_loss: Option<ros_loss::RosLoss>,
    leaving: Option<deactivate::Leaving>,
    outputs: VecDeque<Output>,
    published: Option<MachineState>,
}

impl Driver {
    /// A driver without a port.
    pub fn new(config: DriverConfig) -> Self {
        let link = Link::new(config.link(), Duration::ZERO);
        Self {
            config,
            now: Duration::ZERO,
            link,
            phase: Phase::Closed { reason: "no port was opened yet".into() },
            machine: Machine::default(),
            check: None,
            paused: None,
            hold: None,
            overrides: None,
            shift_before: [0.0; 3],
            commander_heard: None,
            is_single_block: false,
            is_active: true,
            ros_loss: None,
            leaving: None,
            outputs: VecDeque::new(),
            published: None,
        }
    }

    /// Takes what happened at `now`, a monotonic time from any zero.
    pub fn handle(&mut self, now: Duration, input: Input) {
        self.now = self.now.max(now);
        match input {
            Input::PortOpened => self.on_port_opened(),
            Input::PortClosed { reason } => self.on_port_closed(&reason),
            Input::Received(bytes) => self.link.receive(self.now, &bytes),
            Input::Timer => {}
            Input::Command { id, command } => self.on_command(id, command),
        }
        if self.is_open() {
            self.link.handle_time(self.now);
        }
        while let Some(event) = self.link.poll_event() {
            self.on_event(event);
        }
        self.on_time();
        self.settle_paused();
        self.feed();
        self.publish();
    }

    /// The next thing to do, bytes first.
    pub fn poll_output(&mut self) -> Option<Output> {
        match self.link.poll_transmit() {
            Some(bytes) if self.is_open() => Some(Output::Transmit(bytes)),
            _ => self.outputs.pop_front(),
        }
    }

    /// When [`Input::Timer`] is wanted at the latest.
    pub fn next_deadline(&self) -> Option<Duration> {
        let proving = self.is_proving().then_some(self.now);
        let link = self.is_open().then(|| self.link.next_deadline());
        let phase = match &self.phase {
            Phase::Connecting(connecting) => Some(connecting.until()),
            Phase::Manual(operation) => operation.until(),
            Phase::Running(run) => run.deadline(),
            _ => None,
        };
        let leaving = self.leaving.as_ref().map(|leaving| leaving.until);
        let (commander, ros) = (self.commander_deadline(), self.ros_deadline());
        let overrides = self.overrides.as_ref().map(|watch| watch.until);
        [proving, link, phase, leaving, commander, ros, overrides].into_iter().flatten().min()
    }

    /// What is known of the machine now.
    pub fn state(&self, now: Duration) -> MachineState {
        let mut state = self.compose();
        state.link_age_s = match self.heard_at() {
            Some(at) => now.saturating_sub(at).as_secs_f64(),
            None => f64::INFINITY,
        };
        state
    }

    /// When the last report came through the port that is open.
    pub fn heard_at(&self) -> Option<Duration> {
        self.link.last_status_at().filter(|_| self.is_open())
    }

    /// The most bytes that are under way at a time.
    pub fn window(&self) -> usize {
        self.link.window()
    }

    fn is_open(&self) -> bool {
        !matches!(self.phase, Phase::Closed { .. })
    }

    fn is_proving(&self) -> bool {
        self.check.is_some()
            || matches!(&self.phase, Phase::Running(run) if run.is_proving() || run.rest.is_some())
    }

    fn on_time(&mut self) {
        match &self.phase {
            Phase::Connecting(connecting) if self.now >= connecting.until() => {
                self.on_connect_timeout();
            }
            Phase::Manual(operation)
                if operation.until().is_some_and(|until| self.now >= until) =>
            {
                self.on_manual_timeout();
            }
            Phase::Running(_) => self.on_run_time(),
            _ => {}
        }
        if self.overrides.as_ref().is_some_and(|watch| self.now >= watch.until) {
            self.on_overrides_timeout();
        }
        self.watch_commander();
        self.watch_ros();
        self.step_check();
        self.step_rest();
        self.step_leaving();
    }

    fn feed(&mut self) {
        if matches!(self.phase, Phase::Running(_)) {
            self.feed_run();
        }
    }

    fn compose(&self) -> MachineState {
        let mut state = self.machine.state();
        self.compose_mode(&mut state);
        state
    }

    fn publish(&mut self) {
        let state = self.compose();
        if self.published.as_ref() != Some(&state) {
            self.published = Some(state.clone());
            let link_age_s = self.state(self.now).link_age_s;
            self.outputs.push_back(Output::State(MachineState { link_age_s, ..state }));
        }
    }

    fn reply(&mut self, id: u64, result: Result<String, Refusal>) {
        self.outputs.push_back(Output::Reply { id, result });
    }

    fn log(&mut self, level: LogLevel, message: String) {
        self.outputs.push_back(Output::Log { level, message });
    }
}

#[cfg(test)]
mod tests;
