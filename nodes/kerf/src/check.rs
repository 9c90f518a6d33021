//! `kerf check`: compares how each control reads one program. No ROS.

use crate::exit::{CommandResult, Failure, Status, printed};
use crate::files;
use crate::plan::{Planned, position};
use clap::Args;
use cnc_msgs::calls::chain_after;
use cnc_msgs::count::counted;
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::geometry::Position;
use cnc_msgs::profile::Profile;
use compensation_planner::Planning;
use program_loader::LoadOptions;
use program_loader::subroutines::with_subroutines;
use replay::path_distance::{PathDistance, between};
use report::json;
use serde::Serialize;
use std::path::PathBuf;

/// What `kerf check` takes.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// The part program
    file: PathBuf,
    /// All controls that Kerf has; the default without --control
    #[arg(long)]
    all_controls: bool,
    /// A control profile: a built-in name or a YAML file; may be repeated
    #[arg(long = "control", value_name = "NAME|FILE", id = "controls")]
    controls: Vec<String>,
    /// Tool table, YAML, millimetres
    #[arg(long, value_name = "FILE")]
    tools: Option<PathBuf>,
    /// Folder of subroutine files: `o<pocket> call` reads pocket.ngc; `M98 P10` on MASSO reads 10.nc
    #[arg(long, value_name = "DIR")]
    subroutines: Vec<String>,
    /// Position of the tool before the first block, millimetres
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = position, allow_hyphen_values = true)]
    start: [f64; 3],
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// The result of one control.
struct ControlResult {
    /// As the command line names it: a name or a file.
    named: String,
    profile: Profile,
    planned: Planned,
}

impl ControlResult {
    fn count(&self, severity: Severity) -> usize {
        self.planned.findings.iter().filter(|finding| finding.severity == severity).count()
    }

    /// Whether the program is in the language of the control.
    fn is_read(&self) -> bool {
        !self.planned.loaded.findings.iter().any(Finding::is_error)
    }

    fn verdict(&self) -> &'static str {
        match (self.planned.accepted(), self.is_read()) {
            (true, _) => "accepts",
            (false, true) => "refuses",
            (false, false) => "cannot read",
        }
    }
}

/// Where the paths of two controls that accept the program differ.
struct Pair {
    from: String,
    to: String,
    difference: PathDistance,
}

/// Plans under every profile and prints the differences; fails if no control accepts.
pub(crate) fn run(args: &CheckArgs) -> CommandResult {
    let text = files::read_program(&args.file)?;
    let tools = files::tool_table(args.tools.as_deref())?;
    let mut names: Vec<String> = Vec::new();
    if args.all_controls || args.controls.is_empty() {
        names.extend(settings::Control::ALL.map(|control| control.name().to_owned()));
    }
    names.extend(args.controls.iter().cloned());
    let folders = files::subroutines(&args.subroutines)?;
    let options = LoadOptions { start: args.start, ..LoadOptions::default() };
    let mut results = Vec::new();
    for name in names {
        let profile = files::profile(&name)?;
        let text =
            with_subroutines(text.clone(), &profile, |name| files::subroutine(&folders, name));
        let planned = Planned::new(&text, &profile, &tools, &options, Planning::default());
        planned.keep_disagreement(&files::file_name(&args.file), &text);
        results.push(ControlResult { named: name, profile, planned });
    }
    let pairs = pairs(&results);
    let name = files::file_name(&args.file);
    if args.json {
        printed(json::print(&CheckJson::new(&name, &results, &pairs)))?;
    } else {
        print!("{}", to_text(&name, &results, &pairs));
    }
    if results.iter().any(|result| result.planned.accepted()) {
        Ok(())
    } else {
        Err(Failure::said(Status::Refused))
    }
}

/// Pairs each control that accepts with the first one.
fn pairs(results: &[ControlResult]) -> Vec<Pair> {
    let mut accepting = results.iter().filter(|result| result.planned.accepted());
    let Some(first) = accepting.next() else { return Vec::new() };
    accepting
        .map(|other| Pair {
            from: first.profile.name.clone(),
            to: other.profile.name.clone(),
            difference: between(first.planned.path(), other.planned.path()),
        })
        .collect()
}

/// What `--json` prints; keys in the order of the alphabet.
#[derive(Serialize)]
struct CheckJson<'a> {
    controls: Vec<ControlJson<'a>>,
    differences: Vec<DifferenceJson<'a>>,
    file: &'a str,
}

#[derive(Serialize)]
struct ControlJson<'a> {
    accepted: bool,
    control: &'a str,
    element_count: usize,
    error_count: usize,
    #[serde(serialize_with = "report::plan::findings")]
    findings: &'a [Finding],
    read: bool,
    warning_count: usize,
}

#[derive(Serialize)]
struct DifferenceJson<'a> {
    block: Option<u32>,
    differing_feeds: usize,
    differing_functions: usize,
    distance_mm: f64,
    from: &'a str,
    line: u32,
    position: Position,
    to: &'a str,
}

impl<'a> CheckJson<'a> {
    fn new(file: &'a str, results: &'a [ControlResult], pairs: &'a [Pair]) -> Self {
        let controls = results.iter().map(|result| ControlJson {
            accepted: result.planned.accepted(),
            control: &result.profile.name,
            element_count: result.planned.path().elements.len(),
            error_count: result.count(Severity::Error),
            findings: &result.planned.findings,
            read: result.is_read(),
            warning_count: result.count(Severity::Warning),
        });
        let differences = pairs.iter().map(|pair| DifferenceJson {
            block: pair.difference.source.block,
            differing_feeds: pair.difference.feeds,
            differing_functions: pair.difference.functions,
            distance_mm: pair.difference.distance_mm,
            from: &pair.from,
            line: pair.difference.source.line,
            position: pair.difference.position,
            to: &pair.to,
        });
        Self { controls: controls.collect(), differences: differences.collect(), file }
    }
}

fn to_text(name: &str, results: &[ControlResult], pairs: &[Pair]) -> String {
    let width = results.iter().map(|result| result.profile.name.len()).max().unwrap_or(0);
    let mut text = format!("{name}\n\n");
    for result in results {
        let (errors, warnings) = (result.count(Severity::Error), result.count(Severity::Warning));
        text += &format!(
            "{:width$}  {:11}  {}, {}\n",
            result.profile.name,
            result.verdict(),
            counted(errors, "error"),
            counted(warnings, "warning")
        );
        let findings = &result.planned.findings;
        // For a rejected program only the errors are listed.
        let shown = findings.iter().filter(|finding| errors == 0 || finding.is_error());
        const SHOWN_MAX: usize = 5;
        for finding in shown.clone().take(SHOWN_MAX) {
            text += &format!("{:width$}  {}\n", "", finding_text(finding));
        }
        let more = shown.count().saturating_sub(SHOWN_MAX);
        if more > 0 {
            text += &format!(
                "{:width$}  and {more} more, shown by `kerf plan --control {}`\n",
                "", result.named
            );
        }
    }
    if !pairs.is_empty() {
        text += "\nwhere the paths differ\n";
    }
    for pair in pairs {
        text += &format!("{}\n", pair_text(pair));
    }
    text
}

/// `line 5 N40, alarm 3021, unreachable: the tool ...`
fn finding_text(finding: &Finding) -> String {
    let block = finding.source.block.map(|block| format!(" N{block}")).unwrap_or_default();
    let alarm = finding.alarm.as_ref().map(|alarm| format!(", alarm {alarm}")).unwrap_or_default();
    format!(
        "line {}{block}{}{alarm}, {}: {}",
        finding.source.line,
        chain_after(&finding.calls),
        finding.code.name(),
        finding.message
    )
}

fn pair_text(pair: &Pair) -> String {
    let PathDistance { distance_mm, position: [x, y, z], source, functions, feeds } =
        pair.difference;
    // Rounding of six decimals is not a difference.
    let mut parts = Vec::new();
    if distance_mm > 1e-6 {
        let block = source.block.map(|block| format!(" N{block}")).unwrap_or_default();
        parts.push(format!(
            "{distance_mm:.4} mm apart at X{x:.3} Y{y:.3} Z{z:.3} in line {}{block}",
            source.line
        ));
    }
    if functions > 0 {
        parts.push(counted(functions, "function") + " changed or moved");
    }
    if feeds > 0 {
        parts.push(counted(feeds, "block") + " with another feed");
    }
    if parts.is_empty() {
        parts.push("the same path".into());
    }
    format!("{} and {}: {}", pair.from, pair.to, parts.join(", "))
}
