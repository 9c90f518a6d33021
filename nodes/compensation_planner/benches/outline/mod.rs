//! Contours to measure on, for the planner and for others alike.
//!
//! An [`Outline`] is points, lines and arcs in the plane; it becomes a programmed
//! contour with leads, or a polyline of `cavalier_contours`. Every shape is made
//! by a formula, so that a figure can be measured again.

use cavalier_contours::polyline::{PlineSourceMut, Polyline};
use cnc_msgs::contour::{
    Approach, ContourEvent, ContourEventKind, CutterSide, Motion, MotionClass, ProgrammedContour,
    RadiusSource, Source,
};
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Shape};
use std::f64::consts::TAU;

type Point = [f64; 2];

/// A line, or an arc about a centre, to a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment {
    end: Point,
    arc: Option<Bend>,
}

#[derive(Debug, Clone, Copy)]
struct Bend {
    center: Point,
    clockwise: bool,
    /// Tangent of a quarter of the angle, positive counter-clockwise.
    bulge: f64,
}

/// A contour without leads.
#[derive(Debug, Clone)]
pub(crate) struct Outline {
    start: Point,
    segments: Vec<Segment>,
    side: CutterSide,
    /// Before which segments the tool goes deeper, and to where, mm.
    steps: Vec<(usize, f64)>,
    depth_mm: f64,
    /// Length of its leads, mm.
    lead_mm: f64,
}

/// Length of the elements of rings, mm: what a post processor writes for a fine finish.
const STEP_MM: f64 = 0.1;

impl Outline {
    fn lines(points: &[Point], side: CutterSide) -> Self {
        let segments = points[1..].iter().map(|&end| Segment { end, arc: None }).collect();
        Self { start: points[0], segments, side, steps: Vec::new(), depth_mm: 0.0, lead_mm: 20.0 }
    }

    /// A ring with seven waves, of so many lines, counter-clockwise, the tool outside.
    pub(crate) fn wave(count: usize) -> Self {
        Self::lines(&wave_points(count), CutterSide::Right)
    }

    /// The same ring of half as many lines, each corner rounded by a tangent arc.
    pub(crate) fn rounded_wave(count: usize) -> Self {
        let points = wave_points(count / 2);
        let corners = points.len() - 1;
        let mut outline = Self::lines(&points[..1], CutterSide::Right);
        for index in 0..=corners {
            let before = points[(index + corners - 1) % corners];
            let (at, after) = (points[index % corners], points[(index + 1) % corners]);
            let (t, u) = (unit(before, at), unit(at, after));
            let trim = STEP_MM * 0.3;
            let from = [at[0] - t[0] * trim, at[1] - t[1] * trim];
            let to = [at[0] + u[0] * trim, at[1] + u[1] * trim];
            let sine = t[0] * u[1] - t[1] * u[0];
            let angle = sine.atan2(t[0] * u[0] + t[1] * u[1]);
            let radius = trim / (angle / 2.0).tan();
            let center = [from[0] - t[1] * radius, from[1] + t[0] * radius];
            let bend = Bend { center, clockwise: angle < 0.0, bulge: (angle / 4.0).tan() };
            if index == 0 {
                outline.start = to;
                continue;
            }
            outline.segments.push(Segment { end: from, arc: None });
            // At a point of inflection there is nothing to round.
            let arc = (radius.abs() < 1e6).then_some(bend);
            outline.segments.push(Segment { end: to, arc });
        }
        outline
    }

    /// A ring of lines of 1 mm with a corner of 30 degrees at each end.
    pub(crate) fn zigzag(count: usize) -> Self {
        let half_turn = 15.0_f64.to_radians();
        let (depth, radius) = (half_turn.sin(), count as f64 * half_turn.cos() / TAU);
        let count = count & !1;
        let point = |index: usize| {
            let out = radius + if index.is_multiple_of(2) { depth } else { 0.0 };
            let (sin, cos) = (TAU * index as f64 / count as f64).sin_cos();
            [out * cos, out * sin]
        };
        let points: Vec<Point> = (0..=count).map(|index| point(index % count)).collect();
        Self::lines(&points, CutterSide::Right)
    }

    /// A ring of 0.5 mm: every element is near every other.
    pub(crate) fn speck(count: usize) -> Self {
        let point = |index: usize| {
            let (sin, cos) = (TAU * index as f64 / count as f64).sin_cos();
            [0.25 * cos, 0.25 * sin]
        };
        let points: Vec<Point> = (0..=count).map(|index| point(index % count)).collect();
        Self::lines(&points, CutterSide::Right)
    }

    /// Lines between points in a square of 1 mm that nobody would program.
    pub(crate) fn scribble(count: usize) -> Self {
        // Multiples of the golden ratio and of its square root fill the square evenly.
        let point = |index: usize| {
            let index = index as f64;
            [(index * 0.618_033_988_75).fract(), (index * 0.786_151_377_76).fract()]
        };
        let points: Vec<Point> = (0..=count).map(point).collect();
        Self::lines(&points, CutterSide::Right)
    }

    /// A comb: so many slots of this width and 100 mm deep, the tool above it.
    pub(crate) fn comb(teeth: usize, slot_mm: f64) -> Self {
        let mut points = vec![[-50.0, 0.0]];
        for tooth in 0..teeth {
            let left = tooth as f64 * (slot_mm + 4.0);
            points.extend([[left, 0.0], [left, -100.0]]);
            points.extend([[left + slot_mm, -100.0], [left + slot_mm, 0.0]]);
        }
        points.push([teeth as f64 * (slot_mm + 4.0) + 50.0, 0.0]);
        Self::lines(&points, CutterSide::Left)
    }

    /// A spiral inwards with this distance between its turns, 360 lines a turn.
    pub(crate) fn spiral(turns: usize, pitch_mm: f64) -> Self {
        let count = turns * 360;
        let point = |index: usize| {
            let angle = index as f64 / 360.0;
            let radius = 50.0 + pitch_mm * angle;
            let (sin, cos) = (TAU * angle).sin_cos();
            [radius * cos, radius * sin]
        };
        let points: Vec<Point> = (0..=count).rev().map(point).collect();
        Self::lines(&points, CutterSide::Left)
    }

    /// A spiral outwards of so many lines of 2 mm, with this distance between its turns.
    pub(crate) fn even_spiral(count: usize, pitch_mm: f64) -> Self {
        let point = |index: usize| {
            let length = 2.0 * (index + 10_000) as f64;
            let radius = (pitch_mm * length * 2.0 / TAU).sqrt();
            let (sin, cos) = (radius / pitch_mm * TAU).sin_cos();
            [radius * cos, radius * sin]
        };
        let points: Vec<Point> = (0..=count).rev().map(point).collect();
        Self::lines(&points, CutterSide::Left)
    }

    /// A ring of 500 chords that is cut again and again, each time a step deeper.
    pub(crate) fn passes(count: usize, step_mm: f64) -> Self {
        let ring: Vec<Point> = (0..=500).map(|index| wave_point(index, 500, 50.0)).collect();
        let mut outline = Self::lines(&ring, CutterSide::Right);
        let chords = outline.segments.clone();
        while outline.count() < count {
            outline.depth_mm -= step_mm;
            outline.steps.push((outline.count(), outline.depth_mm));
            outline.segments.extend(&chords);
        }
        outline
    }

    /// The Hilbert curve through at least so many points, 10 mm apart.
    pub(crate) fn hilbert(count: usize) -> Self {
        let mut side = 1;
        while side * side < count {
            side *= 2;
        }
        let point = |index: usize| {
            let (mut x, mut y, mut rest, mut square) = (0, 0, index, 1);
            while square < side {
                let right = 1 & (rest / 2);
                let up = 1 & (rest ^ right);
                if up == 0 {
                    if right == 1 {
                        (x, y) = (square - 1 - x, square - 1 - y);
                    }
                    (x, y) = (y, x);
                }
                (x, y) = (x + square * right, y + square * up);
                (rest, square) = (rest / 4, square * 2);
            }
            [x as f64 * 10.0, y as f64 * 10.0]
        };
        // From outside, so that the leads cross nothing.
        let points = std::iter::once([-20.0, 0.0]).chain((0..side * side).map(point));
        Self::lines(&points.collect::<Vec<Point>>(), CutterSide::Left)
    }

    /// So many round bosses of 10 mm in rows, each a contour of its own.
    pub(crate) fn bosses(count: usize) -> Vec<Self> {
        let side = count.isqrt().max(1);
        let boss = |index: usize| {
            let center = [(index % side) as f64 * 40.0, (index / side) as f64 * 40.0];
            let at = |angle: f64| [center[0] + 5.0 * angle.cos(), center[1] + 5.0 * angle.sin()];
            let half = |end: f64| Segment {
                end: at(end),
                arc: Some(Bend { center, clockwise: true, bulge: -1.0 }),
            };
            let segments = vec![half(TAU / 2.0), half(0.0)];
            Self { segments, ..Self::lines(&[at(0.0)], CutterSide::Left) }
        };
        (0..count).map(boss).collect()
    }

    /// Stars of twelve lines in rows, each a contour of its own.
    pub(crate) fn stars(count: usize) -> Vec<Self> {
        let side = (count / 12).isqrt().max(1);
        let star = |index: usize| {
            let center = [(index % side) as f64 * 60.0, (index / side) as f64 * 60.0];
            let point = |corner: usize| {
                let out = if corner.is_multiple_of(2) { 10.0 } else { 8.0 };
                let (sin, cos) = (TAU * corner as f64 / 12.0).sin_cos();
                [center[0] + out * cos, center[1] + out * sin]
            };
            let points: Vec<Point> = (0..=12).map(|corner| point(corner % 12)).collect();
            Self::lines(&points, CutterSide::Right)
        };
        (0..count / 12).map(star).collect()
    }

    /// Rounded squares of eight elements, ten of them in each other, in rows.
    pub(crate) fn nested_squares(count: usize) -> Vec<Self> {
        let nests = (count / 80).max(1);
        let side = nests.isqrt().max(1);
        let square = |index: usize| {
            let nest = index / 10;
            let center = [(nest % side) as f64 * 250.0, (nest / side) as f64 * 250.0];
            let (half, radius) = (20.0 + 8.0 * (index % 10) as f64, 8.0);
            let straight = half - radius;
            let quarter = |turns: usize, [x, y]: Point| match turns {
                0 => [center[0] + x, center[1] + y],
                1 => [center[0] - y, center[1] + x],
                2 => [center[0] - x, center[1] - y],
                _ => [center[0] + y, center[1] - x],
            };
            let bulge = (TAU / 16.0).tan();
            let segments = (0..4).flat_map(|turns| {
                let at = |point| quarter(turns, point);
                let arc = Bend { center: at([straight, straight]), clockwise: false, bulge };
                let line = Segment { end: at([half, straight]), arc: None };
                [line, Segment { end: at([straight, half]), arc: Some(arc) }]
            });
            let segments = segments.collect();
            let start = quarter(0, [half, -straight]);
            Self { segments, lead_mm: 3.0, ..Self::lines(&[start], CutterSide::Right) }
        };
        (0..nests * 10).map(square).collect()
    }

    /// Number of lines and arcs.
    pub(crate) fn count(&self) -> usize {
        self.segments.len()
    }

    /// With D1, a lead-on and a lead-off perpendicular to the ends.
    pub(crate) fn programmed(&self) -> ProgrammedContour {
        programmed(std::slice::from_ref(self))
    }

    /// Where the lead-on begins, and where the lead-off ends.
    fn outside(&self) -> [Point; 2] {
        let (first, last) = (self.segments[0], self.segments[self.count() - 1]);
        let last_start =
            if self.count() > 1 { self.segments[self.count() - 2].end } else { self.start };
        let left = if self.side == CutterSide::Left { self.lead_mm } else { -self.lead_mm };
        let aside = |at: Point, along: Point| [at[0] - along[1] * left, at[1] + along[0] * left];
        [
            aside(self.start, unit(self.start, first.end)),
            aside(last.end, unit(last_start, last.end)),
        ]
    }

    /// The closed polyline that others offset.
    pub(crate) fn polyline(&self) -> Polyline<f64> {
        let mut polyline = Polyline::new_closed();
        let mut start = self.start;
        for segment in &self.segments {
            polyline.add(start[0], start[1], segment.arc.map_or(0.0, |arc| arc.bulge));
            start = segment.end;
        }
        polyline
    }
}

/// Contours one after another, with the leads of each.
pub(crate) fn programmed(outlines: &[Outline]) -> ProgrammedContour {
    let mut events = Vec::new();
    let mut line = 1;
    let mut push = |kind| {
        let source = Source { line, column: 1, length: 20, block: None, call: 0 };
        line += u32::from(matches!(kind, ContourEventKind::Motion(_)));
        events.push(ContourEvent { source, kind });
    };
    let approach = Some(Approach::Normal);
    push(ContourEventKind::Radius(RadiusSource::Offset(1)));
    for outline in outlines {
        let [from, to] = outline.outside();
        push(motion(from, 0.0, None, MotionClass::Rapid));
        push(ContourEventKind::Select { side: outline.side, approach, along: None });
        push(motion(outline.start, 0.0, None, MotionClass::Feed));
        let (mut steps, mut at, mut depth_mm) =
            (outline.steps.iter().peekable(), outline.start, 0.0);
        for (index, segment) in outline.segments.iter().enumerate() {
            if let Some((_, deeper)) = steps.next_if(|(before, _)| *before == index) {
                depth_mm = *deeper;
                push(motion(at, depth_mm, None, MotionClass::Feed));
            }
            at = segment.end;
            push(motion(at, depth_mm, segment.arc, MotionClass::Feed));
        }
        push(ContourEventKind::Cancel { exit: approach });
        push(motion(to, depth_mm, None, MotionClass::Feed));
    }
    let [x, y] = outlines[0].outside()[0];
    ProgrammedContour { start: [x, y, 0.0], events, ..ProgrammedContour::default() }
}

fn wave_points(count: usize) -> Vec<Point> {
    let radius = count as f64 * STEP_MM / TAU;
    (0..=count).map(|index| wave_point(index, count, radius)).collect()
}

fn wave_point(index: usize, count: usize, radius: f64) -> Point {
    let angle = TAU * (index % count) as f64 / count as f64;
    let (sin, cos) = angle.sin_cos();
    let out = radius * (1.0 + 0.05 * (7.0 * angle).cos());
    [out * cos, out * sin]
}

fn unit(from: Point, to: Point) -> Point {
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let length = x.hypot(y);
    [x / length, y / length]
}

fn motion(end: Point, depth_mm: f64, bend: Option<Bend>, class: MotionClass) -> ContourEventKind {
    let shape = match bend {
        None => Shape::Line,
        Some(Bend { center, clockwise, .. }) => {
            let center = [center[0], center[1], depth_mm];
            Shape::Arc(Arc { center, plane: Plane::Xy, clockwise, turns: 0 })
        }
    };
    ContourEventKind::Motion(Motion {
        shape,
        end: [end[0], end[1], depth_mm],
        class,
        feed_mm_per_min: if class == MotionClass::Feed { 1000.0 } else { 0.0 },
        axes: AxisSet::NONE.with(0).with(1),
    })
}
