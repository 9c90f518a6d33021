//! The plan of a contour: how to ask for it, and what it holds.

use crate::check::certificate::Certificate;
use crate::check::uncut::UncutRegion;
use crate::walk::Walk;
use cnc_msgs::contour::{CutterSide, ProgrammedContour};
use cnc_msgs::finding::Finding;
use cnc_msgs::path::{CompensatedPath, PathElement};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;

/// The result of planning a contour.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// The path of the tool centre; empty when the contour is refused.
    pub path: CompensatedPath,
    /// The path that was refused, for pictures.
    pub refused: Vec<PathElement>,
    /// All findings, by line.
    pub findings: Vec<Finding>,
    /// The compensated pieces, in order.
    pub spans: Vec<SpanSummary>,
    /// The valid radii of each of them, from [`plan_certified`].
    pub certificates: Vec<Certificate>,
    /// What stays uncut if the profile leaves out what does not fit.
    pub uncut: Vec<UncutRegion>,
}

/// One compensated piece: what lies between a lead-on and the next lead-off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpanSummary {
    /// Lines of the first and last block of the contour, without its leads.
    pub first_line: u32,
    pub last_line: u32,
    /// The side that the tool runs on; the sign of the radius is already applied.
    pub side: CutterSide,
    /// Offset at the lead-on, mm, never negative.
    pub radius_mm: f64,
    /// Indices of its first and last element without leads and links, in the path or in what was
    /// refused.
    pub first_element: usize,
    pub last_element: usize,
}

impl Plan {
    /// Whether no finding is an error.
    pub fn accepted(&self) -> bool {
        !self.findings.iter().any(Finding::is_error)
    }
}

/// Compensates a contour by the rules of a control; [`judge`](crate::judge) proves the path too.
///
/// Never panics; a contour that cannot be compensated gives findings and no path. The time is
/// linear in the number of events, except for the sorting of boxes.
pub fn plan(contour: &ProgrammedContour, profile: &Profile, tools: &ToolTable) -> Plan {
    plan_with(contour, profile, tools, Planning::default())
}

/// [`plan`] and [`certificates`].
pub fn plan_certified(contour: &ProgrammedContour, profile: &Profile, tools: &ToolTable) -> Plan {
    plan_with(contour, profile, tools, Planning { certifies: true, ..Planning::default() })
}

/// Options of a plan.
#[derive(Debug, Clone, Copy)]
pub struct Planning<'a> {
    /// Whether the valid radii of each span are found too.
    pub certifies: bool,
    /// Finds the paths along spans that do not depend on each other.
    pub workers: &'a dyn Workers,
}

impl Default for Planning<'_> {
    fn default() -> Self {
        Self { certifies: false, workers: &Alone }
    }
}

/// Does several pieces of work at the same time: a core has no threads of its own.
pub trait Workers: std::fmt::Debug + Sync {
    /// Does each piece of work from 0 to `count` once, in any order.
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync));
}

/// Does one piece of work after another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Alone;

impl Workers for Alone {
    fn run(&self, count: usize, work: &(dyn Fn(usize) + Sync)) {
        (0..count).for_each(work);
    }
}

/// [`plan`] with options. The result does not depend on the workers.
pub fn plan_with(
    contour: &ProgrammedContour,
    profile: &Profile,
    tools: &ToolTable,
    planning: Planning<'_>,
) -> Plan {
    let mut walk = Walk::new(contour, profile, tools, planning.workers, None);
    for event in &contour.events {
        walk.event(&event.kind, event.source);
    }
    let mut plan = walk.finish();
    if planning.certifies {
        plan.certificates = certificates(contour, profile, tools, planning.workers, &|| true);
    }
    plan
}

/// The valid radii of each span, in order; no path is made. Once `goes_on` says no, what is left of
/// the work is skipped, and the result is good for nothing.
pub fn certificates(
    contour: &ProgrammedContour,
    profile: &Profile,
    tools: &ToolTable,
    workers: &dyn Workers,
    goes_on: &(dyn Fn() -> bool + Sync),
) -> Vec<Certificate> {
    let mut walk = Walk::new(contour, profile, tools, workers, Some(goes_on));
    for event in &contour.events {
        walk.event(&event.kind, event.source);
    }
    walk.finish_certificates()
}
