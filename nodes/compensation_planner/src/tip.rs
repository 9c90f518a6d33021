//! From the centre of a tool's nose to its theoretical tip.
//!
//! Turning tools are measured at the theoretical tip P, the corner of the square
//! about the nose that is parallel to the axes; compensation computes the centre
//! of the nose S. The chart is that of a tool behind the centre of rotation; in
//! front of it the machine mirrors X, and the program stays the same (S02, S73).

use crate::span::Span;
use cnc_msgs::geometry::Shape;
use cnc_msgs::path::PathElement;

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
fn vector(direction: u8, radius_mm: f64) -> [f64; 2] {
    CHART[usize::from(direction.min(9))].map(|part| part * radius_mm)
}

/// Moves what was compensated of a span from the nose centre to the tip; each
/// block with the edge that it ends with (S45).
pub(crate) fn to_tip(span: &Span, elements: &mut [PathElement]) {
    let [u, v, _] = span.plane.axes();
    let mut legs = span.legs.iter().peekable();
    let mut edge = (span.tip, span.d_mm.abs());
    for element in elements {
        while let Some(leg) = legs.next_if(|leg| leg.source.line <= element.source.line) {
            edge = (leg.tip, leg.d_out_mm.abs());
        }
        let [du, dv] = vector(edge.0, edge.1);
        let shift = |position: &mut [f64; 3]| {
            position[u] += du;
            position[v] += dv;
        };
        shift(&mut element.end);
        if let Shape::Arc(arc) = &mut element.shape {
            shift(&mut arc.center);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn s73_the_centre_lies_beside_the_tip_as_the_chart_says() {
        assert_eq!(vector(3, 0.8), [-0.8, -0.8]);
        assert_eq!(vector(9, 0.8), [0.0, 0.0]);
        // Opposite edges lie opposite each other.
        for (one, other) in [(1, 3), (2, 4), (5, 7), (6, 8)] {
            assert_eq!(vector(one, 1.0).map(|part| -part), vector(other, 1.0));
        }
    }
}
