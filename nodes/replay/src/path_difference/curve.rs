//! A run of elements as a curve, and the distance between two of them.
//!
//! Each point of one curve is compared with the elements of the other near the same share of its
//! length. Lines and arcs are exact. For a helix the point at the same angle is used, which is
//! never nearer than the nearest one. So at the sampled points a distance is never too small:
//! both ends of each element of both curves, and seven points in between.

use cnc_msgs::geometry::{Arc, Position, Shape};
use cnc_msgs::path::CompensatedPath;
use compensation_planner::tessellate::sweep;
use std::f64::consts::TAU;

/// Samples on an element, its end included. In between, a distance that grows and falls like
/// that of chord and arc is found to within 2 %.
const SAMPLES: u32 = 8;
/// Elements of the other curve that are checked on each side of the same share of the length.
const NEAR: usize = 4;

/// One line or arc with its start.
#[derive(Debug, Clone, Copy)]
struct CurveElement {
    start: Position,
    shape: Shape,
    end: Position,
    /// The angle of an arc, rad.
    sweep: f64,
    length: f64,
    /// Length of the curve up to its start.
    before: f64,
}

/// Consecutive elements of a path.
#[derive(Debug)]
pub(crate) struct Curve(Vec<CurveElement>);

impl Curve {
    pub(crate) fn new(path: &CompensatedPath, (first, end): (usize, usize)) -> Self {
        let mut before = 0.0;
        let bit = |index: usize| {
            let (start, element) = (path.start_of(index), &path.elements[index]);
            let mut bit = CurveElement {
                start,
                shape: element.shape,
                end: element.end,
                sweep: 0.0,
                length: distance(start, element.end),
                before,
            };
            if let Shape::Arc(arc) = &element.shape {
                let [u, v, w] = arc.plane.axes();
                let radius = (start[u] - arc.center[u]).hypot(start[v] - arc.center[v]);
                bit.sweep = sweep(start, arc, element.end);
                bit.length = (radius * bit.sweep).hypot(element.end[w] - start[w]);
            }
            before += bit.length;
            bit
        };
        Self((first..end).map(bit).collect())
    }

    pub(crate) fn length(&self) -> f64 {
        self.0.last().map_or(0.0, |bit| bit.before + bit.length)
    }

    /// The largest distance of the points of each curve from the other, and where.
    pub(crate) fn distance_to(&self, other: &Self) -> (f64, Position) {
        let there = self.from(other);
        let back = other.from(self);
        if there.0 >= back.0 { there } else { back }
    }

    fn from(&self, other: &Self) -> (f64, Position) {
        let start = self.0.first().map_or([0.0; 3], |bit| bit.start);
        let mut worst = (0.0_f64, start);
        let scale = other.length() / self.length();
        let mut at = 0;
        for bit in &self.0 {
            for sample in 1..=SAMPLES {
                let part = f64::from(sample) / f64::from(SAMPLES);
                let point = bit.point(part);
                let along = (bit.before + bit.length * part) * scale;
                while at + 1 < other.0.len() && other.0[at + 1].before < along {
                    at += 1;
                }
                let near = at.saturating_sub(NEAR)..(at + NEAR + 1).min(other.0.len());
                let distances = other.0[near].iter().map(|bit| bit.distance(point));
                // Infinite where a coordinate is NaN.
                let nearest = distances.fold(f64::INFINITY, f64::min);
                if nearest > worst.0 {
                    worst = (nearest, point);
                }
            }
        }
        worst
    }
}

impl CurveElement {
    /// The point at this share of its length, from 0 to 1.
    fn point(&self, part: f64) -> Position {
        let Shape::Arc(arc) = &self.shape else {
            return [0, 1, 2].map(|k| self.start[k] + (self.end[k] - self.start[k]) * part);
        };
        if part >= 1.0 {
            return self.end;
        }
        self.on_arc(arc, self.sweep * part)
    }

    /// The point of its arc after this angle, rad.
    fn on_arc(&self, arc: &Arc, angle: f64) -> Position {
        let [u, v, w] = arc.plane.axes();
        let from = [self.start[u] - arc.center[u], self.start[v] - arc.center[v]];
        let (sin, cos) = if arc.clockwise { -angle } else { angle }.sin_cos();
        let part = if self.sweep > 0.0 { angle / self.sweep } else { 0.0 };
        let mut point = [0.0; 3];
        point[u] = arc.center[u] + from[0] * cos - from[1] * sin;
        point[v] = arc.center[v] + from[0] * sin + from[1] * cos;
        point[w] = self.start[w] + (self.end[w] - self.start[w]) * part;
        point
    }

    /// The distance of a point from it, mm.
    fn distance(&self, point: Position) -> f64 {
        let Shape::Arc(arc) = &self.shape else {
            return crate::path_distance::from_chord(point, &(self.start, self.end));
        };
        let ends = distance(point, self.start).min(distance(point, self.end));
        let [u, v, _] = arc.plane.axes();
        let from = [self.start[u] - arc.center[u], self.start[v] - arc.center[v]];
        let to = [point[u] - arc.center[u], point[v] - arc.center[v]];
        let cross = from[0] * to[1] - from[1] * to[0];
        let dot = from[0] * to[0] + from[1] * to[1];
        let turned = if arc.clockwise { -cross } else { cross }.atan2(dot).rem_euclid(TAU);
        // Once for each turn that reaches this angle.
        let turns = ((self.sweep - turned) / TAU).floor();
        if turns.is_nan() || turns < 0.0 {
            return ends;
        }
        let turns = (0..=turns.min(f64::from(u16::MAX)) as u32).map(f64::from);
        let on_turns = turns.map(|turn| distance(point, self.on_arc(arc, turned + TAU * turn)));
        on_turns.fold(ends, f64::min)
    }
}

pub(crate) fn distance(a: Position, b: Position) -> f64 {
    [0, 1, 2].map(|axis| (a[axis] - b[axis]).powi(2)).iter().sum::<f64>().sqrt()
}
