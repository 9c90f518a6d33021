//! Proves cheaply that two pieces are at least a limit apart.
//!
//! Each test is a lower bound of the exact distance. It may fail to see that two pieces are apart,
//! but it never calls near pieces apart. `planar::nearest` decides the rest.

use crate::geometry::pieces::Bow;
#[cfg(test)]
use crate::geometry::planar::{Piece, Round, nearest};
use crate::geometry::planar::{Point, cross, on_segment};

type Chord = (Point, Point);

/// A point relative to a segment, in units of its length: how far along it, and how far to its
/// left.
#[derive(Clone, Copy)]
struct Projection {
    along: f64,
    left: f64,
}

impl Projection {
    #[inline]
    fn new(segment: Point, point: Point) -> Self {
        Self { along: segment.dot(&point), left: cross(segment, point) }
    }

    /// Whether the point is nearer to the segment than the limit, exactly.
    #[inline]
    fn is_near(self, length_squared: f64, to_ends: (f64, f64), squared: f64) -> bool {
        if self.along <= 0.0 {
            to_ends.0 < squared
        } else if self.along >= length_squared {
            to_ends.1 < squared
        } else {
            self.left * self.left < squared * length_squared
        }
    }
}

/// Whether two segments are at least `limit` mm apart: exact, without a division.
#[inline]
pub(crate) fn are_chords_apart(a: Chord, b: Chord, limit: f64) -> bool {
    let squared = limit * limit;
    let (da, db) = (a.1 - a.0, b.1 - b.0);
    let (to_b0, to_b1) = (b.0 - a.0, b.1 - a.0);
    let (b0, b1) = (Projection::new(da, to_b0), Projection::new(da, to_b1));
    let long_a = da.norm_squared();
    // All of one segment is on one side of the other's line, or before or after it, and far away.
    let least = squared * long_a;
    let is_far = |of: f64| of > 0.0 && of * of >= least;
    if is_far(b0.left.min(b1.left))
        || is_far((-b0.left).min(-b1.left))
        || is_far(b0.along.min(b1.along) - long_a)
        || is_far((-b0.along).min(-b1.along))
    {
        return true;
    }
    let ends = [to_b0, to_b1, b.0 - a.1, b.1 - a.1].map(|apart| apart.norm_squared());
    if b0.is_near(long_a, (ends[0], ends[2]), squared)
        || b1.is_near(long_a, (ends[1], ends[3]), squared)
    {
        return false;
    }
    let (a0, a1) = (Projection::new(db, -to_b0), Projection::new(db, a.1 - b.0));
    let is_crossed = b0.left * b1.left < 0.0 && a0.left * a1.left < 0.0;
    let long_b = db.norm_squared();
    !(is_crossed
        || a0.is_near(long_b, (ends[0], ends[1]), squared)
        || a1.is_near(long_b, (ends[2], ends[3]), squared))
}

/// Whether two pieces with these chords are at least `limit` mm apart.
pub(crate) fn are_pieces_apart(
    a: Chord,
    of_a: Option<&Bow>,
    b: Chord,
    of_b: Option<&Bow>,
    limit: f64,
) -> bool {
    if limit <= 0.0 {
        return true;
    }
    if of_a.is_none() && of_b.is_none() {
        return are_chords_apart(a, b, limit);
    }
    if let (Some(one), Some(other)) = (of_a, of_b) {
        let (r, s) = (one.round.radius, other.round.radius);
        let between = (one.round.center - other.round.center).norm();
        let limit = limit + one.uneven + other.uneven;
        if (r - s).abs() - between >= limit || between - r - s >= limit {
            return true;
        }
    }
    let bulge = |bow: Option<&Bow>| bow.map_or(0.0, |bow| bow.bulge);
    let (mut off_a, mut off_b) = (bulge(of_a), bulge(of_b));
    if of_b.is_some_and(|bow| is_on_flat_side(b, bow, a, off_a)) {
        off_b = of_b.map_or(0.0, |bow| bow.uneven);
    }
    if of_a.is_some_and(|bow| is_on_flat_side(a, bow, b, bulge(of_b))) {
        off_a = of_a.map_or(0.0, |bow| bow.uneven);
    }
    are_chords_apart(a, b, limit + off_a + off_b)
        || match (of_a, of_b) {
            (Some(bow), None) => {
                is_off_circle(b, bow, limit)
                    || is_behind(a, bow, b, limit)
                    || is_around(a, bow, b, limit)
            }
            (None, Some(bow)) => {
                is_off_circle(a, bow, limit)
                    || is_behind(b, bow, a, limit)
                    || is_around(b, bow, a, limit)
            }
            _ => false,
        }
}

/// Whether everything within `bulge` of a chord lies on the flat side of an arc. From there the
/// arc's own chord is its nearest part.
fn is_on_flat_side(chord: Chord, bow: &Bow, other: Chord, bulge: f64) -> bool {
    if bow.round.sweep.abs() > std::f64::consts::PI {
        return false;
    }
    let along = chord.1 - chord.0;
    // Counter-clockwise arcs lie to the right of their chord.
    let side = |point: Point| cross(along, point - chord.0) * bow.round.sweep.signum();
    let least = side(other.0).min(side(other.1));
    least >= bulge * along.norm()
}

/// Whether a segment lies so far behind an arc, as one sees it from outside, in every direction from
/// the centre to a point of the arc.
fn is_behind(arc: Chord, bow: &Bow, segment: Chord, limit: f64) -> bool {
    /// Beyond this, rad, directions between both ends may be far from both.
    const SWEEP_MAX: f64 = 2.3;
    let (center, radius) = (bow.round.center, bow.round.radius);
    let most = radius - limit - bow.uneven;
    if most <= 0.0 || bow.round.sweep.abs() > SWEEP_MAX {
        return false;
    }
    let (from, to) = (arc.0 - center, arc.1 - center);
    let turn = bow.round.sweep.signum();
    [segment.0, segment.1].into_iter().all(|end| {
        let out = end - center;
        let is_faced = cross(from, out) * turn >= 0.0 && cross(out, to) * turn >= 0.0;
        from.dot(&out).max(to.dot(&out)) <= most * (radius - bow.uneven)
            && (!is_faced || out.norm_squared() <= most * most)
    })
}

/// Whether a segment is inside or outside the whole circle of an arc, and so far from it.
fn is_off_circle(chord: Chord, bow: &Bow, limit: f64) -> bool {
    let (center, radius) = (bow.round.center, bow.round.radius);
    let limit = limit + bow.uneven;
    let inner = radius - limit;
    let is_in = |point: Point| (point - center).norm_squared() <= inner * inner;
    let outer = radius + limit;
    inner > 0.0 && is_in(chord.0) && is_in(chord.1)
        || (on_segment(chord.0, chord.1, center) - center).norm_squared() >= outer * outer
}

/// Whether a segment lies beyond the centre of an arc, like a wall whose end the tool goes around.
///
/// A point `p` and a point `q` of the arc, both relative to the centre, are `√(p² + r² - 2 p·q)`
/// apart. `p·q` is greatest at an end of the segment, and at an end of the arc if the arc does not
/// face it.
fn is_around(chord: Chord, bow: &Bow, other: Chord, limit: f64) -> bool {
    let (center, radius, sweep) = (bow.round.center, bow.round.radius, bow.round.sweep);
    if sweep.abs() > std::f64::consts::PI {
        return false;
    }
    let (from, to) = (chord.0 - center, chord.1 - center);
    let most = |point: Point| {
        let out = point - center;
        let is_faced = cross(from, out) * sweep >= 0.0 && cross(out, to) * sweep >= 0.0;
        if is_faced { out.norm() * radius } else { out.dot(&from).max(out.dot(&to)) }
    };
    // From an end that is off the circle it may be nearer by that much.
    let needed = limit + bow.uneven;
    radius * radius - 2.0 * most(other.0).max(most(other.1)) >= needed * needed
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Numbers from 0 to 1 that look random.
    struct Numbers(u64);

    impl Numbers {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn between(&mut self, low: f64, high: f64) -> f64 {
            low + (high - low) * self.next()
        }

        fn point(&mut self) -> Point {
            Point::new(self.between(-5.0, 5.0), self.between(-5.0, 5.0))
        }

        fn piece(&mut self) -> Piece {
            let from = self.point();
            if self.next() < 0.4 {
                return Piece::line(from, self.point());
            }
            let center = self.point();
            let out = from - center;
            let most = if self.next() < 0.5 { 1.0 } else { TAU };
            let sweep = self.between(-most, most);
            let (sin, cos) = sweep.sin_cos();
            let to = center + Point::new(out.x * cos - out.y * sin, out.x * sin + out.y * cos);
            // Some endpoints are off their circle.
            let off = if self.next() < 0.2 { self.point() * 1e-3 } else { Point::zeros() };
            Piece { from, to: to + off, round: Some(Round { center, radius: out.norm(), sweep }) }
        }
    }

    #[test]
    fn pieces_are_never_said_to_be_apart_that_are_not() {
        let mut numbers = Numbers(1);
        let (mut apart, mut rejected) = (0, 0);
        for case in 0..200_000 {
            let a = numbers.piece();
            // As a tool runs along its walls.
            let parallel = a.offset(numbers.between(-2.0, 2.0)).filter(|_| case % 2 == 0);
            // Or around their ends.
            let around = a.round.filter(|_| case % 5 == 0);
            let around = around.map(|round| Piece::line(round.center, numbers.point()));
            let b = parallel.or(around).unwrap_or_else(|| numbers.piece());
            let exact = nearest(&a, &b).distance;
            let limit = match case % 3 {
                0 => exact + numbers.between(-1e-3, 1e-3),
                _ => numbers.between(0.0, 3.0),
            };
            let chord = |piece: &Piece| (piece.from, piece.to);
            let (of_a, of_b) = (Bow::of(&a), Bow::of(&b));
            let is_apart =
                are_pieces_apart(chord(&a), of_a.as_ref(), chord(&b), of_b.as_ref(), limit);
            assert!(!is_apart || exact >= limit - 1e-12, "{exact} {limit} {a:?} {b:?}");
            apart += u32::from(exact >= limit);
            rejected += u32::from(is_apart);
            if a.is_line() && b.is_line() {
                let is_on_edge = (exact - limit).abs() < 1e-12;
                assert!(is_on_edge || is_apart == (exact >= limit), "{exact} {limit} {a:?} {b:?}");
            }
        }
        assert!(rejected * 10 > apart * 8, "{rejected} of {apart} are seen");
    }
}
