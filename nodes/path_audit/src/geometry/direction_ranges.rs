//! Finds consecutive legs whose directions are so similar that they cannot meet each other.
//!
//! Where all directions lie within [`RANGE_RAD`], every step advances along the middle direction by
//! most of its length. So two places are as far apart as a part of the path between them.

use crate::geometry::pieces::Pieces;
#[cfg(test)]
use crate::geometry::planar::Piece;
use crate::geometry::planar::{Point, cross, left};

/// A range covers at most 60°, rad; and its cosine.
const RANGE_RAD: f64 = std::f64::consts::FRAC_PI_3;
const RANGE_COS: f64 = 0.5;

/// The rightmost and the leftmost direction of some legs, as vectors of any length. `f32` takes
/// half the memory and is exact enough for so coarse an angle. All zeros: the directions differ too
/// much.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DirectionRange([f32; 4]);

impl DirectionRange {
    const NONE: Self = Self([0.0; 4]);

    fn new(right: Point, left: Point) -> Self {
        Self([right.x as f32, right.y as f32, left.x as f32, left.y as f32])
    }

    fn edges(self) -> (Point, Point) {
        let [a, b, c, d] = self.0.map(f64::from);
        (Point::new(a, b), Point::new(c, d))
    }

    pub(crate) fn is_any(self) -> bool {
        self.0 != Self::NONE.0
    }

    /// Extends the range by one direction.
    fn with(self, direction: Point) -> Self {
        let (mut right, mut left) = self.edges();
        if !(direction.dot(&right) > 0.0 && direction.dot(&left) > 0.0) {
            return Self::NONE;
        }
        if cross(left, direction) > 0.0 {
            left = direction;
        }
        if cross(right, direction) < 0.0 {
            right = direction;
        }
        let cosine = right.dot(&left);
        let least = RANGE_COS * RANGE_COS * right.norm_squared() * left.norm_squared();
        if cosine > 0.0 && cosine * cosine >= least { Self::new(right, left) } else { Self::NONE }
    }

    /// Joins two ranges.
    pub(crate) fn and(self, other: Self) -> Self {
        if !other.is_any() {
            return Self::NONE;
        }
        let (right, left) = other.edges();
        self.with(right).with(left)
    }

    /// The range of one leg.
    fn of(legs: &Pieces, index: usize) -> Self {
        let (from, to) = legs.chord(index);
        let Some(bow) = legs.bow(index) else { return Self::new(to - from, to - from) };
        if bow.round.sweep.abs() > RANGE_RAD {
            return Self::NONE;
        }
        let tangent = |at: Point| left(at - bow.round.center) * bow.round.sweep.signum();
        Self::new(tangent(from), tangent(from)).with(tangent(to))
    }

    /// The range of several legs.
    pub(crate) fn of_all(legs: &Pieces, mut range: std::ops::Range<usize>) -> Self {
        let Some(first) = range.next() else { return Self::NONE };
        range.fold(Self::of(legs, first), |all, index| match legs.bow(index) {
            None => all.with(legs.end(index) - legs.begin(index)),
            Some(_) => all.and(Self::of(legs, index)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range_of(directions: &[f64]) -> DirectionRange {
        let mut at = Point::zeros();
        let legs: Vec<Piece> = (directions.iter())
            .map(|degrees| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let from = at;
                at += Point::new(cos, sin) * 1e-3;
                Piece::line(from, at)
            })
            .collect();
        let legs = Pieces::new(legs.into_iter());
        DirectionRange::of_all(&legs, 0..legs.count())
    }

    #[test]
    fn a_range_is_no_wider_than_sixty_degrees() {
        for start in [0.0, 100.0, 170.0, 250.0, 359.0] {
            for (turns, is_any) in [
                (&[0.0, 59.0][..], true),
                (&[0.0, 61.0], false),
                (&[0.0, -59.0, -20.0], true),
                (&[0.0, 31.0, -30.0], false),
                (&[0.0, 50.0, 170.0], false),
                (&[0.0, 180.0], false),
                (&[0.0, -50.0, 130.0, 0.0], false),
                (&[0.0, 120.0, 240.0], false),
            ] {
                let directions: Vec<f64> = turns.iter().map(|turn| start + turn).collect();
                assert_eq!(range_of(&directions).is_any(), is_any, "{directions:?}");
            }
        }
        assert!(!range_of(&[0.0, 50.0]).and(range_of(&[70.0, 90.0])).is_any());
        assert!(range_of(&[0.0, 30.0]).and(range_of(&[20.0, 50.0])).is_any());
    }
}
