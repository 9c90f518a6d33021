//! The path of the tool centre as lines and arcs in the plane.

use crate::piece::{Piece, Point, point};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{PathElement, Role as PathRole};
use std::f64::consts::TAU;

/// One element of a path, in the plane.
pub(super) struct CenterPath {
    pub shape: Piece,
    pub line: u32,
    pub role: PathRole,
}

/// The elements that move in the plane.
pub(super) fn center_paths(
    start: Position,
    elements: &[PathElement],
    axes: [usize; 3],
) -> Vec<CenterPath> {
    let [u, v, _] = axes;
    let flat = |at: Position| point(at[u], at[v]);
    let mut from = start;
    let mut paths = Vec::new();
    for element in elements {
        let (a, b) = (flat(from), flat(element.end));
        from = element.end;
        let shape = match element.shape {
            Shape::Line if a == b => continue,
            Shape::Line => Piece::line(a, b),
            Shape::Arc(arc) => around(a, b, flat(arc.center), !arc.clockwise, arc.turns > 0),
        };
        paths.push(CenterPath { shape, line: element.source.line, role: element.role });
    }
    paths
}

/// An arc of the path about its own centre; a whole turn, however far apart rounding has put its
/// ends.
fn around(start: Point, end: Point, center: Point, is_ccw: bool, is_whole: bool) -> Piece {
    let angle = |at: Point| (at.v - center.v).atan2(at.u - center.u);
    let ccw = (angle(end) - angle(start)).rem_euclid(TAU);
    let sweep = match (is_whole || start == end, is_ccw) {
        (true, true) => TAU,
        (true, false) => -TAU,
        (false, true) => ccw,
        (false, false) => ccw - TAU,
    };
    Piece::Arc { center, radius: center.to(start), from: angle(start), sweep }
}
