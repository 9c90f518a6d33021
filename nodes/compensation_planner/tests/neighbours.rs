//! What the tool does to the element next to the one it follows.

mod support;

use cnc_msgs::diagnostic::{Code, Severity};
use support::*;

#[test]
fn a_tool_around_a_boss_does_not_cut_the_bow_behind_it() {
    // The bow of radius 50 closes around where the tool comes from.
    let text = "
        N1 G0 X60 Y20
        N2 G41 D1 G456 G1 X0 Y0 F100
        N3 G2 X-9.274596 Y2.74666 I-5.598253 J-1.871509
        N4 G3 X9.615319 Y35.781532 I-31.446117 J39.899666
        N5 G40 G456 G1 X-55 Y45";
    let plan = plan(text, &sinumerik(), &tool(45.8));
    let finding = finding(&plan, Code::Gouge);
    assert_eq!((finding.source.line, finding.severity), (4, Severity::Error));
    assert!(finding.depth_mm.unwrap() > 1.0, "{finding:?}");
    assert!(!plan.accepted());
}

#[test]
fn an_outside_corner_does_not_swing_through_the_arc_before_it() {
    let text = "
        N1 G0 X10 Y-20
        N2 G41 D1 G456 G1 X0 Y0 F100
        N3 G3 X23.779 Y-3.880 I8.859 J-20.512
        N4 G1 X61.536 Y-35.400
        N5 G40 G456 X84 Y-8";
    let plan = plan(text, &sinumerik(), &tool(15.761));
    assert_eq!(finding(&plan, Code::Gouge).source.line, 4);
}

#[test]
fn a_d_shaped_pocket_entered_in_its_corner_is_cut() {
    let text = "
        N1 G0 X0 Y5
        N2 G41 D1 G456 G1 X-20 Y0 F100
        N3 X20
        N4 G3 X-20 Y0 I-20 J0
        N5 G40 G456 G1 X0 Y5";
    let plan = plan(text, &sinumerik(), &tool(5.0));
    let finding = finding(&plan, Code::Gouge);
    assert!((finding.depth_mm.unwrap() - 5.0).abs() < 0.7, "{finding:?}");
}

#[test]
fn a_closed_circle_is_a_pass_and_what_follows_is_another() {
    let text = "
        N1 G0 X40 Y5
        N2 G42 D1 G456 G1 X20 Y0 F100
        N3 G3 X20 Y0 I-20 J0
        N4 G1 X24 Y-30
        N5 G40 G456 X60 Y-30";
    let plan = plan(text, &sinumerik(), &tool(5.0));
    let finding = finding(&plan, Code::CutsOtherPass);
    assert_eq!(finding.severity, Severity::Warning);
    assert!(plan.accepted(), "{}", findings(&plan));
}
