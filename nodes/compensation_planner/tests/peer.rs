//! Offsets made by somebody else, to compare with.

mod support;

use cavalier_contours::polyline::{PlineSource, PlineSourceMut, Polyline};
use cnc_msgs::contour::CutterSide;
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::Position;
use cnc_msgs::path::Role;
use proptest::prelude::*;
use support::random::{config, run};
use support::shapes::area_of;
use support::*;

/// A closed contour of the planner against `cavalier_contours`.
///
/// The offset of a closed polyline is the path, apart from the corner at the
/// start, which the open path does not go around: the contour is entered in the
/// middle of its first line.
fn peer_area(path: &[Position], bulges: &[f64], offset: f64) -> Option<f64> {
    let mut pline: Polyline<f64> = Polyline::new_closed();
    for (point, &bulge) in path.iter().zip(bulges) {
        pline.add(point[0], point[1], bulge);
    }
    let offsets = pline.parallel_offset(offset);
    (offsets.len() == 1).then(|| offsets[0].area())
}

#[test]
fn c4_the_worked_example_encloses_the_area_of_the_peer() {
    let plan = plan(A6, &sinumerik(), &tool(5.0));
    // The open path goes from the last normal to the first one: the corner arc
    // at (30,60) is missing, and so is the piece between its chord and itself.
    let mut inside = plan
        .path
        .elements
        .iter()
        .enumerate()
        .filter(|(_, element)| matches!(element.role, Role::Contour | Role::Corner));
    let (first, last) = (inside.clone().next().unwrap().0, inside.next_back().unwrap().0);
    let (a, b) = (plan.path.elements[last].end, plan.path.start_of(first));
    let sweep = 2.0 * ((a[0] - b[0]).hypot(a[1] - b[1]) / 10.0).asin();
    let closing = (a[0] * b[1] - a[1] * b[0]) / 2.0 - 25.0 * (sweep - sweep.sin()) / 2.0;
    assert!((area_of(&plan.path) + closing + 3993.371467).abs() < 1e-5, "{}", area_of(&plan.path));
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn e17_random_shapes_agree_with_cavalier_contours(
        radii in prop::collection::vec(38.0..60.0_f64, 5..12),
        bends in prop::collection::vec(prop_oneof![2 => Just(0.0), 1 => -0.12..0.12_f64], 12),
        offset in 0.2..3.0_f64,
        is_left in any::<bool>(),
    ) {
        let (count, points) = (radii.len(), ring(&radii));
        let mut bulges = bends[..count].to_vec();
        bulges[0] = 0.0;
        let side = if is_left { CutterSide::Left } else { CutterSide::Right };
        let mut contour = closed_contour(&points, &bulges, side);
        set_radius(&mut contour, offset);
        let plan = run(&contour, &sinumerik(), 0.0);
        let only_leads = codes(&plan).iter().all(|code| *code == Code::LeadGouge);
        prop_assume!(only_leads);
        let Some(expected) = peer_area(&points, &bulges, if is_left { offset } else { -offset }) else {
            return Ok(());
        };
        let got = area_of(&plan.path);
        prop_assert!((got - expected).abs() < 1e-5 * expected.abs(), "{got} {expected}\n{}", listing(&plan.path.elements));
    }
}
