//! Converts between the centre of a tool's nose and its theoretical tip.
//!
//! Turning tools are measured at the theoretical tip P, the corner of the square
//! about the nose that is parallel to the axes; compensation computes the centre
//! of the nose S. The tip runs where it is programmed while compensation is off.
//!
//! The manuals draw two charts, for tools behind and in front of the centre of
//! rotation. In front, X points down: the second is the first turned over with
//! its axes, so that both are one in coordinates, and program and offsets are the
//! same (S02, S73). Source of the numbers: the chart of ISO lathe controls, in
//! which 3 is the outside turning tool that cuts towards the chuck.

use crate::geometry::element::Vec2;
use crate::geometry::frame::{height, in_plane, in_work};
use crate::span::Span;
use cnc_msgs::geometry::{Plane, Position, Shape};
use cnc_msgs::path::{PathElement, Role};

/// From S to P in radii, along the first and second axis of the plane (Z and X),
/// by tip direction. 0 and 9: the tip is the centre.
const CHART: [[f64; 2]; 10] = [
    [0.0, 0.0],
    [1.0, 1.0],
    [-1.0, 1.0],
    [-1.0, -1.0],
    [1.0, -1.0],
    [1.0, 0.0],
    [0.0, 1.0],
    [-1.0, 0.0],
    [0.0, -1.0],
    [0.0, 0.0],
];

/// From S to P, mm, along the axes of the plane.
fn vector(direction: u8, d_mm: f64) -> Vec2 {
    let [u, v] = CHART[usize::from(direction.min(9))];
    Vec2::new(u, v) * d_mm.abs()
}

/// Which point of the tool a span's path describes: the centre, or the tip.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TipShift {
    /// From S to P at the lead-on and at the end of the last leg, mm.
    pub first: Vec2,
    pub last: Vec2,
    is_at_tip: bool,
}

impl TipShift {
    pub(crate) fn new(span: &Span<'_>) -> Self {
        let is_at_tip = span.tip != 0 || span.legs.iter().any(|leg| leg.tip != 0);
        let first = vector(span.tip, span.d_mm);
        let last = span.legs.last().map_or(first, |leg| vector(leg.tip, leg.d_out_mm));
        Self { first, last, is_at_tip }
    }

    /// The centre of a tool with its tip at this position.
    pub(crate) fn centre(&self, plane: Plane, tip: Position, shift: Vec2) -> Position {
        self.moved(plane, tip, -shift)
    }

    /// The tip of a tool with its centre at this position.
    pub(crate) fn tip(&self, plane: Plane, centre: Position, shift: Vec2) -> Position {
        self.moved(plane, centre, shift)
    }

    fn moved(&self, plane: Plane, position: Position, by: Vec2) -> Position {
        if !self.is_at_tip {
            return position;
        }
        in_work(plane, in_plane(plane, position) + by, height(plane, position))
    }

    /// Moves compensated elements from the centre to the tip. A block that changes the edge begins
    /// with the old one, and so does the corner before it (S45).
    pub(crate) fn apply(&self, span: &Span<'_>, elements: &mut [PathElement]) {
        if !self.is_at_tip {
            return;
        }
        let mut legs = span.legs.iter().peekable();
        let (mut before, mut edge) = (self.first, self.first);
        for element in elements {
            while let Some(leg) = legs.next_if(|leg| leg.source.line <= element.source.line) {
                (before, edge) = (edge, vector(leg.tip, leg.d_out_mm));
            }
            let by = if element.role == Role::Corner { before } else { edge };
            element.end = self.moved(span.plane, element.end, by);
            if let Shape::Arc(arc) = &mut element.shape {
                arc.center = self.moved(span.plane, arc.center, by);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn s73_the_centre_lies_beside_the_tip_as_the_chart_says() {
        assert_eq!(vector(3, 0.8), Vec2::new(-0.8, -0.8));
        for no_side in [0, 9] {
            assert_eq!(vector(no_side, 0.8), Vec2::zeros());
        }
        // Opposite edges lie opposite each other; neighbours of the round lie an eighth apart.
        for (one, other) in [(1, 3), (2, 4), (5, 7), (6, 8)] {
            assert_eq!(-vector(one, 1.0), vector(other, 1.0));
        }
        for (side, corners) in [(5, (1, 4)), (6, (1, 2)), (7, (2, 3)), (8, (3, 4))] {
            let middle = (vector(corners.0, 1.0) + vector(corners.1, 1.0)) / 2.0;
            assert_eq!(vector(side, 1.0), middle);
        }
    }
}
