//! Proves a compensated path against the contour that it was made from, with a second algorithm.
//!
//! It shares no code with the planner, which depends on it. Both use `cnc_msgs`: the vocabulary of
//! contours and paths, and how a radius is resolved.
//!
//! The order of the work, each folder using only those before it: `geometry` has lines and arcs,
//! and `report` collects what is found. `blocks` reads the contour and gives every element of the
//! path its block; `events` compares what is not motion. `offsets` proves that the elements of a
//! contour run at their radius along their blocks. `walls` finds what bounds the tool, and
//! `clearance` measures the exact distance of the path from it.
//!
//! A path has millions of pieces, so `geometry::pieces` keeps them in flat arrays. Cheap tests come
//! before exact distances (`planar`): `strip_tree` finds the pieces that are near,
//! `direction_ranges` those that cannot meet, and `distance_bounds` settles most of the rest.
//!
//! A path may leave blocks out within the tolerance that the profile accepts.

mod blocks;
mod clearance;
mod events;
mod geometry;
mod offsets;
mod report;
mod walls;

use crate::blocks::chains::Chains;
use crate::blocks::spans::{Span, Spans};
use crate::blocks::tool_path::ToolPath;
use crate::blocks::{align, program};
use crate::report::Report;
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::finding::{Finding, Severity};
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::{CompensatedPath, Role};
use cnc_msgs::profile::{Profile, Reaction};
use cnc_msgs::tool_table::ToolTable;

/// What an audit found, and how much it checked.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Audit {
    /// A sound path has none, except the warnings that its profile allows.
    pub findings: Vec<Finding>,
    pub elements: usize,
    pub spans: usize,
    pub events: usize,
    /// The least distance from a wall, mm, where it is less than the radius; else `None`.
    pub nearest_mm: Option<f64>,
}

impl Audit {
    /// Whether the path must not be run.
    pub fn refuses(&self) -> bool {
        self.findings.iter().any(Finding::is_error)
    }
}

/// Whether the control runs a contour that the tool does not fit: because the profile ignores it,
/// or because the control looks too few blocks ahead to notice.
fn runs_what_does_not_fit(profile: &Profile) -> bool {
    let lookahead = &profile.lookahead;
    match profile.interference.react {
        Reaction::Ignore => true,
        Reaction::Alarm => {
            lookahead.blocks.is_some() && lookahead.strictness.severity() == Severity::Warning
        }
        // The planner has left out what does not fit.
        Reaction::Trim => false,
    }
}

/// Audits any path of a contour.
///
/// Never panics. The work is bounded; a finding reports what was not checked.
pub fn audit(
    contour: &ProgrammedContour,
    path: &CompensatedPath,
    profile: &Profile,
    tools: &ToolTable,
) -> Audit {
    audit_after(contour, path, profile, tools, &[])
}

/// Audits a path after its planner, without the findings that the planner has reported already (the
/// same code about one of the same blocks).
///
/// If the profile makes it a warning that the tool does not fit a contour, and the planner has
/// reported it, then a path that leaves this contour is a warning too: the control runs it. Nothing
/// else about the path is judged more mildly.
pub fn audit_after(
    contour: &ProgrammedContour,
    path: &CompensatedPath,
    profile: &Profile,
    tools: &ToolTable,
    said: &[Finding],
) -> Audit {
    Auditor::new(profile, tools).audit(contour, path, said)
}

/// Audits a contour whose parts come one after another; each part ends where nothing is compensated.
#[derive(Debug)]
pub struct Auditor<'a> {
    profile: &'a Profile,
    tools: &'a ToolTable,
    reader: program::Reader<'a>,
}

impl<'a> Auditor<'a> {
    /// Before the first part.
    pub fn new(profile: &'a Profile, tools: &'a ToolTable) -> Self {
        Self { profile, tools, reader: program::Reader::new(profile, tools) }
    }

    /// The rules of the control.
    pub fn profile(&self) -> &'a Profile {
        self.profile
    }

    /// The tools.
    pub fn tools(&self) -> &'a ToolTable {
        self.tools
    }

    /// Audits the path of the next part; see [`audit_after`]. Both start where the part before has
    /// ended.
    pub fn audit(
        &mut self,
        contour: &ProgrammedContour,
        path: &CompensatedPath,
        said: &[Finding],
    ) -> Audit {
        let Self { profile, tools, .. } = *self;
        let mut report = Report::new(profile, said);
        let mut result =
            Audit { elements: path.elements.len(), events: path.events.len(), ..Audit::default() };
        let is_sane = check_numbers(path, &mut report);
        let mut tool_path = ToolPath {
            path,
            program: program::read(&mut self.reader, contour),
            block_of: vec![program::NONE; path.elements.len()],
            roles: Vec::with_capacity(path.elements.len()),
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
}

/// Checks that all numbers are finite; also reports elements of no length.
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
        // A move out of the plane may only activate a tool length; its block says so.
        if stays && !matches!(element.role, Role::None | Role::OffPlane) {
            report.push(report::no_length(element, index));
        }
        start = element.end;
    }
    is_sane
}
