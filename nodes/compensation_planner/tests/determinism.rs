//! The same program gives the same path, whoever computes it.

mod support;

use cnc_msgs::contour::{ContourEventKind, ProgrammedContour};
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::PathElement;
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::plan_certified;
use proptest::prelude::*;
use support::opened::shapes;
use support::random::{config, elements, free, in_modes, near, random_contour, run, sides, step};
use support::*;

/// All that is known of a plan, with every bit of its numbers.
fn printed(contour: &ProgrammedContour) -> String {
    format!("{:?}", plan_certified(contour, &free(), &ToolTable::default()))
}

/// Other last bits, as another library of functions would give.
fn nudge(value: &mut f64, ulps: i64) {
    if *value != 0.0 {
        *value = f64::from_bits(value.to_bits().wrapping_add_signed(ulps));
    }
}

proptest! {
    #![proptest_config(config(60))]

    #[test]
    fn p16_a_plan_is_the_same_bit_for_bit_again_and_in_another_thread(
        steps in prop::collection::vec(step(), 1..14),
        side in sides(),
        corner in in_modes(),
        radius in 0.01..20.0_f64,
    ) {
        let mut contour = random_contour(&steps, side, corner);
        set_radius(&mut contour, radius);
        let first = printed(&contour);
        let others = std::thread::scope(|scope| {
            [(); 2].map(|()| scope.spawn(|| printed(&contour))).map(|thread| thread.join().unwrap())
        });
        prop_assert_eq!([&first, &first], [&others[0], &others[1]]);
    }

    /// What differs between platforms is the last bits of angles; no decision hangs on those
    /// of any number.
    #[test]
    fn p16_the_last_bits_of_numbers_change_nothing_but_last_bits(
        shape in shapes(),
        part in 0.01..0.99_f64,
        ulps in prop::collection::vec(-4..5_i64, 60),
    ) {
        let profile = sinumerik();
        let contour = shape.contour(&profile);
        let mut other = contour.clone();
        let mut ulps = ulps.iter().cycle();
        let mut nudge = |value| nudge(value, *ulps.next().unwrap());
        for event in &mut other.events {
            if let ContourEventKind::Motion(motion) = &mut event.kind {
                motion.end[..2].iter_mut().for_each(&mut nudge);
                if let Shape::Arc(arc) = &mut motion.shape {
                    arc.center[..2].iter_mut().for_each(&mut nudge);
                }
            }
        }
        let radius = part * shape.clearance_mm;
        let (one, other) = (run(&contour, &profile, radius), run(&other, &profile, radius));
        prop_assert_eq!(codes(&one), codes(&other));
        prop_assert_eq!(elements(&one).len(), elements(&other).len());
        for (a, b) in elements(&one).iter().zip(elements(&other)) {
            let (shape, end) = (b.shape, b.end);
            prop_assert_eq!(PathElement { shape, end, ..*a }, *b);
            prop_assert!(near(a.end, b.end, 1e-9), "{a:?} {b:?}");
        }
    }
}
