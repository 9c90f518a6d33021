//! What is cut where the tool does not fit and the profile leaves out what does not.

mod support;

use cavalier_contours::core::math::Vector2;
use cavalier_contours::polyline::{PlineSource, PlineSourceMut, Polyline};
use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{CompensatedPath, Role};
use cnc_msgs::profile::{Profile, Reaction};
use compensation_planner::{UncutRegion, tessellate};
use proptest::prelude::*;
use std::f64::consts::PI;
use support::shapes::{area_of, clearance, closed, crosses_itself, vertices};
use support::*;

fn trimming() -> Profile {
    let mut profile = sinumerik();
    profile.interference.react = Reaction::Trim;
    profile
}

fn only(uncut: &[UncutRegion]) -> &UncutRegion {
    assert_eq!(uncut.len(), 1, "{uncut:?}");
    &uncut[0]
}

#[test]
fn what_is_left_of_a_trapezoid_is_between_its_walls_and_the_tool() {
    let text = "
        N1 G0 X-22 Y40
        N2 G41 G456 D1 G1 X-22 Y20 F100
        N3 X-2 Y0
        N4 X2
        N5 X22 Y20
        N6 G40 G456 X22 Y40";
    let plan = plan(text, &trimming(), &tool(5.0));
    assert!(plan.accepted(), "{}", findings(&plan));
    assert_eq!(finding(&plan, Code::Unreachable).severity, Severity::Warning);
    // The fillet in the corner of the walls, lengthened to (0, -2), without the
    // triangle that N4 cuts off it.
    let expected = 25.0 * (1.0 - PI / 4.0) - 4.0;
    let region = only(&plan.uncut);
    assert!((region.area_mm2 - expected).abs() < 1e-9, "{region:?}");
    assert_eq!((region.first.block, region.last.block), (Some(4), Some(4)));
}

#[test]
fn a_slot_that_is_too_narrow_is_passed_by() {
    let text = "
        N10 G0 X0 Y20
        N20 G41 D1 G450 G456 G1 X0 Y0 F400
        N30 X40
        N40 Y-10
        N50 X44
        N60 Y0
        N70 X100
        N80 G40 G456 X100 Y20";
    let plan = plan(text, &trimming(), &tool(3.0));
    assert!(plan.accepted(), "{}", findings(&plan));
    // Around both corners; the tool dips into the slot between them.
    let dip = 5.0_f64.sqrt();
    let region = only(&plan.uncut);
    let expected = 4.0 * 10.0 - (9.0 * (2.0_f64 / 3.0).asin() - 2.0 * dip);
    assert!((region.area_mm2 - expected).abs() < 1e-9, "{region:?} {expected}");
    assert_eq!((region.first.block, region.last.block), (Some(40), Some(60)));
    let lowest = plan.path.elements.iter().map(|e| e.end[1]).filter(|y| *y > 0.0);
    assert!((lowest.fold(f64::INFINITY, f64::min) - dip).abs() < 1e-9);
}

#[test]
fn a_contour_with_a_neck_is_cut_where_it_is_entered() {
    let plan = plan(BOTTLENECK, &trimming(), &tool(5.05));
    assert!(plan.accepted(), "{}", findings(&plan));
    assert_eq!(finding(&plan, Code::Gouge).severity, Severity::Warning);
    assert!(clearance(BOTTLENECK.trim(), &plan) > 5.05 - 2e-3);
}

fn polyline(vertices: &[([f64; 2], f64)]) -> Polyline<f64> {
    let mut pline = Polyline::new_closed();
    for ([x, y], bulge) in vertices {
        pline.add(*x, *y, *bulge);
    }
    pline
}

/// The offset of a closed contour that the tool is on where it is entered.
fn peer(vertices: &[([f64; 2], f64)], offset: f64) -> Option<Polyline<f64>> {
    let pline = polyline(vertices);
    let ([x, y], [to_x, to_y]) = (vertices[0].0, vertices[1].0);
    let across = offset / (to_x - x).hypot(to_y - y);
    let entry = Vector2::new(x - (to_y - y) * across, y + (to_x - x) * across);
    let is_on = |offset: &Polyline<f64>| {
        offset.closest_point(entry, 1e-9).is_some_and(|closest| closest.distance < 1e-6)
    };
    // What is only a point or a line is none.
    let mut offsets = pline.parallel_offset(offset).into_iter();
    offsets.find(|offset| is_on(offset) && offset.area().abs() > 1e-3)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, max_global_rejects: 1_000_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Where the tool fits at the entry, what is cut is the offset of the contour that
    /// the entry is on; where it does not, nothing is cut into all the same.
    #[test]
    fn p3_what_is_trimmed_is_the_offset_that_the_entry_is_on(
        corners in prop::collection::vec((5.0..60.0_f64, -1.0..1.0_f64), 3..24),
        bends in prop::collection::vec(prop_oneof![2 => Just(0.0), 1 => -0.9..0.9_f64], 1..6),
        is_left in any::<bool>(),
        radius in 0.1..12.0_f64,
    ) {
        let text = closed(&corners, &bends, if is_left { "G41" } else { "G42" });
        prop_assume!(!crosses_itself(&text));
        let plan = plan(&text, &trimming(), &tool(radius));
        if plan.accepted() {
            let depth = radius - clearance(&text, &plan);
            prop_assert!(depth < 4e-3, "R {radius}: {depth} deep\n{text}\n{}", findings(&plan));
        }
        let signed = if is_left { radius } else { -radius };
        if let Some(peer) = peer(&vertices(&corners, &bends), signed) {
            prop_assert!(plan.accepted(), "R {signed} fits\n{text}\n{}", findings(&plan));
            let area = area_of(&plan.path);
            prop_assert!(
                (peer.area() - area).abs() < 1e-3 * radius.max(1.0),
                "R {signed}: {area} is not {}\n{text}\n{}", peer.area(), findings(&plan)
            );
        }
    }
}

/// Area and length of the closed part of a path, and its sharp corners with their turns.
fn measure(path: &CompensatedPath) -> (f64, f64, Vec<(Position, f64)>) {
    let mut length = 0.0;
    let mut tangents = Vec::new();
    for (index, element) in path.elements.iter().enumerate() {
        if !matches!(element.role, Role::Contour | Role::Corner) {
            continue;
        }
        let (a, b) = (path.start_of(index), element.end);
        if let Shape::Arc(arc) = element.shape {
            let radius = (a[0] - arc.center[0]).hypot(a[1] - arc.center[1]);
            length += tessellate::sweep(a, &arc, b).abs() * radius;
            let side = if arc.clockwise { -1.0 } else { 1.0 };
            let along =
                |p: Position| (side * (p[0] - arc.center[0])).atan2(side * (arc.center[1] - p[1]));
            tangents.push((along(a), along(b), b));
        } else {
            length += (b[0] - a[0]).hypot(b[1] - a[1]);
            let along = (b[1] - a[1]).atan2(b[0] - a[0]);
            tangents.push((along, along, b));
        }
    }
    let next = tangents.iter().cycle().skip(1);
    let turn = |from: f64, to: f64| (to - from + PI).rem_euclid(2.0 * PI) - PI;
    let corners = tangents.iter().zip(next).map(|(a, b)| (a.2, turn(a.1, b.0)));
    (area_of(path), length, corners.filter(|(_, turn)| turn.abs() > 1e-6).collect())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, max_global_rejects: 1_000_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A pocket is what the tool sweeps, the fillets of its sharp corners, and what is uncut.
    #[test]
    fn p3_what_is_not_cut_is_reported(
        corners in prop::collection::vec((5.0..60.0_f64, -1.0..1.0_f64), 3..24),
        radius in 0.1..12.0_f64,
    ) {
        let text = closed(&corners, &[0.0], "G41");
        prop_assume!(!crosses_itself(&text));
        let vertices = vertices(&corners, &[0.0]);
        let pocket: Polyline<f64> = polyline(&vertices);
        prop_assume!(pocket.area() > 0.0 && peer(&vertices, radius).is_some());
        let plan = plan(&text, &trimming(), &tool(radius));
        let (area, length, turns) = measure(&plan.path);
        let swept = area + length * radius + PI * radius * radius;
        let joints: Vec<Position> = plan.uncut.iter().map(|region| {
            match region.outline.last().unwrap().shape {
                Shape::Arc(arc) => arc.center,
                Shape::Line => panic!("{region:?}"),
            }
        }).collect();
        let is_joint = |at: &Position| {
            joints.iter().any(|joint| (joint[0] - at[0]).hypot(joint[1] - at[1]) < 1e-6)
        };
        let fillets = turns.iter().filter(|(at, _)| !is_joint(at));
        let fillets: f64 =
            fillets.map(|(_, turn)| radius * radius * ((turn / 2.0).tan() - turn / 2.0)).sum();
        let uncut: f64 = plan.uncut.iter().map(|region| region.area_mm2).sum();
        let missing = pocket.area() - swept - fillets - uncut;
        prop_assert!(missing.abs() < 1e-3 * length, "R {radius}: {missing} is missing\n{text}");
    }
}
