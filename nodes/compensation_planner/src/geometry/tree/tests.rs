//! Nothing near is missed, and the work is bounded.

use super::*;
use crate::geometry::element::Vec2;
use proptest::prelude::*;
use std::collections::BTreeSet;

fn line(&[x, y, dx, dy]: &[f64; 4]) -> Element {
    let start = Vec2::new(x, y);
    Element::line(start, start + Vec2::new(dx, dy)).expect("a length")
}

proptest! {
    #[test]
    fn no_pair_that_is_near_is_missed(
        lines in prop::collection::vec(prop::array::uniform4(0.1..20.0_f64), 1..120),
        others in prop::collection::vec(prop::array::uniform4(0.1..20.0_f64), 1..120),
        reach in 0.0..5.0_f64,
    ) {
        let boxes = |lines: &[[f64; 4]]| -> Vec<Bounds> {
            lines.iter().map(|numbers| Bounds::of(&line(numbers))).collect()
        };
        let (a, b) = (boxes(&lines), boxes(&others));
        let tree = |boxes: &[Bounds]| Tree::new(boxes.iter().map(|bounds| (*bounds, NO_CHAIN)));
        let mut seen = BTreeSet::new();
        let both = (|one: usize| (a[one], ()), |other: usize| b[other]);
        let mut all = usize::MAX;
        let is_complete = tree(&a).near_pairs(&tree(&b), reach, &mut all, both, |a, b| {
            seen.insert((a, b));
            ControlFlow::Continue(())
        });
        prop_assert!(is_complete);
        let mut within = BTreeSet::new();
        tree(&a).near_itself(reach, &mut all, |one| a[one], |early, late| {
            within.insert((early, late));
            ControlFlow::Continue(())
        });
        for (late, early) in (0..a.len()).flat_map(|late| (0..late).map(move |it| (late, it))) {
            let is_near = a[early].gap_squared(&a[late]) <= reach * reach;
            prop_assert_eq!(is_near, within.contains(&(early, late)), "{} {}", early, late);
        }
        let mut seen_alone = BTreeSet::new();
        for (i, one) in a.iter().enumerate() {
            tree(&b).near_box(one, reach, &mut usize::MAX.clone(), |b| {
                seen_alone.extend(b.map(|b| (i, b)));
                ControlFlow::Continue(())
            });
        }
        for (i, one) in a.iter().enumerate() {
            for (j, other) in b.iter().enumerate() {
                let is_near = one.gap_squared(other) <= reach * reach;
                prop_assert_eq!(is_near, seen.contains(&(i, j)), "{} {}", i, j);
                prop_assert!(!is_near || seen_alone.contains(&(i, j)), "{i} {j}");
            }
        }
    }
}

/// The box of an element.
fn whole(_: usize, element: &Element) -> (Bounds, ()) {
    (Bounds::of(element), ())
}

/// Boxes visited for each line of a spiral of so many lines of 2 mm, with 12 mm between its
/// turns, to find what is near.
fn visits_of_a_spiral(count: usize) -> f64 {
    let point = |index: usize| {
        let radius = (12.0 * 2.0 * index as f64 / std::f64::consts::PI).sqrt();
        let (y, x) = (radius / 12.0 * std::f64::consts::TAU).sin_cos();
        Vec2::new(x, y) * radius
    };
    let lines = (0..count).map(|index| Element::line(point(index), point(index + 1)));
    let tree = Tree::of_elements(lines.map(|line| (line, NO_CHAIN)), 24.0, whole);
    let all = usize::MAX;
    let mut left = all;
    let bounds = |_| Bounds::EMPTY;
    assert!(tree.near_itself(3.0, &mut left, bounds, |_, _| ControlFlow::Continue(())));
    (all - left) as f64 / count as f64
}

#[test]
fn ten_times_as_long_a_spiral_takes_about_ten_times_as_many_visits() {
    let [short, long] = [10_000, 100_000].map(visits_of_a_spiral);
    assert!(long < 1.5 * short, "{short} and {long} a line");
}

#[test]
fn a_long_element_has_several_boxes_and_short_ones_share_one() {
    let lines = [[0.0, 0.0, 80.0, 60.0], [80.0, 60.0, 1.0, 1.0], [81.0, 61.0, 1.0, 2.0]];
    // Few elements would have a box each.
    let none = std::iter::repeat_n((None, NO_CHAIN), FLAT_MAX);
    let items = lines.iter().map(|numbers| (Some(line(numbers)), NO_CHAIN)).chain(none);
    let tree = Tree::of_elements(items, 20.0, whole);
    let mut items: Vec<_> = tree.leaves.iter().map(|leaf| (leaf.first, leaf.count)).collect();
    items.sort_unstable();
    assert_eq!(items, [(0, 1), (0, 1), (0, 1), (1, 2)]);
}
