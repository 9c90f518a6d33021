//! Replay: today's cores on yesterday's inputs.
//!
//! Time comes from the bag. Reads a recording, runs loader, planner and driver
//! cores on what they were given then, and says what is different now. It
//! fails when nothing was compared: a replay that looks at nothing proves nothing.
//!
//! - `recording`: what a bag holds; `migration`: how older definitions are read; `given`: what a core
//!   is given, `guard`: whether it is all there
//! - `loader`, `planner`, `driver`: one core each; `run_end`, `states`: what the driver says of a run
//! - `compare`, `path_difference`, `controller_lines`, `tolerances`: what counts as the same
//! - `output`, `update`, `trim`: new bags; `report`: what is said

pub mod compare;
mod controller_lines;
mod driver;
pub mod error;
mod given;
mod guard;
mod loader;
mod migration;
pub mod output;
pub mod path_difference;
pub mod path_distance;
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
use given::Given;
use guard::{Contents, absent};
use output::Output;
use planner::Replanned;
use recording::Recording;
use run_recorder::bag_reader::{LATE, Problem, RUN_RECORD};
use run_recorder::files;
use std::path::Path;
use std::sync::Arc;

/// A core.
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
    /// All cores; the stack takes seconds and is only replayed when it is asked for.
    pub const ALL: [Self; 3] = [Self::Loader, Self::Planner, Self::Driver];

    /// As it is called on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Loader => "loader",
            Self::Planner => "planner",
            Self::Driver => "driver",
            Self::Stack => "stack",
        }
    }
}

/// What came of one bag.
#[derive(Debug)]
pub struct Verdict {
    /// By level.
    comparisons: Vec<(Level, Comparison)>,
    /// What the cores make now, as messages.
    pub outputs: Vec<Output>,
    given: Given,
    /// What the planner makes now; empty when it was not asked.
    pub plans: Vec<Replanned>,
    /// What the driver makes now; `None` when it was not asked, or could not be.
    played: Option<Played>,
}

/// Whether a bag is reproduced at every level, and what is said of it.
pub fn check(path: &Path) -> Result<(bool, String), ReplayError> {
    let verdict = replay(path, &Level::ALL, Options::default())?;
    Ok((verdict.is_reproduced(), verdict.report(&path.display().to_string(), false)))
}

/// Plays the level `stack`, which starts processes: what it compares is the recording.
pub type PlayStack<'a> = dyn Fn(&Recording, &mut Comparison) -> Result<(), ReplayError> + 'a;

/// Keeps a program, by name and text, that the planner accepts and its audit refuses.
pub type KeepProgram<'a> = dyn Fn(&str, &[u8], &Disagreement) + 'a;

/// How bags are replayed, besides the levels.
#[derive(Clone, Copy, Default)]
pub struct Options<'a> {
    /// Each core is given what the one before it makes now.
    pub is_chain: bool,
    /// Whoever asks for the level `stack` brings what plays it.
    pub play_stack: Option<&'a PlayStack<'a>>,
    /// Where planner and audit disagree, the program is evidence.
    pub keep_program: Option<&'a KeepProgram<'a>>,
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
/// It cannot be compared: a file that is none, damage, something missing.
pub fn replay(path: &Path, levels: &[Level], options: Options<'_>) -> Result<Verdict, ReplayError> {
    let mut bag = files::open_bag(path)?;
    let recording = Recording::read(&mut bag)?;
    bag.verify_indexes()?;
    let contents = Contents::new(bag.channels(), bag.metadata_named(RUN_RECORD));
    let listed = |is_meant: &dyn Fn(&Problem) -> bool| -> Vec<String> {
        bag.problems().iter().filter(|it| is_meant(it)).map(ToString::to_string).collect()
    };
    // Whatever is lost may have been an input of any level, or what it is compared with.
    let damages = listed(&|it| it.is_damage() && !it.is_of_index());
    if !damages.is_empty() {
        return Err(ReplayError::Damaged(damages.join("; ")));
    }
    // A whole file says what it holds, with and without metadata.yaml and its indexes.
    let is_beside = |it: &Problem| {
        it.is_of_index() || matches!(it, Problem::NoMetadataFile | Problem::FileNotListed { .. })
    };
    let remarks = listed(&is_beside);
    let gaps = listed(&|problem| match problem {
        // A topic without definition is none of ours.
        Problem::SchemaMissing { .. } => false,
        problem if is_beside(problem) => false,
        // What the cores are replayed from was had from the driver and the others.
        Problem::RecorderSays { reason } => reason != LATE,
        _ => true,
    });
    let definitions = Arc::new(recording.definitions.clone());
    let given = Given::new(recording, options.is_chain);
    let mut verdict = Verdict {
        comparisons: Vec::new(),
        outputs: Vec::new(),
        given,
        plans: Vec::new(),
        played: None,
    };
    for &level in levels {
        absent(level, &contents, &verdict.given.recording)?;
        let mut comparison = Comparison::new(Arc::clone(&definitions));
        for text in remarks.iter().chain(&gaps) {
            comparison.remark("bag", text.clone());
        }
        let Verdict { outputs, given, plans, played, .. } = &mut verdict;
        match level {
            Level::Loader => loader::replay(given, &mut comparison, outputs)?,
            Level::Planner => *plans = planner::replay(given, options, &mut comparison, outputs)?,
            Level::Driver if gaps.is_empty() => {
                *played = driver::replay(given, &mut comparison, outputs)?;
                if let Some(played) = played {
                    run_end::compare(&given.recording, played, &mut comparison)?;
                }
            }
            Level::Stack if gaps.is_empty() => {
                let play = options.play_stack.ok_or(ReplayError::NoStack)?;
                play(&given.recording, &mut comparison)?;
            }
            Level::Driver | Level::Stack => {
                return Err(ReplayError::Gaps { level: level.name(), gaps: gaps.join("; ") });
            }
        }
        if comparison.has_seen_nothing() {
            comparison.differs(level.name(), "nothing", "nothing was compared");
        }
        verdict.comparisons.push((level, comparison));
    }
    Ok(verdict)
}
