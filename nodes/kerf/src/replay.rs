//! `kerf replay`: today's cores on yesterday's inputs.
//!
//! Time comes from the bag. Reads a recording, runs loader, planner and driver
//! cores on what they were given then, and says what is different now. It
//! fails when nothing was compared: a replay that looks at nothing proves nothing.

mod compare;
mod controller_lines;
mod driver;
mod error;
mod given;
mod guard;
mod loader;
mod migration;
mod output;
pub(crate) mod path_difference;
pub(crate) mod planner;
pub(crate) mod recording;
mod refused_loads;
mod report;
mod run_end;
pub(crate) mod run_result;
mod stack;
mod states;
mod tolerances;
pub(crate) mod trim;
mod update;

use crate::exit::{Failure, Outcome, Status};
use crate::output_file::OutputFile;
use crate::page::{Page, of_recording};
use clap::{Args, ValueEnum};
use compare::Comparison;
use driver::Played;
pub(crate) use error::ReplayError;
use given::Given;
use guard::{Contents, absent};
use output::Output;
use planner::Replanned;
use recording::Recording;
use run_recorder::bag_reader::{LATE, Problem, RUN_RECORD};
use run_recorder::files;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What `kerf replay` takes.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// Bag directories or .mcap files
    #[arg(required_unless_present = "tolerances")]
    bags: Vec<PathBuf>,
    /// Only this core, or the whole stack; all cores when left out
    #[arg(long, value_enum)]
    level: Option<Level>,
    /// Give each core what the one before it makes now, instead of what was recorded
    #[arg(long)]
    chain: bool,
    /// Write what the cores make now as a bag, NAME.mcap, into this directory
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Show what was and what is now on one page for a browser
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print every difference, not only the first twenty of each core
    #[arg(long)]
    all: bool,
    /// Print one JSON object with every difference instead of the report
    #[arg(long, conflicts_with = "all")]
    json: bool,
    /// Show what is different, then write what the cores make now into the bag; its inputs
    /// stay as they are
    #[arg(long, conflicts_with_all = ["level", "json"])]
    update: bool,
    /// Print what counts as the same, field by field, and why
    #[arg(long, exclusive = true)]
    tolerances: bool,
}

impl ReplayArgs {
    /// The levels that are replayed: in a chain, those before the one that is asked for too.
    fn levels(&self) -> Vec<Level> {
        let last = Level::ALL.iter().position(|level| Some(*level) == self.level);
        match (last, self.level) {
            (_, None) => Level::ALL.to_vec(),
            (Some(last), Some(_)) if self.chain => Level::ALL[..=last].to_vec(),
            (_, Some(level)) => vec![level],
        }
    }
}

/// A core.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Level {
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
    const ALL: [Self; 3] = [Self::Loader, Self::Planner, Self::Driver];

    const fn name(self) -> &'static str {
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
pub(crate) struct Verdict {
    /// By level.
    comparisons: Vec<(Level, Comparison)>,
    outputs: Vec<Output>,
    given: Given,
    /// What the planner makes now; empty when it was not asked.
    plans: Vec<Replanned>,
    /// What the driver makes now; `None` when it was not asked, or could not be.
    played: Option<Played>,
}

/// Replays each bag and reports.
pub(crate) fn run(args: &ReplayArgs) -> Outcome {
    if args.tolerances {
        print!("{}", tolerances::table());
        return Ok(());
    }
    let levels = args.levels();
    if args.chain && levels == [Level::Stack] {
        return Err(Failure::usage("--chain is for cores; the stack is a chain already"));
    }
    // The stack makes folders, and each of its bags has a name that is new.
    let out = args.out.as_deref().filter(|_| levels != [Level::Stack]);
    if let Some(directory) = out {
        output::must_be_free(directory, &args.bags)
            .map_err(|error| Failure::new(error.status(), error.to_string()))?;
    }
    let bags: Vec<&Path> = args.bags.iter().map(PathBuf::as_path).collect();
    let html = OutputFile::claim_if(args.html.as_deref(), &bags)?;
    let mut told = Told::default();
    let mut failed = None;
    for path in &args.bags {
        let count = told.reports.len();
        let Err(failure) = told.replay(args, path, &levels, out) else { continue };
        failure.say();
        if told.reports.len() == count {
            let bag = path.display().to_string();
            told.reports.push(json!({ "bag": bag, "error": failure.message }));
        }
        // One broken bag does not hide the others; where the stack failed, or was
        // interrupted, no other is begun.
        if failure.status != Status::Usage {
            failed = Some(failure.status);
            break;
        }
        failed = Some(failed.unwrap_or(failure.status));
    }
    if args.json {
        let is_reproduced = !told.differs && failed.is_none();
        println!("{}", json!({ "reproduced": is_reproduced, "bags": told.reports }));
    }
    if let Some(file) = html.filter(|_| !told.page.sheets.is_empty()) {
        file.write(&told.page.to_html())?;
    }
    match failed {
        Some(status) => Err(Failure::said(status)),
        None if told.differs => Err(Failure::said(Status::Refused)),
        None => Ok(()),
    }
}

/// What came of the bags so far.
#[derive(Default)]
struct Told {
    /// One is DIFFERENT, and stays so.
    differs: bool,
    page: Page,
    /// With `--json`, an object for each bag.
    reports: Vec<Value>,
}

impl Told {
    /// Replays one bag: first the report, then what is written of it.
    fn replay(
        &mut self,
        args: &ReplayArgs,
        path: &Path,
        levels: &[Level],
        out: Option<&Path>,
    ) -> Result<(), Failure> {
        let shown = path.display().to_string();
        let of_bag = |error: ReplayError| error.of(path);
        let how = How { is_chain: args.chain || args.update, out: args.out.as_deref() };
        let verdict = replay(path, levels, how).map_err(of_bag)?;
        self.differs |= !verdict.is_reproduced() && !args.update;
        if args.json {
            self.reports.push(verdict.to_json(&shown));
        } else {
            print!("{}", verdict.report(&shown, args.all));
        }
        if let Some(directory) = out {
            output::write(directory, path, &verdict.outputs).map_err(of_bag)?;
        }
        if args.html.is_some() {
            verdict.show(&mut self.page, &shown).map_err(of_bag)?;
        }
        if args.update {
            let again = |path: &Path| replay(path, levels, How::default());
            println!("  {}", update::update(path, &verdict, again).map_err(of_bag)?);
        }
        Ok(())
    }
}

/// One page of a bag, as it was recorded: `kerf bag report`.
pub(crate) fn report_page(path: &Path) -> Result<Page, ReplayError> {
    let mut bag = files::open_bag(path)?;
    let recording = Recording::read(&mut bag)?;
    let mut problems: Vec<String> = bag.problems().iter().map(ToString::to_string).collect();
    problems.extend(recording.missing.iter().map(ToString::to_string));
    if recording.plans.is_empty() {
        problems.push("no plan is in the bag".to_owned());
    }
    let mut page = Page::default();
    of_recording(&mut page, &path.display().to_string(), &recording, &[], |sheet| {
        sheet.good = problems.is_empty();
        sheet.verdict = if sheet.good { "complete".into() } else { "not complete".into() };
        sheet.summary = problems.join("\n");
    })?;
    if page.sheets.iter().all(|sheet| sheet.layers.is_empty() && sheet.run.is_none()) {
        return Err(ReplayError::NothingToShow);
    }
    Ok(page)
}

/// Whether a bag is reproduced at every level, and what is said of it.
pub(crate) fn check(path: &Path) -> Result<(bool, String), ReplayError> {
    let verdict = replay(path, &Level::ALL, How::default())?;
    Ok((verdict.is_reproduced(), verdict.report(&path.display().to_string(), false)))
}

/// How bags are replayed, beside the levels.
#[derive(Debug, Clone, Copy, Default)]
struct How<'a> {
    /// Each core is given what the one before it makes now.
    is_chain: bool,
    /// Where the stack writes its bag.
    out: Option<&'a Path>,
}

fn replay(path: &Path, levels: &[Level], how: How<'_>) -> Result<Verdict, ReplayError> {
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
    let given = Given::new(recording, how.is_chain);
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
            Level::Planner => *plans = planner::replay(given, &mut comparison, outputs)?,
            Level::Driver if gaps.is_empty() => {
                *played = driver::replay(given, &mut comparison, outputs)?;
                if let Some(played) = played {
                    run_end::compare(&given.recording, played, &mut comparison)?;
                }
            }
            Level::Stack if gaps.is_empty() => {
                stack::replay(&given.recording, path, how.out, &mut comparison)?;
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
