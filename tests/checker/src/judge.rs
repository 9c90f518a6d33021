//! Whether a verdict of the product is right.
//!
//! A path is measured against the walls of the contour that was drawn, a refusal against what
//! [`fit`](crate::fit) says. What neither proves is counted as not judged.

mod accepted;
mod center_path;
mod lead;
mod refused;

use crate::program::{End, Program, Span};
use accepted::accepted;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::path::{CompensatedPath, PathElement};
use refused::refused;

/// How much nearer than its radius the tool may come, mm: the definition.
pub const GOUGE_MM: f64 = 1e-4;
/// What rounding adds to a distance that is computed, mm.
const ROUNDING_MM: f64 = 1e-5;
/// `accept_tolerance_mm` of every shipped profile.
pub const ACCEPTED_MM: f64 = 0.002;

/// What the product says of a program.
#[derive(Debug, Clone, Default)]
pub struct ProductResult {
    /// Empty when the program is refused.
    pub path: CompensatedPath,
    pub findings: Vec<Finding>,
    /// The path that was refused.
    pub refused: Vec<PathElement>,
    /// Whether the loader refused the program.
    pub is_unread: bool,
}

impl ProductResult {
    pub fn is_accepted(&self) -> bool {
        !self.findings.iter().any(Finding::is_error)
    }
}

/// What is wrong with a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum WrongKind {
    /// It cuts into a wall, and no finding says so.
    SilentCut,
    /// It leaves out what the tool can reach, or runs elsewhere, and no finding says so.
    NotFollowed,
    /// Said to cut, and does not.
    FalseGouge,
    /// Said not to fit, and does.
    FalseUnreachable,
    /// A lead that is said to cut, and does not.
    FalseLeadGouge,
    /// The planner and the audit do not agree.
    InternalError,
}

/// One thing that is wrong, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wrong {
    pub kind: WrongKind,
    pub what: String,
}

fn add(wrong: &mut Vec<Wrong>, kind: WrongKind, what: String) {
    wrong.push(Wrong { kind, what });
}

/// What is right or wrong with a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Judgement {
    /// Accepted; the path was measured.
    Accepted,
    /// Refused, and the tool does not fit.
    Refused,
    /// Refused for a rule of the control that is not about where the tool fits.
    RefusedByRule,
    /// Refused for a place that is not judged here.
    NotJudged(NotJudged),
    Wrong,
}

/// Why a refusal is not judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NotJudged {
    /// Within the tolerances of the definitions.
    Tolerance,
    /// At an outside corner of curves, or where an element may be noise.
    Unknown,
    /// A lead that meets the contour as a corner, or runs over its end.
    Lead,
    /// A change of side or of the tool within the contour.
    Change,
}

/// The verdict on a verdict, and what is wrong with it.
pub fn judge(program: &Program, verdict: &ProductResult) -> (Judgement, Vec<Wrong>) {
    let mut wrong = Vec::new();
    let outcome = if verdict.is_accepted() {
        accepted(program, verdict, &mut wrong);
        Judgement::Accepted
    } else {
        refused(program, verdict, &mut wrong)
    };
    if wrong.is_empty() { (outcome, wrong) } else { (Judgement::Wrong, wrong) }
}

const fn is_about_fitting(code: Code) -> bool {
    matches!(
        code,
        Code::Gouge
            | Code::Unreachable
            | Code::CutsOtherPass
            | Code::LeadGouge
            | Code::LeadNick
            | Code::LinkGouge
    )
}

/// Whether the definitions leave nothing open for a span.
fn is_plain(span: &Span) -> bool {
    !span.changes_tool() && span.begin != End::OtherSide && span.end != End::OtherSide
}
