//! The level `stack`: all nodes over DDS with the virtual controller, driven by a recording.
//!
//! Loads the recorded text, gives the recorded commands where the stack is where it was, has
//! its own recorder write a bag, and compares that bag with the recorded one. Where the other
//! levels feed a core, here processes meet: it takes seconds, and only what does not depend
//! on their pace is compared (`stack_replay/same.rs` has the table).
//!
//! - `run`: what a bag tells of its run
//! - `script`: the commands of a run as cues, and what cannot be played
//! - `place`: where a command is due
//! - `track`: how far along its path a machine is
//! - `gate`: the virtual controller, whose time stands still there
//! - `machine`: the virtual controller as the recorded one was
//! - `nodes`: what the nodes are started with, and why they meet no machine
//! - `conductor`, `player`: play it
//! - `same`: what has to be the same
//!
//! This file is the frame: a folder, a domain, a port, processes, and that nothing of them
//! is left, whatever happens.

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
use run::Run;
use run_recorder::files::open_bag;
use same::Told;
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
/// How often the controller looks whether the gate was opened.
const LOOK_EVERY: Duration = Duration::from_millis(2);
/// How long making a pseudo-terminal may take.
const PORT_WITHIN: Duration = Duration::from_secs(30);
/// What the nodes said, in the folder of the replay.
const LOG: &str = "nodes.log";
/// Lines of that which are told when the replay failed.
const COMPLAINTS_MAX: usize = 6;

/// Runs the stack as recorded and compares; its bag stays in `out`, if there is one.
pub(crate) fn replay(
    recording: &Recording,
    bag: &Path,
    out: Option<&Path>,
    comparison: &mut Comparison,
) -> Result<(), ReplayError> {
    let run = Run::of(recording)?;
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
            check_only: run.goal.check_only,
            ..RunProgramGoal::default()
        },
        is_single_block: run.is_single_block,
        cues: &cues,
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
        .map_err(|failure| folder.complain(failure))?;

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
            let now = Run::of(&again)?;
            let was = Told { recording, run: &run };
            same::compare(was, Told { recording: &again, run: &now }, comparison);
            same::missed(&missed, comparison);
        }
    }
    Ok(())
}

fn failed(error: impl std::fmt::Display) -> ReplayError {
    ReplayError::Stack { status: Status::Usage as u8, message: error.to_string() }
}

/// Starts controller and nodes where nobody else is, plays, and stops everything.
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

/// Threads, and who asks to stop. Of the process: a Ctrl-C between two bags counts for the next.
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

/// A domain of this computer in which nobody is.
fn domain() -> Result<u16, Failure> {
    let tables = ["/proc/net/udp", "/proc/net/udp6"].map(std::fs::read_to_string);
    // Without IPv6 there is no such table; without the other nothing is known.
    let [udp, udp6] = tables;
    let udp = udp.map_err(|error| {
        Failure::usage(format_args!("cannot see who is on this computer: /proc/net/udp: {error}"))
    })?;
    let first = u16::try_from(std::process::id() % 1000).unwrap_or(0);
    nodes::free_domain(first, &[udp, udp6.unwrap_or_default()]).ok_or_else(|| {
        let (from, to) = (nodes::DOMAINS.start(), nodes::DOMAINS.end());
        Failure::new(
            Status::NodeRefused,
            format!(
                "there are other nodes in each of the ROS domains {from} to {to} of this \
                 computer; a stack is replayed only where nobody is: stop some"
            ),
        )
    })
}

/// The virtual controller on a thread of its own.
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
                // Nobody to tell is no reason to stop.
                let tell = move || {
                    let _ = ready.send(());
                };
                serve_device(controller, timing, &link, LOOK_EVERY, &stopped, tell)
            })
            .map_err(Failure::usage)?;
        let port = Self { stop, thread };
        match is_ready.recv_timeout(PORT_WITHIN) {
            Ok(()) => Ok(port),
            Err(_) => Err(Failure::usage(port.close().unwrap_or_else(|| "no port".into()))),
        }
    }

    /// Ends it; says what was wrong with it.
    fn close(self) -> Option<String> {
        self.stop.stop();
        match self.thread.join() {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(format!("the virtual controller: {error}")),
            Err(_) => Some("the virtual controller panicked".into()),
        }
    }
}

/// A folder for one replay, for this user alone, that goes away with this value.
struct Folder(PathBuf);

impl Folder {
    fn new() -> std::io::Result<Self> {
        let temporary = std::path::absolute(std::env::temp_dir())?;
        let mut number = 0;
        loop {
            let path = temporary.join(format!("kerf-replay-{}-{number}", std::process::id()));
            match std::fs::DirBuilder::new().mode(0o700).create(&path) {
                Ok(()) => return Ok(Self(path)),
                // One that was left over by a process that was killed.
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

    /// Adds what the nodes complained about.
    fn complain(&self, failure: Failure) -> ReplayError {
        let Failure { status, mut message } = failure;
        let log = std::fs::read_to_string(self.0.join(LOG)).unwrap_or_default();
        for line in complaints(&log) {
            message += &format!("\n  {line}");
        }
        ReplayError::Stack { status: status as u8, message }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Nobody is left who would miss it.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The last warnings and errors of a log.
fn complaints(log: &str) -> Vec<&str> {
    let is_one = |line: &&str| ["[WARN]", "[ERROR]", "panicked"].iter().any(|it| line.contains(it));
    let all: Vec<&str> = log.lines().filter(is_one).collect();
    all[all.len().saturating_sub(COMPLAINTS_MAX)..].to_vec()
}
