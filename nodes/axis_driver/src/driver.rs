//! The state machine that owns the machine.
//!
//! It is handed inputs (the port, bytes, commands) with the time they came at, and
//! gives outputs (bytes, replies, states). Its outputs are a function of the sequence
//! of inputs and times, so that a recorded run can be played again. Policy: a hold is
//! written at once, in any state; nothing resumes, homes or unlocks by itself; what
//! is not known is reported as unknown. It knows no ROS, no port and no clock.
//!
//! None of this is a safety function.

mod command;
mod config;
mod connect;
mod machine;
mod proof;
mod run;
mod stop;

pub use command::{Command, Refusal, RunRequest};
pub use config::DriverConfig;

use crate::codes::{self, error_code};
use crate::link::{Link, LinkEvent, LinkFault, realtime};
use cnc_msgs::machine::MachineState;
use connect::Connecting;
use machine::Machine;
use proof::Check;
use run::Run;
use std::collections::VecDeque;
use std::time::Duration;

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
#[derive(Debug, Clone, PartialEq)]
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
    /// After [`Command::Shutdown`]: the port may be closed.
    ReadyToClose,
    /// Something for the log.
    Log { level: LogLevel, message: String },
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub struct RunResult {
    /// The command that began it.
    pub id: u64,
    pub outcome: RunOutcome,
    /// 0 when it succeeded; see [`error_code`].
    pub error_code: u16,
    pub message: String,
    /// The source line that was being cut last, 0 when none was.
    pub last_line: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunOutcome {
    Succeeded,
    Canceled,
    Aborted,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogLevel {
    Info,
    Warn,
    Error,
}

/// Where a line that is under way comes from.
#[derive(Debug, Clone, PartialEq)]
enum Origin {
    Query(usize),
    Home,
    Unlock,
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
    Homing {
        id: u64,
        until: Duration,
    },
    Unlocking {
        id: u64,
        until: Duration,
    },
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
    hold: Option<stop::HoldWatch>,
    shutdown: Option<stop::Shutdown>,
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
            hold: None,
            shutdown: None,
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
            Phase::Homing { until, .. } | Phase::Unlocking { until, .. } => Some(*until),
            Phase::Running(run) => run.deadline(),
            _ => None,
        };
        let shutdown = self.shutdown.as_ref().map(|shutdown| shutdown.until);
        [proving, link, phase, shutdown].into_iter().flatten().min()
    }

    /// What is known of the machine now.
    pub fn state(&self, now: Duration) -> MachineState {
        let mut state = self.compose();
        state.link_age_s = match self.link.last_status_at() {
            Some(at) if self.is_open() => now.saturating_sub(at).as_secs_f64(),
            _ => f64::INFINITY,
        };
        state
    }

    /// The most bytes that are under way at a time.
    pub fn window(&self) -> usize {
        self.link.window()
    }

    fn is_open(&self) -> bool {
        !matches!(self.phase, Phase::Closed { .. })
    }

    fn is_proving(&self) -> bool {
        self.check.is_some() || matches!(&self.phase, Phase::Running(run) if run.is_proving())
    }

    fn on_event(&mut self, event: LinkEvent<Origin>) {
        match event {
            LinkEvent::Answer { tag, error } => self.on_answer(tag, error),
            LinkEvent::Alarm(code) => self.on_alarm(code),
            LinkEvent::Banner { firmware, text } => {
                self.machine.on_restart(firmware);
                self.on_banner(&text);
            }
            LinkEvent::Status(report) => {
                self.machine.on_status(report);
                self.watch_hold();
                self.on_status();
            }
            LinkEvent::Message(message) => {
                if let Some(bytes) = self.machine.on_message(&message) {
                    self.link.set_receive_bytes(bytes);
                }
                if let crate::report::Message::Text(text) = message {
                    self.log(LogLevel::Info, format!("controller: {text}"));
                }
            }
            LinkEvent::Setting { number, value } => self.machine.on_setting(number, &value),
            LinkEvent::Text(text) => self.on_text(&text),
            LinkEvent::Fault(fault) => self.on_fault(&fault),
            LinkEvent::Silent => self.on_silence(),
        }
    }

    fn on_answer(&mut self, origin: Origin, error: Option<u16>) {
        let refusal = error.map(|code| {
            let text = codes::describe_error(self.machine.firmware, code);
            Refusal::new(error_code::CONTROLLER_ERROR, format!("the controller refused: {text}"))
        });
        match (&mut self.phase, origin) {
            (Phase::Connecting(_), Origin::Query(index)) => self.on_query_answer(index, error),
            (Phase::Homing { id, .. }, Origin::Home) => {
                let id = *id;
                self.phase = Phase::Ready;
                self.machine.is_homed = refusal.is_none();
                self.reply(id, refusal.map_or(Ok("homed".into()), Err));
            }
            (Phase::Unlocking { id, .. }, Origin::Unlock) => {
                let id = *id;
                self.phase = Phase::Ready;
                let done = "unlocked; the position may be wrong until the machine is homed";
                self.reply(id, refusal.map_or(Ok(done.into()), Err));
            }
            (Phase::Running(_), origin) => self.on_run_answer(origin, error),
            _ => {}
        }
    }

    fn on_alarm(&mut self, code: u16) {
        self.machine.on_alarm(code);
        let text = codes::describe_alarm(self.machine.firmware, code);
        self.log(LogLevel::Error, text.clone());
        if codes::is_deaf(code) {
            self.link.expect_deafness();
        }
        let reason = format!("{text}; soft_reset to go on");
        match &mut self.phase {
            Phase::Running(run) if run.is_resetting() => run.add_to_verdict(&text),
            Phase::Running(_) => {
                self.end_run(RunOutcome::Aborted, error_code::ALARM, text, Phase::Adrift { reason })
            }
            Phase::Homing { id, .. } | Phase::Unlocking { id, .. } => {
                let id = *id;
                self.phase = Phase::Adrift { reason };
                self.reply(id, Err(Refusal::new(error_code::ALARM, text)));
            }
            Phase::Ready => self.phase = Phase::Adrift { reason },
            Phase::Closed { .. } | Phase::Connecting(_) | Phase::Adrift { .. } => {}
        }
    }

    fn on_banner(&mut self, text: &str) {
        match &mut self.phase {
            Phase::Closed { .. } => {}
            Phase::Connecting(_) => self.on_connect_banner(text),
            Phase::Running(run) if run.is_resetting() => self.finish_stop(),
            Phase::Running(_) => {
                let message = format!(
                    "the controller restarted in the middle of the run ({text}); its position is lost: home"
                );
                self.machine.is_homed = false;
                self.end_run(RunOutcome::Aborted, error_code::RESTARTED, message, Phase::Ready);
                self.begin_queries(None);
            }
            Phase::Homing { id, .. } | Phase::Unlocking { id, .. } => {
                let id = *id;
                self.machine.is_homed = false;
                let message = format!("the controller restarted ({text})");
                self.reply(id, Err(Refusal::new(error_code::RESTARTED, message)));
                self.begin_queries(None);
            }
            Phase::Adrift { .. } | Phase::Ready => {
                self.machine.is_homed = false;
                self.log(LogLevel::Warn, format!("the controller restarted by itself: {text}"));
                self.begin_queries(None);
            }
        }
    }

    fn on_status(&mut self) {
        match &mut self.phase {
            Phase::Connecting(_) => self.on_connect_status(),
            Phase::Running(_) => self.on_run_status(),
            _ => {}
        }
    }

    fn on_text(&mut self, text: &str) {
        if let Phase::Connecting(connecting) = &mut self.phase {
            connecting.hear_garbage(text);
        }
        self.log(LogLevel::Info, format!("controller: {text}"));
    }

    fn on_fault(&mut self, fault: &LinkFault) {
        let text = fault.to_string();
        match &mut self.phase {
            Phase::Closed { .. } | Phase::Adrift { .. } => {}
            Phase::Connecting(_) => self.on_connect_fault(fault),
            // It is being stopped already, and a reset forgets all counts.
            Phase::Running(run) if run.is_stopping() => {}
            Phase::Running(_) => {
                self.log(LogLevel::Error, text.clone());
                self.stop_run(RunOutcome::Aborted, error_code::PROTOCOL, text);
            }
            Phase::Homing { id, .. } | Phase::Unlocking { id, .. } => {
                let id = *id;
                self.phase = Phase::Adrift { reason: format!("{text}; soft_reset to go on") };
                self.reply(id, Err(Refusal::new(error_code::PROTOCOL, text)));
            }
            Phase::Ready => self.log(LogLevel::Warn, text),
        }
    }

    fn on_silence(&mut self) {
        const TEXT: &str = "the controller does not answer; motion may continue";
        if matches!(self.phase, Phase::Closed { .. } | Phase::Connecting(_)) {
            return;
        }
        self.machine.is_silent = true;
        self.log(LogLevel::Error, TEXT.into());
        let next = || Phase::Adrift { reason: format!("LINK_LOST: {TEXT}; soft_reset to go on") };
        match &self.phase {
            Phase::Running(_) => {
                // It may still arrive.
                self.link.send_realtime(realtime::FEED_HOLD);
                let (code, text) = (error_code::LINK_LOST, TEXT.to_owned());
                self.end_run(RunOutcome::Aborted, code, text, next());
            }
            Phase::Homing { id, .. } | Phase::Unlocking { id, .. } => {
                let id = *id;
                self.phase = next();
                self.reply(id, Err(Refusal::new(error_code::LINK_LOST, TEXT)));
            }
            _ => self.phase = next(),
        }
    }

    fn on_time(&mut self) {
        match &self.phase {
            Phase::Connecting(connecting) if self.now >= connecting.until() => {
                self.on_connect_timeout();
            }
            Phase::Homing { id, until } | Phase::Unlocking { id, until } if self.now >= *until => {
                let (id, text) = (*id, "no answer in time; soft_reset to go on");
                self.phase = Phase::Adrift { reason: text.into() };
                self.reply(id, Err(Refusal::new(error_code::NO_ANSWER, text)));
            }
            Phase::Running(_) => self.on_run_time(),
            _ => {}
        }
        self.step_check();
        self.step_shutdown();
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
