//! An arc as the first move under compensation, as LinuxCNC takes it: the tool runs another arc from where
//! it stands, which ends at a tangent one radius beside the end of the programmed one.
//!
//! The numbers are those that LinuxCNC's interpreter prints for these programs.

mod support;

use cnc_msgs::contour::ContourEventKind;
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::Role;
use cnc_msgs::profile::{ArcLead, SelectTarget};
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::replan::replan;
use compensation_planner::set_tool::LoadedProgram;
use compensation_planner::{Plan, Planning, Verdict, judge, plan_certified, start};
use proptest::prelude::*;
use support::{codes, contour, dedent, finding, findings, listing, rs274, tool};

/// Planned and audited; both say the same.
#[track_caller]
fn judged(text: &str) -> Plan {
    judged_with(text, &ToolTable::default())
}

#[track_caller]
fn judged_with(text: &str, tools: &ToolTable) -> Plan {
    let contour = contour(text, &rs274());
    let Verdict { plan, disagreement, .. } = judge(&contour, &rs274(), tools, Planning::default());
    assert_eq!(disagreement, None, "{text}\n{}", findings(&plan));
    plan
}

#[track_caller]
fn check(text: &str, expected: &str) {
    let plan = judged(text);
    let elements = if plan.accepted() { &plan.path.elements } else { &plan.refused };
    // Without the rapid to the start.
    assert_eq!(listing(&elements[1..]), dedent(expected), "{}", findings(&plan));
    assert_eq!(findings(&plan), "", "{text}");
}

#[test]
fn on_both_sides_and_in_both_turns_the_arc_ends_beside_its_end() {
    check(
        "G0 X0 Y0\nG41.1 D10\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X-30",
        "L3 lead_on G3 c(-5.833333,20) (15,20)
         L4 contour G1 (15,60)
         L5 lead_off G1 (-30,60)",
    );
    check(
        "G0 X0 Y0\nG42.1 D10\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X60",
        "L3 lead_on G3 c(4.5,20) (25,20)
         L4 contour G1 (25,60)
         L5 lead_off G1 (60,60)",
    );
    check(
        "G0 X0 Y0\nG42.1 D10\nG2 X20 Y-20 I0 J-20\nG1 Y-60\nG40 X-30",
        "L3 lead_on G2 c(-5.833333,-20) (15,-20)
         L4 contour G1 (15,-60)
         L5 lead_off G1 (-30,-60)",
    );
    check(
        "G0 X0 Y0\nG41.1 D10\nG2 X20 Y-20 I0 J-20\nG1 Y-60\nG40 X60",
        "L3 lead_on G2 c(4.5,-20) (25,-20)
         L4 contour G1 (25,-60)
         L5 lead_off G1 (60,-60)",
    );
}

#[test]
fn an_arc_that_grows_to_more_than_twice_its_radius_is_told() {
    // Inside of a quarter of 10 mm: with R 5 the arc grows by 1.75, with R 6 by 2.05, with R 9 by 5.95.
    for (diameter, run) in [(10, None), (12, Some("14.500 mm")), (18, Some("50.500 mm"))] {
        let plan =
            judged(&format!("G0 X0 Y0\nG41.1 D{diameter}\nG3 X10 Y10 I0 J10\nG1 Y60\nG40 X-60"));
        assert!(plan.accepted(), "{diameter}: {}", findings(&plan));
        let Some(run) = run else {
            assert_eq!(findings(&plan), "");
            continue;
        };
        assert_eq!(codes(&plan), [Code::LeadType]);
        let told = finding(&plan, Code::LeadType);
        assert_eq!(told.source.line, 3);
        let wanted = format!(
            "the lead-on is an arc with a radius of 10.000 mm, and the centre of this tool runs one with {run}"
        );
        assert_eq!(told.message, wanted);
    }
    // Outside of it the tool runs one that is as much larger as the tool, and no more.
    let small = judged("G0 X0 Y0\nG42.1 D24\nG3 X10 Y10 I0 J10\nG1 Y60\nG40 X60");
    assert_eq!(findings(&small), "");
}

#[test]
fn a_corner_after_the_arc_is_one_like_any_other() {
    // Inside, where the line meets the circle of the lead; outside, around the end of the arc.
    check(
        "G0 X0 Y0\nG41.1 D10\nG3 X20 Y20 I0 J20\nG1 X-60\nG40 Y0",
        "L3 lead_on G3 c(-5.833333,20) (14.391102,15)
         L4 contour G1 (-60,15)
         L5 lead_off G1 (-60,0)",
    );
    check(
        "G0 X0 Y0\nG41.1 D10\nG3 X20 Y20 I0 J20\nG1 X60\nG40 Y60",
        "L3 lead_on G3 c(-5.833333,20) (15,20)
         L4 corner G2 c(20,20) (20,25)
         L4 contour G1 (60,25)
         L5 lead_off G1 (60,60)",
    );
    check(
        "G0 X0 Y0\nG41.1 D10\nG3 X20 Y20 I0 J20\nG3 X0 Y40 I-20 J0\nG1 X-50\nG40 Y0",
        "L3 lead_on G3 c(-5.833333,20) (15,20)
         L4 contour G3 c(0,20) (0,35)
         L5 contour G1 (-50,35)
         L6 lead_off G1 (-50,0)",
    );
}

#[test]
fn the_third_axis_moves_along_the_arc() {
    check(
        "G0 X0 Y0 Z3\nG42.1 D10\nG3 X20 Y20 Z1 I0 J20\nG1 X60\nG40 Y0",
        "L3 lead_on G3 c(4.5,20) (24.380895,15,1)
         L4 contour G1 (60,15,1)
         L5 lead_off G1 (60,0,1)",
    );
}

#[test]
fn an_arc_of_more_than_a_turn_keeps_its_turns() {
    let around = |select: &str| {
        let text = format!("G0 X0 Y0\n{select} D10\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X20 Y90");
        let mut around = contour(&text, &rs274());
        for event in &mut around.events {
            if let ContourEventKind::Motion(motion) = &mut event.kind
                && let Shape::Arc(arc) = &mut motion.shape
            {
                arc.turns = 1;
            }
        }
        support::plan_of(&around, &rs274(), &ToolTable::default())
    };
    let inside = around("G41.1");
    let lead = "L3 lead_on G3 c(-5.833333,20) +1 (15,20)";
    assert_eq!(listing(&inside.path.elements[1..]).lines().next(), Some(lead));
    // Outside, the tool would come through the contour that it leads to, as in LinuxCNC.
    assert!(codes(&around("G42.1")).contains(&Code::LeadGouge));
}

#[test]
fn in_the_other_planes_it_is_the_same_arc() {
    check(
        "G18\nG0 X0 Z0\nG41.1 D10\nG3 X20 Z20 I20 K0\nG1 X60\nG40 Z-30",
        "L4 lead_on G3 c(20,0) (20,0,15)
         L5 contour G1 (60,0,15)
         L6 lead_off G1 (60,0,-30)",
    );
}

#[test]
fn a_radius_of_zero_runs_the_programmed_arc() {
    check(
        "G0 X0 Y0\nG41.1 D0\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X-30",
        "L3 lead_on G3 c(0,20) (20,20)
         L4 contour G1 (20,60)
         L5 lead_off G1 (-30,60)",
    );
}

#[test]
fn a_negative_diameter_runs_on_the_other_side() {
    let one = judged("G0 X0 Y0\nG41.1 D-10\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X60");
    let other = judged("G0 X0 Y0\nG42.1 D10\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X60");
    assert_eq!(listing(&one.path.elements), listing(&other.path.elements));
}

/// The finding about a quarter to the left, of this radius, with a tool on this side.
fn refused(select: &str, arc: &str, code: Code) -> String {
    let plan = judged(&format!("G0 X0 Y0\n{select}\n{arc}\nG1 Y60\nG40 X-60 Y70"));
    assert!(!plan.accepted(), "{select} {arc}");
    let found = finding(&plan, code);
    assert_eq!(found.source.line, 3);
    format!("{}; {}", found.message, found.help)
}

#[test]
fn a_tool_that_no_arc_leads_is_refused_with_its_limit() {
    // Outside, LinuxCNC compares the ends with the radius; inside, Kerf refuses what would come to the
    // contour backwards.
    let said = refused("G42.1 D10", "G3 X3 Y0.460608 I0 J10", Code::LeadLength);
    assert!(said.starts_with("the lead-on is an arc whose ends are 3.035 mm apart;"), "{said}");
    let said = refused("G41.1 D10", "G3 X10 Y2.679492 I0 J20", Code::LeadType);
    assert!(
        said.starts_with("the lead-on is an arc that leads tools with a radius below 2.679 mm"),
        "{said}"
    );
    let said = refused("G41.1 D10", "G3 X4 Y4 I0 J4", Code::LeadType);
    assert!(said.contains("below 4.000 mm along its inside; this one has 5.000 mm"), "{said}");
    let said = refused("G41.1 D10", "G3 X0 Y0 I0 J20", Code::LeadType);
    assert!(said.starts_with("the lead-on is a full circle"), "{said}");
    assert!(said.ends_with("; put a straight move in the plane before the arc"), "{said}");
}

#[test]
fn with_a_tip_direction_the_lead_on_is_straight() {
    let plan = judged("G18\nG0 X0 Z0\nG42.1 D2 L2\nG3 X20 Z20 I20 K0\nG1 X60\nG40 Z60");
    assert!(finding(&plan, Code::LeadType).message.contains("with tip direction 2"));
}

#[test]
fn a_lead_arc_that_cuts_the_contour_is_refused() {
    // The contour comes back to where the arc sweeps.
    let plan = judged("G0 X0 Y0\nG42.1 D10\nG3 X20 Y20 I0 J20\nG1 Y60\nX60\nY8\nX24\nG40 X24 Y-40");
    let cut = finding(&plan, Code::LeadGouge);
    assert_eq!((cut.source.line, cut.other.unwrap().line), (3, 7), "{}", findings(&plan));
    // The same, above the part: only a straight lead is nearer there.
    let above = judged(
        "G0 X0 Y0 Z5\nG42.1 D10\nG3 X20 Y20 I0 J20\nG1 Z-1\nY60\nX60\nY-20\nX24\nG40 X24 Y0",
    );
    assert_eq!(findings(&above), "");
}

#[test]
fn an_arc_that_starts_past_the_path_along_the_contour_is_refused() {
    // The line from its end goes back past the start. LinuxCNC goes most of the way around to it.
    let plan = judged("G0 X0 Y0\nG41.1 D10\nG3 X6 Y6 I0 J6\nG1 X-30 Y-7.1\nG40 X-40 Y-40");
    assert_eq!(codes(&plan), [Code::LeadType, Code::LeadLength], "{}", findings(&plan));
    let found = finding(&plan, Code::LeadLength);
    assert!(found.message.contains("is an arc of 6.111 mm;"), "{}", found.message);
    assert!(found.message.contains("along line 4 8.009 mm before the end"), "{}", found.message);
}

#[test]
fn other_controls_refuse_it_and_an_arc_needs_a_lead_that_ends_beside_its_own_end() {
    let text = "G0 X0 Y0\nG41 D1\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X-30";
    for name in ["sinumerik_840c", "nct"] {
        let profile = support::profile(name);
        let plan = support::plan(text, &profile, &tool(5.0));
        assert!(!plan.accepted());
        assert!(finding(&plan, Code::LeadType).message.contains("the lead-on is an arc"));
    }
    let mut profile = support::sinumerik();
    profile.select.arc_lead = ArcLead::Arc;
    assert!(profile.check().is_err());
    profile.select.target = SelectTarget::NormalEntry;
    assert!(profile.check().is_ok());
    // As a straight line, for those who want that.
    profile.select.arc_lead = ArcLead::Warn;
    let plan = support::plan(text, &profile, &tool(5.0));
    assert!(plan.accepted(), "{}", findings(&plan));
    assert_eq!(plan.path.elements[0].shape, Shape::Line);
}

#[test]
fn the_leads_of_a_certificate_hold_for_the_arc_of_each_radius() {
    let leads = |text: &str, radius_mm: f64| {
        let contour = contour(text, &rs274());
        let plan = plan_certified(&contour, &rs274(), &tool(radius_mm));
        assert_eq!(plan.certificates.len(), 1, "{}", findings(&plan));
        plan.certificates[0].leads_valid_to_mm
    };
    // Inside a quarter of a circle of 20 mm: 20 mm on the inner side of the tangent.
    let inside = "G0 X0 Y0\nG41 D1\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X-60 Y60";
    // Outside: its chord.
    let outside = "G0 X0 Y0\nG42 D1\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X60 Y60";
    for radius_mm in [1.0, 5.0, 12.0, 19.0] {
        let limit = leads(inside, radius_mm);
        assert!((limit - 20.0).abs() < 1e-3, "{radius_mm}: {limit}");
        let limit = leads(outside, radius_mm);
        assert!((limit - 20.0 * 2.0_f64.sqrt()).abs() < 1e-3, "{radius_mm}: {limit}");
    }
    // The verdict at a radius is that of the certificate.
    for (radius_mm, takes) in [(19.9, true), (20.1, false)] {
        assert_eq!(judged_with(inside, &tool(radius_mm)).accepted(), takes, "{radius_mm}");
    }
    for (radius_mm, takes) in [(28.28, true), (28.29, false)] {
        assert_eq!(judged_with(outside, &tool(radius_mm)).accepted(), takes, "{radius_mm}");
    }
}

#[test]
fn a_run_may_begin_at_the_arc_and_after_it() {
    let text = "G0 X0 Y0\nG41 D1\nG3 X20 Y20 I0 J20\nG1 Y60\nG40 X-30";
    let (contour, plan) = (contour(text, &rs274()), judged_with(text, &tool(5.0)));
    for (line, at) in [(3, [0.0, 0.0, 0.0]), (4, [15.0, 20.0, 0.0])] {
        let start = start(&contour, &rs274(), &plan.path, line, 0).expect("a start");
        assert!((0..3).all(|axis| (start.at[axis] - at[axis]).abs() < 1e-9), "{line}: {start}");
    }
}

#[test]
fn a_value_entered_while_the_arc_is_cut_leaves_the_arc_as_it_is() {
    let mut profile = support::sinumerik();
    (profile.select.arc_lead, profile.select.target) = (ArcLead::Arc, SelectTarget::NormalEntry);
    let text = "G41 D1 G3 X20 Y20 I0 J20\nG1 Y60\nX-10\nG40 X-30 Y40";
    let (before, after) = (tool(5.0), tool(4.0));
    let (contour, running) = (contour(text, &profile), support::plan(text, &profile, &before).path);
    let program = LoadedProgram { name: "arc", contour: &contour, profile: &profile };
    let rest = replan(program, &before, &after, &running, 1).expect("it can change");
    assert_eq!((rest.from_line, rest.plan.path.elements[0]), (2, running.elements[0]));
    // N2 ends where both offsets of 4 mm meet.
    let end = rest.plan.path.elements[1].end;
    assert!((end[0] - 16.0).abs() < 1e-9 && (end[1] - 56.0).abs() < 1e-9, "{end:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Whatever arc leads to a contour: both algorithms agree, and an accepted path begins at the start
    /// and comes no nearer to the first element than the radius.
    #[test]
    fn arcs_that_lead_to_a_contour_are_sound(
        radius in 0.5..60.0_f64,
        sweep in prop_oneof![-350.0..-1.0_f64, 1.0..350.0_f64],
        turn in prop_oneof![Just(0.0), -170.0..170.0_f64],
        bend in prop_oneof![Just(0.0), -0.05..0.05_f64],
        length in 1.0..60.0_f64,
        diameter in 0.1..30.0_f64,
        digits in 3..7_i32,
        is_left in any::<bool>(),
    ) {
        let scale = 10.0_f64.powi(digits);
        let rounded = |value: f64| (value * scale).round() / scale;
        let side = sweep.signum();
        let angle = |degrees: f64| degrees.to_radians();
        let on_arc = |at: f64| {
            let (sin, cos) = angle(at - 90.0 * side).sin_cos();
            [rounded(radius * cos), rounded(radius * sin + radius * side)]
        };
        let end = on_arc(sweep);
        prop_assume!(end[0].hypot(end[1]) > 1e-3);
        let heading = angle(sweep + turn);
        let next = [rounded(end[0] + length * heading.cos()), rounded(end[1] + length * heading.sin())];
        let leg = if bend == 0.0 {
            format!("G1 X{} Y{}", next[0], next[1])
        } else {
            // The centre of an arc of this curvature that begins in that direction.
            let lever = 1.0 / bend;
            let (i, j) = (-heading.sin() * lever, heading.cos() * lever);
            let (sin, cos) = (length * bend).sin_cos();
            let x = end[0] + i + (-i * cos + j * sin);
            let y = end[1] + j + (-i * sin - j * cos);
            let word = if bend > 0.0 { "G3" } else { "G2" };
            format!("{word} X{} Y{} I{} J{}", rounded(x), rounded(y), rounded(i), rounded(j))
        };
        let (select, arc) = (if is_left { "G41.1" } else { "G42.1" }, if side > 0.0 { "G3" } else { "G2" });
        let text = format!(
            "G0 X0 Y0\n{select} D{diameter}\n{arc} X{} Y{} I0 J{}\n{leg}\nG40 G1 X{} Y{}",
            end[0], end[1], rounded(radius * side),
            next[0] + 90.0 * if is_left { -heading.sin() } else { heading.sin() },
            next[1] + 90.0 * if is_left { heading.cos() } else { -heading.cos() },
        );
        let plan = judged(&text);
        if !plan.accepted() {
            return Ok(());
        }
        let lead = plan.path.elements.iter().find(|element| element.role == Role::LeadOn);
        let Some(lead) = lead else { return Err(TestCaseError::fail(format!("no lead: {text}"))) };
        let Shape::Arc(arc) = lead.shape else { return Err(TestCaseError::fail(text)) };
        let start = plan.path.start;
        let far = |at: [f64; 3]| (at[0] - arc.center[0]).hypot(at[1] - arc.center[1]);
        prop_assert!((far(start) - far(lead.end)).abs() < 1e-6 * far(start).max(1.0), "{text}");
        // The circle of the lead touches the end of the programmed arc at the radius of the tool.
        let apart = (far([end[0], end[1], 0.0]) - far(start)).abs();
        prop_assert!((apart - diameter / 2.0).abs() < 1e-3, "{apart}: {text}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// The arc may meet a curve of chords in an inside corner, and skip some of them.
    #[test]
    fn arcs_that_lead_to_chords_are_judged_alike(
        radius in 2.0..40.0_f64,
        sweep in prop_oneof![-340.0..-10.0_f64, 10.0..340.0_f64],
        turn in prop_oneof![Just(0.0), -140.0..140.0_f64],
        bend in -6.0..6.0_f64,
        chords in 3..30_usize,
        length in 0.1..4.0_f64,
        diameter in 0.5..20.0_f64,
        is_left in any::<bool>(),
    ) {
        let side = sweep.signum();
        let at = |degrees: f64| {
            let (sin, cos) = (degrees - 90.0 * side).to_radians().sin_cos();
            [radius * cos, radius * sin + radius * side]
        };
        let (mut end, mut heading) = (at(sweep), sweep + turn);
        let mut text = format!(
            "G0 X0 Y0\n{} D{diameter:.3}\n{} X{:.4} Y{:.4} I0 J{:.4}\nG1",
            if is_left { "G41.1" } else { "G42.1" },
            if side > 0.0 { "G3" } else { "G2" },
            end[0], end[1], radius * side,
        );
        for _ in 0..chords {
            let (sin, cos) = heading.to_radians().sin_cos();
            end = [end[0] + length * cos, end[1] + length * sin];
            text += &format!(" X{:.4} Y{:.4}\n", end[0], end[1]);
            heading += bend;
        }
        let (sin, cos) = (heading - bend).to_radians().sin_cos();
        let out = if is_left { [-sin, cos] } else { [sin, -cos] };
        text += &format!("G40 X{:.4} Y{:.4}", end[0] + 60.0 * out[0], end[1] + 60.0 * out[1]);
        judged(&text);
    }
}
