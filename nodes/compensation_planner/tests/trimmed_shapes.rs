//! What a tool cuts of a shape that is too narrow for it, where the profile leaves out the rest.

mod support;

use cavalier_contours::polyline::{PlineSource, Polyline};
use cnc_msgs::finding::Severity;
use cnc_msgs::profile::{Profile, Reaction};
use proptest::prelude::*;
use support::opened::{Opened, shapes};
use support::outline::{distance, farthest, offsets, outline, samples, samples_of};
use support::random::{config, run};
use support::*;

fn trimming() -> Profile {
    let mut profile = sinumerik();
    profile.interference.react = Reaction::Trim;
    // Everything that is consumed is reported.
    profile.accept_tolerance_mm = 0.0;
    // No corner is so short that it is left out (S68).
    profile.corner.short_block_mm = 0.0;
    profile
}

/// The offset that the tool is on where it enters, if it fits there.
fn peer(shape: &Opened, radius: f64) -> Option<Polyline<f64>> {
    let ([x, y], [to_x, to_y]) = (shape.vertices[0].0, shape.vertices[1].0);
    let across = shape.signed(radius) / (to_x - x).hypot(to_y - y);
    let entry = [x - (to_y - y) * across, y + (to_x - x) * across, 0.0];
    let mut offsets = offsets(&shape.polyline(), shape.signed(radius)).into_iter();
    offsets.find(|offset| distance(offset, entry) < 1e-6)
}

proptest! {
    #![proptest_config(config(120))]

    /// All corners are rounded, so that everything that stays in them is reported.
    #[test]
    fn p3_a_tool_too_large_cuts_what_it_gets_to_and_the_rest_is_reported(
        shape in shapes(),
        more in 0.02..3.0_f64,
    ) {
        let radius = shape.clearance_mm * (1.0 + more);
        let Some(peer) = peer(&shape, radius) else {
            return Err(TestCaseError::reject("it does not fit at the entry"));
        };
        let plan = run(&shape.contour(&trimming()), &trimming(), radius);
        prop_assert!(plan.accepted(), "R {radius}: {}", findings(&plan));
        prop_assert!(plan.findings.iter().any(|found| found.severity == Severity::Warning));
        let out = farthest(&samples(&plan.path), &peer);
        let back = farthest(&samples_of(&peer), &outline(&plan.path));
        // The peer takes points that are 1e-5 mm apart for one.
        prop_assert!(out.max(back) < 1e-5, "R {radius}: {out} {back}");
        let swept = offsets(&outline(&plan.path), -shape.signed(radius));
        prop_assert_eq!(swept.len(), 1);
        let missing = (shape.polyline().area() - swept[0].area()).abs();
        let reported: f64 = plan.uncut.iter().map(|region| region.area_mm2).sum();
        prop_assert!((missing - reported).abs() < 1e-4, "R {radius}: {missing} mm², and {reported} are reported");
    }
}
