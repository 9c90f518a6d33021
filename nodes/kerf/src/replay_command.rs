//! `kerf replay`: runs today's cores on recorded inputs. The crate `replay` does the work.

use crate::exit::{CommandResult, Failure, Status, printed};
use crate::output_file::OutputFile;
use crate::page::{Page, of_recording};
use crate::plan::keep_for_report;
use crate::stack_replay;
use clap::{Args, ValueEnum};
use replay::compare::Comparison;
use replay::recording::Recording;
use replay::update::update;
use replay::{Level, Options, ReplayError, ReplayResult, output, replay, tolerances};
use run_recorder::files;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Differences of a core that a page lists.
const SHOWN_ON_PAGE_MAX: usize = 2000;

/// What `kerf replay` takes.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// Bag directories or .mcap files
    #[arg(required_unless_present = "tolerances")]
    bags: Vec<PathBuf>,
    /// Replay only this core, or the whole stack [default: all cores]
    #[arg(long, value_enum)]
    level: Option<LevelArgument>,
    /// Give each core what the core before it makes now, instead of its recorded input
    #[arg(long)]
    chain: bool,
    /// Write what the cores make now as a bag, NAME.mcap, into this directory
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write a page for a browser with recorded and new results
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print every difference, not only the first twenty of each core
    #[arg(long)]
    all: bool,
    /// Print one JSON object with every difference instead of the report
    #[arg(long, conflicts_with = "all")]
    json: bool,
    /// Show the differences, then replace the outputs in the bag; its inputs stay
    #[arg(long, conflicts_with_all = ["level", "json"])]
    update: bool,
    /// Print which fields count as the same within which tolerance, and why
    #[arg(long, exclusive = true)]
    tolerances: bool,
}

impl ReplayArgs {
    /// The replayed levels; in a chain also those before the requested one.
    fn levels(&self) -> Vec<Level> {
        let wanted = self.level.map(Level::from);
        let last = Level::ALL.iter().position(|level| Some(*level) == wanted);
        match (last, wanted) {
            (_, None) => Level::ALL.to_vec(),
            (Some(last), Some(_)) if self.chain => Level::ALL[..=last].to_vec(),
            (_, Some(level)) => vec![level],
        }
    }
}

/// A core, or all of them together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LevelArgument {
    /// Program text to contour
    Loader,
    /// Contour and tool table to path
    Planner,
    /// Commands and received bytes to transmitted bytes
    Driver,
    /// All nodes over DDS with the virtual controller; takes seconds
    Stack,
}

impl From<LevelArgument> for Level {
    fn from(level: LevelArgument) -> Self {
        match level {
            LevelArgument::Loader => Self::Loader,
            LevelArgument::Planner => Self::Planner,
            LevelArgument::Driver => Self::Driver,
            LevelArgument::Stack => Self::Stack,
        }
    }
}

/// Replays each bag and reports.
pub(crate) fn run(args: &ReplayArgs) -> CommandResult {
    if args.tolerances {
        print!("{}", tolerances::table());
        return Ok(());
    }
    let levels = args.levels();
    if args.chain && levels == [Level::Stack] {
        return Err(Failure::usage("--chain is for cores only; the stack is always a chain"));
    }
    // The stack makes new folders for its bags.
    let out = args.out.as_deref().filter(|_| levels != [Level::Stack]);
    if let Some(directory) = out {
        output::must_be_free(directory, &args.bags).map_err(Failure::usage)?;
    }
    let bags: Vec<&Path> = args.bags.iter().map(PathBuf::as_path).collect();
    let html = OutputFile::claim_if(args.html.as_deref(), &bags)?;
    let mut report = Report::default();
    let mut failed = None;
    for path in &args.bags {
        let count = report.reports.len();
        let Err(failure) = report.replay(args, path, &levels, out) else { continue };
        failure.say();
        if report.reports.len() == count {
            let bag = path.display().to_string();
            report.reports.push(json!({ "bag": bag, "error": failure.message }));
        }
        // One broken bag does not hide the others. When the stack failed or was interrupted,
        // no further bag is started.
        if failure.status != Status::Usage {
            failed = Some(failure.status);
            break;
        }
        failed = Some(failed.unwrap_or(failure.status));
    }
    if args.json {
        let is_reproduced = !report.differs && failed.is_none();
        printed(report::json::print(
            &json!({ "reproduced": is_reproduced, "bags": report.reports }),
        ))?;
    }
    if let Some(file) = html.filter(|_| !report.page.sheets.is_empty()) {
        file.write(|to| report.page.write_html(to))?;
    }
    match failed {
        Some(status) => Err(Failure::said(status)),
        None if report.differs => Err(Failure::said(Status::Refused)),
        None => Ok(()),
    }
}

/// The results of the bags so far.
#[derive(Default)]
struct Report {
    /// Whether any bag differs.
    differs: bool,
    page: Page<'static>,
    /// With `--json`, one object for each bag.
    reports: Vec<Value>,
}

impl Report {
    /// Replays one bag: prints the report, then writes outputs.
    fn replay(
        &mut self,
        args: &ReplayArgs,
        path: &Path,
        levels: &[Level],
        out: Option<&Path>,
    ) -> Result<(), Failure> {
        let shown = path.display().to_string();
        let of_bag = |error: ReplayError| failure(&error, path);
        let out_of_stack = args.out.as_deref();
        let play_stack = |recording: &Recording, comparison: &mut Comparison| {
            stack_replay::replay(recording, path, out_of_stack, comparison)
        };
        let options = Options {
            is_chain: args.chain || args.update,
            play_stack: Some(&play_stack),
            keep_program: Some(&keep_for_report),
            memo: None,
        };
        let verdict = replay(path, levels, options).map_err(of_bag)?;
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
            show(&verdict, &mut self.page, &shown).map_err(of_bag)?;
        }
        if args.update {
            println!("  {}", update(path, &verdict, levels).map_err(of_bag)?);
        }
        Ok(())
    }
}

/// The page of a bag as it was recorded: `kerf bag report`.
pub(crate) fn report_page(path: &Path) -> Result<Page<'static>, ReplayError> {
    let mut bag = files::open_bag(path)?;
    let recording = Recording::read(&mut bag)?;
    let mut problems: Vec<String> = bag.problems().iter().map(ToString::to_string).collect();
    problems.extend(recording.missing.iter().map(ToString::to_string));
    if recording.plans.is_empty() {
        problems.push("the bag holds no plan".to_owned());
    }
    let mut page = Page::default();
    of_recording(&mut page, &path.display().to_string(), &recording, &[], |sheet| {
        sheet.good = problems.is_empty();
        let word = if sheet.good { "recording complete" } else { "recording not complete" };
        sheet.verdict = word.into();
        sheet.summary = problems.join("\n");
    })?;
    if page.sheets.iter().all(|sheet| sheet.layers.is_empty() && sheet.run.is_none()) {
        return Err(ReplayError::NothingToShow);
    }
    Ok(page)
}

/// The failure of the command on a bag.
pub(crate) fn failure(error: &ReplayError, bag: &Path) -> Failure {
    match error {
        ReplayError::Stack { status, message } => {
            Failure::new(Status::of(*status), format!("{}: {message}", bag.display()))
        }
        _ => Failure::usage(error.of(bag)),
    }
}

/// Adds the recorded plans to the page, with today's plans and the differences.
fn show(verdict: &ReplayResult, page: &mut Page<'static>, bag: &str) -> Result<(), ReplayError> {
    let (summary, differences) = (verdict.summary(), verdict.differences(SHOWN_ON_PAGE_MAX));
    of_recording(page, bag, verdict.recording(), &verdict.plans, |sheet| {
        sheet.good = verdict.is_reproduced();
        sheet.verdict = verdict.word().into();
        sheet.summary.clone_from(&summary);
        sheet.differences.clone_from(&differences);
    })
}
