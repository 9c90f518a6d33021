//! One verdict: programs on which the planner and the audit of its path once disagreed, or on
//! which a gouge was hidden.
//!
//! `tests/tests/fuzz` looks for more of them.

mod findings_and_limits;
mod shapes;
#[path = "../support/mod.rs"]
mod support;

use cnc_msgs::finding::Code;
use cnc_msgs::path::PathElement;
use cnc_msgs::profile::Profile;
use compensation_planner::{Planning, Verdict, judge};
use support::*;

fn verdict(text: &str, profile: &Profile, radius_mm: f64) -> Verdict {
    let contour = contour(text, profile);
    judge(&contour, profile, &tool(radius_mm), Planning::default())
}

/// Accepted by both; the path.
#[track_caller]
fn accepted(text: &str, profile: &Profile, radius_mm: f64) -> Vec<PathElement> {
    let Verdict { plan, audit, disagreement } = verdict(text, profile, radius_mm);
    assert_eq!(disagreement, None, "{}", findings(&plan));
    assert!(plan.accepted(), "{}", findings(&plan));
    assert!(audit.is_some_and(|audit| !audit.refuses()));
    plan.path.elements
}

/// Refused by the planner itself, with this code at this line.
#[track_caller]
fn refused(text: &str, profile: &Profile, radius_mm: f64, code: Code, line: u32) {
    let Verdict { plan, disagreement, .. } = verdict(text, profile, radius_mm);
    assert_eq!(disagreement, None, "{}", findings(&plan));
    let is_meant = |it: &&cnc_msgs::finding::Finding| it.is_error() && it.code == code;
    let found = plan.findings.iter().find(is_meant);
    assert_eq!(found.map(|it| it.source.line), Some(line), "{}", findings(&plan));
}
