//! Shapes that just fit the tool, or just do not.

use super::support::*;
use super::{accepted, refused, verdict};
use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::path::{PathElement, Role};
use cnc_msgs::profile::{Reaction, Strictness};
use compensation_planner::Verdict;
use compensation_planner::verdict::prove;

const POCKET: &str = "
    N1 G0 X10 Y10
    N2 G41 D1 G1 X10 Y0 F100
    N3 X20 Y0
    N4 Y20
    N5 X0
    N6 Y0
    N7 X10
    N8 G40 X10 Y10";

#[test]
fn a_tool_as_wide_as_a_pocket_stands_in_its_middle() {
    for profile in [sinumerik(), profile("nct")] {
        for radius_mm in [10.0, 10.0 - 1e-9, 10.0 - 1e-7] {
            let path = accepted(POCKET, &profile, radius_mm);
            assert!(path.iter().all(|it| near_xy(it, [10.0, 10.0])), "{}", listing(&path));
        }
        refused(POCKET, &profile, 10.01, Code::Unreachable, 3);
    }
}

fn near_xy(element: &PathElement, at: [f64; 2]) -> bool {
    (element.end[0] - at[0]).hypot(element.end[1] - at[1]) < 1e-5
}

#[test]
fn a_tool_as_wide_as_a_step_before_its_contour_begins_at_its_corner() {
    // Nothing is left of N3 and N4: from the lead-on the tool touches both.
    let text = "
        N1 G0 X-25 Y25
        N2 G42 D1 G456 G1 X0 Y0 F100
        N3 Y10
        N4 X10
        N5 Y30
        N6 X40
        N7 G40 X60 Y45";
    let path = accepted(text, &sinumerik(), 10.0);
    assert!(path.iter().all(|it| it.role != Role::Contour || it.source.line > 4));
}

#[test]
fn a_fillet_as_large_as_the_tool_is_a_point_of_the_path() {
    // With radii of 5 to four decimals some 1e-5 mm are left of it.
    let text = "
        N1 G0 X-10 Y10
        N2 G41 D1 G1 X0 Y0 F100
        N3 X24.3845
        N4 G3 X29.3845 Y5 I0 J5
        N5 G1 X29.3849 Y30
        N6 G40 X20 Y40";
    let rounded = "
        N1 G0 X1.4213 Y1.4213
        N2 G42 D1 G1 X0 Y0 F100
        N3 X-2.4648 Y0
        N4 G2 X-3.2969 Y0.4453 I0 J1
        N5 G1 X-4.3234 Y1.9851
        N6 G3 X-5.8625 Y2.1375 I-0.832 J-0.5547
        N7 G1 X-9 Y-1
        N8 G40 X-11.01 Y-1";
    for off_mm in [0.0, 1e-9, -1e-9, -1e-6, -1e-4] {
        accepted(text, &sinumerik(), 5.0 + off_mm);
        accepted(rounded, &profile("nct"), 1.0 + off_mm);
    }
}

#[test]
fn without_an_offset_an_arc_with_two_decimals_ends_where_it_is_programmed() {
    let text = "
        N1 G0 X0 Y20
        N2 G41 D1 G1 X0 Y0 F100
        N3 X14.44
        N4 G2 X15.42 Y-0.6 I0 J-2.5
        N5 G1 X40 Y-30
        N6 G40 X40 Y0";
    let path = accepted(text, &sinumerik(), 0.0);
    let arc = path.iter().position(|it| it.source.line == 4).unwrap();
    let cnc_msgs::geometry::Shape::Arc(shape) = path[arc].shape else { panic!("no arc") };
    let out = |p: [f64; 3]| (p[0] - shape.center[0]).hypot(p[1] - shape.center[1]);
    assert_eq!(path[arc].end, [15.42, -0.6, 0.0]);
    assert!((out(path[arc - 1].end) - out(path[arc].end)).abs() < 1e-9, "{:?}", path[arc]);
}

#[test]
fn an_arc_whose_ends_are_on_no_common_circle_is_refused() {
    // Nearly a whole turn; its end is 10 micrometres off its circle, and 35 from its start.
    let text = |end: &str| {
        format!(
            "
            N1 G0 X0 Y30
            N2 G41 G450 G456 D1 G1 X0 Y0 F100
            N3 X50
            N4 G2 X49.965094496 Y{end} I-0.174530710 J-19.999238461
            N5 G1 X99.958926120 Y-0.785091713
            N6 G40 G456 X100.430145639 Y29.211207262"
        )
    };
    let mut ignores = sinumerik();
    ignores.interference.react = Reaction::Ignore;
    for profile in [sinumerik(), ignores] {
        for radius_mm in [0.5, 10.0] {
            refused(&text("0.0103"), &profile, radius_mm, Code::ArcRadius, 4);
        }
    }
}

#[test]
fn a_line_that_is_lengthened_to_its_lead_is_judged_with_the_lead() {
    // Both halves of the lower side are one line but for their third decimal.
    let text = "
        N1 G0 X14.919 Y17.557
        N2 G41 G451 D1 G1 X14.919 Y1.557 F100
        N3 X0 Y0
        N4 G2 X8.908 Y10.984 I9.946 J1.038
        N5 G1 X28.8 Y13.059
        N6 X29.838 Y3.113
        N7 X14.919 Y1.557
        N8 G40 X14.919 Y-14.444";
    let Verdict { plan, disagreement, .. } = verdict(text, &sinumerik(), 10.0001);
    assert_eq!(disagreement, None, "{}", findings(&plan));
}

#[test]
fn contours_that_cross_themselves_get_one_verdict() {
    let crossing = "
        N1 G0 X15 Y45
        N2 G41 D1 G1 X15 Y25 F100
        N3 X28.8 Y6.6
        N4 G3 X32 Y5 I3.2 J2.4
        N5 G1 X40
        N6 Y30
        N7 X0 Y0
        N8 X40 Y-10
        N9 G40 X60 Y-10";
    for name in ["nct", "sinumerik_840c", "rs274"] {
        for radius_mm in [0.0, 1.0, 3.999999, 4.0, 4.000001, 8.0] {
            let profile = profile(name);
            let Verdict { plan, disagreement, .. } = verdict(crossing, &profile, radius_mm);
            assert_eq!(disagreement, None, "{name} {radius_mm} {}", findings(&plan));
        }
    }
}

#[test]
fn what_is_trimmed_away_bounds_the_tool_to_its_radius() {
    let mut profile = sinumerik();
    profile.interference.react = Reaction::Trim;
    let text = "
        N1 G0 X0 Y30
        N2 G41 G450 D1 G1 X0 Y0 F100
        N3 X20
        N4 Y-5
        N5 X22
        N6 Y0
        N7 X50
        N8 G40 X50 Y30";
    let (contour, tools) = (contour(text, &profile), tool(5.0));
    let plan = compensation_planner::plan(&contour, &profile, &tools);
    assert!(plan.accepted(), "{}", findings(&plan));
    assert!(finding(&plan, Code::Unreachable).severity == Severity::Warning);
    let proved = |deep_mm: f64| {
        let mut plan = plan.clone();
        // Between the corners of the slot the tool dips into it.
        let dip = plan.path.elements.iter_mut().find(|it| (it.end[0] - 21.0).abs() < 1e-3);
        dip.expect("a dip").end[1] -= deep_mm;
        prove(plan, &contour, &profile, &tools)
    };
    assert_eq!(proved(0.0).disagreement, None, "{}", listing(&plan.path.elements));
    let half_mm = profile.accept_tolerance_mm / 2.0;
    assert!(half_mm > 1e-4);
    let judged = proved(half_mm);
    assert!(judged.disagreement.is_some(), "{}", listing(&plan.path.elements));
    finding(&judged.plan, Code::Gouge);
}

#[test]
fn a_missing_point_of_a_curve_in_chords_is_no_sharp_corner() {
    // A circle of radius 60 in chords of 3 degrees, and one of 6: from 48.3 mm on a tool does not
    // touch the chord before that one. A turn of 4.5 degrees is no corner of two curves.
    use std::fmt::Write;
    let at = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        format!("X{:.3} Y{:.3}", 60.0 - 60.0 * cos, 60.0 * sin)
    };
    let text = |missing: u32| {
        let mut text = String::from("N1 G0 X20 Y-20\nN2 G42 D1 G1 X0 Y0 F300");
        for step in (1..=60).filter(|step| *step != missing) {
            let _ = write!(text, "\nN{} {}", step + 9, at(3.0 * f64::from(step)));
        }
        text + "\nN70 G40 X100 Y-20"
    };
    let nct = profile("nct");
    accepted(&text(58), &nct, 48.0);
    for radius_mm in [48.5, 48.8795, 50.0] {
        accepted(&text(0), &nct, radius_mm);
        let Verdict { plan, disagreement, .. } = verdict(&text(58), &nct, radius_mm);
        assert_eq!(disagreement, None, "{}", findings(&plan));
        assert_eq!(finding(&plan, Code::Unreachable).severity, Severity::Error);
    }
}

#[test]
fn a_straight_and_a_small_arc_are_no_curve() {
    // The lead-on and N5 meet in a sharp corner; from 2.738 mm on nothing of N5 is reached.
    let text = "
        N1 G0 X11.314 Y11.314
        N2 G42 D1 G1 X0 Y0 F100
        N5 X-1.853 Y2.779
        N6 G3 X-2.238 Y3.119 I-0.832 J-0.555
        N7 G1 X-6 Y5
        N8 X0 Y0
        N9 G40 X-16 Y0";
    accepted(text, &rs274(), 2.7);
    for radius_mm in [3.0, 3.5, 4.0, 5.000000001, 6.0] {
        refused(text, &rs274(), radius_mm, Code::Unreachable, 3);
    }
}

#[test]
fn a_step_as_wide_as_the_tool_is_touched_from_the_line_of_the_lead() {
    // The lead-on and N3 are one line, which ends in an inside corner with N4. With 2 mm one point
    // is left of N4, and the tool touches it and the line from there.
    let text = "
        N1 G0 X0 Y4
        N2 G42 D1 G1 X0 Y0 F100
        N3 X0 Y-1
        N4 X-2
        N5 Y-3
        N6 X-5
        N7 Y-6
        N8 G40 X-9 Y-6";
    for radius_mm in [1.5, 1.999, 2.0 - 1e-9, 2.0] {
        accepted(text, &rs274(), radius_mm);
    }
    refused(text, &rs274(), 2.005, Code::Unreachable, 4);
}

#[test]
fn a_fillet_as_large_as_the_tool_turns_what_follows_it_a_little() {
    // Nothing is left of N5; N4 and N6 do not meet there but for 0.001 mm.
    let text = "
        N1 G0 X-9 Y-6
        N3 G41 D1 G1 X-9 Y2 F100
        N4 X-12.778 Y4.833
        N5 G3 X-13.231 Y5.154 I-6 J-8
        N6 G1 X-15.176 Y6.451
        N7 G2 X-16.7 Y7.7 I5.547 J8.32
        N8 G1 X-20 Y11
        N9 X-16 Y14
        N10 G40 X-16 Y20";
    let mut trims = sinumerik();
    trims.interference.react = Reaction::Trim;
    for profile in [sinumerik(), trims] {
        for off_mm in [0.0, 1e-9, 1e-6, 1e-4, -1e-4, -0.005] {
            accepted(text, &profile, 10.0 + off_mm);
        }
    }
}

#[test]
fn a_tail_bounds_no_corner_of_a_lead() {
    // N9 crosses N7: what is before that is a tail. The corner between the lead-on and N3
    // comes 0.029 mm too near to the end of N4, which is part of it.
    let text = "
        N1 G0 X1.768 Y1.768
        N2 G41 D1 G1 X0 Y0 F100
        N3 X0 Y3
        N4 X0.811 Y-0.243
        N5 G3 X1.781 Y-1 I0.97 J0.243
        N6 G1 X3.613 Y-1
        N7 G2 X4.561 Y-2.316 I0 J-1
        N8 G1 X4 Y-4
        N9 X5 Y0
        N10 X6 Y-1
        N11 Y2
        N12 G40 X6 Y-0.5";
    accepted(text, &rs274(), 0.4999);
}

#[test]
fn the_joint_across_what_is_not_reached_is_one_place() {
    // N6 to N10 are not reached; where N5 and N11 meet the tool cuts into N12, seen from both.
    let text = "
        N1 G0 X-4.278 Y4.278
        N4 G41 D1 G1 X0 Y0 F100
        N5 X0 Y-1
        N6 X-3 Y-1
        N7 X-3 Y-2
        N8 X-1 Y-2
        N9 X-1 Y-5
        N10 X2 Y-5
        N11 X2 Y-7
        N12 X0 Y0
        N13 G40 X0 Y-6.05";
    let mut profile = profile("nct");
    profile.lookahead.strictness = Strictness::Warn;
    let Verdict { plan, disagreement, .. } = verdict(text, &profile, 5.000001);
    assert_eq!(disagreement, None, "{}", findings(&plan));
    finding(&plan, Code::Gouge);
}
