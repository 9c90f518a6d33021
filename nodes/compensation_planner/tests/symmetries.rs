//! What a path keeps when its contour is turned, mirrored, run backwards or cut in pieces.

mod support;

use cnc_msgs::contour::{
    ContourEvent, ContourEventKind, CutterSide, Motion, MotionClass, ProgrammedContour,
};
use cnc_msgs::geometry::{AxisSet, Plane, Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use cnc_msgs::profile::Profile;
use compensation_planner::{Plan, tessellate};
use proptest::prelude::*;
use support::opened::shapes;
use support::outline::{along, hausdorff};
use support::random::{config, elements, near, run};
use support::*;

/// The programs that everything is tried on.
fn programs() -> Vec<(String, Profile)> {
    vec![
        (A6.into(), sinumerik()),
        (A6.replace("G450", "G451"), sinumerik()),
        (A6.replace("G450", "G452"), sinumerik()),
        (M12.into(), masso()),
    ]
}

/// A map of the plane: turned by an angle, scaled, mirrored (in Y) and moved.
#[derive(Debug, Clone, Copy)]
struct Map {
    angle: f64,
    scale: f64,
    is_mirrored: bool,
    shift: [f64; 2],
}

impl Map {
    fn point(&self, p: Position) -> Position {
        let y = if self.is_mirrored { -p[1] } else { p[1] };
        let (sin, cos) = self.angle.sin_cos();
        [
            self.shift[0] + self.scale * (p[0] * cos - y * sin),
            self.shift[1] + self.scale * (p[0] * sin + y * cos),
            self.scale * p[2],
        ]
    }

    fn path(&self, path: &CompensatedPath) -> CompensatedPath {
        let mut mapped = path.clone();
        mapped.start = self.point(path.start);
        for element in &mut mapped.elements {
            element.end = self.point(element.end);
            if let Shape::Arc(arc) = &mut element.shape {
                arc.center = self.point(arc.center);
                arc.clockwise ^= self.is_mirrored;
            }
        }
        mapped
    }

    fn contour(&self, contour: &ProgrammedContour) -> ProgrammedContour {
        let mut mapped = contour.clone();
        mapped.start = self.point(contour.start);
        for event in &mut mapped.events {
            match &mut event.kind {
                ContourEventKind::Motion(motion) => {
                    motion.end = self.point(motion.end);
                    motion.axes = AxisSet::ALL;
                    if let Shape::Arc(arc) = &mut motion.shape {
                        arc.center = self.point(arc.center);
                        arc.clockwise ^= self.is_mirrored;
                    }
                }
                ContourEventKind::Select { side, .. } if self.is_mirrored => *side = other(*side),
                _ => {}
            }
        }
        mapped
    }
}

fn other(side: CutterSide) -> CutterSide {
    match side {
        CutterSide::Left => CutterSide::Right,
        CutterSide::Right => CutterSide::Left,
    }
}

#[test]
fn p7_the_path_turns_moves_mirrors_and_scales_with_the_contour() {
    for (text, profile) in programs() {
        let contour = contour(&text, &profile);
        let plain = run(&contour, &profile, 5.0);
        for angle in [0.1234, 1.0, 2.5, -3.0] {
            for scale in [1.0, 25.4, 1.0 / 25.4] {
                for is_mirrored in [false, true] {
                    let map = Map { angle, scale, is_mirrored, shift: [123.4, -77.7] };
                    let mapped = run(&map.contour(&contour), &profile, 5.0 * scale);
                    assert_eq!(codes(&mapped), codes(&plain), "{map:?}\n{}", findings(&mapped));
                    let (a, b) = (elements(&plain), elements(&mapped));
                    assert_eq!(a.len(), b.len(), "{map:?}");
                    for (a, b) in a.iter().zip(b) {
                        assert!(
                            near(map.point(a.end), b.end, 1e-9 * scale.max(1.0)),
                            "{map:?} {a:?} {b:?}"
                        );
                        assert_eq!((a.role, a.source), (b.role, b.source));
                    }
                }
            }
        }
    }
}

#[test]
fn all_planes_compensate_alike() {
    for plane in [Plane::Zx, Plane::Yz] {
        let turn = |p: Position| {
            let [u, v, w] = plane.axes();
            let mut turned = [0.0; 3];
            (turned[u], turned[v], turned[w]) = (p[0], p[1], p[2]);
            turned
        };
        let mut turned = contour(A6, &sinumerik());
        let select =
            turned.events.iter().position(|event| matches!(event.kind, ContourEventKind::Plane(_)));
        turned.events[select.unwrap()].kind = ContourEventKind::Plane(plane);
        for event in &mut turned.events {
            if let ContourEventKind::Motion(motion) = &mut event.kind {
                motion.end = turn(motion.end);
                motion.axes = AxisSet::ALL;
                if let Shape::Arc(arc) = &mut motion.shape {
                    arc.center = turn(arc.center);
                    arc.plane = plane;
                }
            }
        }
        let plan = run(&turned, &sinumerik(), 5.0);
        assert!(plan.accepted(), "{}", findings(&plan));
        let plain = run(&contour(A6, &sinumerik()), &sinumerik(), 5.0);
        for (a, b) in plain.path.elements.iter().zip(&plan.path.elements) {
            assert_eq!(turn(a.end), b.end);
            if let (Shape::Arc(a), Shape::Arc(b)) = (a.shape, b.shape) {
                assert_eq!((turn(a.center), a.clockwise, plane), (b.center, b.clockwise, b.plane));
            }
        }
    }
}

/// The contour run backwards on the other side.
fn reversed(contour: &ProgrammedContour) -> ProgrammedContour {
    let mut motions = Vec::new();
    let mut at = contour.start;
    for event in &contour.events {
        if let ContourEventKind::Motion(motion) = event.kind {
            motions.push((at, motion));
            at = motion.end;
        }
    }
    let mut backwards = contour.clone();
    backwards.start = at;
    let mut rest = motions.into_iter().rev();
    for event in &mut backwards.events {
        match &mut event.kind {
            ContourEventKind::Motion(motion) => {
                let (start, was) = rest.next().unwrap();
                *motion = Motion { end: start, ..was };
                if let Shape::Arc(arc) = &mut motion.shape {
                    arc.clockwise = !arc.clockwise;
                }
            }
            ContourEventKind::Select { side, .. } => *side = other(*side),
            _ => {}
        }
    }
    backwards
}

#[test]
fn p6_backwards_on_the_other_side_is_the_same_path() {
    for mode in ["G450", "G451"] {
        // Without the first and last rapid, which have no counterpart.
        let text = A6.replace("N130 G0 Z50 M30", "N130 M30").replace("N1 G0 X15 Y60 Z0", "N1 M8");
        let mut contour = contour(&text.replace("G450", mode), &sinumerik());
        contour.start = [15.0, 60.0, 0.0];
        let forwards = run(&contour, &sinumerik(), 5.0);
        let backwards = run(&reversed(&contour), &sinumerik(), 5.0);
        assert!(backwards.accepted(), "{}", findings(&backwards));
        let a = tessellate::path(&forwards.path, 1e9);
        let mut b = tessellate::path(&backwards.path, 1e9);
        b.reverse();
        // A reflex arc is cut into quarters, alike from both sides.
        assert_eq!(a.len(), b.len());
        assert!(a.iter().zip(&b).all(|(a, b)| near(*a, *b, 1e-9)), "{a:?}\n{b:?}");
    }
}

#[test]
fn p8_a_radius_of_0_is_the_contour_itself_bit_for_bit() {
    for (text, profile) in programs() {
        let contour = contour(&text, &profile);
        let plan = run(&contour, &profile, 0.0);
        assert!(plan.findings.is_empty(), "{}", findings(&plan));
        let programmed: Vec<Position> = contour
            .events
            .iter()
            .filter_map(|event| match event.kind {
                ContourEventKind::Motion(motion) => Some(motion.end),
                _ => None,
            })
            .collect();
        let got: Vec<Position> = plan.path.elements.iter().map(|element| element.end).collect();
        assert_eq!(got, programmed);
    }
}

/// Cuts lines and arcs of a contour at these parts of their length.
fn split(contour: &ProgrammedContour, parts: &[f64]) -> ProgrammedContour {
    let mut cut = ProgrammedContour { events: Vec::new(), ..contour.clone() };
    let mut at = contour.start;
    let mut is_active = false;
    let mut parts = parts.iter().cycle();
    for event in &contour.events {
        let ContourEventKind::Motion(motion) = event.kind else {
            cut.events.push(*event);
            continue;
        };
        let is_contour = is_active && motion.class == MotionClass::Feed;
        is_active |= motion.class == MotionClass::Feed;
        if is_contour {
            let element = PathElement {
                side: None,
                shape: motion.shape,
                end: motion.end,
                feed_mm_per_min: None,
                role: Role::None,
                axes: motion.axes,
                source: event.source,
            };
            for part in [parts.next().unwrap() * 0.5, 0.5 + 0.5 * parts.next().unwrap()] {
                let end = along(at, &element, part);
                let kind = ContourEventKind::Motion(Motion { end, ..motion });
                cut.events.push(ContourEvent { kind, ..*event });
            }
        }
        cut.events.push(*event);
        at = motion.end;
    }
    cut
}

/// Joins elements of one block and role again.
fn corners_of(elements: &[PathElement]) -> Vec<Position> {
    let mut ends = Vec::new();
    for (index, element) in elements.iter().enumerate() {
        let next = elements.get(index + 1);
        if next.is_none_or(|next| (next.source, next.role) != (element.source, element.role)) {
            ends.push(element.end);
        }
    }
    ends
}

proptest! {
    #![proptest_config(config(64))]

    #[test]
    fn p14_splitting_lines_and_arcs_changes_nothing(parts in prop::collection::vec(0.0..1.0_f64, 40), radius in 1.0..10.0_f64) {
        for mode in ["G450", "G451"] {
            let contour = contour(&A6.replace("G450", mode).replace("N120 G40 X15 Y60", "N120 G40 G0 X15 Y60"), &sinumerik());
            let whole = run(&contour, &sinumerik(), radius);
            let pieces = run(&split(&contour, &parts), &sinumerik(), radius);
            prop_assert!(pieces.accepted(), "{}", findings(&pieces));
            // G451 has several corner elements in a block, which are the same ones.
            if mode == "G450" {
                let (a, b) = (corners_of(&whole.path.elements), corners_of(&pieces.path.elements));
                prop_assert_eq!(a.len(), b.len());
                prop_assert!(a.iter().zip(&b).all(|(a, b)| near(*a, *b, 1e-9)), "{:?}\n{:?}", a, b);
            }
            let length = |plan: &Plan| tessellate::path(&plan.path, 1e-5)
                .windows(2).map(|p| (p[0][0] - p[1][0]).hypot(p[0][1] - p[1][1])).sum::<f64>();
            prop_assert!((length(&whole) - length(&pieces)).abs() < 1e-2);
        }
    }
}

proptest! {
    #![proptest_config(config(60))]

    #[test]
    fn p6_a_shape_backwards_on_the_other_side_has_the_same_path(shape in shapes(), part in 0.01..0.99_f64) {
        let mut contour = shape.contour(&sinumerik());
        // The rapid to where it begins has no counterpart.
        let ContourEventKind::Motion(rapid) = contour.events.remove(0).kind else { unreachable!() };
        contour.start = rapid.end;
        let radius = part * shape.clearance_mm;
        let forwards = run(&contour, &sinumerik(), radius);
        let backwards = run(&reversed(&contour), &sinumerik(), radius);
        prop_assert!(backwards.accepted(), "R {radius}: {}", findings(&backwards));
        let apart = hausdorff(&forwards.path, &backwards.path);
        prop_assert!(apart < 1e-6, "R {radius}: {apart}");
    }

    #[test]
    fn p7_the_path_of_a_shape_turns_moves_and_mirrors_with_it(
        shape in shapes(),
        part in 0.01..0.99_f64,
        angle in -4.0..4.0_f64,
        shift in (-1e3..1e3_f64, -1e3..1e3_f64),
        is_mirrored in any::<bool>(),
    ) {
        let map = Map { angle, scale: 1.0, is_mirrored, shift: [shift.0, shift.1] };
        let contour = shape.contour(&sinumerik());
        let radius = part * shape.clearance_mm;
        let plain = run(&contour, &sinumerik(), radius);
        let mapped = run(&map.contour(&contour), &sinumerik(), radius);
        prop_assert!(mapped.accepted(), "R {radius} {map:?}: {}", findings(&mapped));
        let apart = hausdorff(&map.path(&plain.path), &mapped.path);
        prop_assert!(apart < 1e-6, "R {radius} {map:?}: {apart}");
    }

    #[test]
    fn p8_a_shape_with_a_radius_of_0_is_itself_bit_for_bit(shape in shapes()) {
        let contour = shape.contour(&sinumerik());
        let plan = run(&contour, &sinumerik(), 0.0);
        prop_assert!(plan.findings.is_empty(), "{}", findings(&plan));
        let programmed = contour.events.iter().filter_map(|event| match event.kind {
            ContourEventKind::Motion(motion) => Some((motion.shape, motion.end)),
            _ => None,
        });
        let got = plan.path.elements.iter().map(|element| (element.shape, element.end));
        prop_assert_eq!(got.collect::<Vec<_>>(), programmed.collect::<Vec<_>>());
    }

    #[test]
    fn p14_a_shape_in_pieces_has_the_same_path(
        shape in shapes(),
        part in 0.01..0.99_f64,
        // A piece shorter than what is merged is one with the block before it.
        cuts in prop::collection::vec(0.05..0.95_f64, 40),
    ) {
        // A lead-off in pieces would end at the first of them.
        let text = shape.program().replace("G40 G456 G1", "G40 G456 G0");
        let contour = contour(&text, &sinumerik());
        let radius = part * shape.clearance_mm;
        let whole = run(&contour, &sinumerik(), radius);
        let pieces = run(&split(&contour, &cuts), &sinumerik(), radius);
        prop_assert!(pieces.accepted(), "R {radius}: {}", findings(&pieces));
        let apart = hausdorff(&whole.path, &pieces.path);
        prop_assert!(apart < 1e-6, "R {radius}: {apart}");
    }
}
