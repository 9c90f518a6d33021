//! The ROS shell of the driver: commands in, state and traffic out.
//!
//! Everything that matters to the machine happens on the serial thread, which
//! does not know that ROS exists, in another process. This file carries commands to it and what it
//! says to the world; if all of it stood still, the machine would not notice.

mod actions;
mod configure;
mod edges;
mod follow;
mod lifecycle;
mod manual;
mod mdi;
mod motion_link;
mod parameters;
mod path;
mod run_start;
mod services;
mod source;
mod stretches;
mod traffic;
mod tuning;
mod user_functions;
mod viewers;
mod waiting;

pub(crate) use parameters::{check_approach, declared, keep_out, serial_config};
pub use viewers::settings_to_wire;

use crate::driver::{
    COMMANDER_LOST, Command, ControllerSettings, LogLevel, Output, PATH_DEVIATION, ProbesOfRun,
    ROS_LOST, Refusal, UserFunctionCall,
};
use crate::journal::{Order, ReplanOrder};
use crate::motion::{self, FACE_VARIABLE};
use crate::protocol::MOTION_LOST;
use crate::serial::Event;
use cnc_msgs::keep_out::KeepOut;
use cnc_msgs::machine::{MachineState, Mode};
use cnc_msgs::wire::cnc_msgs::msg::RunResult as RunResultMessage;
use cnc_msgs::wire::cnc_msgs::srv::{GetProgramChunks, GetTraffic};
use cnc_msgs::wire::rcl_interfaces::msg::Parameter;
use motion_link::{Before, FromMotion, MotionLink};
use path::{Answers, Paths, Planned};
use runtime::commands::CommandLog;
use runtime::parameters::ParameterValue;
use runtime::{Client, Handle, Health, HealthLevel, Memory, Publisher, Qos, RosTime};
use rustix::process::Signal;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{mpsc, oneshot, watch};
use traffic::Traffic;
use user_functions::UserFunctions;
use viewers::Viewers;
use waiting::Waiting;

/// Events that may wait for this shell.
const WAITING_MAX: usize = 16_384;
/// How often the state goes out when nothing changes.
const STATE_PERIOD: Duration = Duration::from_millis(200);
/// How often the motion process hears that this one lives.
const ALIVE_PERIOD: Duration = Duration::from_millis(100);
/// The motion process speaks ten times a second; so long it is held up by no busy computer.
const MOTION_SILENT: Duration = Duration::from_secs(2);
/// Two status requests of the slowest kind without an answer, and a bit, s.
const STALE_S: f64 = 2.5;
/// More ids than a face gives away at a time.
const IDS_UNSEEN_MAX: u64 = 1_000;
/// How long a hold, a resume or an unlock may take to be answered.
const REPLY_WITHIN: Duration = Duration::from_secs(10);

/// Runs the node until it is asked to stop: the motion process, which starts this executable
/// once more for its ROS side. `program` are the words that make it this node.
pub fn main(program: &[&str], args: Vec<String>) -> ExitCode {
    if std::env::var_os(FACE_VARIABLE).is_some() {
        // Also one that is stopped; where this cannot be, the end of the connection ends it.
        let _ = rustix::process::set_parent_process_death_signal(Some(Signal::KILL));
        // Where memory runs out, this process goes before the one that has the line.
        let _ = std::fs::write("/proc/self/oom_score_adj", "1000");
        return runtime::run_managed("axis_driver", declared(), &args, start);
    }
    motion::main(program, &args)
}

/// The node's parameters.
pub fn parameters() -> Vec<runtime::Declared> {
    parameters::declared()
}

/// The parameters of a driver that was started without any, as it publishes them.
pub fn default_parameters() -> Vec<Parameter> {
    let declared = parameters::declared();
    declared.iter().map(|row| runtime::parameter_to_wire(row, &row.default)).collect()
}

async fn start(node: Handle) -> Result<lifecycle::Shell, runtime::Error> {
    let has_port = !node.parameter::<String>("port").is_empty();
    let (motion, incoming, Before { welcome, kept, events }) = MotionLink::connect()?;
    let keeper = Arc::clone(&motion);
    node.remember_in(Memory::new(kept, move |name, value| keeper.keep(name, value)));
    let is_tuned = node.keep_parameters();
    let zero = RosTime::from_nanos(welcome.zero_wall_ns);
    let publisher = node.publisher("controller_traffic", Qos::EVENTS)?;
    let traffic = Traffic::new(publisher, zero, welcome.publish_from);
    let (calls, called) = mpsc::unbounded_channel();
    let driver = Arc::new(RemoteDriver {
        node: node.clone(),
        motion: Arc::clone(&motion),
        // The face before may have given away ids that the driver has not seen.
        next_id: AtomicU64::new(welcome.next_id + IDS_UNSEEN_MAX),
        first_unseen_id: welcome.next_id,
        state: watch::Sender::new(initial_state(has_port)),
        progress: watch::Sender::new(Progress::default()),
        hardware: watch::Sender::default(),
        waiting: Mutex::new(Waiting::new(welcome.next_id)),
        commands: CommandLog::new(&node)?,
        recorder: follow::Recorder::default(),
        last_beat: follow::LastBeat::default(),
        programs: node.client("program/get_chunks")?,
        user_functions: user_functions::client(&node)?,
        keep_out: keep_out(|name| node.parameter::<ParameterValue>(name))
            .map_err(|error| format!("keep_out: {error}"))?,
        run_results: node.publisher("run_result", Qos::LATCHED)?,
        probes: watch::Sender::default(),
        calls,
    });
    let viewers = Viewers::new(&node)?;
    for event in events {
        driver.take_kept(event, &viewers);
    }

    let (relay, mut relayed) = mpsc::channel(WAITING_MAX);
    let (shared, out, answers) =
        (traffic.clone(), Arc::clone(&motion), Arc::new(Answers::default()));
    let path_answers = Arc::clone(&answers);
    std::thread::Builder::new().name("from the motion process".into()).spawn(move || {
        out.listen(incoming, |message| match message {
            // Where nobody takes it any more the node is being taken down.
            FromMotion::Event(event) => drop(relay.blocking_send(event)),
            FromMotion::Entries(entries) => {
                if let Some(newest) = shared.push(entries) {
                    out.say_published(newest);
                }
            }
            FromMotion::Path { program_id, revision, taken } => {
                path_answers.give(&program_id, revision, taken);
            }
        });
    })?;
    let shared = Arc::clone(&driver);
    node.spawn("driver events", async move {
        let mut ticks = tokio::time::interval(STATE_PERIOD);
        let mut beats = tokio::time::interval(ALIVE_PERIOD);
        loop {
            tokio::select! {
                event = relayed.recv() => match event {
                    Some(event) => shared.take(event, &viewers),
                    None => break,
                },
                _ = ticks.tick() => shared.publish_again(&viewers),
                // A motion process that is stopped takes nothing; nothing waits for it here.
                _ = beats.tick() => if shared.motion.silence() < MOTION_SILENT {
                    shared.motion.say_alive();
                },
            }
        }
    });

    services::offer(&node, &driver)?;
    manual::offer(&node, &driver)?;
    configure::offer(&node, &driver)?;
    let shared = traffic.clone();
    node.service::<GetTraffic, _, _>("get_traffic", move |request, _| {
        std::future::ready(shared.answer(&request))
    })?;
    let (handle, shared) = (node.clone(), Arc::clone(&driver));
    let here = path::Here { motion, answers, paths: welcome.paths };
    let paths = Paths::follow(&node, here, move |paths, of, planned| {
        let (driver, paths) = (Arc::clone(&shared), paths.clone());
        handle.spawn("replan of a run", async move { driver.replan(&paths, of, planned).await });
    })?;
    mdi::offer(&node, &driver, &paths)?;
    services::offer_tool_change(&node, &driver, &paths)?;
    stretches::follow(&node, &driver, &paths)?;
    user_functions::follow(&node, &driver, called);
    tuning::follow(&node, &driver, is_tuned);
    follow::follow(&node, &driver)?;
    actions::offer(&node, &driver, paths)?;
    driver.motion.say_ready();
    Ok(lifecycle::Shell { driver, has_port })
}

/// The state before the driver has said anything.
fn initial_state(has_port: bool) -> MachineState {
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

/// How far a run is.
#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    line: u32,
    fraction: f64,
    time_left_s: f64,
}

/// The answer to a command: what was done, or why not.
type Reply = Result<String, Refusal>;

/// An order that was sent.
struct Asked {
    id: u64,
    reply: oneshot::Receiver<Reply>,
}

/// How often somebody wanted the machine to stop: over ROS, and without it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stops {
    over_ros: u64,
    local: u64,
}

/// The driver in the motion process as this shell sees it.
struct RemoteDriver {
    node: Handle,
    motion: Arc<MotionLink>,
    next_id: AtomicU64,
    /// Ids from here on the driver has not seen from an earlier face.
    first_unseen_id: u64,
    /// The newest state.
    state: watch::Sender<MachineState>,
    progress: watch::Sender<Progress>,
    /// What the controller says that it is; empty until it has.
    hardware: watch::Sender<String>,
    waiting: Mutex<Waiting>,
    commands: CommandLog,
    recorder: follow::Recorder,
    last_beat: follow::LastBeat,
    /// Texts of programs.
    programs: Client<GetProgramChunks>,
    user_functions: UserFunctions,
    /// What the tool must not touch.
    keep_out: KeepOut,
    /// How the last run ended.
    run_results: Publisher<RunResultMessage>,
    /// What the probes of a run that waits for its plan have found.
    probes: watch::Sender<Option<ProbesOfRun>>,
    /// What runs wait for that a node of the cell does.
    calls: mpsc::UnboundedSender<UserFunctionCall>,
}

impl RemoteDriver {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The state, with the age of what was heard.
    fn state_now(&self) -> MachineState {
        let state = self.state.borrow().clone();
        let link_age_s = self.motion.link_age_s();
        let silence = self.motion.silence();
        if silence < MOTION_SILENT {
            return MachineState { link_age_s, ..state };
        }
        let reason = format!(
            "{MOTION_LOST}: the motion process has said nothing for {:.1} s; is it stopped?",
            silence.as_secs_f64()
        );
        MachineState {
            mode: Mode::Unknown,
            reason,
            motion_possible: true,
            machine_position: None,
            work_position: None,
            link_age_s,
            ..state
        }
    }

    /// The newest state once more, of the time at which it was heard.
    fn publish_again(&self, viewers: &Viewers) {
        let (now, state) = (self.node.now(), self.state_now());
        // Of what was never heard the age is infinite.
        let received = Duration::try_from_secs_f64(state.link_age_s).map(|age| now.before(age));
        viewers.publish(received.unwrap_or(now), &state);
    }

    /// Takes what happened before this face was there. The state has not changed since, so it
    /// is as old as the last report.
    fn take_kept(&self, event: Event, viewers: &Viewers) {
        match event.output {
            Output::State(state) => {
                self.state.send_replace(state);
                self.publish_again(viewers);
            }
            _ => self.take(event, viewers),
        }
    }

    /// Takes what happens now, or happened while it was queued.
    fn take(&self, event: Event, viewers: &Viewers) {
        let stamp = self.node.now().before(self.motion.age(event.at));
        match event.output {
            Output::State(state) => {
                if state.path_revision == 0 {
                    self.probes.send_if_modified(|waits| waits.take().is_some());
                }
                viewers.publish(stamp, &state);
                self.state.send_replace(state);
            }
            Output::Progress { line, fraction, time_left_s } => {
                self.progress.send_replace(Progress { line, fraction, time_left_s });
            }
            Output::Reply { id, result } => self.waiting().replies.end(id, result),
            Output::RunFinished(result) => self.waiting().runs.end(result.id, result),
            Output::Probes(found) => drop(self.probes.send_replace(Some(found))),
            Output::UserFunction(call) => drop(self.calls.send(call)),
            Output::MoveFinished(result) => self.waiting().moves.end(result.id, result),
            Output::Settings(settings) => {
                let ControllerSettings { firmware, version, .. } = &settings;
                self.hardware.send_replace(format!("{} {version}", firmware.traits().name));
                viewers.publish_settings(stamp, &settings);
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

    /// Whether an id is of the face before: what ends while this one starts is waited for later.
    fn is_of_before(&self, id: u64) -> bool {
        id < self.first_unseen_id
    }

    /// Whether the driver has taken up what the face before this one gave it under this id.
    fn was_taken_up(&self, id: u64) -> bool {
        matches!(self.waiting().replies.before(id), Some(Ok(_)))
    }

    /// Sends an order and waits for its answer.
    async fn ask(&self, order: impl Into<Order>, within: Duration) -> Reply {
        let asked = self.begin(order);
        self.answer(asked, within).await
    }

    async fn ask_as(&self, id: u64, order: impl Into<Order>, within: Duration) -> Reply {
        let asked = self.begin_as(id, order);
        self.answer(asked, within).await
    }

    /// How many wishes to stop there were.
    fn stops(&self) -> Stops {
        Stops { over_ros: self.waiting().stops, local: self.motion.local_stops() }
    }

    /// The same, unless somebody wanted the machine to stop since there were so many wishes:
    /// what was still being prepared then does not begin after it.
    async fn ask_unless_stopped(
        &self,
        stops: Stops,
        id: u64,
        order: impl Into<Order>,
        within: Duration,
    ) -> Reply {
        let asked = {
            let mut waiting = self.waiting();
            if waiting.stops != stops.over_ros {
                let message =
                    "somebody stopped the machine before the command began: send it again".into();
                return Err(Refusal { error_code: crate::codes::error_code::CANCELED, message });
            }
            self.hand_over(&mut waiting, id, order.into(), Some(stops.local))
        };
        self.answer(asked, within).await
    }

    /// Sends an order now; [`Self::answer`] waits for its answer.
    fn begin(&self, order: impl Into<Order>) -> Asked {
        self.begin_as(self.next_id.fetch_add(1, Ordering::Relaxed), order)
    }

    fn begin_as(&self, id: u64, order: impl Into<Order>) -> Asked {
        self.hand_over(&mut self.waiting(), id, order.into(), None)
    }

    /// Hands an order to the driver, one after the other.
    fn hand_over(
        &self,
        waiting: &mut Waiting,
        id: u64,
        order: Order,
        local_stops: Option<u64>,
    ) -> Asked {
        waiting.stops += u64::from(order.stops_whatever_moves());
        let reply = waiting.replies.wait(id);
        self.motion.order(id, &order, local_stops);
        Asked { id, reply }
    }

    async fn answer(&self, asked: Asked, within: Duration) -> Reply {
        let Asked { id, reply } = asked;
        if let Ok(Ok(reply)) = tokio::time::timeout(within, reply).await {
            return reply;
        }
        self.waiting().replies.forget(id);
        let message = format!("the driver did not answer within {} s", within.as_secs_f64());
        Err(Refusal { error_code: crate::codes::error_code::NO_ANSWER, message })
    }

    /// Offers the core another path for what is left of its run.
    async fn replan(&self, paths: &Paths, of: u64, planned: Planned) {
        let Planned { program_id, revision, functions, .. } = planned.clone();
        if let Err(refusal) = user_functions::check(self, &program_id, &functions, 0).await {
            tracing::warn!("revision {revision} is not accepted: {}", refusal.message);
            let answer = Err(refusal.message);
            let _ = self.ask(Command::ProgramContinued { of, answer }, REPLY_WITHIN).await;
            return;
        }
        let order = Order::Replan(ReplanOrder { program_id, of, revision });
        match self.ask(order, REPLY_WITHIN).await {
            Ok(message) => {
                paths.go_on(&planned);
                tracing::info!("{message}");
            }
            Err(refusal) => {
                tracing::warn!("revision {revision} is not accepted: {}", refusal.message)
            }
        }
    }

    fn health(&self) -> Health {
        let state = self.state_now();
        let dropped = self.motion.dropped();
        Health {
            component: "serial link".into(),
            level: match state.mode {
                Mode::Unknown | Mode::Alarm => HealthLevel::Error,
                Mode::Disconnected => HealthLevel::Warn,
                _ if state.needs_reset
                    || [COMMANDER_LOST, PATH_DEVIATION, ROS_LOST]
                        .iter()
                        .any(|lost| state.reason.starts_with(lost)) =>
                {
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
fn reply_fields(reply: Reply) -> (bool, u16, String) {
    match reply {
        Ok(message) => (true, 0, message),
        Err(Refusal { error_code, message }) => (false, error_code, message),
    }
}
