//! The ROS shell of the driver: commands in, state and traffic out.
//!
//! Everything that matters to the machine happens on the serial thread, which
//! does not know that ROS exists. This file carries commands to it and what it
//! says to the world; if all of it stood still, the machine would not notice.

mod actions;
mod by_hand;
mod edges;
mod follow;
mod lifecycle;
mod mdi;
mod parameters;
mod path;
mod ring;
mod services;
mod source;
mod traffic;
mod viewers;

pub use parameters::driver_config;
pub use traffic::kind_from_wire;

use crate::driver::{
    COMMANDER_LOST, Command, ControllerSettings, LogLevel, MoveResult, Output, Refusal,
    RestRequest, RunResult,
};
use crate::journal::Entry;
use crate::serial::{Event, Serial};
use cnc_msgs::machine::MachineState;
use cnc_msgs::wire::cnc_msgs::srv::{GetProgramChunks, GetTraffic};
use path::{Paths, Planned};
use runtime::commands::CommandLog;
use runtime::{Client, Handle, Health, HealthLevel, Qos, RosTime};
use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, oneshot, watch};
use traffic::Traffic;
use viewers::{Viewers, firmware_name};

/// Events and entries that may wait for this shell.
const WAITING_MAX: usize = 16_384;
/// Time over which traffic is gathered into one message.
const BATCH: Duration = Duration::from_millis(20);
/// How often the state goes out when nothing changes.
const STATE_PERIOD: Duration = Duration::from_millis(200);
/// Two status requests of the slowest kind without an answer, and a bit, s.
const STALE_S: f64 = 2.5;
/// How long a hold, a resume or an unlock may take to be answered.
const REPLY_WITHIN: Duration = Duration::from_secs(10);
/// Runs the node until it is told to stop.
pub fn main(args: Vec<String>) -> ExitCode {
    runtime::run_managed("axis_driver", parameters::declared(), &args, start)
}

async fn start(node: Handle) -> Result<lifecycle::Shell, runtime::Error> {
    let config = parameters::serial_config(&node);
    let has_port = !config.path.is_empty();
    let (event_sender, events) = sync_channel(WAITING_MAX);
    let (entry_sender, entries) = sync_channel(WAITING_MAX);
    let serial = Serial::start(config, event_sender, entry_sender)?;
    let zero = RosTime::from_nanos(
        RosTime::wall().as_nanos()
            - i64::try_from(serial.epoch().elapsed().as_nanos()).unwrap_or(0),
    );
    let traffic = Traffic::new(node.publisher("controller_traffic", Qos::EVENTS)?, zero);
    let driver = Arc::new(Driver {
        node: node.clone(),
        serial,
        next_id: AtomicU64::new(1),
        state: watch::Sender::new(not_heard(has_port)),
        progress: watch::Sender::new(Progress::default()),
        hardware: watch::Sender::default(),
        waiting: Mutex::default(),
        commands: CommandLog::new(&node)?,
        recorder: follow::Recorder::default(),
        programs: node.client("program/get_chunks")?,
    });

    let shared = traffic.clone();
    std::thread::Builder::new()
        .name("traffic".into())
        .spawn(move || gather(&entries, |batch| shared.push(batch)))?;
    let (relay, mut relayed) = mpsc::channel(WAITING_MAX);
    std::thread::Builder::new().name("driver events".into()).spawn(move || {
        while let Ok(event) = events.recv() {
            if relay.blocking_send(event).is_err() {
                break;
            }
        }
    })?;
    let viewers = Viewers::new(&node)?;
    let (handle, shared) = (node.clone(), Arc::clone(&driver));
    node.spawn("driver events", async move {
        let mut ticks = tokio::time::interval(STATE_PERIOD);
        loop {
            tokio::select! {
                event = relayed.recv() => match event {
                    Some(event) => shared.take(event, handle.now(), &viewers),
                    None => break,
                },
                _ = ticks.tick() => shared.publish_again(handle.now(), &viewers),
            }
        }
    });

    services::offer(&node, &driver)?;
    by_hand::offer(&node, &driver)?;
    mdi::offer(&node, &driver)?;
    let shared = traffic.clone();
    node.service::<GetTraffic, _, _>("get_traffic", move |request, _| {
        std::future::ready(shared.answer(&request))
    })?;
    let (handle, shared) = (node.clone(), Arc::clone(&driver));
    let paths = Paths::follow(&node, move |paths, of, planned| {
        let (driver, paths) = (Arc::clone(&shared), paths.clone());
        handle.spawn("rest of a run", async move { driver.take_rest(&paths, of, planned).await });
    })?;
    services::offer_tool_change(&node, &driver, &paths)?;
    follow::follow(&node, &driver)?;
    actions::offer(&node, &driver, paths)?;
    // The core would begin at once what it is asked for.
    driver.begin(Command::Deactivate);
    Ok(lifecycle::Shell { driver, has_port })
}

/// The state before the driver has said anything.
fn not_heard(has_port: bool) -> MachineState {
    use cnc_msgs::machine::Mode;
    let (mode, reason) = match has_port {
        true => (Mode::Unknown, "the driver starts"),
        false => (Mode::Disconnected, "no port is set"),
    };
    MachineState {
        mode,
        reason: reason.into(),
        link_age_s: f64::INFINITY,
        overrides_percent: [100; 3],
        ..MachineState::default()
    }
}

/// Hands on what has gathered, every [`BATCH`]; ends with the driver.
fn gather(entries: &Receiver<Entry>, push: impl Fn(Vec<Entry>)) {
    while let Ok(first) = entries.recv() {
        let (mut batch, end) = (vec![first], Instant::now() + BATCH);
        let is_over = loop {
            match entries.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(entry) => batch.push(entry),
                Err(RecvTimeoutError::Timeout) => break false,
                Err(RecvTimeoutError::Disconnected) => break true,
            }
        };
        push(batch);
        if is_over {
            break;
        }
    }
}

/// How far a run is.
#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    line: u32,
    fraction: f64,
    time_left_s: f64,
}

/// The answer to a command: what was done, or why not.
type Reply = Result<String, Refusal>;

/// A command that was sent, or not when too many wait already.
struct Asked {
    id: u64,
    reply: Option<oneshot::Receiver<Reply>>,
}

/// Who waits for what.
#[derive(Debug, Default)]
struct Waiting {
    replies: BTreeMap<u64, oneshot::Sender<Reply>>,
    runs: BTreeMap<u64, oneshot::Sender<RunResult>>,
    moves: BTreeMap<u64, oneshot::Sender<MoveResult>>,
    leave: Option<oneshot::Sender<()>>,
    /// Counts the wishes to stop.
    stops: u64,
}

/// The serial driver as this shell sees it.
struct Driver {
    node: Handle,
    serial: Serial,
    next_id: AtomicU64,
    /// The newest state.
    state: watch::Sender<MachineState>,
    progress: watch::Sender<Progress>,
    /// What the controller says that it is; empty until it has.
    hardware: watch::Sender<String>,
    waiting: Mutex<Waiting>,
    commands: CommandLog,
    recorder: follow::Recorder,
    /// Texts of programs.
    programs: Client<GetProgramChunks>,
}

impl Driver {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The state, with the age of what was heard.
    fn state_now(&self) -> MachineState {
        let state = self.state.borrow().clone();
        MachineState { link_age_s: self.serial.link_age_s(), ..state }
    }

    /// The newest state once more, of the time at which it was heard.
    fn publish_again(&self, now: RosTime, viewers: &Viewers) {
        let state = self.state_now();
        // Of what was never heard the age is infinite.
        let heard = Duration::try_from_secs_f64(state.link_age_s).map(|age| now.before(age));
        viewers.publish(heard.unwrap_or(now), &state);
    }

    fn take(&self, event: Event, now: RosTime, viewers: &Viewers) {
        match event.output {
            Output::State(state) => {
                viewers.publish(now, &state);
                self.state.send_replace(state);
            }
            Output::Progress { line, fraction, time_left_s } => {
                self.progress.send_replace(Progress { line, fraction, time_left_s });
            }
            Output::Reply { id, result } => {
                if let Some(waiting) = self.waiting().replies.remove(&id) {
                    // Whoever asked may have given up.
                    let _ = waiting.send(result);
                }
            }
            Output::RunFinished(result) => {
                if let Some(waiting) = self.waiting().runs.remove(&result.id) {
                    let _ = waiting.send(result);
                }
            }
            Output::MoveFinished(result) => {
                if let Some(waiting) = self.waiting().moves.remove(&result.id) {
                    let _ = waiting.send(result);
                }
            }
            Output::Settings(settings) => {
                let ControllerSettings { firmware, version, .. } = &settings;
                self.hardware.send_replace(format!("{} {version}", firmware_name(*firmware)));
                viewers.publish_settings(now, &settings);
            }
            Output::ReadyToClose => {
                if let Some(waiting) = self.waiting().leave.take() {
                    let _ = waiting.send(());
                }
            }
            Output::Log { level, message } => match level {
                LogLevel::Info => tracing::info!("{message}"),
                LogLevel::Warn => tracing::warn!("{message}"),
                LogLevel::Error => tracing::error!("{message}"),
            },
            // The bytes are in the journal.
            Output::Transmit(_) => {}
        }
    }

    /// Whether goals are taken up. The core looks again; this spares the others what
    /// comes before, and lets a goal be rejected that would be accepted first.
    fn require_active(&self) -> Result<(), Refusal> {
        let refuse =
            |message| Refusal { error_code: crate::codes::error_code::NOT_ACTIVE, message };
        self.node.require_active().map_err(refuse)
    }

    /// Sends a command and waits for its answer.
    async fn ask(&self, command: Command, within: Duration) -> Reply {
        let asked = self.begin(command);
        self.answer(asked, within).await
    }

    async fn ask_as(&self, id: u64, command: Command, within: Duration) -> Reply {
        let asked = self.begin_as(id, command);
        self.answer(asked, within).await
    }

    /// How many wishes to stop there were.
    fn stops(&self) -> u64 {
        self.waiting().stops
    }

    /// The same, unless somebody wanted the machine to stop since there were so many wishes:
    /// what was still being prepared then does not begin behind it.
    async fn ask_unless_stopped(
        &self,
        stops: u64,
        id: u64,
        command: Command,
        within: Duration,
    ) -> Reply {
        let asked = {
            let mut waiting = self.waiting();
            if waiting.stops != stops {
                let message = "somebody stopped the machine before it began: ask again".into();
                return Err(Refusal { error_code: crate::codes::error_code::CANCELED, message });
            }
            self.hand_over(&mut waiting, id, command)
        };
        self.answer(asked, within).await
    }

    /// Sends a command now; [`Self::answer`] waits for its answer.
    fn begin(&self, command: Command) -> Asked {
        self.begin_as(self.next_id.fetch_add(1, Ordering::Relaxed), command)
    }

    fn begin_as(&self, id: u64, command: Command) -> Asked {
        self.hand_over(&mut self.waiting(), id, command)
    }

    /// Hands a command to the driver, one after the other.
    fn hand_over(&self, waiting: &mut Waiting, id: u64, command: Command) -> Asked {
        waiting.stops += u64::from(command.stops_whatever_moves());
        let (sender, reply) = oneshot::channel();
        waiting.replies.insert(id, sender);
        let is_sent = self.serial.command(id, command).is_ok();
        Asked { id, reply: is_sent.then_some(reply) }
    }

    async fn answer(&self, asked: Asked, within: Duration) -> Reply {
        let Asked { id, reply } = asked;
        let message = match reply {
            None => "too many commands wait for the driver".to_owned(),
            Some(reply) => match tokio::time::timeout(within, reply).await {
                Ok(Ok(reply)) => return reply,
                _ => format!("the driver did not answer within {} s", within.as_secs_f64()),
            },
        };
        self.waiting().replies.remove(&id);
        Err(Refusal { error_code: crate::codes::error_code::NO_ANSWER, message })
    }

    /// Offers the core another path for what is left of its run.
    async fn take_rest(&self, paths: &Paths, of: u64, planned: Planned) {
        let Planned { program_id, revision, path, .. } = planned.clone();
        let request = RestRequest { program_id, of, revision, path };
        match self.ask(Command::TakeRest(request), REPLY_WITHIN).await {
            Ok(message) => {
                paths.begin(&planned);
                tracing::info!("{message}");
            }
            Err(refusal) => tracing::warn!("revision {revision} is not taken: {}", refusal.message),
        }
    }

    fn health(&self) -> Health {
        use cnc_msgs::machine::Mode;
        let state = self.state_now();
        let dropped = self.serial.dropped();
        Health {
            component: "serial link".into(),
            level: match state.mode {
                Mode::Unknown | Mode::Alarm => HealthLevel::Error,
                Mode::Disconnected => HealthLevel::Warn,
                _ if state.needs_reset || state.reason.starts_with(COMMANDER_LOST) => {
                    HealthLevel::Warn
                }
                // While it homes a controller reports nothing.
                mode if mode != Mode::Home && state.link_age_s > STALE_S => HealthLevel::Warn,
                _ if dropped.entries > 0 => HealthLevel::Warn,
                _ => HealthLevel::Ok,
            },
            message: match state.reason.as_str() {
                "" => state.mode.name().to_owned(),
                reason => format!("{}: {reason}", state.mode.name()),
            },
            hardware_id: self.hardware.borrow().clone(),
            values: vec![
                ("seconds since the last report".into(), format!("{:.3}", state.link_age_s)),
                ("events dropped".into(), dropped.events.to_string()),
                ("traffic entries dropped".into(), dropped.entries.to_string()),
            ],
        }
    }
}

/// A reply as services say it.
fn told(reply: Reply) -> (bool, u16, String) {
    match reply {
        Ok(message) => (true, 0, message),
        Err(Refusal { error_code, message }) => (false, error_code, message),
    }
}
