//! What holds for contours whose clearance is known beforehand: shapes opened with a disc.

mod support;

use cavalier_contours::core::math::Vector2;
use cavalier_contours::polyline::PlineSource;
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::Position;
use cnc_msgs::path::Role;
use compensation_planner::{Plan, plan_certified};
use proptest::prelude::*;
use support::opened::{Opened, shapes};
use support::outline::{
    along, bulges, closed_part, distance, farthest, hausdorff, offsets, outline, samples,
    samples_of,
};
use support::random::config;
use support::*;

fn run(shape: &Opened, radius_mm: f64) -> Plan {
    plan_of(&shape.contour(&sinumerik()), &sinumerik(), &tool(radius_mm))
}

/// The plan of a control that puts an arc into every outside corner: this one leaves out
/// those that are shorter than its machine datum says (S68).
fn run_around(shape: &Opened, radius_mm: f64) -> Plan {
    let mut profile = sinumerik();
    profile.corner.short_block_mm = 0.0;
    plan_of(&shape.contour(&profile), &profile, &tool(radius_mm))
}

/// Whether nothing is said but of the leads, which are not opened.
fn is_free(plan: &Plan) -> bool {
    plan.accepted() && codes(plan).iter().all(|code| *code == Code::LeadGouge)
}

proptest! {
    #![proptest_config(config(120))]

    #[test]
    fn p2_a_tool_that_fits_passes_and_cuts_nothing(shape in shapes(), part in 0.01..0.9999_f64) {
        let radius = part * shape.clearance_mm;
        let plan = run(&shape, radius);
        prop_assert!(is_free(&plan), "R {radius}\n{}", findings(&plan));
        let wall = shape.polyline();
        for point in samples(&plan.path) {
            let found = distance(&wall, point);
            prop_assert!(found > radius - 1e-6, "R {radius}: {found} at {point:?}");
            let is_within = wall.winding_number(Vector2::new(point[0], point[1])) != 0;
            prop_assert_eq!(is_within, shape.is_left, "R {}: on the other side at {:?}", radius, point);
        }
    }

    #[test]
    fn p2_a_tool_that_does_not_fit_is_refused(shape in shapes(), more in 0.001..0.5_f64) {
        let radius = shape.clearance_mm * (1.0 + more) + 1e-3;
        let plan = run(&shape, radius);
        let is_found = codes(&plan).iter().any(|code| matches!(code, Code::Gouge | Code::Unreachable));
        prop_assert!(is_found && !plan.accepted(), "R {radius} of {}\n{}", shape.clearance_mm, findings(&plan));
    }
}

/// The vertices of the shape that the block in this line joins, with its bulge.
fn block(shape: &Opened, line: u32) -> (Position, Position, f64) {
    let index = line as usize - 3;
    let (from, bulge) = shape.vertices[index];
    let to = shape.vertices[(index + 1) % shape.vertices.len()].0;
    ([from[0], from[1], 0.0], [to[0], to[1], 0.0], bulge)
}

/// How far a point is from the whole line or circle of a block.
fn from_carrier(point: Position, (from, to, bulge): (Position, Position, f64)) -> f64 {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    if bulge == 0.0 {
        return ((dx * (point[1] - from[1]) - dy * (point[0] - from[0])) / dx.hypot(dy)).abs();
    }
    let off = (1.0 - bulge * bulge) / (4.0 * bulge);
    let center = [(from[0] + to[0]) / 2.0 - dy * off, (from[1] + to[1]) / 2.0 + dx * off];
    let out = |p: Position| (p[0] - center[0]).hypot(p[1] - center[1]);
    (out(point) - out(from)).abs()
}

proptest! {
    #![proptest_config(config(120))]

    #[test]
    fn p1_a_path_is_the_radius_away_from_its_own_block_and_corner(shape in shapes(), part in 0.01..0.9999_f64) {
        let radius = part * shape.clearance_mm;
        let plan = run_around(&shape, radius);
        for (start, element) in closed_part(&plan.path) {
            let block = block(&shape, element.source.line);
            for part in [0.0, 0.1, 0.5, 0.9, 1.0] {
                let point = along(start, element, part);
                let found = match element.role {
                    Role::Corner => (point[0] - block.0[0]).hypot(point[1] - block.0[1]),
                    _ => from_carrier(point, block),
                };
                prop_assert!((found - radius).abs() < 1e-6, "R {radius}: {found} {element:?}");
            }
        }
    }

    #[test]
    fn p3_the_path_is_the_whole_offset_of_the_contour(shape in shapes(), part in 0.01..0.9999_f64) {
        let radius = part * shape.clearance_mm;
        let path = run_around(&shape, radius).path;
        let peers = offsets(&shape.polyline(), shape.signed(radius));
        prop_assert_eq!(peers.len(), 1);
        let (out, back) = (farthest(&samples(&path), &peers[0]), farthest(&samples_of(&peers[0]), &outline(&path)));
        prop_assert!(out.max(back) < 1e-6, "R {radius}: {out} {back}");
    }
}

proptest! {
    #![proptest_config(config(50))]

    #[test]
    fn p9_an_offset_of_an_offset_is_the_offset_by_both_radii(
        shape in shapes(),
        parts in (0.3..0.98_f64, 0.0..0.99_f64),
    ) {
        let whole = parts.0 * shape.clearance_mm;
        // Of smaller radii the corners are shorter than what is merged.
        let first = 0.1 + parts.1 * (whole - 0.1);
        let second = whole - first;
        let once = run_around(&shape, whole).path;
        let vertices = bulges(&run_around(&shape, first).path);
        let halfway = Opened { vertices, clearance_mm: shape.clearance_mm - first, ..shape.clone() };
        let twice = run_around(&halfway, second);
        prop_assert!(is_free(&twice), "{first} and {second}\n{}", findings(&twice));
        let apart = hausdorff(&once, &twice.path);
        prop_assert!(apart < 1e-6, "{first} and {second}: {apart}");
    }

    #[test]
    fn p11_what_fits_fits_with_every_smaller_tool(shape in shapes(), parts in prop::collection::vec(1e-4..1.0_f64, 6)) {
        for part in parts {
            let plan = run(&shape, shape.clearance_mm * part);
            prop_assert!(is_free(&plan), "{part} of {}\n{}", shape.clearance_mm, findings(&plan));
        }
    }

    #[test]
    fn p11_a_certificate_ends_at_the_clearance(shape in shapes(), part in 0.05..1.9_f64) {
        let profile = sinumerik();
        let plan = plan_certified(&shape.contour(&profile), &profile, &tool(part * shape.clearance_mm));
        let found = plan.certificates[0].valid_to_mm;
        prop_assert!((found - shape.clearance_mm).abs() < 1e-6, "{found} instead of {} from {part}", shape.clearance_mm);
        prop_assert_eq!(plan.certificates[0].valid_from_mm, 0.0);
    }
}
