//! What the tool does to elements that it does not follow: neighbours and distant ones.

mod support;

use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::profile::Reaction;
use compensation_planner::plan_certified;
use proptest::prelude::*;
use support::shapes::{clearance, closed, crosses_itself};
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
fn a_spiral_is_followed_if_the_tool_fits_between_its_turns() {
    // The benchmarks have longer ones.
    // Half circles about two points in turn, 12 mm from turn to turn.
    let spiral = |last: &str| {
        let mut text = "G0 X56 Y0\nG42 D1 G456 G1 F100 X50 Y0\n".to_string();
        let (mut x, mut radius) = (50.0, 50.0);
        for half in 0..200 {
            x = if half % 2 == 0 { x - 2.0 * radius } else { x + 2.0 * radius };
            let center = if half % 2 == 0 { -radius } else { radius };
            text += &format!("G3 X{x} Y0 I{center} J0\n");
            radius += 6.0;
        }
        text + last
    };
    let text = spiral("G40 G456 G1 X1270 Y0");
    let contour = contour(&text, &sinumerik());
    let fits = compensation_planner::plan(&contour, &sinumerik(), &tool(5.9));
    assert!(fits.findings.is_empty(), "{}", findings(&fits));
    let gouges = compensation_planner::plan(&contour, &sinumerik(), &tool(6.1));
    finding(&gouges, Code::Gouge);
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
fn what_leads_away_from_a_closed_circle_bounds_nothing() {
    let text = "
        N1 G0 X40 Y5
        N2 G42 D1 G456 G1 X20 Y0 F100
        N3 G3 X20 Y0 I-20 J0
        N4 G1 X24 Y-30
        N5 G40 G456 X60 Y-30";
    let plan = plan(text, &sinumerik(), &tool(5.0));
    assert_eq!(findings(&plan), "");
}

#[test]
fn a_roughing_pass_that_cuts_what_a_finishing_pass_leaves_is_reported() {
    let text = "
        N1 G0 X0 Y20
        N2 G41 D1 G456 G1 X0 Y0 F100
        N3 X20
        N4 Y40
        N5 X-20
        N6 Y0
        N7 X12
        N8 Y30
        N9 X-12
        N10 Y0
        N11 X0
        N12 G40 G456 X0 Y20";
    let plan = plan(text, &sinumerik(), &tool(3.0));
    let finding = finding(&plan, Code::CutsOtherPass);
    assert_eq!(finding.severity, Severity::Warning);
    assert!(plan.accepted(), "{}", findings(&plan));
}

#[test]
fn two_walls_far_apart_in_the_program_are_too_near() {
    let run = |radius| plan(BOTTLENECK, &sinumerik(), &tool(radius));
    for radius in [1.0, 4.0, 4.99, 5.0] {
        assert!(run(radius).accepted(), "{radius}: {}", findings(&run(radius)));
    }
    for radius in [5.01, 5.05, 5.1] {
        let plan = run(radius);
        let finding = finding(&plan, Code::Gouge);
        assert!(!plan.accepted());
        assert_eq!(codes(&plan), [Code::Gouge], "{radius}: {}", findings(&plan));
        assert_eq!(finding.source.block, Some(70));
        assert_eq!(finding.other.unwrap().block, Some(50));
        let [x, y, _] = finding.position.unwrap();
        assert!((x - 100.0).abs() < 1e-3 && (y - 55.0).abs() < 1e-3, "{finding:?}");
        assert!((finding.depth_mm.unwrap() - 2.0 * (radius - 5.0)).abs() < 1e-6, "{finding:?}");
        assert!((finding.available_mm.unwrap() - 5.0).abs() < 1e-6, "{finding:?}");
        assert_eq!(finding.alarm.as_deref(), Some("3021"));
    }
}

#[test]
fn a_contour_that_is_entered_in_an_inside_corner_is_cut() {
    let plan = plan(&A6.replace("G41", "G42"), &sinumerik(), &tool(5.0));
    let finding = finding(&plan, Code::Gouge);
    assert!((finding.depth_mm.unwrap() - 2.0).abs() < 1e-6, "{finding:?}");
    let blocks = [finding.source.block, finding.other.unwrap().block];
    assert_eq!(blocks, [Some(110), Some(20)]);
}

#[test]
fn a_neck_is_judged_by_its_width_however_its_walls_are_split() {
    // A chamber of 24 by 30 mm after a neck of 4 mm.
    let whole = "Y-10\nX30\nY-40\nX54\nY-10\nX44\nY0";
    let split = "Y-2\nY-4.5\nY-9.9\nY-10\nX30\nY-40\nX54\nY-10\nX44\nY-8\nY-3.3\nY0";
    for walls in [whole, split] {
        let text =
            format!("G0 X0 Y20\nG41 D1 G456 G1 X0 Y0 F100\nX40\n{walls}\nX100\nG40 G456 X100 Y20");
        let fits = plan(&text, &sinumerik(), &tool(1.999));
        assert!(fits.accepted(), "{}", findings(&fits));
        let gouges = plan(&text, &sinumerik(), &tool(3.0));
        assert_eq!(codes(&gouges), [Code::Gouge], "{}", findings(&gouges));
        let finding = finding(&gouges, Code::Gouge);
        assert!((finding.depth_mm.unwrap() - 2.0).abs() < 1e-9, "{finding:?}");
        assert!((finding.available_mm.unwrap() - 2.0).abs() < 1e-9, "{finding:?}");
    }
}

#[test]
fn an_open_slot_is_cut_by_a_tool_that_runs_between_its_walls() {
    // Both walls in one contour, joined far away on the side of the tool.
    let text = "
        G0 X-20 Y2
        G42 D1 G456 G1 X0 Y4 F100
        X100
        X140 Y30
        X140 Y-26
        X100 Y0
        X0
        G40 G456 X-20 Y-2";
    let accepted = |radius| plan(text, &sinumerik(), &tool(radius)).accepted();
    assert!(accepted(1.9));
    let plan = plan(text, &sinumerik(), &tool(3.0));
    let finding = finding(&plan, Code::Gouge);
    assert!((finding.depth_mm.unwrap() - 2.0).abs() < 1e-6, "{finding:?}");
}

#[test]
fn a_rib_that_the_tool_runs_around_may_be_thinner_than_the_tool() {
    let text = "
        G0 X50 Y-30
        G42 D1 G456 G1 X50 Y0 F100
        X100
        Y1
        X60
        X60 Y0.5
        X40
        X40 Y1
        X0
        Y0
        X50
        G40 G456 X50 Y-30";
    let plan = plan(text, &sinumerik(), &tool(0.2));
    assert!(plan.accepted(), "{}", findings(&plan));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, max_global_rejects: 1_000_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn p2_what_is_accepted_keeps_its_distance_and_what_is_cut_is_cut_so_deep(
        corners in prop::collection::vec((5.0..60.0_f64, -1.0..1.0_f64), 3..24),
        bends in prop::collection::vec(prop_oneof![2 => Just(0.0), 1 => -0.9..0.9_f64], 1..6),
        is_left in any::<bool>(),
        radius in 0.1..12.0_f64,
    ) {
        let text = closed(&corners, &bends, if is_left { "G41" } else { "G42" });
        let plan = plan(&text, &sinumerik(), &tool(radius));
        let gouges: Vec<f64> = plan
            .findings
            .iter()
            .filter(|finding| matches!(finding.code, Code::Gouge | Code::CutsOtherPass))
            .map(|finding| finding.depth_mm.unwrap())
            .collect();
        // A contour that crosses itself as it is programmed has tails; what is not reached
        // has no path.
        let other = codes(&plan).into_iter().any(|code| {
            !matches!(code, Code::Gouge | Code::CutsOtherPass | Code::LeadGouge)
        });
        prop_assume!(!other && !crosses_itself(&text));
        let depth = radius - clearance(&text, &plan);
        let deepest = gouges.iter().copied().fold(0.0, f64::max);
        prop_assert!(
            (depth - deepest).abs() < 4e-3,
            "R {radius}: {depth} deep, and {deepest} was found\n{text}\n{}",
            findings(&plan)
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, max_global_rejects: 1_000_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn p11_a_certificate_is_good_up_to_its_end_and_no_farther(
        corners in prop::collection::vec((5.0..60.0_f64, -1.0..1.0_f64), 3..16),
        bends in prop::collection::vec(prop_oneof![2 => Just(0.0), 1 => -0.9..0.9_f64], 1..6),
        is_left in any::<bool>(),
        radius in 0.1..12.0_f64,
    ) {
        let text = closed(&corners, &bends, if is_left { "G41" } else { "G42" });
        prop_assume!(!crosses_itself(&text));
        let profile = sinumerik();
        let certified = |radius| plan_certified(&contour(&text, &profile), &profile, &tool(radius));
        let end = certified(radius).certificates[0].valid_to_mm;
        // Below, what is accepted with a tolerance may be anything.
        prop_assume!(end > 0.5 && end < 200.0);
        let fits = |radius| {
            let codes = codes(&plan(&text, &profile, &tool(radius)));
            !codes.iter().any(|code| matches!(code, Code::Gouge | Code::Unreachable))
        };
        prop_assert!(fits(end * (1.0 - 1e-6)), "{end} does not fit\n{text}");
        prop_assert!(!fits(end * 1.02 + 0.02), "{end} is not the end\n{text}");
        // The same end from a radius below it.
        let again = certified(end * 0.7).certificates[0].valid_to_mm;
        prop_assert!((again - end).abs() < 1e-6 * end.max(1.0), "{again} and {end}");
    }
}

/// Two outside corners that face each other across 11.3 mm.
fn facing_corners(mode: &str) -> String {
    format!(
        "
        N1 G0 X-50 Y20
        N2 G41 D1 {mode} G456 G1 X-50 Y0 F100
        N3 X0
        N4 Y-50
        N5 X60
        N6 Y8
        N7 X8
        N8 Y60
        N9 G40 G456 X-20 Y60"
    )
}

#[test]
fn the_spike_of_an_intersection_does_not_cut_what_the_arc_passes_by() {
    let arc = plan(&facing_corners("G450"), &sinumerik(), &tool(5.0));
    assert!(arc.findings.is_empty(), "{}", findings(&arc));
    let spike = plan(&facing_corners("G451"), &sinumerik(), &tool(5.0));
    let finding = finding(&spike, Code::Gouge);
    // The spike ends at (5, 5), the other corner is at (8, 8).
    let depth_mm = 5.0 - 3.0 * 2.0_f64.sqrt();
    assert!((finding.depth_mm.unwrap() - depth_mm).abs() < 1e-9, "{finding:?}");
    let certified =
        plan_certified(&contour(&facing_corners("G451"), &sinumerik()), &sinumerik(), &tool(4.0));
    // Where (8 - R) * sqrt 2 = R.
    let radius_mm = 8.0 * 2.0_f64.sqrt() / (1.0 + 2.0_f64.sqrt());
    assert!((certified.certificates[0].valid_to_mm - radius_mm).abs() < 1e-6);
}

#[test]
fn the_corner_between_a_lead_and_the_contour_is_part_of_the_lead() {
    // From below, around the start of the contour, past a wall 8 mm away from it.
    let run = |y: f64| {
        let text = format!(
            "
            N1 G0 X-20 Y-40
            N2 G41 D1 G450 G455 G1 X0 Y0 F100
            N3 X50
            N4 Y60
            N5 X20
            N6 Y{y}
            N7 X-20
            N8 G40 G456 X-20 Y{}",
            y - 20.0
        );
        plan(&text, &sinumerik(), &tool(5.0))
    };
    // An oblique lead nicks the corner itself, whatever else there is (S18).
    let nicked = finding(&run(11.0), Code::LeadNick).other.unwrap().block;
    assert_eq!(nicked, Some(3));
    let near = run(9.0);
    let swung = finding(&near, Code::LeadGouge);
    assert_eq!(swung.other.unwrap().block, Some(7));
    assert!((swung.depth_mm.unwrap() - 1.0).abs() < 1e-9, "{swung:?}");
}

/// A wall with a slot 8 mm wide, from X-30 to X60, and how it ends.
fn slot_and(end: &str) -> String {
    format!(
        "G0 X-30 Y20\nG41 D1 G1 X-30 Y0 F500\nX0\nY-10\nX-20\nY-40\nX40\nY-10\nX8\nY0\nX60\n{end}"
    )
}

#[test]
fn a_loop_at_the_end_of_a_contour_hides_no_gouge_before_it() {
    // By itself, with a loop, and with a bit of it run twice.
    for end in ["G40 X60 Y30", "Y-5\nX50\nY5\nG40 X50 Y60", "X50\nG40 X50 Y-40"] {
        let plan = plan(&slot_and(end), &rs274(), &tool(5.0));
        let gouge = plan.findings.iter().find(|finding| finding.code == Code::Gouge);
        let gouge = gouge.unwrap_or_else(|| panic!("{end}: {}", findings(&plan)));
        assert!((gouge.available_mm.unwrap() - 4.0).abs() < 1e-6, "{gouge:?}");
        let mut ignoring = rs274();
        ignoring.interference.react = Reaction::Ignore;
        let programmed = contour(&slot_and(end), &rs274());
        let cuts = compensation_planner::plan(&programmed, &ignoring, &tool(5.0));
        let audit = path_audit::audit(&programmed, &cuts.path, &rs274(), &tool(5.0));
        assert!(audit.findings.iter().any(|finding| finding.code == Code::Gouge), "{end}");
        let fits = plan_certified(&contour(&slot_and(end), &rs274()), &rs274(), &tool(3.5));
        assert!(fits.accepted(), "{end}: {}", findings(&fits));
        assert!((fits.certificates[0].valid_to_mm - 4.0).abs() < 1e-6, "{end}");
    }
}

#[test]
fn a_loop_at_the_start_of_a_contour_hides_no_gouge_after_it() {
    let slot = "X0\nY-10\nX-20\nY-40\nX40\nY-10\nX8\nY0\nX60\nG40 X60 Y30";
    let start = "G0 X-30 Y-20\nG41 D1 G1 X-30 Y0 F500\nX-30.001";
    let plan = plan(&format!("{start}\n{slot}"), &rs274(), &tool(5.0));
    assert!(codes(&plan).contains(&Code::Gouge), "{}", findings(&plan));
}

#[test]
fn coordinates_that_jump_back_by_a_thousandth_cut_nothing() {
    let bottom = |back: &str| {
        slot_and("G40 X60 Y30").replace("X40\nY-10", &format!("X10\n{back}\nX40\nY-10"))
    };
    for back in ["", "X9.999", "X9.999 Y-40.0005\nX10.001 Y-39.9995", "X9.9995\nX10"] {
        let fits = plan(&bottom(back), &rs274(), &tool(3.5));
        assert!(fits.accepted(), "{back}: {}", findings(&fits));
        let gouges = plan(&bottom(back), &rs274(), &tool(5.0));
        let found: Vec<_> = gouges.findings.iter().filter(|d| d.code == Code::Gouge).collect();
        let [gouge] = found[..] else { panic!("{back}: {}", findings(&gouges)) };
        assert!((gouge.available_mm.unwrap() - 4.0).abs() < 1e-6, "{gouge:?}");
    }
}

#[test]
fn a_circle_that_is_entered_and_left_on_arcs_is_cut() {
    for (text, radius) in [
        // A pocket and a boss.
        (
            "G0 X0 Y0\nG41 D1 G1 X10 Y-10 F500\nG3 X20 Y0 I0 J10\nG3 X20 Y0 I-20 J0
            G3 X10 Y10 I-10 J0\nG40 G1 X0 Y0",
            5.0,
        ),
        (
            "G0 X40 Y20\nG41 D1 G1 X30 Y10 F500\nG3 X20 Y0 I0 J-10\nG2 X20 Y0 I-20 J0
            G3 X30 Y-10 I10 J0\nG40 G1 X40 Y-20",
            5.0,
        ),
    ] {
        let plan = plan(text, &sinumerik(), &tool(radius));
        assert!(plan.accepted(), "{text}: {}", findings(&plan));
        assert!(!codes(&plan).contains(&Code::CutsOtherPass), "{}", findings(&plan));
    }
}
