//! Which findings a verdict has, which of them refuse, and where the audit reaches a limit.

use super::support::*;
use super::{refused, verdict};
use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use cnc_msgs::profile::{Reaction, Strictness};
use compensation_planner::Verdict;
use compensation_planner::verdict::prove;

#[test]
fn a_gouge_is_not_hidden_behind_a_cut_into_another_pass() {
    // N9 comes back to where N4 ended: another pass begins, and is cut into, which is a
    // warning. N7 is of the first pass, and the tool on N4 cuts 0.9 mm into it.
    let text = "
        N1 G0 X21.92 Y21.92
        N2 G41 G450 D1 G1 X0 Y0 F100
        N4 X-3
        N5 X-2.406
        N6 G2 X-1.615 Y-0.128 I0 J-2.5
        N7 G1 X1 Y-1
        N8 X-3 Y0
        N9 X-2 Y1
        N10 X0 Y0
        N11 G40 X0 Y31";
    let Verdict { plan, disagreement, .. } = verdict(text, &sinumerik(), 10.0);
    assert_eq!(disagreement, None, "{}", findings(&plan));
    let gouge = finding(&plan, Code::Gouge);
    assert_eq!(gouge.severity, Severity::Error);
    assert!(gouge.depth_mm.unwrap() > 0.9, "{gouge:?}");
}

#[test]
fn a_disagreement_is_an_error_of_kerf_and_has_the_same_name_everywhere() {
    let text = "
        N1 G0 X0 Y20
        N2 G41 D1 G1 X0 Y0 F100
        N3 X50
        N4 G40 X50 Y20";
    let (profile, tools) = (sinumerik(), tool(5.0));
    let contour = contour(text, &profile);
    let mut wrong = compensation_planner::plan(&contour, &profile, &tools);
    assert!(wrong.accepted());
    // As if the planner had gone a tenth too near.
    for element in &mut wrong.path.elements {
        if element.role != Role::None && element.end[1] == 5.0 {
            element.end[1] = 4.9;
        }
    }
    let judged = prove(wrong.clone(), &contour, &profile, &tools);
    let file_name = judged.disagreement.clone().expect("a disagreement").file_name;
    let first = &judged.plan.findings[0];
    assert_eq!((first.code, first.severity), (Code::InternalError, Severity::Error));
    assert!(first.help.contains(&file_name), "{first:?}");
    assert!(judged.plan.path.elements.is_empty() && !judged.plan.refused.is_empty());
    finding(&judged.plan, Code::Gouge);
    assert_eq!(judged, prove(wrong, &contour, &profile, &tools));
}

/// What makes a path wrong.
type Change<'a> = &'a dyn Fn(&mut CompensatedPath);

/// The tool is wider than the slot of N4 to N8; the control is let run it.
const SLOT: &str = "
    N1 G0 X0 Y30
    N2 G41 D1 G1 X0 Y0 F100
    N3 X20
    N4 Y-5
    N5 M5
    N6 X22
    N7 Z-1
    N8 Y0
    N9 X50
    N10 G40 X50 Y30";

#[test]
fn where_a_misfit_is_ignored_only_the_shape_of_the_path_may_be_off() {
    let mut profile = sinumerik();
    profile.interference.react = Reaction::Ignore;
    let (contour, tools) = (contour(SLOT, &profile), tool(5.0));
    let planned = compensation_planner::plan(&contour, &profile, &tools);
    assert!(planned.accepted(), "{}", findings(&planned));
    finding(&planned, Code::Unreachable);
    let proved = |change: Change<'_>| {
        let mut plan = planned.clone();
        change(&mut plan.path);
        assert_ne!(plan.path, planned.path);
        prove(plan, &contour, &profile, &tools)
    };
    let refuses: [(&str, Change<'_>); 5] = [
        ("M5 lost", &|path| {
            path.events.remove(0);
        }),
        ("M5 twice", &|path| path.events.insert(0, path.events[0])),
        ("M5 late", &|path| path.events[0].at_element += 2),
        ("another Z", &|path| {
            let down = path.elements.iter_mut().find(|it| it.role == Role::OffPlane);
            down.expect("the block out of the plane").end[2] = -2.0;
        }),
        ("another end of the lead-off", &|path| {
            let off = path.elements.iter_mut().find(|it| it.role == Role::LeadOff);
            off.expect("a lead-off").end[1] = 29.0;
        }),
    ];
    for (name, change) in refuses {
        let judged = proved(change);
        assert!(judged.disagreement.is_some(), "{name}: {}", findings(&judged.plan));
        assert_eq!(finding(&judged.plan, Code::PathMismatch).severity, Severity::Error, "{name}");
    }
    // A path that leaves the contour is a warning, of the plan as well.
    let judged = proved(&|path| {
        let last = path.elements.iter_mut().rfind(|it| it.role == Role::Contour);
        last.expect("an element of the contour").end[0] -= 1.0;
    });
    assert_eq!(judged.disagreement, None, "{}", findings(&judged.plan));
    let found = judged.audit.expect("an audit").findings;
    assert!(!found.is_empty() && found.iter().all(|it| judged.plan.findings.contains(it)));
}

#[test]
fn no_number_of_warnings_refuses_a_path_or_hides_an_error() {
    use std::fmt::Write;
    const STEPS: usize = 150;
    let mut text = String::from(
        "
        N1 G0 X0 Y30
        N2 G41 D1 G1 X0 Y0 F100
        N3 X20
        N4 Y-5
        N5 X22
        N6 Y0",
    );
    for step in 0..STEPS {
        let _ = write!(text, "\nX{} Y{}", 32 + 10 * step, step % 2);
    }
    text += "\nM5\nX2000 Y0\nG40 X2000 Y30";
    let mut profile = sinumerik();
    profile.interference.react = Reaction::Ignore;
    let (contour, tools) = (contour(&text, &profile), tool(5.0));
    let mut plan = compensation_planner::plan(&contour, &profile, &tools);
    assert!(plan.accepted(), "{}", findings(&plan));
    for element in plan.path.elements.iter_mut().filter(|it| it.role == Role::Contour) {
        element.end[1] += 0.1;
    }
    let judged = prove(plan.clone(), &contour, &profile, &tools);
    assert_eq!(judged.disagreement, None, "{}", findings(&judged.plan));
    let warnings = judged.audit.expect("an audit").findings.len();
    assert!(warnings > STEPS / 2 && warnings <= 100, "{warnings}");
    plan.path.events.clear();
    let judged = prove(plan, &contour, &profile, &tools);
    assert!(judged.disagreement.is_some());
    assert_eq!(finding(&judged.plan, Code::PathMismatch).severity, Severity::Error);
}

#[test]
fn a_cut_into_a_block_that_is_known_not_to_fit_is_no_disagreement() {
    // N8 is 1 mm long; nct looks one block ahead. The audit calls a cut what is unreachable.
    let text = "
        N1 G0 X-0.77 Y6.362
        N2 G42 D1 G1 X-0.77 Y-0.638 F100
        N4 X0 Y0
        N5 X2.551 Y-3.081
        N6 X1.01 Y-4.357
        N7 X-1.541 Y-1.275
        N8 X-0.77 Y-0.638
        N9 G40 X4.179 Y4.312";
    let mut profile = profile("nct");
    profile.lookahead.strictness = Strictness::Warn;
    let Verdict { plan, disagreement, .. } = verdict(text, &profile, 2.000000001);
    assert_eq!(disagreement, None, "{}", findings(&plan));
    assert_eq!(finding(&plan, Code::Gouge).severity, Severity::Warning);
}

#[test]
fn a_warning_about_a_far_block_hides_no_cut_into_a_near_one() {
    // The mouth between N3 and N9 is too narrow; nct looks one block ahead and would not see it.
    let text = "
        N1 G0 X-30 Y5
        N2 G41 D1 G1 X0 Y0 F100
        N3 X60 Y0
        N4 X60 Y-30
        N5 X100 Y-30
        N6 X100 Y40
        N7 X60 Y40
        N8 X60 Y8
        N9 X0 Y8
        N10 G40 X-30 Y3";
    let mut profile = profile("nct");
    profile.lookahead.strictness = Strictness::Warn;
    profile.corner.default = cnc_msgs::contour::OutsideCorner::Arc;
    let (contour, tools) = (contour(text, &profile), tool(5.0));
    let mut plan = compensation_planner::plan(&contour, &profile, &tools);
    assert!(plan.accepted(), "{}", findings(&plan));
    let said = finding(&plan, Code::Gouge);
    assert_eq!((said.source.line, said.other.map(|other| other.line)), (9, Some(3)));
    assert_eq!(prove(plan.clone(), &contour, &profile, &tools).disagreement, None);
    // Straight on at the corner of N8 and N9 the tool cuts into both.
    let is_corner = |it: &&mut PathElement| it.role == Role::Corner && it.source.line == 9;
    let corner = plan.path.elements.iter_mut().find(is_corner).expect("a corner");
    corner.shape = cnc_msgs::geometry::Shape::Line;
    let judged = prove(plan, &contour, &profile, &tools);
    assert!(judged.disagreement.is_some(), "{}", findings(&judged.plan));
}

#[test]
fn what_only_the_audit_cannot_look_at_is_a_limit_with_advice() {
    // Each pass is a little smaller and cuts into all before it, which is ignored; of so many cuts
    // the audit keeps fewer than the planner.
    use std::fmt::Write;
    let mut text = String::from("N1 G0 X-20 Y0\nN2 G41 D1 G1 X0 Y0 F100");
    for pass in 0..100 {
        let far = 100.0 - 0.01 * f64::from(pass);
        let _ = write!(text, "\nX0 Y{far}\nX{far} Y{far}\nX{far} Y0\nX0 Y0");
    }
    text += "\nG40 X-20 Y-20";
    let mut ignores = sinumerik();
    ignores.interference.react = Reaction::Ignore;
    let Verdict { plan, audit, disagreement } = verdict(&text, &ignores, 5.0);
    assert!(audit.is_some_and(|audit| audit.refuses()), "{}", findings(&plan));
    assert_eq!(disagreement, None, "{}", findings(&plan));
    assert!(!plan.accepted() && plan.path.elements.is_empty() && !plan.refused.is_empty());
    let limit = plan.findings.iter().find(|it| it.is_error()).expect("an error");
    assert_eq!(limit.code, Code::Limit);
    assert!(limit.help.contains("split the contour"), "{limit:?}");
}

#[test]
fn a_negative_radius_excuses_no_cut() {
    // Inside out: the tool is 7.5 mm on the other side, and N40 crosses N20 and N30.
    let inside_out = BOTTLENECK.replacen("X80 Y55", "X-80 Y55", 1);
    refused(&inside_out, &sinumerik(), -7.5, Code::Gouge, 12);
    refused(&inside_out.replacen("G42", "G41", 1), &sinumerik(), 7.5, Code::Gouge, 12);
}
