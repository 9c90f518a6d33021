//! What the tool fits into and what it does not.

mod support;

use cnc_msgs::finding::{Code, Finding, Severity};
use cnc_msgs::path::Role;
use proptest::prelude::*;
use support::*;

fn unreachable(text: &str, radius: f64) -> Option<Finding> {
    let plan = plan(text, &sinumerik(), &tool(radius));
    plan.findings.iter().find(|d| d.code == Code::Unreachable).cloned()
}

const S64: &str = "N1 G0 X-40 Y60
    N2 G41 D1 G456 G1 X-22 Y20
    N3 X-2 Y0
    N4 X2
    N5 X22 Y20
    N6 G40 G456 X40 Y60";

#[test]
fn s64_a_trapezoid_takes_tools_up_to_its_critical_radius() {
    assert_eq!(unreachable(S64, 4.5), None);
    assert_eq!(unreachable(S64, 4.828), None);
    for radius in [4.829, 4.9, 5.0, 7.0] {
        let finding = unreachable(S64, radius).unwrap();
        assert_eq!(finding.severity, Severity::Error);
        assert_eq!(finding.alarm.as_deref(), Some("3021"));
        assert_eq!(finding.source.block, Some(4));
        assert_eq!(finding.position, Some([-2.0, 0.0, 0.0]));
        assert_eq!(finding.needed_mm, Some(radius));
        let critical = 2.0 / (2.0_f64.sqrt() - 1.0);
        assert!((finding.available_mm.unwrap() - critical).abs() < 1e-5, "{finding:?}");
        assert!(finding.help.contains("4.828"), "{}", finding.help);
    }
}

#[test]
fn s65_a_step_lower_than_the_tool_is_unreachable() {
    let text =
        "N1 G0 X-20 Y40\nN2 G41 D1 G456 G1 X0 Y0\nN3 X50\nN4 Y3\nN5 X100\nN6 G40 G456 X120 Y40";
    let finding = unreachable(text, 5.0).unwrap();
    assert_eq!((finding.source.block, finding.alarm.as_deref()), (Some(4), Some("3021")));
    assert!((finding.available_mm.unwrap() - 3.0).abs() < 1e-5);
    assert_eq!(unreachable(text, 2.999), None);
    assert!(unreachable(&text.replace("D1", "D1 G451"), 5.0).is_some());
    // What would have been cut goes around the step.
    let plan = plan(text, &sinumerik(), &tool(5.0));
    assert!((plan.refused[2].end[0] - 45.417424).abs() < 1e-6, "{}", listing(&plan.refused));
}

#[test]
fn a6_is_reached_to_20_85_and_n40_vanishes_at_20_86() {
    let far = A6.replace("N1 G0 X15", "N1 G0 X-60").replace("N120 G40 X15", "N120 G40 X-60");
    let fits = plan(&far, &sinumerik(), &tool(20.85));
    assert!(fits.accepted() && fits.findings.is_empty(), "{}", findings(&fits));
    let near = plan(A6, &sinumerik(), &tool(20.85));
    assert!(near.accepted());
    assert_eq!(codes(&near), [Code::LeadGouge, Code::LeadGouge], "the start is 15 mm away");
    for text in [A6, &far] {
        let finding = unreachable(text, 20.86).unwrap();
        assert_eq!(finding.source.block, Some(40));
        assert!((finding.available_mm.unwrap() - 20.851449).abs() < 1e-5, "{finding:?}");
        assert_eq!(finding.position, Some([65.0, 55.0, 0.0]));
    }
}

#[test]
fn a6_takes_its_leads_to_13_416() {
    let cuts = |radius| codes(&plan(A6, &sinumerik(), &tool(radius))).contains(&Code::LeadGouge);
    assert!(!cuts(13.416) && cuts(13.45));
}

#[test]
fn the_closed_contour_on_the_right_loses_neighbours_at_5_1283() {
    let text = "N10 G0 X80 Y20
        N20 G42 D1 G456 G1 X80 Y55
        N40 X95
        N50 G2 X110 Y70 I15 J0
        N60 G1 X105 Y55
        N70 X110 Y35
        N80 G40 G456 X80 Y20";
    assert_eq!(unreachable(text, 5.128), None);
    let finding = unreachable(text, 5.129).unwrap();
    assert!((finding.available_mm.unwrap() - 5.128292).abs() < 1e-4, "{finding:?}");
}

#[test]
fn a_fillet_smaller_than_the_tool_is_unreachable_as_an_arc_or_as_chords() {
    let head = "N1 G0 X-20 Y40\nN2 G41 D1 G456 G1 X0 Y0\nN3 X46";
    let tail = "N50 G1 X50 Y50\nN60 G40 G456 X20 Y60";
    let arc = format!("{head}\nN4 G3 X50 Y4 I0 J4\n{tail}");
    let mut chords = head.to_string();
    for step in 1..=16 {
        let (sin, cos) = (f64::from(step) / 16.0 * std::f64::consts::FRAC_PI_2).sin_cos();
        chords += &format!("\nN{} X{} Y{}", 4 + step, 46.0 + 4.0 * sin, 4.0 - 4.0 * cos);
    }
    chords += &format!("\n{tail}");
    for text in [arc, chords] {
        assert_eq!(unreachable(&text, 3.9), None);
        let finding = unreachable(&text, 5.0).unwrap();
        let limit = finding.available_mm.unwrap();
        assert!((limit - 4.0).abs() < 0.02, "{limit}");
    }
}

#[test]
fn a_tool_of_the_radius_of_the_fillet_stands_still_in_it() {
    let text = "N1 G0 X-20 Y40\nN2 G41 D1 G456 G1 X0 Y0\nN3 X46\nN4 G3 X50 Y4 I0 J4\nN5 G1 X50 Y50\nN6 G40 G456 X20 Y60";
    let expected = [[-20.0, 40.0], [0.0, 4.0], [46.0, 4.0], [46.0, 50.0], [20.0, 60.0]];
    assert_ends(&plan(text, &sinumerik(), &tool(4.0)), &expected, 1e-9);
}

#[test]
fn a_sharp_inside_corner_is_always_reached() {
    for angle in [1.0_f64, 30.0, 90.0, 150.0, 170.0] {
        let (sin, cos) = angle.to_radians().sin_cos();
        let (x, y) = (500.0 + 500.0 * cos, 500.0 * sin);
        let text = format!(
            "G0 X0 Y90\nG41 D1 G456 G1 X0 Y0\nX500\nX{x:.6} Y{y:.6}\nG40 G456 X{:.6} Y{:.6}",
            x - 50.0 * sin,
            y + 50.0 * cos
        );
        assert_eq!(unreachable(&text, 5.0), None, "{angle}");
    }
}

#[test]
fn noise_of_posted_coordinates_is_no_finding() {
    let clean = "G0 X-20 Y40\nG41 D1 G456 G1 X0 Y0\nX50\nY50\nG40 G456 X20 Y60";
    let expected = ends(&plan(clean, &sinumerik(), &tool(5.0)));
    let noisy = [
        "X50\nX50.00001\nX50 Y0.00001\nY50",
        "X49.9995\nX50 Y0.0005\nY50",
        "X49.999\nX50.0005 Y0\nX50 Y0.001\nY50",
    ];
    for noise in noisy {
        for mode in ["", " G451"] {
            let text = clean
                .replace("X50\nY50\nG40", &format!("{noise}\nG40"))
                .replace("D1", &format!("D1{mode}"));
            let plan = plan(&text, &sinumerik(), &tool(5.0));
            assert!(plan.findings.is_empty(), "{noise}: {}", findings(&plan));
            let got = ends(&plan);
            assert_eq!(got.len(), expected.len(), "{noise}\n{}", listing(&plan.path.elements));
            for (a, b) in got.iter().zip(&expected) {
                assert!((a[0] - b[0]).abs() < 0.003 && (a[1] - b[1]).abs() < 0.003, "{got:?}");
            }
        }
    }
}

#[test]
fn a_step_below_the_tolerance_is_run_over() {
    for height in [0.00001, 0.0005, 0.0019] {
        for mode in ["G450", "G451"] {
            let text = format!(
                "G0 X-20 Y40\nG41 {mode} D1 G456 G1 X0 Y0\nX50\nY{height}\nX100\nG40 G456 X120 Y40"
            );
            let plan = plan(&text, &sinumerik(), &tool(5.0));
            assert!(plan.findings.is_empty(), "{height} {mode}: {}", findings(&plan));
        }
    }
}

#[test]
fn a_piece_that_is_trimmed_away_vanishes_without_a_finding() {
    let text = "N1 G0 X-20 Y40\nN2 G41 D1 G456 G1 X0 Y0\nN3 X48\nN4 X50\nN5 Y2\nN6 Y50\nN7 G40 G456 X20 Y60";
    let plan = plan(text, &sinumerik(), &tool(5.0));
    let expected = "N1 none G0 (-20,40)
        N2 lead_on G1 (0,5)
        N3 contour G1 (45,5)
        N6 contour G1 (45,50)
        N7 lead_off G1 (20,60)";
    assert_eq!(listing(&plan.path.elements), dedent(expected));
    assert!(plan.findings.is_empty());
}

#[test]
fn all_findings_are_listed() {
    let text = S64.replace(
        "N6 G40 G456 X40 Y60",
        "N6 X60\nN7 X62 Y22\nN8 X80 Y22\nN9 Y20\nN10 X100\nN11 G40 G2 X110 Y20 I5 J0",
    );
    let plan = plan(&text, &sinumerik(), &tool(5.0));
    let count = codes(&plan).iter().filter(|code| **code == Code::Unreachable).count();
    assert!(count >= 2 && codes(&plan).contains(&Code::LeadType), "{}", findings(&plan));
}

#[test]
fn a_wall_in_pieces_of_three_decimals_is_no_finding_at_an_inside_corner() {
    for (angle, turn, step) in [(0.9_f64, 2.47_f64, 0.02_f64), (4.83, 0.65, 0.5), (4.21, 2.07, 0.1)]
    {
        let (first, second) = (angle.sin_cos(), (angle + turn).sin_cos());
        let mut text =
            format!("G0 X{:.3} Y{:.3}\nG41 D1 G456 G1 X0 Y0", -40.0 * first.0, 40.0 * first.1);
        let pieces = (60.0 / step) as u32;
        let mut at = (0.0, 0.0);
        for (sin, cos) in [first, second] {
            let start = at;
            for piece in 1..=pieces {
                let along = step * f64::from(piece);
                at = (start.0 + along * cos, start.1 + along * sin);
                text += &format!("\nX{:.3} Y{:.3}", at.0, at.1);
            }
        }
        let out = (at.0 - 30.0 * second.0, at.1 + 30.0 * second.1);
        text += &format!("\nG40 G456 X{:.3} Y{:.3}", out.0, out.1);
        let plan = plan(&text, &sinumerik(), &tool(5.0));
        assert!(plan.accepted(), "{angle} {turn} {step}: {}", findings(&plan));
        // The corner of the tool path: from both walls by the radius.
        let half = (turn / 2.0).tan();
        let corner = (
            60.0 * first.1 - 5.0 * first.0 - 5.0 * half * first.1,
            60.0 * first.0 + 5.0 * first.1 - 5.0 * half * first.0,
        );
        let near = ends(&plan)
            .iter()
            .map(|end| (end[0] - corner.0).hypot(end[1] - corner.1))
            .fold(f64::INFINITY, f64::min);
        assert!(near < 0.01, "{angle} {turn} {step}: {near}");
    }
}

#[test]
fn a_smooth_contour_of_short_chords_in_three_decimals_is_no_finding() {
    let at = |part: f64| {
        let angle = 6.2 * part;
        (50.0 * angle.cos() + 8.0 * (2.0 * angle).cos(), 40.0 * angle.sin())
    };
    let count = 20_000;
    let mut text = "G0 X38 Y0\nG41 D1 G456 G1 X58 Y0".to_string();
    for index in 1..=count {
        let (x, y) = at(f64::from(index) / f64::from(count));
        text += &format!("\nX{x:.3} Y{y:.3}");
    }
    text += "\nG40 G456 X38 Y0";
    for radius in [2.0, 5.0, 10.0] {
        let plan = plan(&text, &sinumerik(), &tool(radius));
        assert!(plan.accepted(), "{radius}: {}", findings(&plan));
    }
}

#[test]
fn very_many_findings_are_cut_short() {
    let step = "\nX30\nX2 Y-2\nX0.5\nX2 Y2";
    let text =
        format!("G0 X-20 Y40\nG41 D1 G456 G1 X-20 Y0\nG91{}\nG90\nG40 G456 Y60", step.repeat(500));
    let plan = plan(&text, &sinumerik(), &tool(2.0));
    let count = codes(&plan).iter().filter(|code| **code == Code::Unreachable).count();
    assert_eq!(count, 100);
    assert!(codes(&plan).contains(&Code::Limit));
}

/// Points of a curve from (0, 0) in a direction: a line when the curvature is 0.
fn curve(angle: f64, curvature: f64, length: f64, step: f64) -> Vec<(f64, f64)> {
    let count = (length / step).ceil().max(1.0) as u32;
    let at = |index: u32| {
        let along = length * f64::from(index) / f64::from(count);
        let turned = curvature * along;
        let (forward, sideways) = if turned.abs() < 1e-9 {
            (along, 0.0)
        } else {
            (turned.sin() / curvature, (1.0 - turned.cos()) / curvature)
        };
        let (sin, cos) = angle.sin_cos();
        (forward * cos - sideways * sin, forward * sin + sideways * cos)
    };
    (1..=count).map(at).collect()
}

/// Two curves of 30 mm, written in chords, that meet at the origin with the tool on their left.
fn curves_in_chords(
    angle: f64,
    corner: f64,
    curvatures: (f64, f64),
    steps: (f64, f64),
    decimals: usize,
) -> String {
    // From the corner outwards.
    let first = curve(angle + std::f64::consts::PI, -curvatures.0, 30.0, steps.0);
    let second = curve(angle + corner, curvatures.1, 30.0, steps.1);
    let start = first[first.len() - 1];
    let mut points: Vec<(f64, f64)> = first.into_iter().rev().skip(1).collect();
    points.push((0.0, 0.0));
    points.extend(second);
    let leads = |along: f64| {
        let (sin, cos) = (along + std::f64::consts::FRAC_PI_2).sin_cos();
        (40.0 * cos, 40.0 * sin)
    };
    let on = leads(angle - curvatures.0 * 30.0);
    let off = leads(angle + corner + curvatures.1 * 30.0);
    let end = points[points.len() - 1];
    let write = |(x, y): (f64, f64)| format!("X{x:.decimals$} Y{y:.decimals$}");
    let mut text =
        format!("G0 {}\nG41 D1 G456 G1 {}", write((start.0 + on.0, start.1 + on.1)), write(start));
    for point in points {
        text += &format!("\n{}", write(point));
    }
    text += &format!("\nG40 G456 {}", write((end.0 + off.0, end.1 + off.1)));
    text
}

#[test]
fn a_few_straights_before_a_sharp_corner_are_no_curve() {
    let lead = "G0 X0 Y30\nG41 D1 G456 G1 X0 Y10";
    let leave = "X60\nG40 G456 X60 Y30";
    // After an arc, and bent by 5 degrees.
    for (text, radius, fits) in [
        (format!("{lead}\nX5\nG2 X10 Y5 I0 J-5\nG1 Y1\n{leave}"), 5.0, 4.0),
        (format!("{lead}\nX10\nX10.174 Y2\nY0\n{leave}"), 6.0, 2.0),
    ] {
        let refused = unreachable(&text, radius).expect(&text);
        assert!((refused.available_mm.unwrap() - fits).abs() < 0.2, "{refused:?}");
    }
}

#[test]
fn a_piece_of_1e_5_mm_after_an_arc_is_no_finding() {
    let text = "G0 X30 Y-9\nG42 D1 G456 G1 X9 Y-9\nG3 X0 Y0 I-9 J0
        G1 X-0.0000127 Y0.00000000016\nG1 X-10 Y0.000254\nG40 G456 X-10 Y20";
    for radius in [0.001, 0.1, 1.0, 5.0] {
        assert_eq!(unreachable(text, radius), None, "{radius}");
    }
}

#[test]
fn a_last_chord_next_to_the_line_before_it_is_no_feature() {
    // Each ends in a chord that is shorter than what the noise of its direction takes.
    for (angle, corner, curvatures, steps) in [
        (-2.553549811592904, 1.814895, (0.0092835719, -0.0010861), (0.0462090768, 0.73803032)),
        (-2.553765999592904, 1.7556985, (0.0092359958, -0.0468584), (0.0461041308, 0.44121576)),
        (2.0962248574070963, 1.809025, (0.0092183896, 0.0497131), (0.0463529064, 0.03934716)),
    ] {
        let text = curves_in_chords(angle, corner, curvatures, steps, 3);
        let plan = plan(&text, &sinumerik(), &tool(5.0));
        assert!(plan.accepted(), "{}", findings(&plan));
    }
}

/// Curvatures of lines, and of curves whose chords are no straights as long as the tool.
fn bend() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), 0.002..0.05_f64, -0.05..-0.002_f64]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, max_global_rejects: 1_000_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// As arcs they take nothing of each other, and as chords they do not either.
    #[test]
    fn curves_in_chords_that_meet_in_a_sharp_corner_are_reached(
        curvatures in (bend(), bend()),
        steps in (0.02..1.0_f64, 0.02..1.0_f64),
        corner in 0.3..2.6_f64,
        angle in 0.0..std::f64::consts::TAU,
        decimals in prop_oneof![Just(3), Just(4), Just(9)],
    ) {
        // They do not bend towards each other until the tool does not fit between them.
        let turn = |curvature: f64| 30.0 * curvature.max(0.0);
        prop_assume!(corner + turn(curvatures.0) + turn(curvatures.1) < 2.6);
        let text = curves_in_chords(angle, corner, curvatures, steps, decimals);
        let refused = unreachable(&text, 5.0);
        prop_assert!(refused.is_none(), "{refused:?}\n{text}");
    }
}

#[test]
fn a_lead_takes_of_a_curve_in_chords_what_it_takes_of_an_arc() {
    // The lead-on meets the contour at 32 degrees, and the tool starts between both.
    for step in [0.005, 0.05, 0.5, 50.0] {
        let mut text = "G0 X530 Y0\nG42 D1 G1 X500 Y0".to_string();
        for (x, y) in curve(0.5585, -0.001, 50.0, step) {
            text += &format!("\nX{:.3} Y{y:.3}", 500.0 + x);
        }
        text += "\nG40 X600 Y0";
        let plan = plan(&text, &rs274(), &tool(5.0));
        assert!(plan.accepted(), "{step}: {}", findings(&plan));
        let lead_on = plan.path.elements.iter().find(|element| element.role == Role::LeadOn);
        let start = lead_on.unwrap().end;
        // 5 mm from the lead and from the curve.
        assert!((start[0] - 518.0).abs() < 0.4 && (start[1] - 5.0).abs() < 1e-6, "{start:?}");
    }
}
