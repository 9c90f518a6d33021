//! One verdict on a contour, whoever asks for it: the plan, and the proof of its path.
//!
//! `kerf plan`, `kerf check`, the planner's node, `set_tool`, single blocks, the rest of a run
//! and `kerf replay` all ask [`judge`] or [`prove`], and nobody asks only one of the two
//! algorithms. Where both disagree, the path is refused and the verdict says that Kerf is wrong
//! and not the program, with a name for the file that a shell keeps for a report.

use crate::audit::{Audit, audit_after};
use crate::{Plan, Planning, plan_with};
use cnc_msgs::contour::{ProgrammedContour, Source};
use cnc_msgs::diagnostic::{Code, Diagnostic};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::ToolTable;
use std::fmt::Write;

/// A plan whose path is proved, or refused.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Verdict {
    pub plan: Plan,
    /// `None`: the planner refused the contour, so that there was no path to audit.
    pub audit: Option<Audit>,
    /// The planner accepted the contour, and the audit refused its path.
    pub disagreement: Option<Disagreement>,
}

/// A contour on which both algorithms disagree: a defect of Kerf.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Disagreement {
    /// Name of the file that keeps the program; the same wherever the verdict is made.
    pub file_name: String,
}

/// Plans a contour and audits the path.
///
/// Never panics. The verdict depends neither on certificates nor on the workers.
pub fn judge(
    contour: &ProgrammedContour,
    profile: &Profile,
    tools: &ToolTable,
    planning: Planning<'_>,
) -> Verdict {
    prove(plan_with(contour, profile, tools, planning), contour, profile, tools)
}

/// Audits a plan before anybody runs it. What the planner has said already is not said again,
/// and what is an error refuses the plan; what is a warning is one of the plan too.
pub fn prove(
    mut plan: Plan,
    contour: &ProgrammedContour,
    profile: &Profile,
    tools: &ToolTable,
) -> Verdict {
    if !plan.accepted() {
        return Verdict { plan, ..Verdict::default() };
    }
    let audit = audit_after(contour, &plan.path, profile, tools, &plan.diagnostics);
    let mut disagreement = None;
    if audit.refuses() {
        let found = disagree(contour, profile, tools);
        plan.diagnostics.push(internal_error(&found));
        plan.diagnostics.extend(audit.findings.iter().filter(|f| f.is_error()).cloned());
        // What is about the program as a whole comes first.
        plan.diagnostics.sort_by_key(|finding| finding.source.line);
        plan.refused = std::mem::take(&mut plan.path).elements;
        plan.uncut.clear();
        disagreement = Some(found);
    } else if !audit.findings.is_empty() {
        plan.diagnostics.extend(audit.findings.iter().cloned());
        plan.diagnostics.sort_by_key(|finding| finding.source.line);
    }
    Verdict { plan, audit: Some(audit), disagreement }
}

fn disagree(contour: &ProgrammedContour, profile: &Profile, tools: &ToolTable) -> Disagreement {
    let mut name = Fnv::default();
    // Writing to it cannot fail.
    let _ = write!(name, "{contour:?}{profile:?}{tools:?}");
    Disagreement { file_name: format!("disagreement_{:016x}.yaml", name.0) }
}

fn internal_error(disagreement: &Disagreement) -> Diagnostic {
    Diagnostic::error(
        Code::InternalError,
        Source::default(),
        "the planner accepts this program, and the audit refuses the path that it made: this is \
         a defect of Kerf, not of the program",
    )
    .help(format!(
        "send {} to the developers of Kerf; it holds the program, the tools and the control",
        disagreement.file_name
    ))
}

/// FNV-1a: a number that is the same everywhere, of whatever is written.
#[derive(Debug)]
struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Write for Fnv {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        Ok(())
    }
}
