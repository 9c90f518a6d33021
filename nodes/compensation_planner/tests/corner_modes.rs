//! How far the tool swings out at outside corners that it does not go around in arcs.

mod support;

use cnc_msgs::finding::Code;
use cnc_msgs::profile::Profile;
use compensation_planner::Plan;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};
use support::outline::{closed_part, distance, polyline, samples};
use support::random::{config, run};
use support::shapes::{closed, crosses_itself, vertices};
use support::*;

/// No corner is so short that it is left out (S68).
fn around() -> Profile {
    let mut profile = sinumerik();
    profile.corner.short_block_mm = 0.0;
    profile
}

/// How much the contour turns away from the tool at each of its corners, rad.
fn turns(vertices: &[([f64; 2], f64)], is_left: bool) -> Vec<f64> {
    let count = vertices.len();
    let heading = |index: usize, side: f64| {
        let ([x, y], bulge) = vertices[index % count];
        let [to_x, to_y] = vertices[(index + 1) % count].0;
        (to_y - y).atan2(to_x - x) + side * 2.0 * bulge.atan()
    };
    let turn = |index: usize| {
        let turn = heading(index, -1.0) - heading(index + count - 1, 1.0);
        let turn = (turn + PI).rem_euclid(2.0 * PI) - PI;
        if is_left { -turn } else { turn }
    };
    (0..count).map(turn).collect()
}

/// The largest distance of the path from the contour, in radii, and the smallest.
fn swings(vertices: &[([f64; 2], f64)], plan: &Plan, radius: f64) -> (f64, f64) {
    let wall = polyline(vertices);
    let far = samples(&plan.path).into_iter().map(|point| distance(&wall, point) / radius);
    far.fold((0.0, f64::INFINITY), |(most, least), far| (far.max(most), far.min(least)))
}

fn is_free(plan: &Plan) -> bool {
    plan.accepted() && codes(plan).iter().all(|code| *code == Code::LeadGouge)
}

proptest! {
    #![proptest_config(config(200))]

    /// As far as the intersection at obtuse corners; acute ones are cut short.
    #[test]
    fn p4_a_corner_cut_short_swings_out_by_the_root_of_2_at_most(
        corners in prop::collection::vec((25.0..60.0_f64, -1.0..1.0_f64), 3..12),
        bends in prop::collection::vec(prop_oneof![2 => Just(0.0), 1 => -0.5..0.5_f64], 1..6),
        is_left in any::<bool>(),
        radius in 0.2..2.0_f64,
    ) {
        let text = closed(&corners, &bends, if is_left { "G41 G451" } else { "G42 G451" });
        prop_assume!(!crosses_itself(&text));
        let plan = run(&contour(&text, &around()), &around(), radius);
        prop_assume!(is_free(&plan));
        let vertices = vertices(&corners, &bends);
        let (most, least) = swings(&vertices, &plan, radius);
        prop_assert!(least > 1.0 - 1e-6 / radius, "{least} R\n{text}");
        prop_assert!(most < SQRT_2 + 1e-6, "{most} R\n{text}");
        // And it does swing out as far as the sharpest of them asks for.
        let sharpest = turns(&vertices, is_left).into_iter().fold(0.0, f64::max);
        let expected = if sharpest > FRAC_PI_2 { SQRT_2 } else { 1.0 / (sharpest / 2.0).cos() };
        prop_assert!((most - expected).abs() < 1e-6, "{most} R, not {expected}\n{text}");
    }

    /// A corner of up to 100 degrees keeps the tool within 1.5557 radii.
    #[test]
    fn p4_an_intersection_is_as_far_as_half_the_turn_says(
        corners in prop::collection::vec((30.0..60.0_f64, -0.5..0.5_f64), 4..12),
        is_left in any::<bool>(),
        radius in 0.2..2.0_f64,
    ) {
        let text = closed(&corners, &[0.0], if is_left { "G41 G452" } else { "G42 G452" });
        let plan = run(&contour(&text, &around()), &around(), radius);
        prop_assume!(is_free(&plan));
        let vertices = vertices(&corners, &[0.0]);
        let turns = turns(&vertices, is_left);
        let sharpest = turns.iter().copied().fold(0.0, f64::max);
        let (most, least) = swings(&vertices, &plan, radius);
        prop_assert!(least > 1.0 - 1e-6 / radius, "{least} R\n{text}");
        prop_assert!((most - 1.0 / (sharpest / 2.0).cos()).abs() < 1e-6, "{most} R\n{text}");
        prop_assert!(sharpest > 100_f64.to_radians() || most <= 1.5557 + 1e-4, "{most} R\n{text}");
        // Each corner for itself: the block before it ends where both offsets meet.
        for (start, element) in closed_part(&plan.path) {
            let index = element.source.line as usize - 3;
            let far = (start[0] - vertices[index].0[0]).hypot(start[1] - vertices[index].0[1]);
            let expected = radius / (turns[index] / 2.0).cos();
            // The entry and the end of the contour are no corners.
            let is_corner = index > 0 && turns[index].abs() > 1e-9;
            prop_assert!(!is_corner || (far - expected).abs() < 1e-6, "{far}, not {expected}\n{text}");
        }
    }
}
