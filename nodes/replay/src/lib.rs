//! Replay: runs today's cores on recorded inputs.
//!
//! Time comes from the bag. Reads a recording, runs the cores of loader, planner and driver on
//! their recorded inputs, and reports what is different now. It fails when nothing was compared:
//! such a replay proves nothing.
//!
//! - `recording`: what a bag holds; `migration`: how older definitions are read; `inputs`: the
//!   inputs of a core; `guard`: whether all inputs are there
//! - `loader`, `planner`, `driver`: one core each; `run_end`, `states`: the driver's result and
//!   states of a run
//! - `bounds`: bounds of a program in old and new bags
//! - `compare`, `path_difference`, `controller_lines`, `tolerances`: what counts as the same
//! - `output`, `update`, `trim`: new bags; `report`: the texts

pub mod bounds;
pub mod compare;
mod controller_lines;
mod driver;
pub mod error;
mod guard;
mod inputs;
mod loader;
mod migration;
pub mod output;
pub mod path_difference;
pub mod path_distance;
mod plan_memo;
pub mod planner;
pub mod recording;
mod refused_loads;
mod report;
mod run_end;
pub mod run_result;
mod states;
pub mod tolerances;
pub mod trim;
pub mod update;

use compare::Comparison;
use compensation_planner::verdict::Disagreement;
use driver::Played;
pub use error::ReplayError;
use guard::{Contents, absent};
use inputs::CoreInputs;
pub use migration::{completed, with_names_of_today};
use output::CoreOutput;
pub use plan_memo::PlanMemo;
use planner::PlannedToday;
use recording::Recording;
use run_recorder::bag_reader::{Bag, LATE, Problem, RUN_RECORD};
use run_recorder::files;
use std::io::{Read, Seek};
use std::path::Path;
use std::sync::Arc;

/// A core, or all nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Program text to contour
    Loader,
    /// Contour and tool table to path
    Planner,
    /// Commands and received bytes to transmitted bytes
    Driver,
    /// All nodes over DDS with the virtual controller; takes seconds
    Stack,
}

impl Level {
    /// All cores; the stack takes seconds and is replayed on request only.
    pub const ALL: [Self; 3] = [Self::Loader, Self::Planner, Self::Driver];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Loader => "loader",
            Self::Planner => "planner",
            Self::Driver => "driver",
            Self::Stack => "stack",
        }
    }
}

/// The result of replaying one bag.
#[derive(Debug)]
pub struct ReplayResult {
    /// By level.
    comparisons: Vec<(Level, Comparison)>,
    /// What the cores make now, as messages.
    pub outputs: Vec<CoreOutput>,
    inputs: CoreInputs,
    /// What the planner makes now; empty when it was not replayed.
    pub plans: Vec<PlannedToday>,
    /// What the driver makes now; `None` when it was not replayed, or could not be.
    played: Option<Played>,
}

/// Whether a bag is reproduced at every level, and the report.
pub fn check(path: &Path) -> Result<(bool, String), ReplayError> {
    let result = replay(path, &Level::ALL, Options::default())?;
    Ok((result.is_reproduced(), result.report(&path.display().to_string(), false)))
}

/// Plays the level `stack`, which starts processes, and compares it with the recording.
pub type PlayStack<'a> = dyn Fn(&Recording, &mut Comparison) -> Result<(), ReplayError> + 'a;

/// Keeps a program, by name and text, that the planner accepts and its audit rejects.
pub type KeepProgram<'a> = dyn Fn(&str, &[u8], &Disagreement) + 'a;

/// How bags are replayed, apart from the levels.
#[derive(Clone, Copy, Default)]
pub struct Options<'a> {
    /// Each core gets what the core before it makes now.
    pub is_chain: bool,
    /// Plays the level `stack`; only callers that replay it need one.
    pub play_stack: Option<&'a PlayStack<'a>>,
    /// Keeps the program where planner and audit disagree, as evidence.
    pub keep_program: Option<&'a KeepProgram<'a>>,
    /// Plans that other bags have in common with this one; without it each bag is planned by itself.
    pub memo: Option<&'a PlanMemo>,
}

impl Options<'_> {
    fn keep(self, name: &str, text: &[u8], found: &Disagreement) {
        if let Some(keep) = self.keep_program {
            keep(name, text, found);
        }
    }
}

impl std::fmt::Debug for Options<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Options").field("is_chain", &self.is_chain).finish_non_exhaustive()
    }
}

/// Replays one bag.
///
/// # Errors
/// The bag cannot be compared: it is not a bag, is damaged, or lacks something.
pub fn replay(
    path: &Path,
    levels: &[Level],
    options: Options<'_>,
) -> Result<ReplayResult, ReplayError> {
    replay_opened(&mut files::open_bag(path)?, levels, options)
}

/// Replays a bag that is open, from files or from memory.
///
/// # Errors
/// As [`replay`].
pub fn replay_opened<R: Read + Seek>(
    bag: &mut Bag<R>,
    levels: &[Level],
    options: Options<'_>,
) -> Result<ReplayResult, ReplayError> {
    let recording = Recording::read(bag)?;
    bag.verify_indexes()?;
    let contents = Contents::new(bag.channels(), bag.metadata_named(RUN_RECORD));
    let listed = |is_meant: &dyn Fn(&Problem) -> bool| -> Vec<String> {
        bag.problems().iter().filter(|it| is_meant(it)).map(ToString::to_string).collect()
    };
    // Anything lost may have been an input of any level, or what it is compared with.
    let damages = listed(&|it| it.is_damage() && !it.is_of_index());
    if !damages.is_empty() {
        return Err(ReplayError::Damaged(damages.join("; ")));
    }
    // A whole file says what it holds, with or without metadata.yaml and indexes.
    let is_harmless = |it: &Problem| {
        it.is_of_index() || matches!(it, Problem::NoMetadataFile | Problem::FileNotListed { .. })
    };
    let mut remarks = listed(&is_harmless);
    let gaps = listed(&|problem| match problem {
        // A topic without a definition is not a topic of this project.
        Problem::SchemaMissing { .. } => false,
        problem if is_harmless(problem) => false,
        // A recorder that started late has fetched the inputs of the cores from the nodes.
        Problem::RecorderSays { reason } => reason != LATE,
        _ => true,
    });
    let definitions = Arc::new(recording.definitions.clone());
    let inputs = CoreInputs::new(recording, options.is_chain);
    let mut result = ReplayResult {
        comparisons: Vec::new(),
        outputs: Vec::new(),
        inputs,
        plans: Vec::new(),
        played: None,
    };
    // The plan of a goal that was only checked is all that there is.
    let is_left_out = |level: Level| {
        level == Level::Driver && levels.len() > 1 && result.inputs.recording.is_check()
    };
    let (left_out, levels): (Vec<Level>, Vec<Level>) =
        levels.iter().partition(|it| is_left_out(**it));
    if !left_out.is_empty() {
        remarks.push("its goal was only checked: the driver has sent nothing to replay".to_owned());
    }
    for level in levels {
        absent(level, &contents, &result.inputs.recording)?;
        let mut comparison = Comparison::new(Arc::clone(&definitions));
        for text in remarks.iter().chain(&gaps) {
            comparison.remark("bag", text.clone());
        }
        let ReplayResult { outputs, inputs, plans, played, .. } = &mut result;
        match level {
            Level::Loader => loader::replay(inputs, &mut comparison, outputs)?,
            Level::Planner => *plans = planner::replay(inputs, options, &mut comparison, outputs)?,
            Level::Driver if gaps.is_empty() => {
                *played = driver::replay(inputs, &mut comparison, outputs)?;
                if let Some(played) = played {
                    run_end::compare(&inputs.recording, played, &mut comparison)?;
                }
            }
            Level::Stack if gaps.is_empty() => {
                let play = options.play_stack.ok_or(ReplayError::NoStack)?;
                play(&inputs.recording, &mut comparison)?;
            }
            Level::Driver | Level::Stack => {
                return Err(ReplayError::Gaps { level: level.name(), gaps: gaps.join("; ") });
            }
        }
        if comparison.is_empty() {
            comparison.differs(level.name(), "nothing", "nothing was compared");
        }
        result.comparisons.push((level, comparison));
    }
    Ok(result)
}
