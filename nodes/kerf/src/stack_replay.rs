//! The level `stack`: all nodes over DDS with the virtual controller, driven by a recording.
//!
//! Loads the recorded text, gives each recorded command when the stack is at the same place again,
//! lets its own recorder write a bag, and compares that bag with the recorded one. The other levels
//! feed one core; here processes communicate. It takes seconds, and only what does not depend on
//! their timing is compared (`stack_replay/same.rs` has the table).
//!
//! - `run`: the run in a bag
//! - `script`: the commands of a run as cues, and what cannot be played
//! - `place`: where a command is due
//! - `track`: how far along its path a machine is
//! - `gate`: the virtual controller, whose time stops there
//! - `machine`: the virtual controller, built as the recorded one
//! - `nodes`: the arguments of the nodes, and why they cannot reach a real machine
//! - `conductor`, `player`: play it
//! - `same`: what has to be the same
//!
//! This file is the frame: it makes a folder, a domain, a port and processes, and removes all of
//! them in any case.

mod conductor;
mod gate;
mod machine;
mod nodes;
mod place;
mod player;
mod run;
mod same;
mod script;
mod track;

use crate::exit::{Failure, Status};
use crate::stack::Stack;
use cnc_msgs::wire::cnc_msgs::action::RunProgramGoal;
use conductor::{Play, Played, Stage, play};
use gate::{Gate, GatedController};
use nodes::{LINK, NODES, TOOLS};
use replay::ReplayError;
use replay::compare::Comparison;
use replay::output::name_of;
use replay::recording::Recording;
use run::RunHistory;
use run_recorder::files::open_bag;
use same::RecordedRun;
use script::Script;
use std::fs::File;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::signal::unix::{Signal, SignalKind, signal};
use virtual_controller::{LineTiming, ServeError, StopHandle, serve_device, stop_pair};

/// How much faster than a real machine the axes move; bytes take no time.
const TIME_FACTOR: f64 = 20.0;
/// How often the controller checks whether the gate was opened.
const LOOK_EVERY: Duration = Duration::from_millis(2);
/// How long making a pseudo-terminal may take.
const PORT_WITHIN: Duration = Duration::from_secs(30);
/// The log of the nodes, in the folder of the replay.
const LOG: &str = "nodes.log";
/// Lines of the log that are shown when the replay failed.
const LOG_LINES_SHOWN_MAX: usize = 6;

/// Runs the stack as recorded and compares; its bag goes to `out`, if given.
pub(crate) fn replay(
    recording: &Recording,
    bag: &Path,
    out: Option<&Path>,
    comparison: &mut Comparison,
) -> Result<(), ReplayError> {
    let run = RunHistory::of(recording)?;
    let missing = |what| ReplayError::Incomplete { what, of: "the run".into() };
    if run.lines().is_empty() && !run.goal.check_only {
        return Err(missing("a single line to the controller"));
    }
    if !recording.parameters.contains_key("axis_driver") {
        return Err(missing("the parameters of axis_driver"));
    }
    let program = recording.programs.get(&run.goal.program_id);
    let program = program.ok_or_else(|| ReplayError::Incomplete {
        what: "the text of the program",
        of: run.goal.program_id.clone(),
    })?;
    let tools = recording.plans.get(&run.goal.revision);
    let tools = tools.and_then(|it| recording.tool_tables.get(&it.report.tool_table_revision));
    let tools = tools.ok_or_else(|| missing("the tool table"))?;
    let Script { cues, track } = script::script(recording, &run)?;
    let likeness = machine::likeness(recording, &run)?;
    for note in &likeness.notes {
        eprintln!("kerf: {note}");
    }

    let folder = Folder::new().map_err(failed)?;
    let profile = settings::profile_to_yaml(&program.profile()?);
    let profile = folder.write("profile.yaml", &profile)?;
    folder.write(TOOLS, &compensation_planner::tool_file::whole(tools))?;
    for node in NODES {
        let recorded = recording.parameters.get(node);
        folder.write(&format!("{node}.yaml"), &nodes::parameter_file(node, recorded))?;
    }
    let play = Play {
        program,
        profile,
        goal: RunProgramGoal {
            start_line: run.goal.start_line,
            occurrence: run.goal.occurrence,
            check_only: run.goal.check_only,
            ..RunProgramGoal::default()
        },
        is_single_block: run.is_single_block,
        cues: &cues,
        functions: run.functions(),
        track,
    };
    let bags = match out {
        Some(out) => {
            std::path::absolute(out).map_err(failed)?.join(format!("{}_stack", name_of(bag)))
        }
        None => folder.0.join("bags"),
    };
    std::fs::create_dir_all(&bags).map_err(failed)?;
    let gate = Gate::default();
    let controller = GatedController::new(likeness.controller, gate.clone());
    let played = on_stage(&folder, &bags, &gate, controller, &play)
        .map_err(|failure| folder.with_log(failure))?;

    comparison.count("commands", cues.len() + 1);
    match played {
        Played::Refused { by, reason } => {
            comparison.differs(
                by,
                "accepted",
                format!("it was accepted and is refused now: {reason}"),
            );
        }
        Played::Ran { bag, missed } => {
            let mut bag = open_bag(&bag)?;
            let again = Recording::read(&mut bag)?;
            let now = RunHistory::of(&again)?;
            let was = RecordedRun { recording, run: &run };
            same::compare(was, RecordedRun { recording: &again, run: &now }, comparison);
            same::missed(&missed, comparison);
        }
    }
    Ok(())
}

fn failed(error: impl std::fmt::Display) -> ReplayError {
    ReplayError::Stack { status: Status::Usage as u8, message: error.to_string() }
}

/// Starts controller and nodes in an unused domain, plays, and stops everything.
fn on_stage<'a>(
    folder: &Folder,
    bags: &Path,
    gate: &Gate,
    controller: GatedController,
    script: &Play<'a>,
) -> Result<Played<'a>, Failure> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let namespace = format!("/kerf_replay_{}_{number}", std::process::id());
    let domain = domain()?;
    let arguments = nodes::arguments(&namespace, &folder.0, bags);
    let inherited = std::env::vars_os();
    let inherited = inherited
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    let variables = nodes::variables(inherited.collect(), domain);
    let log = File::create(folder.0.join(LOG)).map_err(Failure::usage)?;

    let stage = Stage {
        folder: &folder.0,
        namespace: &namespace,
        arguments: &arguments,
        variables: &variables,
        gate,
    };
    let mut frame = FRAME.lock().unwrap_or_else(PoisonError::into_inner);
    if frame.is_none() {
        *frame = Some(Frame::new().map_err(Failure::usage)?);
    }
    let Some(Frame { executor, interrupt, terminate }) = &mut *frame else {
        unreachable!("it was made just now")
    };
    executor.block_on(async {
        let port = VirtualPort::open(controller, &folder.0.join(LINK))?;
        let mut nodes = Stack::isolated(variables.clone(), log).map_err(Failure::usage)?;
        let played = tokio::select! {
            played = play(&stage, &mut nodes, script) => played,
            _ = interrupt.recv() => Err(Failure::new(Status::NodeRefused, "interrupted")),
            _ = terminate.recv() => Err(Failure::new(Status::NodeRefused, "terminated")),
        };
        let mut troubles = nodes.stop().await;
        troubles.extend(port.close());
        let played = played?;
        if troubles.is_empty() {
            Ok(played)
        } else {
            let text = format!("the stack did not stop cleanly: {}", troubles.join("; "));
            Err(Failure::new(Status::NodeRefused, text))
        }
    })
}

/// Threads and the stop signal. A Ctrl-C between two bags counts for the next one.
struct Frame {
    executor: tokio::runtime::Runtime,
    interrupt: Signal,
    terminate: Signal,
}

static FRAME: Mutex<Option<Frame>> = Mutex::new(None);

impl Frame {
    fn new() -> std::io::Result<Self> {
        let executor =
            tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
        let (interrupt, terminate) = executor.block_on(async {
            Ok::<_, std::io::Error>((
                signal(SignalKind::interrupt())?,
                signal(SignalKind::terminate())?,
            ))
        })?;
        Ok(Self { executor, interrupt, terminate })
    }
}

/// An unused ROS domain of this computer.
fn domain() -> Result<u16, Failure> {
    let tables = ["/proc/net/udp", "/proc/net/udp6"].map(std::fs::read_to_string);
    // Without IPv6 the second table is missing; without the first nothing is known.
    let [udp, udp6] = tables;
    let udp = udp.map_err(|error| {
        Failure::usage(format_args!("cannot find the used ROS domains: /proc/net/udp: {error}"))
    })?;
    let first = u16::try_from(std::process::id() % 1000).unwrap_or(0);
    nodes::free_domain(first, &[udp, udp6.unwrap_or_default()]).ok_or_else(|| {
        let (from, to) = (nodes::DOMAINS.start(), nodes::DOMAINS.end());
        Failure::new(
            Status::NodeRefused,
            format!(
                "there are other nodes in each of the ROS domains {from} to {to} of this \
                 computer; a stack is replayed only in an unused domain: stop some of them"
            ),
        )
    })
}

/// The virtual controller on its own thread.
struct VirtualPort {
    stop: StopHandle,
    thread: JoinHandle<Result<(), ServeError>>,
}

impl VirtualPort {
    fn open(controller: GatedController, link: &Path) -> Result<Self, Failure> {
        let (stop, stopped) = stop_pair().map_err(Failure::usage)?;
        let (ready, is_ready) = mpsc::channel();
        let link = link.to_path_buf();
        let timing = LineTiming { baud: None, time_factor: TIME_FACTOR, scales_bytes: false };
        let thread = std::thread::Builder::new()
            .name("virtual-controller".into())
            .spawn(move || {
                // The receiver may be gone; that is no reason to stop.
                let report_port = move || {
                    let _ = ready.send(());
                };
                serve_device(controller, timing, &link, LOOK_EVERY, &stopped, report_port)
            })
            .map_err(Failure::usage)?;
        let port = Self { stop, thread };
        match is_ready.recv_timeout(PORT_WITHIN) {
            Ok(()) => Ok(port),
            Err(_) => Err(Failure::usage(port.close().unwrap_or_else(|| "no port".into()))),
        }
    }

    /// Ends it; returns its error, if any.
    fn close(self) -> Option<String> {
        self.stop.stop();
        match self.thread.join() {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(format!("the virtual controller: {error}")),
            Err(_) => Some("the virtual controller panicked".into()),
        }
    }
}

/// A folder for one replay, for this user alone; removed when this value is dropped.
struct Folder(PathBuf);

impl Folder {
    fn new() -> std::io::Result<Self> {
        let temporary = std::path::absolute(std::env::temp_dir())?;
        let mut number = 0;
        loop {
            let path = temporary.join(format!("kerf-replay-{}-{number}", std::process::id()));
            match std::fs::DirBuilder::new().mode(0o700).create(&path) {
                Ok(()) => return Ok(Self(path)),
                // The folder may be left over from a killed process.
                Err(error)
                    if error.kind() == std::io::ErrorKind::AlreadyExists && number < 1000 =>
                {
                    number += 1;
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn write(&self, name: &str, content: &str) -> Result<PathBuf, ReplayError> {
        let path = self.0.join(name);
        match std::fs::write(&path, content) {
            Ok(()) => Ok(path),
            Err(error) => Err(failed(format_args!("cannot write {}: {error}", path.display()))),
        }
    }

    /// Adds the last warnings and errors of the nodes to a failure.
    fn with_log(&self, failure: Failure) -> ReplayError {
        let Failure { status, mut message } = failure;
        let log = std::fs::read_to_string(self.0.join(LOG)).unwrap_or_default();
        for line in warnings(&log) {
            message += &format!("\n  {line}");
        }
        ReplayError::Stack { status: status as u8, message }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A failure here has no effect on anybody.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The last warnings and errors of a log.
fn warnings(log: &str) -> Vec<&str> {
    let is_one = |line: &&str| ["[WARN]", "[ERROR]", "panicked"].iter().any(|it| line.contains(it));
    let all: Vec<&str> = log.lines().filter(is_one).collect();
    all[all.len().saturating_sub(LOG_LINES_SHOWN_MAX)..].to_vec()
}
