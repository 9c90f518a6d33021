//! `kerf check`: what each control would say of one program, side by side. No ROS.

use crate::exit::{Failure, Outcome, Status};
use crate::files;
use crate::plan::{Planned, plural, position};
use crate::plan_json;
use clap::Args;
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::profile::Profile;
use compensation_planner::Planning;
use program_loader::LoadOptions;
use replay::path_distance::{Difference, between};
use serde_json::{Value, json};
use std::path::PathBuf;

/// What `kerf check` takes.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// The part program
    file: PathBuf,
    /// Every control that Kerf has; so without --control too
    #[arg(long)]
    all_controls: bool,
    /// A control profile, built in or a YAML file; may be repeated
    #[arg(long = "control", value_name = "NAME|FILE", id = "controls")]
    controls: Vec<String>,
    /// Tool table, YAML, millimetres
    #[arg(long, value_name = "FILE")]
    tools: Option<PathBuf>,
    /// Where the tool is before the first block, millimetres
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = position, allow_hyphen_values = true)]
    start: [f64; 3],
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// One control's answer.
struct Answer {
    profile: Profile,
    planned: Planned,
}

impl Answer {
    fn count(&self, severity: Severity) -> usize {
        self.planned.findings.iter().filter(|finding| finding.severity == severity).count()
    }

    /// Whether the program is in the language of the control at all.
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

/// Where two controls that accept go different ways.
struct Pair {
    from: String,
    to: String,
    difference: Difference,
}

/// Plans under every profile, prints what differs, and says whether any accepts.
pub(crate) fn run(args: &CheckArgs) -> Outcome {
    let text = files::read_program(&args.file)?;
    let tools = files::tool_table(args.tools.as_deref())?;
    let mut names: Vec<String> = Vec::new();
    if args.all_controls || args.controls.is_empty() {
        names.extend(settings::Control::ALL.map(|control| control.name().to_owned()));
    }
    names.extend(args.controls.iter().cloned());
    let options = LoadOptions { start: args.start, ..LoadOptions::default() };
    let mut answers = Vec::new();
    for name in names {
        let profile = files::profile(&name)?;
        let planned = Planned::new(&text, &profile, &tools, &options, Planning::default());
        planned.keep_disagreement(&files::file_name(&args.file), &text);
        answers.push(Answer { profile, planned });
    }
    let pairs = pairs(&answers);
    let name = files::file_name(&args.file);
    if args.json {
        println!("{:#}", to_json(&name, &answers, &pairs));
    } else {
        print!("{}", to_text(&name, &answers, &pairs));
    }
    if answers.iter().any(|answer| answer.planned.accepted()) {
        Ok(())
    } else {
        Err(Failure::said(Status::Refused))
    }
}

/// Each control that accepts beside the first one.
fn pairs(answers: &[Answer]) -> Vec<Pair> {
    let mut accepting = answers.iter().filter(|answer| answer.planned.accepted());
    let Some(first) = accepting.next() else { return Vec::new() };
    accepting
        .map(|other| Pair {
            from: first.profile.name.clone(),
            to: other.profile.name.clone(),
            difference: between(first.planned.path(), other.planned.path()),
        })
        .collect()
}

fn to_json(name: &str, answers: &[Answer], pairs: &[Pair]) -> Value {
    let controls: Vec<Value> = answers
        .iter()
        .map(|answer| {
            json!({
                "control": answer.profile.name,
                "read": answer.is_read(),
                "accepted": answer.planned.accepted(),
                "error_count": answer.count(Severity::Error),
                "warning_count": answer.count(Severity::Warning),
                "element_count": answer.planned.path().elements.len(),
                "findings": answer.planned.findings.iter().map(plan_json::finding)
                    .collect::<Vec<_>>(),
            })
        })
        .collect();
    let differences: Vec<Value> = pairs
        .iter()
        .map(|pair| {
            json!({
                "from": pair.from,
                "to": pair.to,
                "distance_mm": pair.difference.distance_mm,
                "position": pair.difference.position,
                "line": pair.difference.source.line,
                "block": pair.difference.source.block,
                "differing_functions": pair.difference.functions,
                "differing_feeds": pair.difference.feeds,
            })
        })
        .collect();
    json!({"file": name, "controls": controls, "differences": differences})
}

fn to_text(name: &str, answers: &[Answer], pairs: &[Pair]) -> String {
    let width = answers.iter().map(|answer| answer.profile.name.len()).max().unwrap_or(0);
    let mut text = format!("{name}\n\n");
    for answer in answers {
        let (errors, warnings) = (answer.count(Severity::Error), answer.count(Severity::Warning));
        text += &format!(
            "{:width$}  {:11}  {}, {}\n",
            answer.profile.name,
            answer.verdict(),
            plural(errors, "error"),
            plural(warnings, "warning")
        );
        let findings = &answer.planned.findings;
        // The warnings of what is refused wait until the errors are gone.
        let shown = findings.iter().filter(|finding| errors == 0 || finding.is_error());
        const SHOWN_MAX: usize = 5;
        for finding in shown.clone().take(SHOWN_MAX) {
            text += &format!("{:width$}  {}\n", "", finding_text(finding));
        }
        let more = shown.count().saturating_sub(SHOWN_MAX);
        if more > 0 {
            text += &format!(
                "{:width$}  and {more} more: kerf plan --control {}\n",
                "", answer.profile.name
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
        "line {}{block}{alarm}, {}: {}",
        finding.source.line,
        finding.code.name(),
        finding.message
    )
}

fn pair_text(pair: &Pair) -> String {
    let Difference { distance_mm, position: [x, y, z], source, functions, feeds } = pair.difference;
    // Rounding of six decimals is no difference.
    let mut parts = Vec::new();
    if distance_mm > 1e-6 {
        let block = source.block.map(|block| format!(" N{block}")).unwrap_or_default();
        parts.push(format!(
            "{distance_mm:.4} mm apart at X{x:.3} Y{y:.3} Z{z:.3} in line {}{block}",
            source.line
        ));
    }
    if functions > 0 {
        parts.push(plural(functions, "function") + " other or elsewhere");
    }
    if feeds > 0 {
        parts.push(plural(feeds, "block") + " with another feed");
    }
    if parts.is_empty() {
        parts.push("the same path".into());
    }
    format!("{} and {}: {}", pair.from, pair.to, parts.join(", "))
}
