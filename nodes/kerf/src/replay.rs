//! `kerf replay`: today's cores on yesterday's inputs.
//!
//! Time comes from the bag. Reads a recording, runs loader, planner and driver
//! cores on what they were given then, and says what is different now. It
//! fails when nothing was compared: a replay that looks at nothing proves nothing.

mod compare;
mod driver;
mod loader;
pub(crate) mod planner;
pub(crate) mod recording;

use crate::exit::{Failure, Outcome, Status};
use crate::page::{Page, of_recording};
use crate::plan::plural;
use clap::{Args, ValueEnum};
use cnc_msgs::cdr::{self, CdrError};
use cnc_msgs::chunk::ChunkError;
use cnc_msgs::interface::Message;
use compare::{Comparison, Difference};
use planner::Replanned;
use recording::Recording;
use run_recorder::bag_reader::{BagError, BagMessage};
use run_recorder::bag_writer::{BagWriteError, BagWriter, ChannelSpec};
use run_recorder::files;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Differences that are printed one by one.
const SHOWN_MAX: usize = 20;
/// Differences of a core that a page lists.
const SHOWN_ON_PAGE_MAX: usize = 2000;

/// What `kerf replay` takes.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// Bag directories or .mcap files
    #[arg(required = true)]
    bags: Vec<PathBuf>,
    /// Only this core; all of them when left out
    #[arg(long, value_enum)]
    level: Option<Level>,
    /// Write what the cores make now as a bag, NAME.mcap, into this directory
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Show what was and what is now on one page for a browser
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
}

/// A core.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Level {
    /// Program text to contour
    Loader,
    /// Contour and tool table to path
    Planner,
    /// Commands and received bytes to transmitted bytes
    Driver,
}

impl Level {
    const ALL: [Self; 3] = [Self::Loader, Self::Planner, Self::Driver];

    const fn name(self) -> &'static str {
        match self {
            Self::Loader => "loader",
            Self::Planner => "planner",
            Self::Driver => "driver",
        }
    }
}

/// Why a bag cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ReplayError {
    #[error(transparent)]
    Bag(#[from] BagError),
    #[error(transparent)]
    Chunk(#[from] ChunkError),
    #[error("{what} of {of} is not in the bag; it cannot be replayed")]
    Incomplete { what: &'static str, of: String },
    #[error("the input of {of} cannot be used: {reason}")]
    Input { of: String, reason: String },
    #[error("{topic}: {error}")]
    Content { topic: String, error: String },
    #[error(
        "{type_name} was recorded with definition {recorded}; this build has {today} and knows no way between them"
    )]
    Definition { type_name: &'static str, recorded: String, today: &'static str },
    #[error("the bag says it is not complete ({0}); the driver cannot be replayed from it")]
    Gaps(String),
    #[error("the output cannot be written: {0}")]
    Write(#[from] BagWriteError),
}

impl ReplayError {
    fn content(message: &BagMessage, error: impl Display) -> Self {
        Self::Content { topic: message.channel.topic.clone(), error: error.to_string() }
    }
}

impl From<CdrError> for ReplayError {
    fn from(error: CdrError) -> Self {
        Self::Content { topic: "a message".into(), error: error.to_string() }
    }
}

/// One message that a core made.
#[derive(Debug, Clone)]
struct Output {
    topic: &'static str,
    type_name: &'static str,
    log_time_ns: u64,
    data: Vec<u8>,
}

impl Output {
    fn new<M: Message>(topic: &'static str, log_time_ns: u64, message: &M) -> Self {
        Self { topic, type_name: M::TYPE_NAME, log_time_ns, data: cdr::encapsulated(message) }
    }
}

/// What came of one bag.
#[derive(Debug)]
pub(crate) struct Verdict {
    /// By level.
    comparisons: Vec<(Level, Comparison)>,
    outputs: Vec<Output>,
    recording: Recording,
    /// What the planner makes now; empty when it was not asked.
    plans: Vec<Replanned>,
}

/// Replays each bag and reports.
pub(crate) fn run(args: &ReplayArgs) -> Outcome {
    let levels = args.level.map_or_else(|| Level::ALL.to_vec(), |level| vec![level]);
    let mut differs = false;
    let mut page = Page::default();
    for path in &args.bags {
        let shown = path.display();
        let of_bag = |error: ReplayError| match error.to_string() {
            // It names the bag already.
            error if error.contains(&shown.to_string()) => Failure::usage(error),
            error => Failure::usage(format_args!("{shown}: {error}")),
        };
        let verdict = replay(path, &levels).map_err(of_bag)?;
        if let Some(directory) = &args.out {
            write(directory, path, &verdict.outputs).map_err(of_bag)?;
        }
        differs |= !verdict.is_reproduced();
        if args.html.is_some() {
            verdict.show(&mut page, &shown.to_string()).map_err(of_bag)?;
        }
        print!("{}", verdict.report(&shown.to_string()));
    }
    if let Some(file) = &args.html {
        crate::files::write(file, &page.to_html())?;
    }
    if differs { Err(Failure::said(Status::Refused)) } else { Ok(()) }
}

/// One page of a bag, as it was recorded: `kerf bag report`.
pub(crate) fn report_page(path: &Path) -> Result<Page, ReplayError> {
    let mut bag = files::open_bag(path)?;
    let recording = Recording::read(&mut bag)?;
    let problems: Vec<String> = bag.problems().iter().map(ToString::to_string).collect();
    let mut page = Page::default();
    of_recording(&mut page, &path.display().to_string(), &recording, &[], |sheet| {
        sheet.good = problems.is_empty();
        sheet.verdict = if sheet.good { "complete".into() } else { "not complete".into() };
        sheet.summary = problems.join("\n");
    })?;
    Ok(page)
}

/// Whether a bag is reproduced at every level, and what is said of it.
pub(crate) fn check(path: &Path) -> Result<(bool, String), ReplayError> {
    let verdict = replay(path, &Level::ALL)?;
    Ok((verdict.is_reproduced(), verdict.report(&path.display().to_string())))
}

fn replay(path: &Path, levels: &[Level]) -> Result<Verdict, ReplayError> {
    let mut bag = files::open_bag(path)?;
    let recording = Recording::read(&mut bag)?;
    let gaps: Vec<String> = bag.problems().iter().map(ToString::to_string).collect();
    let mut verdict =
        Verdict { comparisons: Vec::new(), outputs: Vec::new(), recording, plans: Vec::new() };
    for &level in levels {
        let mut comparison = Comparison::default();
        let Verdict { outputs, recording, plans, .. } = &mut verdict;
        match level {
            Level::Loader => loader::replay(recording, &mut comparison, outputs)?,
            Level::Planner => *plans = planner::replay(recording, &mut comparison, outputs)?,
            Level::Driver if gaps.is_empty() => {
                driver::replay(recording, &mut comparison, outputs)?;
            }
            Level::Driver => return Err(ReplayError::Gaps(gaps.join("; "))),
        }
        if comparison.compared.is_empty() {
            comparison.differs(
                level.name(),
                "nothing",
                "nothing was compared: the bag holds nothing of this core",
            );
        }
        verdict.comparisons.push((level, comparison));
    }
    Ok(verdict)
}

impl Verdict {
    fn is_reproduced(&self) -> bool {
        self.comparisons.iter().all(|(_, comparison)| comparison.differences.is_empty())
    }

    /// Puts the plans of the bag on a page, with what they are now and what is different.
    fn show(&self, page: &mut Page, bag: &str) -> Result<(), ReplayError> {
        let differences = self.comparisons.iter().flat_map(|(level, comparison)| {
            let shown = comparison.differences.iter().take(SHOWN_ON_PAGE_MAX);
            shown.map(|it| [format!("{}: {}", level.name(), it.message), it.text.clone()])
        });
        let differences: Vec<[String; 2]> = differences.collect();
        let report = self.report(bag);
        let counts: Vec<&str> = report.lines().filter(|line| line.contains("compared")).collect();
        of_recording(page, bag, &self.recording, &self.plans, |sheet| {
            sheet.good = self.is_reproduced();
            sheet.verdict = if sheet.good { "reproduced".into() } else { "DIFFERENT".into() };
            sheet.summary = counts.iter().map(|line| line.trim()).collect::<Vec<_>>().join("\n");
            sheet.differences.clone_from(&differences);
        })
    }

    /// Counts first, then a row a field, then the first differences themselves.
    fn report(&self, bag: &str) -> String {
        let verdict = if self.is_reproduced() { "reproduced" } else { "DIFFERENT" };
        let mut report = format!("{bag}: {verdict}\n");
        for (level, comparison) in &self.comparisons {
            let counts: Vec<String> =
                comparison.compared.iter().map(|(what, count)| format!("{count} {what}")).collect();
            report += &format!(
                "  {}: {}; compared {}\n",
                level.name(),
                plural(comparison.differences.len(), "difference"),
                if counts.is_empty() { "nothing".to_owned() } else { counts.join(", ") }
            );
            let mut fields: BTreeMap<&str, usize> = BTreeMap::new();
            for difference in &comparison.differences {
                *fields.entry(&difference.field).or_default() += 1;
            }
            for (field, count) in fields {
                report += &format!("    {count} x {field}\n");
            }
            for Difference { message, text, .. } in comparison.differences.iter().take(SHOWN_MAX) {
                report += &format!("    {message}: {text}\n");
            }
            if comparison.differences.len() > SHOWN_MAX {
                let more = comparison.differences.len() - SHOWN_MAX;
                report += &format!("    and {more} more\n");
            }
        }
        report
    }
}

/// Writes the outputs as a bag file; equal outputs give equal bytes.
fn write(directory: &Path, bag: &Path, outputs: &[Output]) -> Result<(), ReplayError> {
    let name = bag.file_stem().unwrap_or(bag.as_os_str()).to_string_lossy().into_owned();
    std::fs::create_dir_all(directory).map_err(BagWriteError::Io)?;
    let file = std::fs::File::create(directory.join(format!("{name}.mcap")));
    let mut writer = BagWriter::new(std::io::BufWriter::new(file.map_err(BagWriteError::Io)?))?;
    let mut channels = BTreeMap::new();
    for output in outputs {
        let channel = match channels.get(output.topic) {
            Some(&channel) => channel,
            None => {
                let info = cnc_msgs::schema::lookup(output.type_name)
                    .expect("every output is a message of ours");
                let channel = writer.add_channel(&ChannelSpec {
                    topic: format!("/{}", output.topic),
                    type_name: output.type_name.to_owned(),
                    schema_text: info.schema_text.to_owned(),
                    type_hash: info.rihs01.to_owned(),
                    qos: Vec::new(),
                })?;
                channels.insert(output.topic, channel);
                channel
            }
        };
        writer.write(channel, output.log_time_ns, output.log_time_ns, &output.data)?;
    }
    writer.finish(&format!("{name}.mcap"), &BTreeMap::new())?;
    Ok(())
}
