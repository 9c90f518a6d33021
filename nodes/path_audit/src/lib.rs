//! An independent audit of a compensated path: a second algorithm that proves a path against
//! the contour it was made of.
//!
//! It shares no code with the planner, which depends on it; both use `cnc_msgs`: the vocabulary of
//! contours and paths, and how a radius is resolved. `program` reads what each motion is to compensation, `align` gives
//! every element its block, `events` counts what is not motion, `beside` and `follow` prove
//! that elements run at their radius beside their own blocks (`sharp`: what a sharp corner
//! takes), `bounds` finds what bounds the tool, and `clearance` measures the exact distance of
//! the path from it (`leads`: what a lead may pass over). Millions of pieces lie side by side
//! in memory (`pieces`); strip trees find those that are near (`strip`), directions those that
//! cannot meet (`fans`), and lower bounds settle most of the rest (`apart`) before anything is
//! measured (`planar`). What a contour retraces is looked at once (`copies`).
//! Blocks may be left out within the tolerance that the profile accepts.

mod align;
mod clearance;
mod direction_ranges;
mod distance_bounds;
mod element_offset;
mod events;
mod leads;
mod offsets;
mod passes;
mod pieces;
mod planar;
mod program;
mod report;
mod retraced_legs;
mod sharp_corner;
mod spans;
mod strip_tree;
mod tool_path;

use crate::pieces::Chains;
use crate::report::Report;
use crate::spans::{Span, Spans};
use crate::tool_path::ToolPath;
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::{CompensatedPath, Role};
use cnc_msgs::profile::{OutputPoint, Profile, Reaction};
use cnc_msgs::tool_table::ToolTable;

/// What an audit found, and how much it looked at.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Audit {
    /// Sound paths have none, but for the warnings that their profile allows.
    pub findings: Vec<Finding>,
    pub elements: usize,
    pub spans: usize,
    pub events: usize,
    /// The least distance from a wall that is nearer than the radius, mm; `None`: no wall is.
    pub nearest_mm: Option<f64>,
}

impl Audit {
    /// Whether the path must not be run.
    pub fn refuses(&self) -> bool {
        self.findings.iter().any(Finding::is_error)
    }
}

/// Whether a contour may be run although the tool does not fit it: because that is ignored, or
/// because the control looks too few blocks ahead to see it.
fn runs_what_does_not_fit(profile: &Profile) -> bool {
    let lookahead = &profile.lookahead;
    match profile.interference.react {
        Reaction::Ignore => true,
        Reaction::Alarm => {
            lookahead.blocks.is_some() && lookahead.strictness.severity() == Severity::Warning
        }
        // What does not fit has been left out.
        Reaction::Trim => false,
    }
}

/// Audits any path of a contour.
///
/// Never panics; the work is bounded, and what cannot be looked at is a finding.
pub fn audit(
    contour: &ProgrammedContour,
    path: &CompensatedPath,
    profile: &Profile,
    tools: &ToolTable,
) -> Audit {
    audit_after(contour, path, profile, tools, &[])
}

/// Audits a path after its planner, without what that has said already: the same code about one
/// of the same blocks.
///
/// Where the profile takes it for a warning that the tool does not fit a contour, and that has
/// been said, it is a warning too that the path is not beside that contour: the control runs it.
/// Nothing else about the path gets milder by that.
pub fn audit_after(
    contour: &ProgrammedContour,
    path: &CompensatedPath,
    profile: &Profile,
    tools: &ToolTable,
    said: &[Finding],
) -> Audit {
    let mut report = Report::new(profile, said);
    let mut result =
        Audit { elements: path.elements.len(), events: path.events.len(), ..Audit::default() };
    let is_sane = check_numbers(path, &mut report);
    let mut tool_path = ToolPath {
        path,
        program: program::read(contour, profile, tools),
        block_of: vec![program::NONE; path.elements.len()],
        roles: Vec::with_capacity(path.elements.len()),
        is_of_tip: profile.output == OutputPoint::Tip,
    };
    if is_sane && align::align(&mut tool_path, &mut report) {
        events::check(&tool_path, profile, tools, &mut report);
        let Spans { spans, legs } = Spans::of(&tool_path);
        result.spans = spans.len();
        let line = |block: u32| tool_path.program.source(block).line;
        if runs_what_does_not_fit(profile) {
            let misfits =
                said.iter().filter(|said| !said.is_error() && report::is_misfit(said.code));
            let misfits: Vec<u32> = misfits.map(|said| said.source.line).collect();
            let lines = |span: &Span| line(span.blocks.start)..=line(span.blocks.end - 1);
            let spans = spans.iter().map(lines);
            report.misfits =
                spans.filter(|span| misfits.iter().any(|line| span.contains(line))).collect();
        }
        let chains: Vec<Chains<'_>> =
            spans.iter().map(|span| Chains::of(&tool_path, span, &legs)).collect();
        for chains in &chains {
            offsets::check(&mut tool_path, chains, &mut report);
        }
        for chains in &chains {
            clearance::check(&tool_path, chains, &mut result.nearest_mm, &mut report);
        }
        for pair in chains.windows(2).filter(|pair| pair[1].span.from_side) {
            clearance::check_change_of_side(&tool_path, (&pair[0], &pair[1]), &mut report);
        }
    }
    result.findings = report.findings;
    result.findings.sort_by_key(|finding| finding.source.line);
    result
}

/// Whether all numbers are numbers; what is no motion or no circle is reported beside.
fn check_numbers(path: &CompensatedPath, report: &mut Report<'_>) -> bool {
    let mut is_sane = path.start.iter().all(|value| value.is_finite());
    let mut start = path.start;
    for (index, element) in path.elements.iter().enumerate() {
        let center = match &element.shape {
            Shape::Line => [0.0; 3],
            Shape::Arc(arc) => arc.center,
        };
        let feed = element.feed_mm_per_min.unwrap_or(0.0);
        if !element.end.iter().chain(&center).chain([&feed]).all(|value| value.is_finite()) {
            report.push(report::not_finite(element, index));
            is_sane = false;
        }
        let stays =
            element.end == start && !matches!(element.shape, Shape::Arc(arc) if arc.turns > 0);
        // A move out of the plane may only let a tool length act; its block says so.
        if stays && !matches!(element.role, Role::None | Role::OffPlane) {
            report.push(report::no_length(element, index));
        }
        start = element.end;
    }
    is_sane
}
