//! What a contour cuts of those before it in the program.

mod support;

use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::profile::{OtherSpans, Strictness};
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::{Plan, Planning, Verdict, judge};
use std::fmt::Write;
use support::{codes, contour, finding, findings, profile};

/// Planned and audited; both say the same.
#[track_caller]
fn judged_with(text: &str, other_spans: OtherSpans) -> Plan {
    let mut profile = profile("rs274");
    profile.interference.other_spans = other_spans;
    let contour = contour(text, &profile);
    let Verdict { plan, disagreement, .. } =
        judge(&contour, &profile, &ToolTable::default(), Planning::default());
    assert_eq!(disagreement, None, "{}", findings(&plan));
    plan
}

#[track_caller]
fn judged(text: &str) -> Plan {
    judged_with(text, OtherSpans::Warn)
}

/// A bore around X, Y with a radius, at a height, with arcs that lead to it and away from it.
fn bore(x: f64, y: f64, radius: f64, z: f64) -> String {
    let near = x + radius - 4.0;
    format!(
        "G0 Z5\nG0 X{x} Y{y}\nG1 Z{z} F100\nG41.1 D6 G1 X{near} Y{}\nG3 X{} Y{y} I0 J4\n\
         G3 X{} Y{y} I{} J0\nG3 X{} Y{y} I{radius} J0\nG3 X{near} Y{} I-4 J0\n\
         G40 G1 X{x} Y{y}\n",
        y - 4.0,
        x + radius,
        x - radius,
        -radius,
        x + radius,
        y + 4.0,
    )
}

#[test]
fn a_contour_that_cuts_into_an_earlier_one_is_reported() {
    // Two bores whose walls are 1.4 mm into each other.
    let text = bore(0.0, 0.0, 20.0, -2.0) + &bore(38.6, 0.0, 20.0, -2.0);
    let plan = judged(&text);
    let cut = finding(&plan, Code::CutsOtherSpan);
    assert_eq!(codes(&plan), [Code::CutsOtherSpan], "{}", findings(&plan));
    assert_eq!(cut.severity, Severity::Warning);
    assert!((cut.depth_mm.unwrap() - 1.4).abs() < 1e-6, "{cut:?}");
    assert!(cut.other.unwrap().line < 12 && cut.source.line > 12, "{cut:?}");
    let refused = judged_with(&text, OtherSpans::Error);
    assert!(!refused.accepted(), "{}", findings(&refused));
    let parts_of_their_own = judged_with(&text, OtherSpans::Ignore);
    assert_eq!(findings(&parts_of_their_own), "");
}

#[test]
fn contours_that_only_touch_are_not_reported() {
    for apart in [40.0, 40.1, 60.0] {
        let plan = judged(&(bore(0.0, 0.0, 20.0, -2.0) + &bore(apart, 0.0, 20.0, -2.0)));
        assert_eq!(findings(&plan), "", "{apart}");
    }
}

#[test]
fn what_is_cut_above_an_earlier_contour_is_meant_to_take_its_rim() {
    // A counterbore after its hole, the hole after the counterbore, and a larger hole.
    let counterbore = bore(0.0, 0.0, 20.0, -5.0) + &bore(0.0, 0.0, 25.0, -2.0);
    assert_eq!(findings(&judged(&counterbore)), "");
    let hole = bore(0.0, 0.0, 25.0, -2.0) + &bore(0.0, 0.0, 20.0, -5.0);
    assert_eq!(findings(&judged(&hole)), "");
    let larger = judged(&(bore(0.0, 0.0, 20.0, -2.0) + &bore(0.0, 0.0, 25.0, -5.0)));
    assert_eq!(codes(&larger), [Code::CutsOtherSpan], "{}", findings(&larger));
}

#[test]
fn a_contour_that_is_cut_again_deeper_is_the_same_contour() {
    let mut text = String::new();
    for z in 1..=4 {
        text += &bore(0.0, 0.0, 20.0, -f64::from(z));
    }
    assert_eq!(findings(&judged(&text)), "");
    // What it left is as deep as its last cut.
    assert_eq!(findings(&judged(&(text.clone() + &bore(0.0, 0.0, 25.0, -3.0)))), "");
    let deep = judged(&(text + &bore(0.0, 0.0, 25.0, -4.0)));
    assert_eq!(codes(&deep), [Code::CutsOtherSpan], "{}", findings(&deep));
}

#[test]
fn a_lead_of_a_later_contour_cuts_an_earlier_one() {
    // The second contour is led onto across the first.
    let line = |y: f64, from: f64| {
        format!(
            "G0 Z5\nG0 X0 Y{from}\nG1 Z-1 F100\nG41.1 D6 G1 X0 Y{y}\nX40\nG40 G1 X40 Y{}\n",
            y + 9.0
        )
    };
    let plan = judged(&(line(0.0, 9.0) + &line(-30.0, 9.0)));
    assert_eq!(codes(&plan), [Code::CutsOtherSpan], "{}", findings(&plan));
    assert_eq!(finding(&plan, Code::CutsOtherSpan).source.line, 10);
    assert_eq!(findings(&judged(&(line(0.0, 9.0) + &line(-30.0, -20.0)))), "");
}

#[test]
fn another_work_coordinate_system_is_another_part() {
    let second = bore(38.6, 0.0, 20.0, -2.0);
    let moved = format!("{}G0 Z5\nG55\n{second}", bore(0.0, 0.0, 20.0, -2.0));
    assert_eq!(findings(&judged(&moved)), "");
    let back = judged(&format!("{moved}G0 Z5\nG54\n{second}"));
    assert_eq!(codes(&back), [Code::CutsOtherSpan], "{}", findings(&back));
}

#[test]
fn a_work_coordinate_system_that_changes_within_a_contour_counts_from_the_next() {
    let mut profile = profile("rs274");
    profile.forbidden_under_compensation.strictness = Strictness::Warn;
    let cuts = |first: &str| {
        let text = first.to_owned() + &bore(38.6, 0.0, 20.0, -2.0);
        let contour = contour(&text, &profile);
        judge(&contour, &profile, &ToolTable::default(), Planning::default()).plan
    };
    let first = bore(0.0, 0.0, 20.0, -2.0);
    assert!(codes(&cuts(&first)).contains(&Code::CutsOtherSpan));
    let plan = cuts(&first.replace("\nG40", "\nG55\nG40"));
    assert_eq!(codes(&plan), [Code::ForbiddenUnderCompensation], "{}", findings(&plan));
    assert!(plan.accepted());
}

#[test]
fn of_contours_that_all_cut_into_each_other_a_hundred_are_reported() {
    let mut text = String::new();
    for step in 0..130 {
        let _ = write!(text, "{}", bore(f64::from(step), 0.0, 20.0, -2.0));
    }
    let plan = judged(&text);
    assert!(plan.accepted());
    let reported: Vec<_> =
        plan.findings.iter().filter(|it| it.code == Code::CutsOtherSpan).collect();
    assert_eq!(reported.len(), 100);
    assert!(
        reported[99].message.ends_with("not compared with earlier ones"),
        "{}",
        reported[99].message
    );
}
