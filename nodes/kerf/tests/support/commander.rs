//! A commander of a machine over ROS 2, within this process, which keeps all messages.

use super::machine::{Machine, until};
use super::support::TIMEOUT;
use cnc_msgs::convert::mode_from_wire;
use cnc_msgs::wire::cnc_msgs::action::{
    Home, HomeGoal, HomeResult, RunProgram, RunProgramGoal, RunProgramResult,
};
use cnc_msgs::wire::cnc_msgs::msg::{Command, MachineState, Recording, RunResult};
use cnc_msgs::wire::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus};
use cnc_msgs::wire::std_srvs::srv::{Trigger, TriggerRequest};
use runtime::action::{ActionClient, GoalError, GoalHandle, GoalId};
use runtime::configuration::Configuration;
use runtime::{Client, Handle, Qos, Session};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::task::JoinHandle;

/// The services without arguments.
const BUTTONS: [&str; 5] = ["feed_hold", "resume", "soft_reset", "unlock", "confirm_tool_change"];

/// All received messages, in order.
#[derive(Debug, Default)]
struct Received {
    states: Vec<MachineState>,
    recordings: Vec<Recording>,
    commands: Vec<Command>,
    results: Vec<RunResult>,
    findings: Vec<DiagnosticArray>,
}

/// A node of this process, next to a machine.
pub(crate) struct Commander {
    executor: tokio::runtime::Runtime,
    session: Option<Session>,
    received: Arc<Mutex<Received>>,
    buttons: BTreeMap<&'static str, Client<Trigger>>,
    runs: ActionClient<RunProgram>,
    homes: ActionClient<Home>,
}

/// A run that was accepted.
#[derive(Debug)]
pub(crate) struct Running {
    goal: GoalId,
    result: JoinHandle<Result<RunProgramResult, String>>,
}

impl Running {
    /// Whether its result is there.
    pub(crate) fn is_over(&self) -> bool {
        self.result.is_finished()
    }
}

impl Commander {
    /// Joins the machine's domain and namespace.
    pub(crate) fn join(machine: &Machine) -> Self {
        Self::join_as("commander", &machine.domain, &machine.namespace)
    }

    /// Joins under this name.
    pub(crate) fn join_as(name: &str, domain: &str, namespace: &str) -> Self {
        let executor = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .expect("threads");
        let inside = executor.enter();
        let namespace = format!("__ns:={namespace}");
        let words = ["--ros-args", "-r", &namespace].map(String::from);
        let domain = ("ROS_DOMAIN_ID".to_owned(), domain.to_owned());
        let configuration =
            Configuration::read(name, Vec::new(), &words, &BTreeMap::from([domain]))
                .expect("a domain and a namespace");
        let session = Session::start(configuration).expect("a node of our own");
        let node = session.handle().clone();
        let received = Arc::<Mutex<Received>>::default();
        listen(&node, &received);
        let buttons = BUTTONS.map(|name| (name, node.client::<Trigger>(name).expect("a client")));
        let runs = node.action_client("run_program").expect("a client");
        let homes = node.action_client("home").expect("a client");
        drop(inside);
        let buttons = BTreeMap::from(buttons);
        Self { executor, session: Some(session), received, buttons, runs, homes }
    }

    pub(crate) fn node(&self) -> &Handle {
        self.session.as_ref().expect("it is taken at the end only").handle()
    }

    /// Runs what is written in async.
    pub(crate) fn wait<T>(&self, work: impl Future<Output = T>) -> T {
        self.executor.block_on(work)
    }

    fn received(&self) -> MutexGuard<'_, Received> {
        self.received.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// States from here on are younger than this.
    pub(crate) fn mark(&self) -> usize {
        self.received().states.len()
    }

    /// The states since then.
    pub(crate) fn states_since(&self, mark: usize) -> Vec<MachineState> {
        self.received().states[mark..].to_vec()
    }

    /// What is said of the machine now.
    pub(crate) fn state(&self) -> MachineState {
        self.received().states.last().expect("a state was received").clone()
    }

    /// Waits until the newest state is such a one.
    #[track_caller]
    pub(crate) fn until(&self, what: &str, is_so: impl Fn(&MachineState) -> bool) -> MachineState {
        let last = || self.received().states.last().cloned();
        let mut newest = None;
        let end = Instant::now() + TIMEOUT;
        while Instant::now() < end {
            newest = last();
            if let Some(state) = newest.as_ref().filter(|state| is_so(state)) {
                return state.clone();
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let newest = newest.map(|state| describe(&state));
        panic!("{what}: not within {} s; the last was {newest:?}", TIMEOUT.as_secs());
    }

    /// Waits for this mode.
    #[track_caller]
    pub(crate) fn until_mode(&self, mode: &str) -> MachineState {
        self.until(mode, |state| mode_from_wire(state.state).name() == mode)
    }

    /// Waits until `/diagnostics` says this of the driver's line, with these words.
    #[track_caller]
    pub(crate) fn until_health(&self, level: u8, words: &str) {
        self.until_part_health("serial link", level, words);
    }

    /// Waits until `/diagnostics` says this of a part of the driver, with these words.
    #[track_caller]
    pub(crate) fn until_part_health(&self, part: &str, level: u8, words: &str) {
        let name = format!("axis_driver: {part}");
        let newest = || -> Option<DiagnosticStatus> {
            let received = self.received();
            let mut all = received.findings.iter().rev().flat_map(|array| &array.status);
            all.find(|status| status.name.ends_with(&name)).cloned()
        };
        let is_so = |it: &DiagnosticStatus| it.level == level && it.message.contains(words);
        let end = Instant::now() + TIMEOUT;
        while !newest().is_some_and(|status| is_so(&status)) {
            assert!(Instant::now() < end, "not {level} {words:?} but {:?}", newest());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// What the recorder says now.
    pub(crate) fn recording(&self) -> Option<Recording> {
        self.received().recordings.last().cloned()
    }

    /// Presses a button; the error is why the driver refuses.
    #[track_caller]
    pub(crate) fn press(&self, button: &str) -> Result<String, String> {
        let client = &self.buttons[button];
        let answer = self.wait(client.call_within(TriggerRequest::default(), TIMEOUT));
        let answer = answer.expect("the driver answers");
        if answer.success { Ok(answer.message) } else { Err(answer.message) }
    }

    /// Presses a button again until the driver answers: what was asked of a process that has
    /// died since is lost.
    pub(crate) fn press_again(&self, button: &str) -> Result<String, String> {
        let client = &self.buttons[button];
        let answer = self.wait(client.call_idempotent(&TriggerRequest::default(), TIMEOUT));
        let answer = answer.expect("the driver answers");
        if answer.success { Ok(answer.message) } else { Err(answer.message) }
    }

    /// Begins a run of what is loaded; the error is why the driver refuses.
    pub(crate) fn run(&self) -> Result<Running, String> {
        let known = self.received().commands.len();
        match self.wait(self.runs.send_goal(RunProgramGoal::default())) {
            Ok(goal) => Ok(Running {
                goal: goal.id(),
                result: self.executor.spawn(async move {
                    let ended = goal.result(3 * TIMEOUT).await;
                    ended.map(|(_, result)| result).map_err(|error| error.to_string())
                }),
            }),
            Err(GoalError::Rejected { .. }) => Err(until("the reason", || {
                let received = self.received();
                let mut refused = received.commands[known..].iter().filter(|command| {
                    command.endpoint.ends_with("run_program") && !command.success
                });
                refused.next_back().map(|command| command.message.clone())
            })),
            Err(error) => panic!("no goal could be sent: {error}"),
        }
    }

    /// Begins a run of what is loaded, and leaves its end to the caller.
    pub(crate) fn begin_run(&self) -> Result<GoalHandle<RunProgram>, GoalError> {
        self.wait(self.runs.send_goal(RunProgramGoal::default()))
    }

    /// Waits for the end of a run, of which `run_result` says the same as its goal.
    pub(crate) fn result(&self, run: Running) -> Result<RunProgramResult, String> {
        let result = self.wait(run.result).expect("the task only waits")?;
        let said = until("the end of the run on run_result", || {
            let received = self.received();
            received.results.iter().find(|it| it.goal_id.uuid == run.goal.0).cloned()
        });
        let RunResult { outcome, error_code, message, last_line, .. } = said;
        assert_eq!(RunProgramResult { outcome, error_code, message, last_line }, result);
        Ok(result)
    }

    /// Cancels whatever runs.
    pub(crate) fn cancel(&self) {
        self.wait(self.runs.cancel_all()).expect("the driver answers");
    }

    /// Homes, and waits for the end of it.
    pub(crate) fn home(&self) -> HomeResult {
        self.wait(async {
            let goal = self.homes.send_goal(HomeGoal::default()).await.expect("homing is taken up");
            goal.result(TIMEOUT).await.expect("homing ends").1
        })
    }
}

impl Drop for Commander {
    fn drop(&mut self) {
        self.buttons.clear();
        if let Some(session) = self.session.take() {
            self.executor.block_on(session.stop());
        }
    }
}

impl std::fmt::Debug for Commander {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Commander").finish_non_exhaustive()
    }
}

fn listen(node: &Handle, received: &Arc<Mutex<Received>>) {
    macro_rules! keep {
        ($topic:literal, $qos:expr, $list:ident) => {
            let mut messages = node.subscription($topic, $qos.with_depth(1000)).expect($topic);
            let received = Arc::clone(received);
            node.spawn($topic, async move {
                loop {
                    let (message, _) = messages.next().await;
                    received.lock().unwrap_or_else(PoisonError::into_inner).$list.push(message);
                }
            });
        };
    }
    keep!("machine_state", Qos::LATCHED, states);
    keep!("recording", Qos::LATCHED, recordings);
    keep!("command_log", Qos::EVENTS, commands);
    keep!("run_result", Qos::LATCHED, results);
    keep!("/diagnostics", Qos::DEFAULT, findings);
}

/// A state in short.
pub(crate) fn describe(state: &MachineState) -> String {
    format!("{} {:?} line {}", mode_from_wire(state.state).name(), state.reason, state.line)
}
