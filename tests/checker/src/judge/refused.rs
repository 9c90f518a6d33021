//! Judges a refusal: whether the tool really does not fit.

use super::center_path::center_paths;
use super::lead::lead_refused;
use super::{
    ACCEPTED_MM, Judgement, NotJudged, ProductResult, Wrong, WrongKind, add, is_about_fitting,
    is_plain,
};
use crate::fit::{self, Fit};
use crate::program::{Program, Span};
use cnc_msgs::finding::{Code, Finding};

/// A tool that is this much larger must fit too, before a refusal is a false alarm, mm: what is
/// consumed is decided without a tolerance, by coordinates that are rounded.
const MARGIN_MM: f64 = 5e-4;

pub(super) fn refused(
    program: &Program,
    verdict: &ProductResult,
    wrong: &mut Vec<Wrong>,
) -> Judgement {
    let errors = || verdict.findings.iter().filter(|finding| finding.is_error());
    if let Some(finding) = errors().find(|finding| finding.code == Code::InternalError) {
        add(wrong, WrongKind::InternalError, format!("internal error: {}", finding.message));
    }
    if verdict.is_unread
        || errors()
            .any(|finding| !is_about_fitting(finding.code) && finding.code != Code::InternalError)
    {
        return Judgement::RefusedByRule;
    }
    let refused = center_paths([0.0; 3], &verdict.refused, program.axes);
    let mut outcomes = Vec::new();
    for finding in errors() {
        let span = program.spans.iter().find(|span| span.contains(finding.source.line));
        let one = match (span, finding.code) {
            (None, _) if finding.code == Code::InternalError => continue,
            // A contradiction is reported once.
            _ if errors().any(|other| other.code == Code::InternalError) => continue,
            (None, _) => {
                add(
                    wrong,
                    WrongKind::FalseGouge,
                    format!("{} at line {}: no contour", finding.code.name(), finding.source.line),
                );
                continue;
            }
            (Some(span), Code::LeadGouge | Code::LeadNick | Code::LinkGouge) => {
                let is_here = |other: &&Finding| span.contains(other.source.line);
                // Where the contour is not followed to its end a lead begins anywhere.
                let mut others = verdict.findings.iter().filter(is_here);
                match others.any(|other| matches!(other.code, Code::Unreachable | Code::Gouge)) {
                    true => Judgement::NotJudged(NotJudged::Lead),
                    false => lead_refused(span, finding, &refused, wrong),
                }
            }
            (Some(span), Code::Gouge) if errors().any(|other| is_by_lead(span, other)) => {
                Judgement::NotJudged(NotJudged::Lead)
            }
            (Some(span), _) => span_refused(span, finding, wrong),
        };
        outcomes.push(one);
    }
    // One good reason is enough.
    outcomes.into_iter().min().unwrap_or(Judgement::Wrong)
}

/// Whether a tool that is said not to fit does not.
fn span_refused(span: &Span, finding: &Finding, wrong: &mut Vec<Wrong>) -> Judgement {
    if !is_plain(span) {
        return Judgement::NotJudged(NotJudged::Change);
    }
    if let Some(outcome) = not_fitting(span) {
        return outcome;
    }
    if is_by_lead(span, finding) {
        return Judgement::NotJudged(NotJudged::Lead);
    }
    let kind = match finding.code {
        Code::Gouge => WrongKind::FalseGouge,
        _ => WrongKind::FalseUnreachable,
    };
    add(
        wrong,
        kind,
        format!(
            "false alarm: {} at line {}: {}",
            finding.code.name(),
            finding.source.line,
            finding.message
        ),
    );
    Judgement::Wrong
}

/// Whether it is the direction of a lead that the tool does not fit.
fn is_by_lead(span: &Span, finding: &Finding) -> bool {
    finding.code == Code::Unreachable
        && span.contains(finding.source.line)
        && finding.message.contains("the lead meets the contour")
}

/// What a refusal is where the tool does not fit.
fn not_fitting(span: &Span) -> Option<Judgement> {
    let all = [2.0 * ACCEPTED_MM, 0.0, -MARGIN_MM].map(|slack_mm| fit::fits(span, slack_mm));
    if matches!(all[0], Fit::DoesNot(_) | Fit::PassesBy(_)) && all[1] != Fit::Fits {
        return Some(Judgement::Refused);
    }
    if all.iter().any(|fit| matches!(fit, Fit::Unknown(_))) {
        return Some(Judgement::NotJudged(NotJudged::Unknown));
    }
    all.iter().any(|fit| *fit != Fit::Fits).then_some(Judgement::NotJudged(NotJudged::Tolerance))
}
