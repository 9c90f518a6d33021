//! One block of manual data input.
//!
//! A lead-on needs the block after it, and here is none. So a single block runs as programmed, or
//! not at all, whatever its words select (N09, C20).

use crate::tools::verdict::{Verdict, judge};
use crate::walk::plan::Planning;
use cnc_msgs::contour::{ContourEventKind, CutterSide, ProgrammedContour, Source};
use cnc_msgs::finding::{Code, Finding, Severity};
use cnc_msgs::profile::{MdiMode, Profile};
use cnc_msgs::tool_table::ToolTable;

/// Plans a single block by the rules of a control; its path is never compensated.
pub fn plan_block(contour: &ProgrammedContour, profile: &Profile, tools: &ToolTable) -> Verdict {
    let selection = contour.events.iter().find_map(|event| match event.kind {
        ContourEventKind::Select { side, .. } => Some((side, event.source)),
        _ => None,
    });
    let mut uncompensated = contour.clone();
    uncompensated.events.retain(|event| !is_about_compensation(&event.kind));
    let mut verdict = judge(&uncompensated, profile, tools, Planning::default());
    let planned = &mut verdict.plan;
    if let Some((side, source)) = selection {
        planned.findings.insert(0, selected(side, source, profile));
        if !planned.accepted() {
            planned.refused.append(&mut planned.path.elements);
            planned.path.events.clear();
        }
    }
    verdict
}

const fn is_about_compensation(kind: &ContourEventKind) -> bool {
    use ContourEventKind as K;
    match kind {
        K::Radius(_)
        | K::RadiusValue { .. }
        | K::Select { .. }
        | K::Cancel { .. }
        | K::HoldDirection { .. }
        | K::CornerArc { .. }
        | K::Calculation => true,
        K::Motion(_) | K::Plane(_) | K::Corner(_) | K::Action(_) => false,
    }
}

fn selected(side: CutterSide, source: Source, profile: &Profile) -> Finding {
    let side = match side {
        CutterSide::Left => "left",
        CutterSide::Right => "right",
    };
    let rule = match profile.mdi.rule {
        MdiMode::Uncompensated => "has no effect in a single block",
        MdiMode::Forbidden => "is not allowed in a single block",
    };
    let message = format!(
        "compensation {side} of the contour {rule} of manual data input ({})",
        profile.name
    );
    match profile.mdi.severity() {
        Severity::Error => Finding::error(Code::NeverActive, source, message)
            .help("leave it out, or run it as a program"),
        Severity::Warning => Finding::warning(Code::NeverActive, source, message)
            .help("the block runs as it is programmed, along the centre of the tool"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::verdict::tests::{offset, sinumerik, spoil_paths, square};

    #[test]
    fn a_block_whose_path_is_wrong_is_handed_out_for_a_report() {
        let mut block = square();
        block.events.truncate(1);
        let (profile, tools) = (sinumerik(), offset(5.0));
        assert!(plan_block(&block, &profile, &tools).plan.accepted());
        spoil_paths();
        let verdict = plan_block(&block, &profile, &tools);
        assert_eq!(verdict.disagreement.expect("a disagreement").contour, block);
        assert!(!verdict.plan.accepted());
    }
}
