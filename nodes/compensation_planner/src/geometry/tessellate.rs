//! Points along a path for previews.
//!
//! Every point lies on the path, and the lines between them within the chord
//! error. Nothing that is sent to a machine goes through here.

use cnc_msgs::geometry::{Arc, Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement};
use std::f64::consts::{FRAC_PI_2, TAU};

/// The most points of one element; beyond that the chord error grows.
const POINTS_MAX: f64 = 65_536.0;

/// Calls `each` with the points of one element, from after its start to its end.
///
/// Arcs, helices and whole turns follow their circle within `chord_error_mm`;
/// the last point is the end itself.
pub fn points(
    start: Position,
    element: &PathElement,
    chord_error_mm: f64,
    each: impl FnMut(Position),
) {
    along(start, &element.shape, element.end, chord_error_mm, each);
}

/// The same for a line or arc that is not part of a path.
pub fn along(
    start: Position,
    shape: &Shape,
    end: Position,
    chord_error_mm: f64,
    mut each: impl FnMut(Position),
) {
    if let Shape::Arc(arc) = shape {
        along_arc(start, arc, end, chord_error_mm, &mut each);
    }
    each(end);
}

/// The points of a whole path, from its start.
pub fn path(path: &CompensatedPath, chord_error_mm: f64) -> Vec<Position> {
    let mut all = Vec::with_capacity(path.elements.len() + 1);
    let mut start = path.start;
    all.push(start);
    for element in &path.elements {
        points(start, element, chord_error_mm, |point| all.push(point));
        start = element.end;
    }
    all
}

/// The angle of an arc, rad, with its whole turns.
pub fn sweep(start: Position, arc: &Arc, end: Position) -> f64 {
    let [u, v, _] = arc.plane.axes();
    let from = [start[u] - arc.center[u], start[v] - arc.center[v]];
    let to = [end[u] - arc.center[u], end[v] - arc.center[v]];
    let cross = from[0] * to[1] - from[1] * to[0];
    let dot = from[0] * to[0] + from[1] * to[1];
    let angle = if arc.clockwise { -cross } else { cross }.atan2(dot);
    let base = if angle < 0.0 { angle + TAU } else { angle };
    base + TAU * f64::from(arc.turns)
}

fn along_arc(
    start: Position,
    arc: &Arc,
    end: Position,
    chord_error_mm: f64,
    each: &mut impl FnMut(Position),
) {
    let [u, v, w] = arc.plane.axes();
    let from = [start[u] - arc.center[u], start[v] - arc.center[v]];
    let radius = from[0].hypot(from[1]);
    let sweep = sweep(start, arc, end);
    // Sagitta of a chord: r (1 - cos(step / 2)).
    let part = (chord_error_mm / radius).clamp(1e-12, 1.0);
    let step = (2.0 * (1.0 - part).acos()).min(FRAC_PI_2);
    let count = (sweep / step).ceil();
    if !(count > 1.0 && radius.is_finite()) {
        return;
    }
    let count = count.min(POINTS_MAX) as u32;
    for index in 1..count {
        let ratio = f64::from(index) / f64::from(count);
        let angle = if arc.clockwise { -sweep } else { sweep } * ratio;
        let (sin, cos) = angle.sin_cos();
        let mut point = [0.0; 3];
        point[u] = arc.center[u] + from[0] * cos - from[1] * sin;
        point[v] = arc.center[v] + from[0] * sin + from[1] * cos;
        point[w] = start[w] + (end[w] - start[w]) * ratio;
        each(point);
    }
}
