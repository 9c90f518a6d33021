//! What a bag holds for the cores: their inputs, and their recorded outputs.
//!
//! Reads a bag once, by topic name in any namespace, and assembles chunks. Other modules run the
//! cores.

use super::migration::{Definitions, profile_of_then, rename_parameters};
use super::run_result::{self, STATUS_TOPIC};
use super::{Level, ReplayError};
use cnc_msgs::chunk::{ChunkError, Collector, ContourChunks};
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::interface::Message;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use cnc_msgs::wire::action_msgs::msg::GoalStatusArray;
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use run_recorder::bag_reader::{Bag, BagMessage, LATE, Problem, RUN_RECORD};
use run_recorder::info::RunEnd;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::{Read, Seek};
use std::sync::Arc;

/// A program as it was loaded.
#[derive(Debug, Clone)]
pub struct RecordedProgram {
    pub text: Vec<u8>,
    pub manifest: wire::ProgrammedContour,
    pub contour: Arc<ProgrammedContour>,
    /// Recording time of the manifest.
    pub log_time_ns: u64,
}

impl RecordedProgram {
    /// The control for which it was loaded.
    pub fn profile(&self) -> Result<Profile, ReplayError> {
        profile_of_then(&self.manifest.profile)
            .map_err(|reason| ReplayError::Input { of: self.manifest.program_id.clone(), reason })
    }
}

/// A plan; may be a refused one.
#[derive(Debug, Clone)]
pub struct RecordedPlan {
    pub report: wire::CompensationReport,
    /// `None` when it was refused.
    pub manifest: Option<wire::CompensatedPath>,
    pub path: Option<Arc<CompensatedPath>>,
    /// Recording time of the report.
    pub log_time_ns: u64,
}

/// A state on its topic.
#[derive(Debug, Clone)]
pub struct RecordedState {
    pub state: wire::MachineState,
    /// Recording time.
    pub at_ns: i64,
    /// Publication time.
    pub published_ns: i64,
}

/// Everything that replay needs from a bag.
#[derive(Debug, Default)]
pub struct Recording {
    /// By program id.
    pub programs: BTreeMap<String, RecordedProgram>,
    /// By revision.
    pub tool_tables: BTreeMap<u64, ToolTable>,
    /// By revision.
    pub plans: BTreeMap<u64, RecordedPlan>,
    /// By sequence.
    pub traffic: BTreeMap<u64, (u64, wire::TrafficEntry)>,
    /// In order.
    pub states: Vec<RecordedState>,
    /// The newest parameters of each node, by its name without namespace.
    pub parameters: BTreeMap<String, wire::NodeParameters>,
    /// The definitions of the bag's types.
    pub(crate) definitions: Definitions,
    /// The recorded requests to nodes, in order.
    pub commands: Vec<wire::Command>,
    /// The last identification of the controller.
    pub settings: Option<wire::ControllerSettings>,
    /// Results of the goals of `run_program`, in order.
    pub goals: Vec<GoalStatusArray>,
    /// Results of runs, in order; the first may be of an earlier bag.
    pub results: Vec<wire::RunResult>,
    /// The bag is not older than the topic of results.
    pub(crate) has_result_topic: bool,
    /// The goal that the bag was recorded for.
    pub goal_id: Option<String>,
    /// States that were sent but did not reach the recorder, if it counted them.
    pub missed_states: Option<u64>,
    /// The recorder started in the middle of the run, and says so: earlier messages are missing.
    pub begins_late: bool,
    /// What the bag should hold but does not; it is left out above.
    pub missing: Vec<Missing>,
}

/// How many states the recorder reports as missed.
fn missed_states<R: Read + Seek>(bag: &Bag<R>) -> Option<u64> {
    let closing = bag.closing().filter(|closing| !closing.written.is_empty())?;
    let mut topics = bag.channels().iter();
    let states = topics.find(|topic| topic.type_name() == wire::MachineState::TYPE_NAME)?;
    Some(closing.missed.get(&states.topic).copied().unwrap_or(0))
}

/// A time of the wall clock, ns.
pub fn nanoseconds(stamp: &Time) -> i64 {
    nanoseconds_of(stamp.sec, stamp.nanosec)
}

/// When an entry was made, by the driver's clock, ns; 0 for an invalid time.
pub fn monotonic_ns(entry: &wire::TrafficEntry) -> u64 {
    let since = nanoseconds_of(entry.monotonic.sec, entry.monotonic.nanosec);
    u64::try_from(since).unwrap_or(0)
}

fn nanoseconds_of(sec: i32, nanosec: u32) -> i64 {
    i64::from(sec) * 1_000_000_000 + i64::from(nanosec)
}

/// A driver that is restarted numbers its entries anew.
const TWO_DRIVERS: &str = "one journal (the driver was started again in this bag)";

/// Something without which some levels cannot be replayed.
#[derive(Debug)]
pub struct Missing {
    pub what: &'static str,
    pub of: String,
    pub levels: &'static [Level],
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} is not in the bag", self.what, self.of)
    }
}

/// Messages in the order of the bag, before chunks are assembled.
#[derive(Default)]
struct Gathered {
    programs: BTreeMap<String, wire::Program>,
    program_chunks: Vec<wire::ProgramChunk>,
    contours: BTreeMap<String, (u64, wire::ProgrammedContour)>,
    contour_chunks: Vec<wire::ContourChunk>,
    paths: BTreeMap<u64, (u64, wire::CompensatedPath)>,
    path_chunks: Vec<wire::PathChunk>,
    reports: BTreeMap<u64, (u64, wire::CompensationReport)>,
}

/// The types that replay reads: messages of other types may be missing.
pub const READ_TYPES: [&str; 15] = [
    wire::Program::TYPE_NAME,
    wire::ProgramChunk::TYPE_NAME,
    wire::ProgrammedContour::TYPE_NAME,
    wire::ContourChunk::TYPE_NAME,
    wire::CompensatedPath::TYPE_NAME,
    wire::PathChunk::TYPE_NAME,
    wire::CompensationReport::TYPE_NAME,
    wire::ToolTable::TYPE_NAME,
    wire::ControllerTraffic::TYPE_NAME,
    wire::MachineState::TYPE_NAME,
    wire::NodeParameters::TYPE_NAME,
    wire::ControllerSettings::TYPE_NAME,
    wire::Command::TYPE_NAME,
    wire::RunResult::TYPE_NAME,
    GoalStatusArray::TYPE_NAME,
];

impl Recording {
    /// Reads a whole bag.
    pub fn read<R: Read + Seek>(bag: &mut Bag<R>) -> Result<Self, ReplayError> {
        let mut recording = Self::default();
        let mut gathered = Gathered::default();
        let mut numbers: BTreeMap<usize, u64> = BTreeMap::new();
        for message in bag.messages() {
            let message = message?;
            let number = numbers.entry(message.channel_index).or_default();
            *number += 1;
            recording.sort(&message, *number, &mut gathered)?;
        }
        recording.put_together(gathered)?;
        recording.missed_states = missed_states(bag);
        recording.has_result_topic = run_result::has_result_topic(bag);
        recording.goal_id =
            bag.metadata_named(RUN_RECORD).and_then(|it| it.get("goal_id").cloned());
        recording.begins_late = bag
            .problems()
            .iter()
            .any(|problem| matches!(problem, Problem::RecorderSays { reason } if reason == LATE));
        Ok(recording)
    }

    /// The earliest stamp of traffic and states, ns since the epoch: on a page and in a report this
    /// is the time 0.
    pub fn begin_ns(&self) -> Option<i64> {
        let traffic = self.traffic.values().map(|(_, entry)| nanoseconds(&entry.stamp));
        let states = self.states.iter().map(|it| nanoseconds(&it.state.header.stamp));
        traffic.chain(states).min()
    }

    /// How the run ended for which the bag was recorded.
    pub fn end(&self) -> Option<RunEnd> {
        let goal = self.goal_id.as_deref()?;
        Some(match run_result::last_result(&self.results, goal) {
            Some(result) => run_result::of_message(result),
            None => run_result::without_result(
                run_result::last_status(&self.goals, goal),
                self.states.iter().map(|it| &it.state),
                self.has_result_topic,
            ),
        })
    }

    /// Whether the goal was only checked: nothing was sent to the machine.
    pub(crate) fn is_check(&self) -> bool {
        self.end().is_some_and(|end| end.outcome == run_result::CHECKED)
    }

    /// The recorded path of a program and a revision.
    pub fn path(&self, program_id: &str, revision: u64) -> Option<Arc<CompensatedPath>> {
        let plan = self.plans.get(&revision)?;
        (plan.report.program_id == program_id).then(|| plan.path.clone()).flatten()
    }

    fn sort(
        &mut self,
        message: &BagMessage,
        number: u64,
        to: &mut Gathered,
    ) -> Result<(), ReplayError> {
        let at = message.log_time_ns;
        match message.channel.type_name() {
            wire::Program::TYPE_NAME => {
                let program: wire::Program = self.definitions.decode(message, number)?;
                to.programs.insert(program.program_id.clone(), program);
            }
            wire::ProgramChunk::TYPE_NAME => {
                to.program_chunks.push(self.definitions.decode(message, number)?)
            }
            wire::ProgrammedContour::TYPE_NAME => {
                let contour: wire::ProgrammedContour = self.definitions.decode(message, number)?;
                to.contours.insert(contour.program_id.clone(), (at, contour));
            }
            wire::ContourChunk::TYPE_NAME => {
                to.contour_chunks.push(self.definitions.decode(message, number)?)
            }
            wire::CompensatedPath::TYPE_NAME => {
                let path: wire::CompensatedPath = self.definitions.decode(message, number)?;
                to.paths.insert(path.revision, (at, path));
            }
            wire::PathChunk::TYPE_NAME => {
                to.path_chunks.push(self.definitions.decode(message, number)?)
            }
            wire::CompensationReport::TYPE_NAME => {
                let report: wire::CompensationReport = self.definitions.decode(message, number)?;
                to.reports.insert(report.revision, (at, report));
            }
            wire::ToolTable::TYPE_NAME => {
                let table: wire::ToolTable = self.definitions.decode(message, number)?;
                let checked = ToolTable::try_from(&table)
                    .map_err(|error| ReplayError::content(message, number, error))?;
                self.tool_tables.insert(table.revision, checked);
            }
            wire::ControllerTraffic::TYPE_NAME => {
                let traffic: wire::ControllerTraffic = self.definitions.decode(message, number)?;
                for entry in traffic.entries {
                    let number = entry.sequence;
                    // A fetched entry may also have arrived on its topic.
                    let (_, known) = self.traffic.entry(number).or_insert((at, entry.clone()));
                    let is_other = known.monotonic != entry.monotonic;
                    if is_other && self.missing.iter().all(|it| it.what != TWO_DRIVERS) {
                        let of = format!("controller_traffic from entry {number} on");
                        self.missing.push(Missing {
                            what: TWO_DRIVERS,
                            of,
                            levels: &[Level::Driver, Level::Stack],
                        });
                    }
                }
            }
            wire::MachineState::TYPE_NAME => {
                let state = self.definitions.decode(message, number)?;
                let ns = |time_ns| i64::try_from(time_ns).unwrap_or(i64::MAX);
                let (at_ns, published_ns) = (ns(at), ns(message.publish_time_ns));
                self.states.push(RecordedState { state, at_ns, published_ns });
            }
            wire::Command::TYPE_NAME => {
                self.commands.push(self.definitions.decode(message, number)?)
            }
            wire::ControllerSettings::TYPE_NAME => {
                self.settings = Some(self.definitions.decode(message, number)?);
            }
            GoalStatusArray::TYPE_NAME if message.channel.topic.ends_with(STATUS_TOPIC) => {
                self.goals.push(self.definitions.decode(message, number)?);
            }
            wire::RunResult::TYPE_NAME => {
                self.results.push(self.definitions.decode(message, number)?)
            }
            wire::NodeParameters::TYPE_NAME => {
                let mut parameters: wire::NodeParameters =
                    self.definitions.decode(message, number)?;
                rename_parameters(&mut parameters);
                let name = parameters.node.rsplit('/').next().unwrap_or_default().to_owned();
                self.parameters.insert(name, parameters);
            }
            _ => {}
        }
        Ok(())
    }

    fn put_together(&mut self, mut gathered: Gathered) -> Result<(), ReplayError> {
        use Level::{Loader, Planner};
        let missing = &mut self.missing;
        let after = AfterRun::of(&self.states, &gathered.reports);
        let mut lack = |what, of: &str, levels| {
            missing.push(Missing { what, of: of.to_owned(), levels });
        };
        for (id, (log_time_ns, mut manifest)) in gathered.contours {
            let in_contour = spoilt(format!("the contour of {id}"));
            let contour = Collector::for_contour(&manifest).map_err(&in_contour)?;
            let mut contour = self.definitions.sealed(contour);
            collect(&mut contour, &mut gathered.contour_chunks).map_err(&in_contour)?;
            let is_later = after.has_program(&id, log_time_ns);
            if contour.missing().is_some() {
                if !is_later {
                    lack("a chunk of the contour", &id, &[Loader, Planner]);
                }
                continue;
            }
            // The planner does not need the text.
            let mut text = Vec::new();
            match gathered.programs.remove(&id) {
                None if is_later => continue,
                None => lack("the program", &id, &[Loader]),
                Some(program) => {
                    let in_text = spoilt(format!("the text of {id}"));
                    let mut chunks = Collector::for_program(&program).map_err(&in_text)?;
                    collect(&mut chunks, &mut gathered.program_chunks).map_err(&in_text)?;
                    match chunks.missing() {
                        Some(_) if is_later => continue,
                        Some(_) => lack("a chunk of the text", &id, &[Loader]),
                        None => text = chunks.finish(&program).map_err(&in_text)?,
                    }
                }
            }
            let contour = Arc::new(contour.finish(&manifest).map_err(&in_contour)?);
            // Checksums over bytes of an older definition become those of today.
            if self.definitions.is_migrated(wire::ContourChunk::TYPE_NAME) {
                let chunks = ContourChunks::new(id.clone(), (*contour).clone());
                chunks.sha256().clone_into(&mut manifest.sha256);
            }
            let program = RecordedProgram { text, contour, manifest, log_time_ns };
            self.programs.insert(id, program);
        }
        for (revision, (log_time_ns, report)) in gathered.reports {
            let mut manifest = gathered.paths.remove(&revision);
            let began_ns = manifest.as_ref().map_or(log_time_ns, |(at, _)| *at);
            let is_later = after.has_plan(revision, began_ns);
            let of = format!("revision {revision} of {}", report.program_id);
            let path = match &mut manifest {
                None => {
                    if report.accepted && !is_later {
                        lack("the path", &of, &[Planner]);
                    }
                    None
                }
                Some((_, manifest)) => {
                    let in_path = spoilt(format!("the path, {of}"));
                    let path = Collector::for_path(manifest).map_err(&in_path)?;
                    let mut path = self.definitions.sealed(path);
                    collect(&mut path, &mut gathered.path_chunks).map_err(&in_path)?;
                    if path.missing().is_some() {
                        if !is_later {
                            lack("a chunk of the path", &of, &[Planner]);
                        }
                        None
                    } else {
                        let path = Arc::new(path.finish(manifest).map_err(&in_path)?);
                        // It is over bytes of an older definition: nothing is compared with it.
                        if self.definitions.is_migrated(wire::PathChunk::TYPE_NAME) {
                            manifest.sha256.clear();
                        }
                        Some(path)
                    }
                }
            };
            let manifest = manifest.map(|(_, manifest)| manifest);
            let is_whole = (path.is_some() || !report.accepted)
                && self.programs.contains_key(&report.program_id);
            if is_whole || !is_later {
                self.plans.insert(revision, RecordedPlan { report, manifest, path, log_time_ns });
            }
        }
        for (revision, (at, manifest)) in gathered.paths {
            let of = format!("revision {revision} of {}", manifest.program_id);
            if !after.has_plan(revision, at) {
                lack("the report on the plan", &of, &[Planner]);
            }
        }
        Ok(())
    }
}

/// What was loaded when the run had ended: it is for the next one, and the bag may end before it is whole.
struct AfterRun {
    ended_ns: Option<u64>,
    programs: BTreeSet<String>,
    revisions: BTreeSet<u64>,
}

impl AfterRun {
    fn of(
        states: &[RecordedState],
        reports: &BTreeMap<u64, (u64, wire::CompensationReport)>,
    ) -> Self {
        let last_of_run = states.iter().rposition(|it| it.state.path_revision > 0);
        let ended = last_of_run.and_then(|last| states.get(last + 1));
        let ended_ns = ended.and_then(|state| u64::try_from(state.at_ns).ok());
        let run = states.iter().map(|it| &it.state).filter(|it| it.path_revision > 0);
        let revisions: BTreeSet<u64> = run.clone().map(|it| it.path_revision).collect();
        // With the results of probes a program has another id than its run.
        let planned = revisions.iter().filter_map(|revision| reports.get(revision));
        let planned = planned.map(|(_, report)| report.program_id.clone());
        let programs = run.map(|it| it.program_id.clone()).chain(planned).collect();
        Self { ended_ns, programs, revisions }
    }

    fn has_program(&self, id: &str, began_ns: u64) -> bool {
        self.ended_ns.is_some_and(|end| began_ns > end) && !self.programs.contains(id)
    }

    fn has_plan(&self, revision: u64, began_ns: u64) -> bool {
        self.ended_ns.is_some_and(|end| began_ns > end) && !self.revisions.contains(&revision)
    }
}

/// Names the chunks that do not fit together.
fn spoilt(of: String) -> impl Fn(ChunkError) -> ReplayError {
    move |error| ReplayError::Input { of: of.clone(), reason: error.to_string() }
}

/// Moves the chunks that the collector wants out of the heap.
fn collect<C: cnc_msgs::chunk::Chunk>(
    collector: &mut Collector<C>,
    heap: &mut Vec<C>,
) -> Result<(), ChunkError> {
    let mut rest = Vec::new();
    for chunk in heap.drain(..) {
        if collector.wants(&chunk) {
            collector.add(chunk)?;
        } else {
            rest.push(chunk);
        }
    }
    *heap = rest;
    Ok(())
}
