//! Contours that no program was read for: rings that do not cross themselves, and
//! events in any order.
//!
//! Of a ring that is accepted every place of the path is asked for its distance from
//! every element, by formulas that the planner knows nothing of.

use crate::mutate::Random;
use crate::programs::{planned, tools};
use cnc_msgs::contour::{
    Action, Approach, ContourEvent, ContourEventKind, CutterSide, Motion, MotionClass,
    OutsideCorner, ProgrammedContour, RadiusSource, Source,
};
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Shape};
use cnc_msgs::path::{CompensatedPath, Role};
use cnc_msgs::profile::Profile;
use cnc_msgs::tool_table::{Offset, ToolTable};
use std::f64::consts::TAU;

type Point = [f64; 2];

/// A line, or an arc with a centre.
#[derive(Debug, Clone, Copy)]
struct Segment {
    start: Point,
    end: Point,
    arc: Option<(Point, bool)>,
}

/// What the path may be nearer than the radius, beyond the accepted tolerance, mm.
const GOUGE_MM: f64 = 1e-4;

/// One random ring; whether it was accepted.
pub(crate) fn check_ring(profile: &Profile, random: &mut Random) -> bool {
    let ring = ring(random);
    let side = *random.of(&[CutterSide::Left, CutterSide::Right]);
    let radius_mm = random.between(0.2, 8.0);
    let contour = programmed(&ring, side, radius_mm, random);
    let mut table = ToolTable::default();
    table.offsets.insert(1, Offset { radius_mm, ..Offset::default() });
    let shown = || format!("radius {radius_mm} {side:?}\n{contour:?}");
    let plan = planned(&contour, profile, &table, 1000, true, shown);
    if !plan.accepted() {
        return false;
    }
    let needed = radius_mm - GOUGE_MM - profile.accept_tolerance_mm;
    for point in points(&plan.path) {
        for segment in &ring {
            let distance = segment.distance(point);
            assert!(distance >= needed, "{distance} at {point:?} of {segment:?}\n{}", shown());
        }
    }
    true
}

/// Around the origin, counter-clockwise, each element within its own sector.
fn ring(random: &mut Random) -> Vec<Segment> {
    let count = 3 + random.below(30);
    let (size, roughness) = (random.between(3.0, 80.0), random.between(0.0, 0.7));
    let corner = |index: usize, random: &mut Random| {
        let angle = TAU * (index as f64 + random.between(0.0, 0.8)) / count as f64;
        let out = size * (1.0 - random.between(0.0, roughness));
        // Posted with three decimals.
        [out * angle.cos(), out * angle.sin()].map(|value| (value * 1e3).round() / 1e3)
    };
    let mut points: Vec<Point> = (0..count).map(|index| corner(index, random)).collect();
    // It begins and ends within an element.
    let first = [(points[0][0] + points[1][0]) / 2.0, (points[0][1] + points[1][1]) / 2.0];
    points.rotate_left(1);
    points.insert(0, first);
    points.push(first);
    let ends = points.windows(2).enumerate();
    ends.map(|(index, pair)| {
        let (start, end) = (pair[0], pair[1]);
        let is_inner = index > 0 && index + 2 < points.len();
        let bulge = random.between(-0.6, 0.6);
        let arc = (is_inner && random.once_in(3)).then(|| bend(start, end, bulge));
        let bent = Segment { start, end, arc };
        if is_in_sector(&bent) { bent } else { Segment { arc: None, ..bent } }
    })
    .collect()
}

/// Centre and direction of the arc with this tangent of a quarter of its angle.
fn bend(start: Point, end: Point, bulge: f64) -> (Point, bool) {
    let along = [end[0] - start[0], end[1] - start[1]];
    let far = (1.0 - bulge * bulge) / (4.0 * bulge);
    let middle = [(start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0];
    ([middle[0] - along[1] * far, middle[1] + along[0] * far], bulge < 0.0)
}

/// Whether all of an element lies between the rays to its ends, so that it crosses no other.
fn is_in_sector(segment: &Segment) -> bool {
    let cross = |a: Point, b: Point| a[0] * b[1] - a[1] * b[0];
    (1..64)
        .map(|step| segment.at(f64::from(step) / 64.0))
        .all(|point| cross(segment.start, point) > 1e-6 && cross(point, segment.end) > 1e-6)
}

impl Segment {
    /// Radius, angle of the start and sweep of an arc, rad, positive counter-clockwise.
    fn sweep(&self, center: Point, clockwise: bool) -> (f64, f64, f64) {
        let angle = |p: Point| (p[1] - center[1]).atan2(p[0] - center[0]);
        let (from, to) = (angle(self.start), angle(self.end));
        let ccw = (to - from).rem_euclid(TAU);
        let radius = (self.start[0] - center[0]).hypot(self.start[1] - center[1]);
        (radius, from, if clockwise { ccw - TAU } else { ccw })
    }

    /// The point at this part of it.
    fn at(&self, part: f64) -> Point {
        let Some((center, clockwise)) = self.arc else {
            let along = |axis: usize| self.start[axis] + (self.end[axis] - self.start[axis]) * part;
            return [along(0), along(1)];
        };
        let (radius, from, sweep) = self.sweep(center, clockwise);
        let (sin, cos) = (from + sweep * part).sin_cos();
        [center[0] + radius * cos, center[1] + radius * sin]
    }

    /// How far a point is away, mm.
    fn distance(&self, point: Point) -> f64 {
        let to = |other: Point| (point[0] - other[0]).hypot(point[1] - other[1]);
        let ends = to(self.start).min(to(self.end));
        if let Some((center, clockwise)) = self.arc {
            let (radius, from, sweep) = self.sweep(center, clockwise);
            let angle = (point[1] - center[1]).atan2(point[0] - center[0]);
            let turned = ((angle - from) * sweep.signum()).rem_euclid(TAU);
            return if turned <= sweep.abs() { (to(center) - radius).abs() } else { ends };
        }
        let along = [self.end[0] - self.start[0], self.end[1] - self.start[1]];
        let length = along[0].hypot(along[1]);
        let from = [point[0] - self.start[0], point[1] - self.start[1]];
        let part = (from[0] * along[0] + from[1] * along[1]) / (length * length);
        if (0.0..=1.0).contains(&part) {
            (from[0] * along[1] - from[1] * along[0]).abs() / length
        } else {
            ends
        }
    }
}

/// Places along the path without its leads.
fn points(path: &CompensatedPath) -> Vec<Point> {
    let flat = |position: [f64; 3]| [position[0], position[1]];
    let mut points = Vec::new();
    for (index, element) in path.elements.iter().enumerate() {
        if !matches!(element.role, Role::Contour | Role::Corner) {
            continue;
        }
        let arc = match element.shape {
            Shape::Arc(arc) => Some((flat(arc.center), arc.clockwise)),
            Shape::Line => None,
        };
        let segment = Segment { start: flat(path.start_of(index)), end: flat(element.end), arc };
        points.extend((0..=16).map(|step| segment.at(f64::from(step) / 16.0)));
    }
    points
}

/// Entered and left perpendicular, in the middle of an element.
fn programmed(
    ring: &[Segment],
    side: CutterSide,
    radius_mm: f64,
    random: &mut Random,
) -> ProgrammedContour {
    let first = ring[0];
    let along = [first.end[0] - first.start[0], first.end[1] - first.start[1]];
    let length = along[0].hypot(along[1]);
    let sign = if side == CutterSide::Left { 1.0 } else { -1.0 };
    let far = sign * radius_mm * random.between(1.0, 3.0) / length;
    let aside = [first.start[0] - along[1] * far, first.start[1] + along[0] * far];
    let approach = Some(Approach::Normal);
    let mut contour =
        ProgrammedContour { start: [aside[0], aside[1], 0.0], ..ProgrammedContour::default() };
    let mut push = |kind| {
        let source = Source { line: contour.events.len() as u32 + 1, ..Source::default() };
        contour.events.push(ContourEvent { source, kind });
    };
    let corners = [OutsideCorner::Arc, OutsideCorner::Intersection, OutsideCorner::ExtendByRadius];
    push(ContourEventKind::Corner(*random.of(&corners)));
    push(ContourEventKind::Radius(RadiusSource::Offset(1)));
    push(motion(aside, None, MotionClass::Rapid));
    push(ContourEventKind::Select { side, approach, along: None });
    push(motion(first.start, None, MotionClass::Feed));
    for segment in ring {
        push(motion(segment.end, segment.arc, MotionClass::Feed));
    }
    push(ContourEventKind::Cancel { exit: approach });
    push(motion(aside, None, MotionClass::Feed));
    contour
}

fn motion(end: Point, arc: Option<(Point, bool)>, class: MotionClass) -> ContourEventKind {
    let shape = arc.map_or(Shape::Line, |(center, clockwise)| {
        let center = [center[0], center[1], 0.0];
        Shape::Arc(Arc { center, plane: Plane::Xy, clockwise, turns: 0 })
    });
    ContourEventKind::Motion(Motion {
        shape,
        end: [end[0], end[1], 0.0],
        class,
        feed_mm_per_min: if class == MotionClass::Feed { 500.0 } else { 0.0 },
        axes: AxisSet::NONE.with(0).with(1),
    })
}

/// Events that no loader would give, in an order that no program has.
pub(crate) fn check_events(profiles: &[Profile], random: &mut Random) {
    let mut contour = ProgrammedContour::default();
    let mut at = [0.0, 0.0];
    for line in 1..2 + random.below(40) as u32 {
        let source = Source { line, ..Source::default() };
        let kind = event(&mut at, random);
        contour.events.push(ContourEvent { source, kind });
    }
    let (profile, table) = (random.of(profiles), tools(random));
    let shown = || format!("{}\n{table:?}\n{contour:?}", profile.name);
    planned(&contour, profile, &table, 1000, false, shown);
}

fn event(at: &mut Point, random: &mut Random) -> ContourEventKind {
    let side = *random.of(&[CutterSide::Left, CutterSide::Right]);
    let approach = *random.of(&[None, Some(Approach::Corner), Some(Approach::Normal)]);
    let direction = [random.between(-1.0, 1.0), random.between(-1.0, 1.0), 0.0];
    let along = random.once_in(4).then_some(direction);
    match random.below(24) {
        0 | 1 => ContourEventKind::Select { side, approach, along },
        2 => ContourEventKind::Cancel { exit: approach },
        3 => ContourEventKind::Plane(*random.of(&[Plane::Xy, Plane::Zx, Plane::Yz])),
        4 => ContourEventKind::Radius(RadiusSource::Offset(random.below(9) as u32)),
        5 => ContourEventKind::Radius(RadiusSource::Radius(random.between(-5.0, 20.0))),
        6 => ContourEventKind::RadiusValue { radius_mm: random.between(-5.0, 20.0) },
        7 => ContourEventKind::CornerArc { along },
        8 => ContourEventKind::HoldDirection { along },
        9 => ContourEventKind::Action(*random.of(&[
            Action::Dwell { seconds: 1.0 },
            Action::ExactStop,
            Action::Home { axes: AxisSet::ALL },
            Action::Stop { optional: false },
            Action::ToolLength { offset: Some(1), length_mm: 0.0, second: None },
            Action::ProgramEnd { rewind: true },
        ])),
        10 => ContourEventKind::Calculation,
        _ => any_motion(at, random),
    }
}

/// Mostly in reach, sometimes nowhere, sometimes no place at all.
fn any_motion(at: &mut Point, random: &mut Random) -> ContourEventKind {
    let size = *random.of(&[1e-9, 1e-4, 1.0, 30.0, 30.0, 30.0, 1e6, 1e12]);
    let start = *at;
    let mut end = [at[0] + random.between(-size, size), at[1] + random.between(-size, size)];
    if random.once_in(10) {
        end = start;
    }
    if random.once_in(60) {
        end[0] = *random.of(&[f64::NAN, f64::INFINITY, f64::MAX, -1e9]);
    }
    let center = [at[0] + random.between(-size, size), at[1] + random.between(-size, size)];
    let is_arc = random.once_in(3);
    // A centre that is as far from both ends, mostly.
    let bulge = random.between(-2.0, 2.0);
    let arc = match random.below(8) {
        0 => (center, random.once_in(2)),
        _ if end == start => (center, random.once_in(2)),
        _ => bend(start, end, bulge),
    };
    let class = *random.of(&[
        MotionClass::Feed,
        MotionClass::Feed,
        MotionClass::Feed,
        MotionClass::Rapid,
        MotionClass::NonCoordinated,
    ]);
    let mut kind = motion(end, is_arc.then_some(arc), class);
    if let ContourEventKind::Motion(motion) = &mut kind {
        motion.end[2] = *random.of(&[0.0, 0.0, 0.0, 5.0]);
        motion.axes = AxisSet::from_bits(random.below(8) as u8);
        if let Shape::Arc(arc) = &mut motion.shape {
            arc.turns = u16::from(end == start) * (1 + random.below(3) as u16);
            arc.plane = *random.of(&[Plane::Xy, Plane::Xy, Plane::Xy, Plane::Zx]);
        }
    }
    if end.iter().all(|value| value.abs() < 1e9) {
        *at = end;
    }
    kind
}
