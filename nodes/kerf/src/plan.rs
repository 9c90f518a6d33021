//! `kerf plan`: reads a program; prints whether it is accepted, and its path. No ROS.

mod in_parts;
mod long_program;
mod text;

use crate::exit::{CommandResult, Failure, Status, printed};
use crate::output_file::OutputFile;
use crate::page::{Layer, Page, Sheet};
use crate::picture::view::View;
use crate::plan_machine::{self, Machine, MachineArgs};
use crate::terminal::show_findings;
use crate::words::{from_one, percent};
use crate::{files, picture};
use axis_driver::envelope::Beginning;
use clap::Args;
use cnc_msgs::count::counted;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::Position;
use cnc_msgs::path::{CompensatedPath, PathElement};
use cnc_msgs::profile::{Profile, Reaction};
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::node::disagreement;
use compensation_planner::node::threads::Threads;
use compensation_planner::verdict::Disagreement;
use compensation_planner::{Planning, Start, Verdict, judge, start};
use in_parts::{FILE_PART_EVENTS, OfFile};
use long_program::LongProgram;
use program_loader::limits::COORDINATE_MM_MAX;
use program_loader::subroutines::with_subroutines;
use program_loader::tool_rows::load_with_tools;
use program_loader::{LoadOptions, Loaded};
use report::plan::{Elements, OnMachine, PlanReport};
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use text::{audit_text, certificate_text, uncut_text};

/// What `kerf plan` takes.
#[derive(Debug, Args)]
pub(crate) struct PlanArgs {
    /// The part program
    file: PathBuf,
    /// Control profile: a built-in name, or a YAML file
    #[arg(long, default_value = "rs274", value_name = "NAME|FILE")]
    control: String,
    /// Tool table, YAML, millimetres
    #[arg(long, value_name = "FILE")]
    tools: Option<PathBuf>,
    /// Folder of subroutine files: `o<pocket> call` reads pocket.ngc; `M98 P10` on MASSO reads 10.nc
    #[arg(long, value_name = "DIR")]
    subroutines: Vec<String>,
    /// File with start values of numbered parameters (`5221 12.5`, as LinuxCNC writes it)
    #[arg(long, value_name = "FILE")]
    parameters: Option<PathBuf>,
    /// Position of the tool before the first block, millimetres
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = position, allow_hyphen_values = true)]
    start: [f64; 3],
    /// Assume that each probe touches after this share of its travel, and plan the whole program
    #[arg(long, value_name = "PERCENT", value_parser = percent::<0, 100>)]
    probes_touch_at: Option<u8>,
    /// Reaction to a contour that the tool does not fit: alarm, trim or ignore [default: the
    /// profile's]
    #[arg(long, value_name = "REACTION")]
    interference: Option<Reaction>,
    /// Also show how `kerf run --start-line` would start at this line
    #[arg(long, value_name = "LINE", value_parser = from_one)]
    start_line: Option<u32>,
    /// Where loops or calls run that line several times: which time, counted from 1
    #[arg(long, value_name = "NUMBER", value_parser = from_one, requires = "start_line")]
    occurrence: Option<u32>,
    #[command(flatten)]
    machine: MachineArgs,
    /// Print one JSON object
    #[arg(long, conflicts_with = "quiet")]
    json: bool,
    /// Write a picture of the programmed contour and the path of the tool centre
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Write a page for a browser: both, with the program and the findings
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print errors only; judges plain programs of any length, also those that are too long to run
    #[arg(long)]
    quiet: bool,
    /// Has no effect: the path is always proved by a second algorithm
    #[arg(long, hide = true)]
    audit: bool,
}

impl PlanArgs {
    /// Whether nobody sees anything of a program that is accepted.
    fn shows_errors_only(&self) -> bool {
        self.quiet
            && self.svg.is_none()
            && self.html.is_none()
            && self.machine.files().iter().all(Option::is_none)
            && self.start_line.max(self.occurrence).unwrap_or_default() <= 1
    }
}

/// Loads and plans, prints the result; fails if the program is refused.
pub(crate) fn run(args: &PlanArgs) -> CommandResult {
    let read = [Some(args.file.as_path()), args.tools.as_deref(), args.parameters.as_deref()];
    let inputs = files::inputs(read.into_iter().chain(args.machine.files()), &args.control);
    let [svg, html] = OutputFile::claim_both([args.svg.as_deref(), args.html.as_deref()], &inputs)?;
    let is_long = args.shows_errors_only() && args.parameters.is_none();
    let long = if is_long { LongProgram::open(&args.file) } else { None };
    let mut text = if long.is_some() { Vec::new() } else { files::read_program(&args.file)? };
    let mut profile = files::profile(&args.control)?;
    profile.interference.react = args.interference.unwrap_or(profile.interference.react);
    let folders = files::subroutines(&args.subroutines)?;
    let tools = files::tool_table(args.tools.as_deref())?;
    let machine = args.machine.read()?;
    let name = files::file_name(&args.file);
    let probes_touch_at = args.probes_touch_at.map(|percent| f64::from(percent) / 100.0);
    let options = LoadOptions { start: args.start, probes_touch_at, ..LoadOptions::default() };
    // With --quiet nobody reads certificates, and they cost more than the plan.
    let planning = Planning { certifies: !args.quiet, workers: &Threads::all() };
    let plan = if args.shows_errors_only() { Planned::without_path } else { Planned::new };
    if let Some(mut program) = long {
        let events = FILE_PART_EVENTS;
        match OfFile::plan(&mut program, &profile, &tools, &options, planning, events) {
            OfFile::Judged { is_accepted, shown } => return program.conclude(is_accepted, &shown),
            // It is refused as one that has to be held.
            OfFile::NotPlain => program.failure().map_or(Ok(()), Err)?,
        }
        text = files::read_program(&args.file)?;
    }
    let text = with_subroutines(text, &profile, |name| files::subroutine(&folders, name));
    let text = match &args.parameters {
        Some(path) => files::with_parameters(text, &profile, path)?,
        None => text,
    };
    let mut planned = plan(&text, &profile, &tools, &options, planning);
    planned.keep_disagreement(&name, &text);
    let start_line = args.start_line.unwrap_or_default();
    let start = planned.start_at((start_line, args.occurrence.unwrap_or_default()), &profile);
    if let Some(machine) = &machine {
        planned.put_on(machine, &tools, start.as_ref());
    }

    if let Some(file) = svg {
        file.write(|to| planned.write_svg(to, &name, &profile))?;
    }
    if let Some(file) = html {
        file.write(|to| planned.page(&name, &text, &profile).write_html(to))?;
    }
    if args.json {
        printed(planned.report(&profile.name, start.as_ref()).print())?;
    } else {
        let shown: Vec<_> = planned
            .findings
            .iter()
            .filter(|finding| finding.is_error() || !args.quiet)
            .cloned()
            .collect();
        if !shown.is_empty() {
            let text = String::from_utf8_lossy(&text);
            let color = std::io::stderr().is_terminal();
            show_findings(&program_loader::render::render(&name, &text, &shown, color));
        }
        if !args.quiet {
            println!("{}", planned.summary(&name, &profile.name));
            if let Some(start) = start {
                println!("  a run from line {start_line} {start}");
            }
        }
    }
    if planned.accepted() { Ok(()) } else { Err(Failure::said(Status::Refused)) }
}

pub(crate) fn position(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>().ok().filter(|number| number.is_finite()))
        .collect::<Option<_>>()
        .ok_or_else(|| format!("{text:?} is not three numbers X,Y,Z"))?;
    if let Some(far) = numbers.iter().find(|number| number.abs() > COORDINATE_MM_MAX) {
        return Err(format!(
            "{far:e} mm is too far away; at most {COORDINATE_MM_MAX} mm is accepted"
        ));
    }
    numbers.try_into().map_err(|_| format!("{text:?} is not three numbers X,Y,Z"))
}

/// Keeps a program on which planner and audit disagree, and prints its path.
pub(crate) fn keep_for_report(name: &str, text: &[u8], found: &Disagreement) {
    match disagreement::keep(Path::new(disagreement::FOLDER), name, text, found) {
        Ok(path) => eprintln!("kerf: the program was kept for a bug report: {}", path.display()),
        Err(error) => eprintln!(
            "kerf: cannot keep the program in {}/{}: {error}",
            disagreement::FOLDER,
            found.file_name
        ),
    }
}

/// A program after loader and planner.
#[derive(Debug)]
pub(crate) struct Planned {
    pub(crate) loaded: Loaded,
    pub(super) verdict: Verdict,
    /// Findings of the loader, then of the planner and its audit.
    pub(crate) findings: Vec<Finding>,
    pub(super) on_machine: Option<OnMachine>,
}

impl Planned {
    /// Loads the program; plans and audits it unless it was refused.
    pub(crate) fn new(
        text: &[u8],
        profile: &Profile,
        tools: &ToolTable,
        options: &LoadOptions,
        planning: Planning<'_>,
    ) -> Self {
        let (_, loaded) = load_with_tools(text, profile, options, tools);
        Self::of(loaded, profile, tools, planning)
    }

    /// Plans and audits what was loaded, unless it was refused.
    pub(super) fn of(
        loaded: Loaded,
        profile: &Profile,
        tools: &ToolTable,
        planning: Planning<'_>,
    ) -> Self {
        let mut findings = loaded.findings.clone();
        let mut verdict = Verdict::default();
        if !findings.iter().any(Finding::is_error) {
            verdict = judge(&loaded.contour, profile, tools, planning);
            findings.extend(verdict.plan.findings.iter().cloned());
        }
        Self { loaded, verdict, findings, on_machine: None }
    }

    /// Keeps the program if planner and audit disagree, and prints its path.
    pub(crate) fn keep_disagreement(&self, name: &str, text: &[u8]) {
        if let Some(found) = &self.verdict.disagreement {
            keep_for_report(name, text, found);
        }
    }

    pub(crate) fn accepted(&self) -> bool {
        !self.findings.iter().any(Finding::is_error)
    }

    /// The path; empty when refused.
    pub(crate) fn path(&self) -> &CompensatedPath {
        &self.verdict.plan.path
    }

    /// Judges the path against a machine.
    fn put_on(&mut self, machine: &Machine, tools: &ToolTable, start: Option<&Start>) {
        if !self.accepted() {
            return;
        }
        let beginning = start.map(|start| start.entry).map(|entry| Beginning {
            element: entry.element,
            event: entry.event,
            approach: None,
        });
        let beginning = beginning.unwrap_or_default();
        let (report, on_machine) = machine.judge(self.path(), tools, beginning);
        self.findings.extend(report.findings);
        self.on_machine = Some(on_machine);
    }

    /// What a refused program would have cut.
    fn refused(&self) -> &[PathElement] {
        match self.verdict.plan.refused.as_slice() {
            // The machine refuses it, not the planner.
            [] => &self.path().elements,
            refused => refused,
        }
    }

    fn start(&self) -> Position {
        self.loaded.contour.start
    }

    /// How a run starts at a line; if it cannot, adds a finding.
    fn start_at(&mut self, (line, occurrence): (u32, u32), profile: &Profile) -> Option<Start> {
        if line <= 1 && occurrence <= 1 || !self.accepted() {
            return None;
        }
        let started = start(&self.loaded.contour, profile, self.path(), line, occurrence);
        let finding = match &started {
            Ok(start) => start.warning.clone(),
            Err(refused) => Some(refused.finding.clone()),
        };
        self.findings.extend(finding);
        started.ok()
    }

    fn report<'a>(&'a self, control: &'a str, start: Option<&'a Start>) -> PlanReport<'a> {
        let elements = |elements| Elements { start: self.start(), elements };
        PlanReport {
            accepted: self.accepted(),
            audit: self.verdict.audit.as_ref(),
            calls: self.loaded.contour.calls.rows(),
            certificates: &self.verdict.plan.certificates,
            control,
            elements: elements(if self.accepted() { &self.path().elements } else { &[] }),
            events: &self.path().events,
            findings: &self.findings,
            machine: self.on_machine.as_ref(),
            refused_elements: (!self.accepted()).then(|| elements(self.refused())),
            start,
            uncut: &self.verdict.plan.uncut,
        }
    }

    /// Draws the picture; also of a refused program.
    pub(crate) fn write_svg(
        &self,
        to: &mut impl Write,
        title: &str,
        profile: &Profile,
    ) -> io::Result<()> {
        let elements =
            if self.accepted() { self.path().elements.as_slice() } else { self.refused() };
        let picture = picture::Picture {
            title,
            contour: &self.loaded.contour,
            start: self.start(),
            elements,
            accepted: self.accepted(),
            findings: &self.findings,
            uncut: &self.verdict.plan.uncut,
            profile,
        };
        picture::write(&picture, to)
    }

    /// The page; also of a refused program.
    fn page<'a>(&'a self, name: &str, text: &'a [u8], profile: &Profile) -> Page<'a> {
        let view = View::of(&self.loaded.contour, profile);
        let mut sheet = Sheet::new(name.to_owned(), view, String::from_utf8_lossy(text));
        let (layer, elements) = match self.accepted() {
            true => ("compensated", self.path().elements.as_slice()),
            false => ("refused", self.refused()),
        };
        sheet.good = self.accepted();
        sheet.verdict = if sheet.good { "accepted".into() } else { "refused".into() };
        sheet.summary = self.summary(name, &profile.name);
        sheet.layers = vec![
            Layer::programmed(&self.loaded.contour, view),
            Layer::compensated(layer, self.start(), elements, view),
        ];
        sheet.call(&self.loaded.contour.calls);
        sheet.turn(&self.loaded.contour, view);
        sheet.find(&self.findings, view);
        sheet.fill(&self.verdict.plan.uncut, view);
        Page { sheets: vec![sheet], runs: Vec::new() }
    }

    /// The summary for people: result and sizes.
    fn summary(&self, name: &str, control: &str) -> String {
        let count = |error| self.findings.iter().filter(|d| d.is_error() == error).count();
        let (errors, warnings) = (count(true), count(false));
        let verdict = if self.accepted() { "accepted" } else { "refused" };
        let mut summary = format!(
            "{name}: {verdict} by {control}, {}, {}",
            counted(errors, "error"),
            counted(warnings, "warning")
        );
        if self.accepted() {
            let path = self.path();
            let rapids = path.elements.iter().filter(|e| e.feed_mm_per_min.is_none()).count();
            summary += &format!(
                "\n  {} ({} rapid), {}",
                counted(path.elements.len(), "element"),
                rapids,
                counted(path.events.len(), "event")
            );
        }
        // The program is accepted, but some areas are trimmed or gouges ignored.
        let fits = !self.findings.iter().any(|finding| {
            finding.is_error() || matches!(finding.code, Code::Unreachable | Code::Gouge)
        });
        if let Some(note) = picture::further_note(&self.loaded.contour) {
            summary += &format!("\n  {note}");
        }
        if let Some(audit) = &self.verdict.audit {
            summary += &format!("\n  {}", audit_text(audit));
        }
        for certificate in &self.verdict.plan.certificates {
            summary += &format!("\n  {}", certificate_text(certificate, fits));
        }
        if !self.verdict.plan.uncut.is_empty() {
            summary += &uncut_text(&self.verdict.plan.uncut);
        }
        if let Some(on_machine) = &self.on_machine {
            summary += &plan_machine::text(on_machine, self.accepted());
        }
        summary
    }
}
