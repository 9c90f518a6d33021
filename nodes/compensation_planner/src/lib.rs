//! Programmed contour and tool table to compensated path.
//!
//! [`judge`] is the whole interface: a contour, the rules of a control and the
//! tools go in; the path of the tool centre, proved by [`path_audit`], or the reasons against it
//! come out.
//! It does not read programs.
//!
//! The way of an event: `walk` gathers what lies between a lead-on and a
//! lead-off into a [`span`](crate::span) and applies the `rules`; `normalise`
//! makes runs of its legs, `links` a chain of them, `chain` joins their offsets; `reach`
//! says what the tool does not fit into, `walls` what bounds it (`meeting`: where the
//! contour meets itself), `interference` where it cuts into that (`tree`: who is near), `trim` cuts off
//! what does not fit and `uncut` tells what that leaves, `corner` shapes outside corners,
//! `lead` checks the leads, `write` and `emit` put it all out, and `other_spans` compares it
//! with the spans before it.
//!
//! Beside it: `mdi` plans a single block, `set_tool` decides on a change of the tool
//! table and `tool_file` writes it into the file of its owner.

mod certificate;
mod chain;
mod compensate;
mod copies;
mod corner;
mod distance;
mod element;
mod emit;
mod finding;
mod frame;
mod interference;
mod intersect;
mod lead;
mod links;
pub mod mdi;
mod meeting;
#[cfg(feature = "node")]
pub mod node;
mod normalise;
mod other_spans;
#[cfg(feature = "node")]
mod preview;
mod reach;
pub mod rest;
mod restart;
mod rules;
pub mod set_tool;
mod span;
pub mod tessellate;
mod tip;
mod tolerance;
pub mod tool_file;
mod tree;
mod trim;
mod uncut;
pub mod verdict;
mod walk;
mod walls;
mod write;

pub use certificate::{Certificate, CertificateLimit};
pub use restart::{NoStart, Start, start};
pub use uncut::{OutlinePiece, UncutRegion};
pub use verdict::{Verdict, judge};

use cnc_msgs::contour::{CutterSide, ProgrammedContour};
use cnc_msgs::finding::Finding;
use cnc_msgs::path::{CompensatedPath, PathElement};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;

/// What becomes of a contour.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// The path of the tool centre; empty when the contour is refused.
    pub path: CompensatedPath,
    /// What would have been cut, for pictures, when the contour is refused.
    pub refused: Vec<PathElement>,
    /// All findings, by line.
    pub findings: Vec<Finding>,
    /// The compensated pieces, in order.
    pub spans: Vec<SpanSummary>,
    /// The radii that each of them is good for, by [`plan_certified`].
    pub certificates: Vec<Certificate>,
    /// What stays uncut where the profile leaves out what does not fit.
    pub uncut: Vec<UncutRegion>,
}

/// One compensated piece: what lies between a lead-on and the next lead-off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpanSummary {
    /// Lines of the first and last block of the contour, without its leads.
    pub first_line: u32,
    pub last_line: u32,
    /// The side that the tool runs on; a negative radius has been taken into account.
    pub side: CutterSide,
    /// Offset at the lead-on, mm, never negative.
    pub radius_mm: f64,
    /// Indices of its first and last element without leads and links, in the
    /// path or in what was refused.
    pub first_element: usize,
    pub last_element: usize,
}

impl Plan {
    /// Whether no finding is an error.
    pub fn accepted(&self) -> bool {
        !self.findings.iter().any(Finding::is_error)
    }
}

/// Compensates a contour by the rules of a control; [`judge`] proves the path too.
///
/// Never panics; a contour that cannot be compensated gives findings and no path.
/// The time is linear in the number of events but for the sorting of boxes.
pub fn plan(contour: &ProgrammedContour, profile: &Profile, tools: &ToolTable) -> Plan {
    plan_with(contour, profile, tools, Planning::default())
}

/// [`plan`], and the radii that each span is good for: some ten times the work.
pub fn plan_certified(contour: &ProgrammedContour, profile: &Profile, tools: &ToolTable) -> Plan {
    plan_with(contour, profile, tools, Planning { certifies: true, ..Planning::default() })
}

/// How a contour is planned.
#[derive(Debug, Clone, Copy)]
pub struct Planning<'a> {
    /// Whether the radii that each span is good for are found too.
    pub certifies: bool,
    /// Who finds the ways along spans that do not depend on each other.
    pub workers: &'a dyn Workers,
}

impl Default for Planning<'_> {
    fn default() -> Self {
        Self { certifies: false, workers: &Alone }
    }
}

/// Whoever can do several pieces of work at the same time: a core has no threads.
pub trait Workers: std::fmt::Debug {
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

/// [`plan`], with a choice of what is wanted and who works. The result does not depend on
/// the workers.
pub fn plan_with(
    contour: &ProgrammedContour,
    profile: &Profile,
    tools: &ToolTable,
    planning: Planning<'_>,
) -> Plan {
    let mut walk = walk::Walk::new(contour, profile, tools, planning);
    for event in &contour.events {
        walk.event(&event.kind, event.source);
    }
    walk.finish()
}
