//! Lengths and directions of moves.

use cnc_msgs::geometry::{Arc, Position, Shape};
use std::f64::consts::TAU;

/// The length of one element, mm.
pub fn length_mm(shape: &Shape, start: Position, end: Position) -> f64 {
    match shape {
        Shape::Line => norm(minus(end, start)),
        Shape::Arc(arc) => {
            let [a, b, normal] = arc.plane.axes();
            let radius = (start[a] - arc.center[a]).hypot(start[b] - arc.center[b]);
            (radius * sweep(arc, start, end)).hypot(end[normal] - start[normal])
        }
    }
}

/// The angle of an arc along its direction, all turns together, rad.
pub(crate) fn sweep(arc: &Arc, start: Position, end: Position) -> f64 {
    let [a, b, _] = arc.plane.axes();
    let angle = |point: Position| (point[b] - arc.center[b]).atan2(point[a] - arc.center[a]);
    let turned = angle(end) - angle(start);
    let turned = if arc.clockwise { -turned } else { turned }.rem_euclid(TAU);
    let is_whole = arc.turns > 0 && (end[a] - start[a]).hypot(end[b] - start[b]) < 1e-6;
    if is_whole { 0.0 } else { turned }.mul_add(1.0, TAU * f64::from(arc.turns))
}

pub(crate) fn minus<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

pub(crate) fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    let mut sum = 0.0;
    for axis in 0..N {
        sum += a[axis] * b[axis];
    }
    sum
}

pub(crate) fn norm<const N: usize>(a: [f64; N]) -> f64 {
    dot(a, a).sqrt()
}

pub(crate) fn unit<const N: usize>(a: [f64; N]) -> [f64; N] {
    let length = norm(a);
    if length > 0.0 { a.map(|value| value / length) } else { a }
}
