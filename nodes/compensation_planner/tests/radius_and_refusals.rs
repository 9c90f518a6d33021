//! Which radius is in force, and what is refused under compensation.

mod support;

use cnc_msgs::contour::ContourEvent;
use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::Role;
use cnc_msgs::profile::{LeadLength, NegativeRadius, Reselect};
use cnc_msgs::tool_table::{Offset, Tool, ToolTable};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use support::*;

fn ends_of(text: &str, radius: f64) -> Vec<[f64; 2]> {
    ends(&plan(text, &sinumerik(), &tool(radius)))
}

#[test]
fn with_a_tip_direction_in_the_program_the_path_is_that_of_the_tip() {
    const R: f64 = 0.8;
    let text = |tip: u8| {
        format!(
            "F100\nG18\nG0 X0 Z0\nG42.1 D1.6 L{tip} G1 X10 Z20\nZ40\nX40\nZ20\nX20 Z10\nG40 G0 X60 Z0"
        )
    };
    let profile = profile("rs274");
    let contours: Vec<_> = (0..10).map(|tip| contour(&text(tip), &profile)).collect();
    let plans: Vec<_> =
        contours.iter().map(|it| plan_of(it, &profile, &ToolTable::default())).collect();
    for event in contours.iter().flat_map(|contour| &contour.events) {
        let sent = wire::ContourEvent::from(event);
        assert_eq!(ContourEvent::try_from(&sent).unwrap().kind, event.kind.received());
        if sent.kind == wire::ContourEvent::KIND_RADIUS {
            let no_tip = wire::ContourEvent { number: 10, ..sent };
            assert!(ContourEvent::try_from(&no_tip).is_err());
        }
    }
    let elements = &plans[0].path.elements;
    assert!(elements.len() > 9 && plans[0].accepted(), "{}", findings(&plans[0]));
    // As LinuxCNC shifts it, along X and Z.
    let shifts = [
        [0.0, 0.0],
        [R, R],
        [R, -R],
        [-R, -R],
        [-R, R],
        [0.0, R],
        [R, 0.0],
        [0.0, -R],
        [-R, 0.0],
        [0.0, 0.0],
    ];
    for (tip, [x, z]) in shifts.into_iter().enumerate() {
        assert_eq!(plans[tip].path.elements.len(), elements.len());
        assert_eq!(findings(&plans[tip]), findings(&plans[0]));
        for (shifted, element) in plans[tip].path.elements.iter().zip(elements) {
            let is_compensated = !matches!(element.role, Role::None | Role::LeadOff);
            let [x, z] = if is_compensated { [x, z] } else { [0.0, 0.0] };
            let moved = |[a, b, c]: [f64; 3]| [a + x, b, c + z];
            let is_near =
                |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
            assert!(is_near(shifted.end, moved(element.end)), "{tip}: {shifted:?} {element:?}");
            if let (Shape::Arc(shifted), Shape::Arc(arc)) = (shifted.shape, element.shape) {
                assert!(is_near(shifted.center, moved(arc.center)), "{tip}: {shifted:?} {arc:?}");
            }
        }
        // The audit knows the direction by itself.
        let other = &contours[(tip + 1) % 9];
        let audit = path_audit::audit(other, &plans[tip].path, &profile, &ToolTable::default());
        assert!(audit.findings.iter().any(|found| found.is_error()), "{tip}");
    }
}

#[test]
fn n03_a_negative_radius_runs_on_the_other_side() {
    let square = "G0 X-20 Y-20\nG41 D1 G1 X0 Y0 F100\nY50\nX50\nY0\nX0\nG40 X-20 Y20";
    let run = |text: &str, radius: f64| plan(text, &profile("nct"), &tool(radius));
    assert_eq!(ends(&run(square, 5.0))[1], [-5.0, 0.0]);
    let inside = run(square, -5.0);
    let expected = [[5.0, 0.0], [5.0, 45.0], [45.0, 45.0], [45.0, 5.0], [0.0, 5.0]];
    assert_eq!(&ends(&inside)[1..6], &expected);
    // P5: the same on the other side, to the letter; the figure begins in an inside corner.
    let other = run(&square.replace("G41", "G42"), 5.0);
    assert_eq!(findings(&inside), findings(&other));
    assert_eq!(inside.path.elements, other.path.elements);
    assert_eq!(finding(&inside, Code::Gouge).severity, Severity::Warning);
    // No figure of that control does so.
    for (text, radius) in [(square, -5.0), (&square.replace("G41", "G42"), 5.0)] {
        let text = text.replace("G41", "G41 G456").replace("G42", "G42 G456");
        let refused = plan(&text, &sinumerik(), &tool(radius));
        assert_eq!(finding(&refused, Code::Gouge).severity, Severity::Error);
        assert_eq!(finding(&refused, Code::Gouge).depth_mm, Some(5.0));
    }
    let mut strict = sinumerik();
    strict.radius.negative.rule = NegativeRadius::Forbidden;
    finding(&plan(square, &strict, &tool(-5.0)), Code::RadiusSource);
}

#[test]
fn m03_to_m10_the_radius_is_half_the_worn_diameter_and_p() {
    let radius = |diameter_mm: f64, wear_diameter_mm: f64, p: f64| {
        let mut tools = ToolTable::default();
        tools.tools.insert(1, Tool { diameter_mm, wear_diameter_mm, ..Tool::default() });
        tools.tools.insert(2, Tool { diameter_mm: 99.0, ..Tool::default() });
        let text = M12.replace("N40 G41", &format!("N40 G41 P{p}"));
        let plan = plan(&text, &masso(), &tools);
        assert!(plan.accepted(), "{}", findings(&plan));
        plan.path.elements[2].end[1] + 25.0
    };
    let cases = [
        (10.0, -0.5, 5.0, 9.75),
        (10.0, 0.0, 0.0, 5.0),
        (0.0, 0.0, 5.0, 5.0),
        (10.0, -0.5, 0.0, 4.75),
        (10.0, 0.5, 0.0, 5.25),
        (0.0, -0.5, 5.0, 4.75),
        (10.0, 0.0, 5.0, 10.0),
        (0.0, -0.5, 0.0, -0.25),
    ];
    for (diameter, wear, p, expected) in cases {
        assert!((radius(diameter, wear, p) - expected).abs() < 1e-9, "{diameter} {wear} {p}");
    }
}

/// A tool table that was not checked does not turn the side either.
#[test]
fn wear_that_is_larger_than_the_tool_is_refused_and_turns_no_side() {
    let by_tool = |diameter_mm, wear_diameter_mm| {
        let mut tools = ToolTable::default();
        tools.tools.insert(1, Tool { diameter_mm, wear_diameter_mm, ..Tool::default() });
        plan(M12, &masso(), &tools)
    };
    let by_offset = |radius_mm, wear_mm| {
        let mut tools = ToolTable::default();
        tools.offsets.insert(1, Offset { radius_mm, wear_mm, ..Offset::default() });
        plan("G0 X-20 Y-20\nG41 D1 G1 X0 Y0\nX50\nG40 X70", &sinumerik(), &tools)
    };
    for (plan, says) in [
        (by_tool(10.0, -20.0), "wear of T1 is larger than its value: radius 5 mm, wear -10 mm"),
        (by_offset(5.0, -5.1), "wear of D1 is larger than its value: radius 5 mm, wear -5.1 mm"),
        (by_offset(-5.0, 6.0), "wear of D1 is larger than its value: radius -5 mm, wear 6 mm"),
    ] {
        let finding = finding(&plan, Code::RadiusSource);
        assert_eq!(finding.severity, Severity::Error);
        assert!(finding.message.contains(says), "{}", finding.message);
    }
    for plan in [by_tool(0.0, -0.5), by_tool(10.0, -10.0), by_offset(0.0, -0.2)] {
        assert!(!codes(&plan).contains(&Code::RadiusSource), "{}", findings(&plan));
    }
}

#[test]
fn m08_p_alone_is_the_radius_when_nothing_is_known_of_tools() {
    let text = M12.replace("N10 T1 M6", "N10 S100").replace("N40 G41", "N40 G41 P5");
    let plan = plan(&text, &masso(), &ToolTable::default());
    assert_eq!(plan.path.elements[2].end, [100.0, -20.0, 0.0], "{}", findings(&plan));
}

#[test]
fn m13_a_retract_right_after_the_cancel_is_refused() {
    let text = M12.replace("N110 X25 Y50", "N105 Z20\nN110 X25 Y50");
    let plan = plan(&text, &masso(), &tool(5.0));
    assert_eq!(finding(&plan, Code::Cancel).source.block, Some(105));
}

#[test]
fn m16_compensation_in_another_plane_is_refused() {
    let plan = plan(&M12.replace("N40 G41", "N40 G18 G41"), &masso(), &tool(5.0));
    finding(&plan, Code::Plane);
}

#[test]
fn m18_m19_a_move_of_z_under_compensation_is_refused() {
    for text in
        [M12.replace("N70 Y-100", "N65 Z-1\nN70 Y-100"), M12.replace("N50 G1", "N45 Z-1\nN50 G1")]
    {
        let plan = plan(&text, &masso(), &tool(5.0));
        let finding = finding(&plan, Code::ForbiddenUnderCompensation);
        assert!(finding.message.contains("a move of Z"), "{}", finding.message);
    }
}

#[test]
fn m20_coolant_under_compensation_is_refused_by_masso_and_taken_by_others() {
    let text = M12.replace("N70 Y-100", "N65 M8\nN70 Y-100");
    let refused = plan(&text, &masso(), &tool(5.0));
    assert!(finding(&refused, Code::ForbiddenUnderCompensation).message.starts_with("M8 "));
    assert!(plan(&text.replace("N40 G41", "N40 G41 D1"), &rs274(), &tool(5.0)).accepted());
}

#[test]
fn m24_a_lead_must_be_longer_than_the_radius() {
    for (length, is_accepted) in [("5.000", false), ("5.001", true)] {
        let on = M12
            .replace("N20 G0 X-50", &format!("N20 G0 X{}", -25.0 - length.parse::<f64>().unwrap()));
        let off =
            M12.replace("X25 Y50", &format!("X25 Y{}", 25.0 + length.parse::<f64>().unwrap()));
        for text in [on, off] {
            let plan = plan(&text, &masso(), &tool(5.0));
            assert_eq!(plan.accepted(), is_accepted, "{}", findings(&plan));
            if !is_accepted {
                let finding = finding(&plan, Code::LeadLength);
                assert_eq!((finding.needed_mm, finding.available_mm), (Some(5.0), Some(5.0)));
            }
        }
    }
    let mut free = masso();
    free.select.length.rule = LeadLength::Any;
    let zero = M12.replace("N20 G0 X-50", "N20 G0 X-25");
    assert!(plan(&zero, &free, &tool(5.0)).accepted());
}

#[test]
fn m25_the_lead_out_has_its_role_and_ends_on_the_programmed_point() {
    let plan = plan(M12, &masso(), &tool(5.0));
    let last = plan.path.elements.last().unwrap();
    assert_eq!((last.role, last.end), (Role::LeadOff, [25.0, 50.0, 0.0]));
}

#[test]
fn m26_a_full_circle_in_one_block_is_refused_and_two_halves_are_not() {
    let text = |arc: &str| format!("T1 M6\nG0 X-20 Y0\nG41\nG1 X0 Y0\n{arc}\nG40\nG1 X-20 Y1");
    let whole = plan(&text("G3 X0 Y0 I20 J0"), &masso(), &tool(5.0));
    assert_eq!(finding(&whole, Code::FullCircle).source.line, 5);
    let halves = plan(&text("G3 X40 Y0 I20 J0\nG3 X0 Y0 I-20 J0"), &masso(), &tool(5.0));
    assert!(!codes(&halves).contains(&Code::FullCircle));
    assert!(!codes(&halves).contains(&Code::Unreachable));
}

#[test]
fn m27_the_first_move_after_the_cancel_names_both_axes() {
    let plan = plan(&M12.replace("X25 Y50", "Y50"), &masso(), &tool(5.0));
    assert!(finding(&plan, Code::Cancel).message.contains("names Y"));
}

#[test]
fn a_tool_that_is_not_there_is_named_with_what_the_table_holds() {
    let plan = plan(&A6.replace("D1", "D7"), &sinumerik(), &tool(5.0));
    let finding = finding(&plan, Code::UnknownTool);
    assert_eq!(finding.message, "D7 is not in the tool table; it holds T1 D1");
    assert_eq!(finding.source.block, Some(10));
}

#[test]
fn a_register_without_an_entry_is_the_tool_of_that_number() {
    let mut tools = tool(5.0);
    tools.offsets.clear();
    assert_eq!(ends(&plan(A6, &sinumerik(), &tools)), ends_of(A6, 5.0));
}

#[test]
fn a_selection_that_nothing_follows_is_a_warning() {
    let plan = plan("G0 X1 Y1\nG41 D1\nG40\nM30", &sinumerik(), &tool(5.0));
    assert_eq!(codes(&plan), [Code::NeverActive]);
    assert!(plan.accepted());
}

#[test]
fn a_selection_and_a_cancel_without_a_contour_are_refused() {
    let plan = plan("G0 X1 Y1\nG41 D1 G1 X20\nG40 X40\nM30", &sinumerik(), &tool(5.0));
    assert_eq!(finding(&plan, Code::NeverActive).severity, Severity::Error);
}

#[test]
fn the_length_of_a_tool_comes_from_the_table() {
    use cnc_msgs::contour::{Action, ContourEvent, ContourEventKind, Source};
    let mut contour = contour(A6, &profile("nct"));
    let action = Action::ToolLength { offset: Some(1), length_mm: 0.0, second: None };
    let kind = ContourEventKind::Action(action);
    contour
        .events
        .insert(0, ContourEvent { source: Source { line: 1, ..Source::default() }, kind });
    let mut tools = tool(5.0);
    tools.tools.get_mut(&1).unwrap().length_mm = 60.0;
    let plan = |tools: &ToolTable| compensation_planner::plan(&contour, &profile("nct"), tools);
    let expected = Action::ToolLength { offset: Some(1), length_mm: 60.0, second: None };
    assert_eq!(plan(&tools).path.events[0].action, expected);
    tools.tools.clear();
    let empty = plan(&tools);
    assert!(empty.accepted() && codes(&empty) == [Code::UnknownTool]);
    tools.tools.insert(9, Tool::default());
    assert!(!plan(&tools).accepted());
}

#[test]
fn reselection_by_profile_is_a_rule_of_the_control() {
    let mut strict = sinumerik();
    strict.reselect.rule = Reselect::Forbidden;
    let text = A6.replace("N70 X110", "N70 G41 X110");
    assert!(!plan(&text, &strict, &tool(5.0)).accepted());
}
