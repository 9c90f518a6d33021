//! Corners, selection, cancellation and what happens while compensation is active.

mod support;

use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::path::Role;
use cnc_msgs::tool_table::Offset;
use support::*;

fn ends_of(text: &str, radius: f64) -> Vec<[f64; 2]> {
    ends(&plan(text, &sinumerik(), &tool(radius)))
}

#[track_caller]
fn check(text: &str, radius: f64, expected: &str) {
    let plan = plan(text, &sinumerik(), &tool(radius));
    let elements = if plan.accepted() { &plan.path.elements } else { &plan.refused };
    assert_eq!(listing(elements), dedent(expected), "{}", findings(&plan));
    assert!(plan.accepted(), "{}", findings(&plan));
}

#[test]
fn m02_left_of_plus_x_is_plus_y_and_left_of_plus_y_is_minus_x() {
    let along_x = "G0 X0 Y30\nG41 G456 D1 G1 X0 Y0\nX50\nG40 G456 Y40";
    assert_eq!(ends_of(along_x, 5.0)[2], [50.0, 5.0]);
    let along_y = "G0 X-30 Y0\nG41 G456 D1 G1 X0 Y0\nY50\nG40 G456 X-40";
    assert_eq!(ends_of(along_y, 5.0)[2], [-5.0, 50.0]);
}

#[test]
fn s08_g451_makes_three_two_one_and_no_blocks() {
    let cases = [
        ("line to line, obtuse", "X50 Y0\nX80 Y-30", 0),
        ("line to line, acute", "X50 Y0\nX30 Y-30", 1),
        ("line to arc, obtuse", "X50 Y0\nG2 X70 Y-60 I-20 J-40", 1),
        ("arc to line, obtuse", "G2 X50 Y0 I25 J-25\nG1 X60 Y-90", 1),
        ("arc to line, acute", "G2 X50 Y0 I25 J-25\nG1 X-40 Y-24", 2),
        ("line to arc, acute", "X50 Y0\nG2 X-31.96 Y-21.96 I-51.96 J30", 2),
        ("arc to arc, obtuse", "G2 X50 Y0 I25 J-60\nG2 X70 Y-60 I-20 J-40", 2),
        ("arc to arc, acute", "G2 X50 Y0 I25 J-25\nG2 X-23.5 Y42.5 I-15.5 J58", 3),
    ];
    for (name, contour, count) in cases {
        let text =
            format!("G0 X-30 Y40\nG41 G451 D1 G456 G1 X0 Y0\n{contour}\nG40 G456 G1 X150 Y-100");
        let plan = plan(&text, &sinumerik(), &tool(5.0));
        assert!(plan.accepted(), "{name}: {}", findings(&plan));
        let corners: Vec<_> =
            plan.path.elements.iter().filter(|element| element.role == Role::Corner).collect();
        assert_eq!(corners.len(), count, "{name}\n{}", listing(&plan.path.elements));
        assert!(corners.iter().all(|corner| corner.source.line == 4), "{name}");
    }
}

#[test]
fn s26_g451_is_continuous_at_a_right_angle() {
    let corner = |y: f64| {
        let text = format!(
            "G0 X0 Y40\nG41 G451 D1 G456 G1 X0 Y0\nX50\nX{} Y-50\nG40 G456 X150 Y-50",
            50.0 + y
        );
        ends_of(&text, 5.0)[2]
    };
    let (obtuse, acute) = (corner(1e-7), corner(-1e-7));
    assert!((obtuse[0] - acute[0]).abs() < 1e-6 && (obtuse[0] - 55.0).abs() < 1e-6);
}

#[test]
fn s09_each_corner_is_rounded_in_the_mode_of_the_block_after_it() {
    let text = "G0 X0 Y40
        N1 G41 D1 G456 G1 X0 Y0
        N2 X50
        N3 G451 Y-50
        N4 G450 X0
        N5 G40 G456 X-50 Y-90";
    check(
        text,
        5.0,
        "L1 none G0 (0,40)
         N1 lead_on G1 (0,5)
         N2 contour G1 (55,5)
         N3 contour G1 (55,-50)
         N4 corner G2 c(50,-50) (50,-55)
         N4 contour G1 (0,-55)
         N5 lead_off G1 (-50,-90)",
    );
}

/// The single outside corner of S18, with its lead-on word.
fn s18(words: &str) -> String {
    format!("N1 G0 X0 Y0\nN2 G41 D1 {words} G1 X50 Y0\nN3 Y-50\nN4 G40 G456 X100 Y-60")
}

#[test]
fn s18_g455_starts_around_the_corner_and_says_how_near_it_comes() {
    // Around the corner it only passes over the free end; from the intersection it cuts deeper.
    for (words, roles, nearest, code) in
        [("G455 G450", 1, 9.8058, Code::LeadNick), ("G455 G451", 0, 8.2199, Code::LeadGouge)]
    {
        let plan = plan(&s18(words), &sinumerik(), &tool(10.0));
        assert!(plan.accepted());
        let corners = plan.path.elements.iter().filter(|e| e.role == Role::Corner).count();
        assert_eq!(corners, roles, "{}", listing(&plan.path.elements));
        let cut = finding(&plan, code);
        assert_eq!(cut.severity, Severity::Warning);
        assert!((cut.available_mm.unwrap() - nearest).abs() < 1e-4, "{cut:?}");
        assert!((cut.depth_mm.unwrap() - (10.0 - nearest)).abs() < 1e-4);
        assert_eq!(cut.position, Some([50.0, 0.0, 0.0]));
        assert!(cut.help.contains("G456"));
    }
    let ends = ends_of(&s18("G455 G450"), 10.0);
    assert_eq!(&ends[..3], &[[0.0, 0.0], [50.0, 10.0], [60.0, 0.0]][..]);
    assert_eq!(ends_of(&s18("G455 G451"), 10.0)[1], [60.0, 10.0]);
}

#[test]
fn s18_g456_goes_straight_to_the_normal_position() {
    let ends = ends_of(&s18("G456 G450"), 10.0);
    assert_eq!(&ends[1..3], &[[60.0, 0.0], [60.0, -50.0]][..]);
}

#[test]
fn s15_a_selection_without_a_word_is_g455() {
    assert_eq!(ends_of(&s18("G450"), 10.0), ends_of(&s18("G455 G450"), 10.0));
}

#[test]
fn s23_a_start_in_front_of_the_contour_does_not_depend_on_the_words() {
    let first = ends_of(A6, 5.0)[1];
    for words in ["G455", "G456"] {
        for mode in ["G450", "G451"] {
            let text = A6.replace("G41 G450", &format!("G41 {mode} {words}"));
            assert_eq!(ends_of(&text, 5.0)[1], first);
        }
    }
}

#[test]
fn s30_an_end_in_front_of_the_contour_goes_straight_from_its_normal_position() {
    for words in ["G40", "G40 G455", "G40 G456"] {
        let ends = ends_of(&A6.replace("G40", words), 5.0);
        let last = ends[ends.len() - 3];
        assert!((last[0] - 25.527864).abs() < 1e-6 && (last[1] - 57.763932).abs() < 1e-6);
    }
}

#[test]
fn s31_an_end_behind_the_contour_mirrors_the_start() {
    let text = |words: &str| {
        format!("N1 G0 X100 Y-60\nN2 G41 D1 G456 G1 X50 Y-50\nN3 Y0\nN4 G40 {words} X100 Y0")
    };
    // Heading +Y the tool runs at X 40; the lead-off turns away to the right.
    let with = |words: &str| plan(&text(words), &sinumerik(), &tool(10.0));
    let arc = with("G455 G450");
    assert_eq!(&ends(&arc)[2..], &[[40.0, 0.0], [50.0, 10.0], [100.0, 0.0]][..]);
    let cut = arc.findings.iter().rfind(|d| d.code == Code::LeadNick).unwrap();
    assert!((cut.available_mm.unwrap() - 9.8058).abs() < 1e-4);
    let lines = with("G455 G451");
    assert_eq!(&ends(&lines)[2..], &[[40.0, 10.0], [100.0, 0.0]][..]);
    let straight = with("G456");
    assert_eq!(&ends(&straight)[2..], &[[40.0, 0.0], [100.0, 0.0]][..]);
}

#[test]
fn s20_and_s29_leads_are_straight() {
    let arc_on = "G0 X0 Y0\nG41 D1 G2 X20 Y0 I10 J0\nG1 X50\nG40 X70 Y20";
    let arc_off = "G0 X0 Y0\nG41 D1 G1 X20 Y0\nX50\nG40 G2 X70 Y0 I10 J0";
    for (text, line) in [(arc_on, 2), (arc_off, 4)] {
        for profile in [sinumerik(), masso(), rs274()] {
            if profile.name == "rs274" && line == 2 {
                // LinuxCNC has it otherwise: `arc_leads`.
                continue;
            }
            let text = text.replace("D1", "P5");
            let mut tools = tool(5.0);
            tools.tools.clear();
            let plan = match profile.name.as_str() {
                "masso" => plan(&text, &profile, &tools),
                _ => plan(&text.replace("P5", "D1"), &profile, &tool(5.0)),
            };
            assert_eq!(finding(&plan, Code::LeadType).source.line, line);
            assert!(!plan.accepted() && plan.path.elements.is_empty());
        }
    }
}

#[test]
fn s21_a_selection_with_one_axis_moves_both() {
    let plan = plan(&A6.replace("D1 X30 Y60", "D1 X30"), &sinumerik(), &tool(5.0));
    let lead = plan.path.elements[1];
    assert!((lead.end[0] - 25.527864).abs() < 1e-6 && (lead.end[1] - 62.236068).abs() < 1e-6);
    assert_eq!(lead.axes.letters(), "XY");
}

#[test]
fn s22_d0_is_no_offset() {
    let plan = plan(&A6.replace("D1", "D0"), &sinumerik(), &tool(5.0));
    assert_eq!(
        listing(&plan.path.elements),
        listing(
            &support::plan(&A6.replace("D1", "D2"), &sinumerik(), &{
                let mut tools = tool(5.0);
                tools.offsets.insert(2, Offset::default());
                tools
            })
            .path
            .elements
        )
    );
    assert_eq!(plan.path.elements[3].end, [65.0, 55.0, 0.0]);
}

#[test]
fn s32_a_program_that_ends_under_compensation_is_refused() {
    let without = A6.replace("N120 G40 X15 Y60", "N120 X15 Y60");
    let finding_of = |text: &str| {
        let plan = plan(text, &sinumerik(), &tool(5.0));
        assert!(!plan.accepted());
        finding(&plan, Code::NotCancelled).clone()
    };
    finding_of(&without);
    assert_eq!(finding_of(&A6.replace("N120 G40 X15 Y60", "N120 G40")).source.line, 13);
}

#[test]
fn s33_and_m11_a_selection_alone_waits_for_a_move_in_the_plane() {
    let alone = A6.replace("N10 G41 G450 G1", "N9 G41 D1\nN9 G1 Z5\nN10 G450 G1");
    let plan = plan(&alone, &sinumerik(), &tool(5.0));
    let lead = plan.path.elements.iter().find(|element| element.role == Role::LeadOn).unwrap();
    assert_eq!(lead.source.block, Some(10));
    assert!((lead.end[0] - 25.527864).abs() < 1e-6 && lead.end[2] == 5.0);
}

#[test]
fn s35_a_repeated_selection_changes_nothing() {
    assert_eq!(ends_of(&A6.replace("N70 X110", "N70 G41 X110"), 5.0), ends_of(A6, 5.0));
}

#[test]
fn s37_s38_a_repeated_selection_with_g456_links_two_contours() {
    let text = |link: &str, next: &str| {
        format!("G0 X0 Y40\nG41 G456 D1 G1 X0 Y0\nX100\nG41 G456 {link}\n{next}\nG40 G456 X200 Y90")
    };
    let s37 = ends_of(&text("X150 Y0", "X180"), 5.0);
    assert_eq!(&s37[2..5], &[[100.0, 5.0], [150.0, 5.0], [180.0, 5.0]][..]);
    let s38 = ends_of(&text("X150 Y40", "Y80"), 5.0);
    assert_eq!(&s38[2..5], &[[100.0, 5.0], [145.0, 40.0], [145.0, 80.0]][..]);
}

#[test]
fn s36_a_repeated_selection_with_g455_goes_around_both_points() {
    let text = "G0 X0 Y40
        N1 G41 G456 D1 G1 X0 Y0
        N2 X100
        N3 G41 G455 X100 Y-50
        N4 X50
        N5 G40 G456 X40 Y-90";
    check(
        text,
        5.0,
        "L1 none G0 (0,40)
         N1 lead_on G1 (0,5)
         N2 contour G1 (100,5)
         N3 corner G2 c(100,0) (105,0)
         N3 link G1 (105,-50)
         N4 corner G2 c(100,-50) (100,-55)
         N4 contour G1 (50,-55)
         N5 lead_off G1 (40,-90)",
    );
}

#[test]
fn s40_a_point_programmed_twice_changes_the_side_there() {
    let text = "N10 G0 X0 Y40\nN20 G41 G456 D1 G1 X0 Y0\nN55 X100\nN60 G42 X100\nN65 X150\nN70 G40 G456 X160 Y-40";
    let ends = ends_of(text, 5.0);
    assert_eq!(&ends[2..5], &[[100.0, 5.0], [100.0, -5.0], [150.0, -5.0]][..]);
}

#[test]
fn s41_two_full_circles_are_linked() {
    let text = "N5 G0 X90 Y60
        N10 G42 G456 D1 G1 X50 Y0
        N15 G3 X50 Y0 I-20 J0
        N20 G1 G42 G456 X80 Y0
        N25 G3 X80 Y0 I20 J0
        N30 G40 G456 G1 X70 Y60";
    check(
        text,
        5.0,
        "N5 none G0 (90,60)
         N10 lead_on G1 (55,0)
         N15 contour G3 c(30,0) +1 (55,0)
         N20 link G1 (75,0)
         N25 contour G3 c(100,0) +1 (75,0)
         N30 lead_off G1 (70,60)",
    );
}

#[test]
fn s42_line_by_line_milling_changes_the_side_at_every_end() {
    let text = "N10 G0 X-20 Y-30
        N20 G42 G456 D1 G1 X0 Y0
        N30 X100
        N40 G41 Y20
        N50 X0
        N60 G42 Y40
        N70 X100
        N80 G40 G456 X120 Y60";
    let plan = plan(text, &sinumerik(), &tool(5.0));
    let expected = [
        [-20.0, -30.0],
        [0.0, -5.0],
        [100.0, -5.0],
        [100.0, 15.0],
        [0.0, 15.0],
        [0.0, 35.0],
        [100.0, 35.0],
        [120.0, 60.0],
    ];
    assert_ends(&plan, &expected, 1e-9);
    assert_eq!(finding(&plan, Code::LinkGouge).severity, Severity::Warning);
    assert_eq!(plan.spans.len(), 3);
}

#[test]
fn a_second_selection_is_refused_where_the_control_takes_none() {
    for text in ["X50\nG41 X80", "X50\nG42 X80", "X50\nG40\nG41 X80"] {
        let text = format!("G0 X0 Y40\nG41 D1 G1 X0 Y0\n{text}\nG40 X90 Y40");
        let plan = plan(&text, &rs274(), &tool(5.0));
        assert!(codes(&plan).contains(&Code::SideChange), "{text}: {}", findings(&plan));
    }
}

#[test]
fn s43_new_tool_offset_starts_with_the_old_radius() {
    let text = "N10 G0 X50 Y50
        N20 G41 D1 G456 G1 X50 Y0
        N40 X100
        N45 D2 Y100
        N50 X0
        N55 Y0
        N57 X50
        N60 G40 G456 X50 Y50";
    let mut tools = tool(5.0);
    tools.offsets.insert(2, Offset { radius_mm: 8.0, ..Offset::default() });
    let expected = [
        [50.0, 50.0],
        [50.0, 5.0],
        [95.0, 5.0],
        [92.0, 92.0],
        [8.0, 92.0],
        [8.0, 8.0],
        [50.0, 8.0],
        [50.0, 50.0],
    ];
    assert_ends(&plan(text, &sinumerik(), &tools), &expected, 1e-9);
    let in_arc = text.replace("D2 Y100", "D2 G3 Y100 J50");
    let refused = plan(&in_arc.replace("N50 X0", "N50 G1 X0"), &sinumerik(), &tools);
    assert_eq!(finding(&refused, Code::RadiusSource).source.block, Some(45));
}

#[test]
fn s44_a_new_radius_of_the_other_sign_is_a_side_change_and_refused() {
    let text = "G0 X0 Y40\nG41 D1 G456 G1 X0 Y0\nX50\nD2 X90\nG40 X90 Y40";
    let mut tools = tool(5.0);
    tools.offsets.insert(2, Offset { radius_mm: -5.0, ..Offset::default() });
    finding(&plan(text, &sinumerik(), &tools), Code::SideChange);
    tools.offsets.insert(2, Offset::default());
    finding(&plan(text, &sinumerik(), &tools), Code::RadiusSource);
}

#[test]
fn the_outside_corner_before_a_rapid_is_an_arc_at_the_last_feed() {
    let text = A6.replace("N80 X90", "N80 G0 X90").replace("N90 X65", "N90 G1 X65");
    let plan = plan(&text, &sinumerik(), &tool(5.0));
    let of_n80: Vec<_> = plan
        .path
        .elements
        .iter()
        .filter(|element| element.source.block == Some(80))
        .map(|element| (element.role, element.feed_mm_per_min))
        .collect();
    assert_eq!(of_n80, [(Role::Corner, Some(400.0)), (Role::Contour, None)]);
}
