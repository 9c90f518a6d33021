//! Plays a script on a stack of nodes: starts them, gives the commands, waits for the bag.
//!
//! Plumbing. `place` says where a command is due, `gate` stops the machine's time there, `player`
//! gives the command, and `nodes` has the arguments of the nodes.

use super::gate::Gate;
use super::nodes::{LINK, NODES};
use super::player::{Player, Seen, until};
use super::script::{Cue, When};
use super::track::Track;
use crate::exit::{Failure, Status};
use crate::stack::Stack;
use crate::{load, operate};
use cnc_msgs::wire::cnc_msgs::action::{RunProgram, RunProgramGoal};
use cnc_msgs::wire::cnc_msgs::msg::{
    CompensationReport, MachineState, NodeParameters, Recording as Bag,
};
use cnc_msgs::wire::cnc_msgs::srv::{CallUserFunction, CallUserFunctionResponse};
use cnc_msgs::wire::rcl_interfaces::msg::Parameter;
use replay::recording::RecordedProgram;
use runtime::action::GoalHandle;
use runtime::configuration::Configuration;
use runtime::{Handle, NodeError, Qos, Session, Subscription};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use tokio::time::{sleep, timeout};

/// How long nodes and controller may take to start.
const READY_WITHIN: Duration = Duration::from_secs(90);
/// How long planning a program may take.
const PLAN_WITHIN: Duration = Duration::from_secs(300);
/// How long the recorder may take to close the bag after the run.
const CLOSED_WITHIN: Duration = Duration::from_secs(90);
/// The path may not have reached the driver yet when the goal is sent.
const GOAL_TRIES: (usize, Duration) = (4, Duration::from_secs(1));
/// No run takes longer than this.
const RUN_WITHIN: Duration = Duration::from_secs(7 * 24 * 3600);

/// The recording to play.
#[derive(Debug)]
pub(super) struct Play<'a> {
    pub(super) program: &'a RecordedProgram,
    /// The control profile, in a file.
    pub(super) profile: PathBuf,
    pub(super) goal: RunProgramGoal,
    pub(super) is_single_block: bool,
    pub(super) cues: &'a [Cue],
    /// What is said of the functions of the user that it calls.
    pub(super) functions: BTreeMap<u32, Result<String, String>>,
    /// The path of the goal.
    pub(super) track: Arc<Track>,
}

/// The result of playing.
#[derive(Debug)]
pub(super) enum Played<'a> {
    /// It was accepted when recorded, and is refused now: by which node, and why.
    Refused { by: &'static str, reason: String },
    /// It ran; these commands were not given because their place was not reached.
    Ran { bag: PathBuf, missed: Vec<&'a Cue> },
}

/// The stack on which it is played.
#[derive(Debug)]
pub(super) struct Stage<'a> {
    pub(super) folder: &'a Path,
    pub(super) namespace: &'a str,
    pub(super) arguments: &'a [String],
    pub(super) variables: &'a BTreeMap<String, String>,
    pub(super) gate: &'a Gate,
}

/// Plays the recording; the caller stops the nodes.
pub(super) async fn play<'a>(
    stage: &Stage<'_>,
    nodes: &mut Stack,
    play: &Play<'a>,
) -> Result<Played<'a>, Failure> {
    for name in NODES {
        nodes.start(name, stage.arguments).map_err(Failure::usage)?;
    }
    let name = format!("kerf_replay_{}", std::process::id());
    let words = ["--ros-args", "-r", &format!("__ns:={}", stage.namespace)].map(String::from);
    let configuration = Configuration::read(&name, Vec::new(), &words, stage.variables);
    let session = Session::start(configuration.map_err(Failure::usage)?).map_err(Failure::usage)?;
    let played = tokio::select! {
        played = commission(session.handle(), stage, play) => played,
        name = died(nodes) => Err(Failure::new(Status::NodeRefused, format!("{name} ended by itself"))),
    };
    session.stop().await;
    played
}

async fn died(nodes: &mut Stack) -> String {
    loop {
        if let Some((name, status)) = nodes.ended() {
            return format!("{name} ({status})");
        }
        sleep(Duration::from_millis(100)).await;
    }
}

/// Stands in for the node of the cell: a call that has no answer in the recording gets none.
fn answer_functions(
    node: &Handle,
    recorded: &BTreeMap<u32, Result<String, String>>,
) -> Result<(), NodeError> {
    let (recorded, calls) = (recorded.clone(), AtomicU32::new(0));
    node.concurrent_service::<CallUserFunction, _, _>("user_function", move |request, _| {
        let answer = match request.check_only {
            true => Some(Ok(String::new())),
            false => recorded.get(&(calls.fetch_add(1, Ordering::Relaxed) + 1)).cloned(),
        };
        async move {
            let Some(answer) = answer else { return std::future::pending().await };
            let success = answer.is_ok();
            let message = answer.unwrap_or_else(|why| why);
            CallUserFunctionResponse { success, message }
        }
    })
}

async fn commission<'a>(
    node: &Handle,
    stage: &Stage<'_>,
    play: &Play<'a>,
) -> Result<Played<'a>, Failure> {
    let mut bags: Subscription<Bag> = node.subscription("recording", Qos::LATCHED)?;
    let mut reports: Subscription<CompensationReport> =
        node.subscription("compensation_report", Qos::LATCHED)?;
    let states: Subscription<MachineState> = node.subscription("machine_state", Qos::LATCHED)?;
    let parameters: Subscription<NodeParameters> =
        node.subscription("node_parameters", Qos::LATCHED.with_depth(32))?;
    let seen = Seen::follow(node, states);
    answer_functions(node, &play.functions)?;
    has_our_port(parameters, &stage.folder.join(LINK)).await?;
    until("the machine to be ready", READY_WITHIN, &seen, stage.gate, || {
        seen.last().is_some_and(|state| state.state == MachineState::STATE_IDLE)
    })
    .await?;
    let received = timeout(READY_WITHIN, bags.next()).await;
    received.map_err(|_| Failure::new(Status::NoAnswer, "the recorder does not answer"))?;

    let RecordedProgram { manifest, text, .. } = play.program;
    let profile = play.profile.display().to_string();
    let loaded = load::send_program(node, (&manifest.name, text), &profile, "").await?;
    if !loaded.success {
        return Ok(Played::Refused { by: "program_loader", reason: loaded.message });
    }
    let report = timeout(PLAN_WITHIN, async {
        loop {
            let (report, _) = reports.next().await;
            if report.program_id == loaded.program_id {
                break report;
            }
        }
    });
    let report = report.await.map_err(|_| {
        let text = format!("{} was not planned within {} s", manifest.name, PLAN_WITHIN.as_secs());
        Failure::new(Status::NoAnswer, text)
    })?;
    if !report.accepted {
        let first = report.findings.iter().find(|it| it.severity >= 2);
        let first = first.map_or(String::new(), |it| format!("line {}: {}", it.line, it.message));
        return Ok(Played::Refused { by: "compensation_planner", reason: first });
    }

    let mut player = Player::new(node, stage.gate, seen);
    if play.is_single_block {
        player.single_block(true).await?;
    }
    let is_followed = play.cues.iter().any(|cue| matches!(cue.when, When::Moving(_)));
    stage.gate.begin(is_followed.then(|| Arc::clone(&play.track)));
    player.seen.begin();
    let goal = RunProgramGoal { program_id: loaded.program_id, ..play.goal.clone() };
    let handle = match begin(node, &goal).await {
        Ok(handle) => handle,
        Err(Failure { status: Status::NodeRefused, message }) => {
            return Ok(Played::Refused { by: "axis_driver", reason: message });
        }
        Err(failure) => return Err(failure),
    };
    let mut result = tokio::spawn(handle.result(RUN_WITHIN));
    let mut missed = Vec::new();
    for cue in play.cues {
        if !player.give(cue, &handle, &result).await? {
            missed.push(cue);
        }
    }
    player.until("the end of the run", || result.is_finished()).await?;
    let ended = (&mut result).await.map_err(Failure::usage)?;
    let (_, result) = ended.map_err(|error| Failure::new(Status::NoAnswer, error.to_string()))?;
    eprintln!("kerf: {}", result.message);
    Ok(Played::Ran { bag: closed(&mut bags).await?, missed })
}

/// Checks, before anything else, that the driver's port is the virtual one.
async fn has_our_port(
    mut parameters: Subscription<NodeParameters>,
    link: &Path,
) -> Result<(), Failure> {
    let found = timeout(READY_WITHIN, async {
        loop {
            let (found, _) = parameters.next().await;
            if found.node.ends_with("/axis_driver") {
                break found;
            }
        }
    });
    let found = found.await.map_err(|_| {
        Failure::new(Status::NoAnswer, "the driver does not answer the request for its parameters")
    })?;
    let is_port = |it: &&Parameter| it.name == "port";
    let port = found.parameters.iter().find(is_port).map(|it| it.value.string_value.clone());
    match port {
        Some(port) if Path::new(&port) == link => Ok(()),
        port => Err(Failure::new(
            Status::NodeRefused,
            format!("the driver has the port {port:?} instead of the virtual controller's"),
        )),
    }
}

async fn begin(node: &Handle, goal: &RunProgramGoal) -> Result<GoalHandle<RunProgram>, Failure> {
    let (tries, pause) = GOAL_TRIES;
    for _ in 1..tries {
        match operate::begin::<RunProgram>(node, "run_program", goal.clone()).await {
            Err(Failure { status: Status::NodeRefused, .. }) => sleep(pause).await,
            other => return other,
        }
    }
    operate::begin::<RunProgram>(node, "run_program", goal.clone()).await
}

/// The bag of the run, when the recorder has closed it.
async fn closed(bags: &mut Subscription<Bag>) -> Result<PathBuf, Failure> {
    let closed = timeout(CLOSED_WITHIN, async {
        loop {
            let (bag, _) = bags.next().await;
            if !bag.is_recording && !bag.run_id.is_empty() {
                break bag;
            }
        }
    });
    let bag = closed.await.map_err(|_| {
        Failure::new(Status::NoAnswer, "the recorder did not close the bag of the run")
    })?;
    if bag.complete {
        Ok(PathBuf::from(bag.uri))
    } else {
        let text = format!("{} is not complete: {}", bag.uri, bag.reason);
        Err(Failure::new(Status::NodeRefused, text))
    }
}
