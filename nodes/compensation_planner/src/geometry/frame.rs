//! Converts between work coordinates and the coordinates of a plane.
//!
//! It only picks coordinates and computes nothing. So a point that goes into the plane and back is
//! the same, bit for bit.

use crate::geometry::element::{Element, Vec2};
use cnc_msgs::contour::Motion;
use cnc_msgs::geometry::{AxisSet, Plane, Position, Shape};

/// The point in the plane, mm.
pub(crate) fn in_plane(plane: Plane, position: Position) -> Vec2 {
    let [u, v, _] = plane.axes();
    Vec2::new(position[u], position[v])
}

/// The coordinate along the plane's normal, mm.
pub(crate) fn height(plane: Plane, position: Position) -> f64 {
    position[plane.axes()[2]]
}

/// The position of a point in the plane at a height.
pub(crate) fn in_work(plane: Plane, point: Vec2, height: f64) -> Position {
    let [u, v, w] = plane.axes();
    let mut position = [0.0; 3];
    position[u] = point.x;
    position[v] = point.y;
    position[w] = height;
    position
}

/// Both axes of the plane.
pub(crate) fn plane_axes(plane: Plane) -> AxisSet {
    let [u, v, _] = plane.axes();
    AxisSet::NONE.with(u).with(v)
}

/// The element that a motion makes in the plane; `None` when it does not move there.
///
/// It does not recognise an arc of another plane: check for that first.
pub(crate) fn element(plane: Plane, start: Position, motion: &Motion) -> Option<Element> {
    element_from(plane, in_plane(plane, start), motion)
}

/// [`element`], from a point in the plane.
pub(crate) fn element_from(plane: Plane, from: Vec2, motion: &Motion) -> Option<Element> {
    let to = in_plane(plane, motion.end);
    match motion.shape {
        Shape::Line => Element::line(from, to),
        Shape::Arc(arc) => {
            Element::arc(from, to, in_plane(plane, arc.center), !arc.clockwise, arc.turns)
        }
    }
}
