//! What holds for every contour: the properties of the geometry.

mod support;

use cavalier_contours::polyline::{PlineSource, PlineSourceMut, Polyline};
use cnc_msgs::contour::{
    Action, ContourEvent, ContourEventKind, CutterSide, Motion, MotionClass, OutsideCorner,
    ProgrammedContour, RadiusSource, Source,
};
use cnc_msgs::diagnostic::Code;
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Position, Shape};
use cnc_msgs::path::{PathElement, Role};
use cnc_msgs::profile::{Profile, Reaction, Strictness};
use cnc_msgs::tool_table::ToolTable;
use compensation_planner::{Plan, tessellate};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use support::shapes::area_of;
use support::*;

/// Failing cases become tests of their own instead of files of seeds.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

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

fn run(contour: &ProgrammedContour, profile: &Profile, radius: f64) -> Plan {
    plan_of(contour, profile, &tool(radius))
}

fn elements(plan: &Plan) -> &[PathElement] {
    if plan.accepted() { &plan.path.elements } else { &plan.refused }
}

fn near(a: Position, b: Position, tolerance: f64) -> bool {
    (0..3).all(|axis| (a[axis] - b[axis]).abs() <= tolerance)
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
        assert!(plan.diagnostics.is_empty(), "{}", findings(&plan));
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

fn along(start: Position, element: &PathElement, part: f64) -> Position {
    match element.shape {
        Shape::Line => {
            std::array::from_fn(|axis| start[axis] + (element.end[axis] - start[axis]) * part)
        }
        Shape::Arc(arc) => {
            let angle = tessellate::sweep(start, &arc, element.end) * part;
            let (sin, cos) = if arc.clockwise { -angle } else { angle }.sin_cos();
            let (x, y) = (start[0] - arc.center[0], start[1] - arc.center[1]);
            [arc.center[0] + x * cos - y * sin, arc.center[1] + x * sin + y * cos, start[2]]
        }
    }
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

/// A random contour: headings turn by these angles, lengths and arcs by these numbers.
#[derive(Debug, Clone)]
struct Step {
    turn: f64,
    length: f64,
    /// Curvature times length, 0 for a line.
    bend: f64,
    rise: f64,
    aux: u8,
}

fn step() -> impl Strategy<Value = Step> {
    let turn = prop_oneof![
        4 => -3.1..3.1_f64,
        2 => Just(0.0),
        1 => prop_oneof![Just(3.1), Just(-3.1), Just(PI), Just(1e-7), Just(-1e-5)],
        2 => prop_oneof![Just(FRAC_PI_2), Just(-FRAC_PI_2)],
    ];
    let length = prop_oneof![5 => 0.5..60.0_f64, 1 => Just(1e-5), 1 => Just(0.0), 1 => 1e-4..0.01_f64, 1 => Just(1e3)];
    let bend = prop_oneof![3 => Just(0.0), 2 => -6.0..6.0_f64, 1 => Just(1e-2), 1 => Just(TAU), 1 => Just(-TAU)];
    let rise = prop_oneof![6 => Just(0.0), 1 => -5.0..5.0_f64];
    (turn, length, bend, rise, 0..6_u8).prop_map(|(turn, length, bend, rise, aux)| Step {
        turn,
        length,
        bend,
        rise,
        aux,
    })
}

fn random_contour(steps: &[Step], side: CutterSide, corner: OutsideCorner) -> ProgrammedContour {
    let mut contour = ProgrammedContour::default();
    let mut line = 0;
    let mut push = |contour: &mut ProgrammedContour, kind, fresh: bool| {
        line += u32::from(fresh);
        let source = Source { line, block: Some(line), column: 1, length: 1 };
        contour.events.push(ContourEvent { source, kind });
    };
    let motion = |shape, end| {
        let class = MotionClass::Feed;
        ContourEventKind::Motion(Motion {
            shape,
            end,
            class,
            feed_mm_per_min: 500.0,
            axes: AxisSet::ALL,
        })
    };
    push(&mut contour, ContourEventKind::Radius(RadiusSource::Radius(0.0)), true);
    push(&mut contour, ContourEventKind::Corner(corner), false);
    push(&mut contour, ContourEventKind::Select { side, approach: None, along: None }, false);
    push(&mut contour, motion(Shape::Line, [0.0, 0.0, 0.0]), false);
    contour.start = [-30.0, if side == CutterSide::Left { 50.0 } else { -50.0 }, 0.0];
    let (mut at, mut heading) = ([0.0_f64; 3], 0.0_f64);
    for (index, step) in steps.iter().enumerate() {
        heading += step.turn;
        let mut end = at;
        end[2] += step.rise;
        let mut shape = Shape::Line;
        if step.bend == 0.0 || step.length == 0.0 {
            end[0] += step.length * heading.cos();
            end[1] += step.length * heading.sin();
        } else {
            let radius = step.length / step.bend.abs();
            let side = step.bend.signum();
            let center = [
                at[0] - radius * side * heading.sin(),
                at[1] + radius * side * heading.cos(),
                at[2],
            ];
            heading += step.bend;
            let is_full = step.bend.abs() == TAU;
            if !is_full {
                end[0] = center[0] + radius * side * heading.sin();
                end[1] = center[1] - radius * side * heading.cos();
            }
            shape = Shape::Arc(Arc {
                center,
                plane: Plane::Xy,
                clockwise: side < 0.0,
                turns: u16::from(is_full),
            });
        }
        push(&mut contour, motion(shape, end), true);
        at = end;
        for number in 0..u32::from(step.aux.saturating_sub(3)) {
            let number = f64::from(number + 10 * index as u32);
            let action = Action::Auxiliary { letter: 'M', number };
            push(&mut contour, ContourEventKind::Action(action), (number as u32).is_multiple_of(2));
        }
    }
    push(&mut contour, ContourEventKind::Cancel { exit: None }, true);
    push(&mut contour, motion(Shape::Line, [at[0] + 40.0, at[1] + 70.0, at[2]]), false);
    contour
}

fn free() -> Profile {
    let mut profile = sinumerik();
    profile.interference.react = Reaction::Ignore;
    profile.corner.arc_over_360 = Strictness::Warn;
    profile.off_plane.max_blocks = None;
    profile
}

fn in_modes() -> impl Strategy<Value = OutsideCorner> {
    prop_oneof![
        Just(OutsideCorner::Arc),
        Just(OutsideCorner::Intersection),
        Just(OutsideCorner::ExtendByRadius)
    ]
}

fn sides() -> impl Strategy<Value = CutterSide> {
    prop_oneof![Just(CutterSide::Left), Just(CutterSide::Right)]
}

fn check_elements(start: Position, elements: &[PathElement]) -> Result<(), TestCaseError> {
    let mut at = start;
    for element in elements {
        let finite = element.end.iter().all(|value| value.is_finite());
        prop_assert!(finite, "{element:?}");
        let moved = (0..3).any(|axis| (at[axis] - element.end[axis]).abs() > 1e-7);
        match element.shape {
            Shape::Line => {
                prop_assert!(moved || element.role == Role::None, "{element:?} at {at:?}")
            }
            Shape::Arc(arc) => {
                prop_assert!(moved || arc.turns > 0, "{element:?} at {at:?}");
                let out = |p: Position| (p[0] - arc.center[0]).hypot(p[1] - arc.center[1]);
                prop_assert!(out(at).is_finite() && out(at) > 0.0);
                let off = (out(at) - out(element.end)).abs();
                prop_assert!(off < 3e-3 + 1e-9 * out(at), "off {off} {element:?} at {at:?}");
            }
        }
        at = element.end;
    }
    Ok(())
}

proptest! {
    #![proptest_config(config(2000))]

    #[test]
    fn p13_absurd_contours_give_finite_chained_paths(steps in prop::collection::vec(step(), 1..14), side in sides(), corner in in_modes(), radius in prop_oneof![0.01..20.0_f64, Just(-5.0), Just(0.0), Just(1000.0)]) {
        let mut contour = random_contour(&steps, side, corner);
        set_radius(&mut contour, radius);
        let plan = run(&contour, &free(), 0.0);
        check_elements(contour.start, elements(&plan))?;
    }

    #[test]
    fn p12_every_action_comes_once_and_in_order(steps in prop::collection::vec(step(), 1..14), side in sides(), corner in in_modes(), radius in 0.01..20.0_f64) {
        let mut contour = random_contour(&steps, side, corner);
        set_radius(&mut contour, radius);
        let mut plan = run(&contour, &free(), 0.0);
        let programmed: Vec<Action> = contour.events.iter().filter_map(|event| match event.kind {
            ContourEventKind::Action(action) => Some(action),
            _ => None,
        }).collect();
        if !plan.accepted() {
            // The events of what is refused are not kept; a small tool is never refused.
            let mut small = contour.clone();
            set_radius(&mut small, 1e-7);
            plan = run(&small, &free(), 0.0);
        }
        prop_assume!(plan.accepted());
        let got: Vec<Action> = plan.path.events.iter().map(|event| event.action).collect();
        prop_assert_eq!(got, programmed);
        prop_assert!(plan.path.events.windows(2).all(|pair| pair[0].at_element <= pair[1].at_element));
    }

    #[test]
    fn p5_a_negative_radius_is_the_other_side(steps in prop::collection::vec(step(), 1..10), corner in in_modes(), radius in 0.01..20.0_f64) {
        let mut left = random_contour(&steps, CutterSide::Left, corner);
        let mut right = left.clone();
        right.events[2].kind = ContourEventKind::Select { side: CutterSide::Right, approach: None, along: None };
        set_radius(&mut left, radius);
        set_radius(&mut right, -radius);
        let (left, right) = (run(&left, &free(), 0.0), run(&right, &free(), 0.0));
        prop_assert_eq!(elements(&left), elements(&right));
    }

    #[test]
    fn p1_every_point_is_the_radius_away_from_its_own_block(steps in prop::collection::vec(step(), 1..10), side in sides(), radius in 0.1..10.0_f64) {
        let mut contour = random_contour(&steps, side, OutsideCorner::Arc);
        set_radius(&mut contour, radius);
        let plan = run(&contour, &free(), 0.0);
        if !plan.accepted() {
            return Ok(());
        }
        let mut programmed = std::collections::BTreeMap::new();
        let mut at = contour.start;
        for event in &contour.events {
            if let ContourEventKind::Motion(motion) = event.kind {
                programmed.insert(event.source.line, (at, motion));
                at = motion.end;
            }
        }
        for (index, element) in plan.path.elements.iter().enumerate() {
            if !matches!(element.role, Role::Contour | Role::Corner) {
                continue;
            }
            let start = plan.path.start_of(index);
            let (from, motion) = programmed[&element.source.line];
            let length = (motion.end[0] - from[0]).hypot(motion.end[1] - from[1]);
            let is_full = matches!(motion.shape, Shape::Arc(arc) if arc.turns > 0);
            if length < 0.05 && !is_full && element.role == Role::Contour {
                // Merged with its neighbours: its own direction means nothing.
                continue;
            }
            for part in [0.0, 0.3, 0.7, 1.0] {
                let point = along(start, element, part);
                let distance = if element.role == Role::Corner {
                    (point[0] - from[0]).hypot(point[1] - from[1])
                } else {
                    off_carrier(point, from, &motion)
                };
                // Twice what merging and acceptance may move it.
                prop_assert!((distance - radius).abs() < 2.0 * 0.0021, "{distance} {element:?}");
            }
        }
    }
}

/// The distance from the whole line or circle of a motion.
fn off_carrier(point: Position, start: Position, motion: &Motion) -> f64 {
    match motion.shape {
        Shape::Line => {
            let (dx, dy) = (motion.end[0] - start[0], motion.end[1] - start[1]);
            let cross = dx * (point[1] - start[1]) - dy * (point[0] - start[0]);
            (cross / dx.hypot(dy)).abs()
        }
        Shape::Arc(arc) => {
            let radius = (start[0] - arc.center[0]).hypot(start[1] - arc.center[1]);
            ((point[0] - arc.center[0]).hypot(point[1] - arc.center[1]) - radius).abs()
        }
    }
}

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
        let count = radii.len();
        let points: Vec<Position> = radii.iter().enumerate().map(|(index, radius)| {
            let (sin, cos) = (index as f64 / count as f64 * TAU).sin_cos();
            [radius * cos, radius * sin, 0.0]
        }).collect();
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

#[test]
fn an_empty_program_is_an_empty_path() {
    let plan =
        compensation_planner::plan(&ProgrammedContour::default(), &rs274(), &ToolTable::default());
    assert_eq!(plan, Plan::default());
}
