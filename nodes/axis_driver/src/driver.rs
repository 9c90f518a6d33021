//! The state machine that owns the machine.
//!
//! It is handed inputs (the port, bytes, commands) with the time they came at, and
//! gives outputs (bytes, replies, states). Its outputs are a function of the sequence
//! of inputs and times, so that a recorded run can be played again. Policy: a hold is
//! written at once, in any state; nothing resumes, homes or unlocks by itself; what
//! is not known is reported as unknown. It knows no ROS, no port and no clock.
//!
//! The driver is a [`Context`] and a [`Phase`]. The context (`context/`) outlives every
//! phase and knows none. Each phase (`connect/`, `manual/`, `run/`, `stop/`) is a type that
//! owns its state; its handlers take an event and return how the phase is left. No phase
//! names another except that a stop takes over what is left of a run. The `impl Driver`
//! here and in the files of this folder is all that sees both: it routes inputs to the
//! phase, and makes the transitions (`transition.rs`).
//!
//! None of this is a safety function.

mod answer;
mod buttons;
mod checkpoint;
mod command;
mod connect;
mod context;
mod deactivate;
mod events;
mod manual;
mod next;
mod output;
mod paused;
mod phase;
mod restart;
mod run;
mod start;
mod state;
mod stop;
mod transition;
mod unattended;

pub use answer::Refusal;
pub use buttons::STILL_STOPPING;
pub use command::Command;
pub use context::commander::{COMMANDER_LOST, OnCommanderLoss};
pub use context::config::DriverConfig;
pub use context::limits::CheckTravel;
pub use context::overrides::Overrides;
pub use context::path_deviation::{OnPathDeviation, PATH_DEVIATION};
pub use context::ros_loss::{OnRosLoss, ROS_LOST};
pub use manual::lines::{JogFrame, JogRequest, OffsetRequest, ProbeRequest};
pub use output::{
    ControllerSettings, LogLevel, MoveResult, Offset, Output, ProbesOfRun, RunOutcome, RunResult,
    UserFunctionCall,
};
pub use run::replan::ReplanRequest;
pub use run::request::{MDI, RunRequest};

use cnc_msgs::machine::MachineState;
use context::Context;
use deactivate::Leaving;
use paused::Paused;
use phase::Phase;
use run::proof::Check;
use std::time::Duration;

/// What happened outside.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// A port was opened; which controller is on it is unknown.
    PortOpened,
    /// There is no port (any more).
    PortClosed { reason: String },
    /// Bytes came from the controller.
    Received(Vec<u8>),
    /// Time has passed; nothing else happened.
    Timer,
    /// A command; `id` comes back with the answer.
    Command { id: u64, command: Command },
}

/// The driver of one controller. Owns the context, the phase, and what runs next to any
/// phase: a check, a run that waits for its tool, the wish to stop.
#[derive(Debug)]
pub struct Driver {
    context: Context,
    phase: Phase,
    /// A path that is only encoded, in whatever phase.
    check: Option<Check>,
    /// A run that waits for its tool during a manual operation.
    paused: Option<Paused>,
    /// Whether it begins what it is asked for.
    is_active: bool,
    leaving: Option<Leaving>,
    published: Option<MachineState>,
}

impl Driver {
    /// A driver without a port.
    pub fn new(config: DriverConfig) -> Self {
        Self {
            context: Context::new(config),
            phase: Phase::Closed { reason: "no port was opened yet".into() },
            check: None,
            paused: None,
            is_active: true,
            leaving: None,
            published: None,
        }
    }

    /// Takes what happened at `now`, a monotonic time from any zero.
    pub fn handle(&mut self, now: Duration, input: Input) {
        self.context.now = self.context.now.max(now);
        match input {
            Input::PortOpened => self.on_port_opened(),
            Input::PortClosed { reason } => self.on_port_closed(&reason),
            Input::Received(bytes) => self.context.link.receive(self.context.now, &bytes),
            Input::Timer => {}
            Input::Command { id, command } => self.on_command(id, command),
        }
        if self.is_open() {
            self.context.link.handle_time(self.context.now);
        }
        while let Some(event) = self.context.link.poll_event() {
            self.on_event(event);
        }
        self.on_time();
        self.settle_paused();
        self.feed();
        self.publish();
    }

    /// The next thing to do, bytes first.
    pub fn poll_output(&mut self) -> Option<Output> {
        match self.context.link.poll_transmit() {
            Some(bytes) if self.is_open() => Some(Output::Transmit(bytes)),
            _ => self.context.outputs.pop_front(),
        }
    }

    /// When [`Input::Timer`] is wanted at the latest.
    pub fn next_deadline(&self) -> Option<Duration> {
        let checking = self.check.as_ref();
        let checking = checking.map(|it| it.proof.waits_until().unwrap_or(self.context.now));
        let encoding = self.phase.is_encoding().then_some(self.context.now);
        let link = self.is_open().then(|| self.context.link.next_deadline());
        let phase = self.phase.deadline();
        let leaving = self.leaving.as_ref().map(|leaving| leaving.until);
        let (commander, ros) = (self.commander_deadline(), self.ros_deadline());
        let overrides = self.context.overrides.as_ref().map(|watch| watch.until);
        [checking, encoding, link, phase, leaving, commander, ros, overrides]
            .into_iter()
            .flatten()
            .min()
    }

    /// When the last report came through the port that is open.
    pub fn last_report_at(&self) -> Option<Duration> {
        self.context.link.last_status_at().filter(|_| self.is_open())
    }

    /// The most bytes that are under way at a time.
    pub fn window(&self) -> usize {
        self.context.link.window()
    }

    fn is_open(&self) -> bool {
        !matches!(self.phase, Phase::Closed { .. })
    }

    fn on_time(&mut self) {
        let context = &mut self.context;
        match &mut self.phase {
            Phase::Connecting(connecting) if context.now >= connecting.until() => {
                let next = connecting.on_timeout(context);
                self.go(next);
            }
            Phase::Manual(operation)
                if operation.until().is_some_and(|until| context.now >= until) =>
            {
                let end = operation.on_timeout(context);
                self.end_manual(end);
            }
            Phase::Running(run) => {
                let exit = run.on_time(context);
                self.leave_run(exit);
            }
            Phase::Stopping(stopping) if context.now >= stopping.until() => {
                let next = stopping.on_timeout(context);
                self.end_stop(Some(next));
            }
            _ => {}
        }
        if self.context.overrides.as_ref().is_some_and(|watch| self.context.now >= watch.until) {
            self.context.on_overrides_timeout();
        }
        self.watch_commander();
        self.watch_ros();
        if self.check.as_mut().is_some_and(|check| check.step(&mut self.context)) {
            self.check = None;
        }
        match &mut self.phase {
            Phase::Running(run) => run.step_rest(&mut self.context),
            Phase::Stopping(stopping) => stopping.refuse_rest(&mut self.context),
            _ => {}
        }
        self.step_leaving();
    }

    fn feed(&mut self) {
        if let Phase::Running(run) = &mut self.phase {
            let exit = run.feed(&mut self.context);
            self.leave_run(exit);
        }
    }
}

#[cfg(test)]
mod tests;
