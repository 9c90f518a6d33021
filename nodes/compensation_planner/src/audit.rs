//! An independent audit of a compensated path: a second algorithm that proves a path against
//! the contour it was made of.
//!
//! It shares no geometry with the planner, only the vocabulary of contours and paths and the
//! resolving of radii. `program` reads what each motion is to compensation, `align` gives
//! every element its block, `events` counts what is not motion, `beside` and `follow` prove
//! that elements run at their radius beside their own blocks (`sharp`: what a sharp corner
//! takes), `bounds` finds what bounds the tool, and `clearance` measures the exact distance of
//! the path from it. Millions of pieces lie side by side in memory (`pieces`); strip trees
//! find those that are near (`strip`), directions those that cannot meet (`fans`), and lower
//! bounds settle most of the rest (`apart`) before anything is measured (`planar`).
//! Blocks may be left out within the tolerance that the profile accepts.

mod align;
mod apart;
mod beside;
mod bounds;
mod clearance;
mod events;
mod fans;
mod follow;
mod pieces;
mod planar;
mod program;
mod report;
mod sharp;
mod spans;
mod strip;
mod way;

use crate::Plan;
use cnc_msgs::contour::ProgrammedContour;
use cnc_msgs::diagnostic::Diagnostic;
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::{CompensatedPath, Role};
use cnc_msgs::profile::{OutputPoint, Profile};
use cnc_msgs::tool_table::ToolTable;
use pieces::Chains;
use report::Report;
use spans::Spans;
use way::Way;

/// What an audit found, and how much it looked at.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Audit {
    /// Sound paths have none, but for the warnings that their profile allows.
    pub findings: Vec<Diagnostic>,
    pub elements: usize,
    pub spans: usize,
    pub events: usize,
    /// The least distance from a wall that is nearer than the radius, mm; `None`: no wall is.
    pub nearest_mm: Option<f64>,
}

impl Audit {
    /// Whether the path must not be run.
    pub fn refuses(&self) -> bool {
        self.findings.iter().any(Diagnostic::is_error)
    }

    /// The same without what has been said before: the same code about one of the same blocks.
    #[must_use]
    pub fn beside(mut self, said: &[Diagnostic]) -> Self {
        self.findings.retain(|finding| !said.iter().any(|other| is_same(finding, other)));
        self
    }
}

fn is_same(a: &Diagnostic, b: &Diagnostic) -> bool {
    let lines =
        |finding: &Diagnostic| [Some(finding.source.line), finding.other.map(|other| other.line)];
    let (of_a, of_b) = (lines(a), lines(b));
    a.code == b.code && of_a.iter().flatten().any(|line| of_b.contains(&Some(*line)))
}

/// Audits a plan before anybody runs it: what the planner has said already is not said again,
/// and what is an error refuses the plan, with its findings.
pub fn veto(
    plan: &mut Plan,
    contour: &ProgrammedContour,
    profile: &Profile,
    tools: &ToolTable,
) -> Audit {
    if !plan.accepted() {
        return Audit::default();
    }
    let audit = audit(contour, &plan.path, profile, tools).beside(&plan.diagnostics);
    if audit.refuses() {
        plan.diagnostics.extend(audit.findings.iter().filter(|f| f.is_error()).cloned());
        plan.diagnostics.sort_by_key(|finding| finding.source.line);
        plan.refused = std::mem::take(&mut plan.path).elements;
    }
    audit
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
    let mut report = Report::new(profile);
    let mut result =
        Audit { elements: path.elements.len(), events: path.events.len(), ..Audit::default() };
    let is_sane = sane(path, &mut report);
    let mut way = Way {
        path,
        program: program::read(contour, profile, tools),
        of: vec![program::NONE; path.elements.len()],
        roles: Vec::with_capacity(path.elements.len()),
        is_of_tip: profile.output == OutputPoint::Tip,
    };
    if is_sane && align::align(&mut way, &mut report) {
        events::check(&way, tools, &mut report);
        let Spans { spans, legs } = Spans::of(&way);
        result.spans = spans.len();
        let chains: Vec<Chains<'_>> =
            spans.iter().map(|span| Chains::of(&way, span, &legs)).collect();
        for chains in &chains {
            beside::check(&mut way, chains, &mut report);
        }
        for chains in &chains {
            clearance::check(&way, chains, &mut result.nearest_mm, &mut report);
        }
    }
    result.findings = report.findings;
    result.findings.sort_by_key(|finding| finding.source.line);
    result
}

/// Whether all numbers are numbers; what is no motion or no circle is reported beside.
fn sane(path: &CompensatedPath, report: &mut Report<'_>) -> bool {
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
        if stays && element.role != Role::None {
            report.push(report::no_length(element, index));
        }
        start = element.end;
    }
    is_sane
}
