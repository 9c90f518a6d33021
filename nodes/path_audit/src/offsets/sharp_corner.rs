//! Recognises a sharp inside corner that takes whole chords of the two curves that meet in it.
//!
//! The path leaves such chords out as it would leave out a piece of an arc. They are no missed
//! feature.

use crate::geometry::planar::{Piece, Point, cross, unit};

/// Chords of a curve bend less than this, rad, and are less than [`CHORD_MM`] off it.
const CHORD_TURN_RAD: f64 = 0.12;
const CHORD_MM: f64 = 0.052;
/// Shorter chords are merged, mm: their directions are noise.
const SHORT_MM: f64 = 0.2;
/// The most points of one arc.
const STEPS_MAX: f64 = 1000.0;

/// Whether legs are two curves that meet in one sharp inside corner. The tool goes from the first
/// to the last of them at `joint`.
pub(crate) fn is_corner_of_curves(
    legs: impl Iterator<Item = Piece>,
    joint: Point,
    d_mm: f64,
) -> bool {
    let mut points: Vec<Point> = Vec::new();
    // Where the first leg ends and the last begins: the corner is there or between them.
    let (mut first_end, mut last_start) = (0, 0);
    let mut legs = legs.peekable();
    while let Some(leg) = legs.next() {
        // An arc between the two is a feature if it is more than a chord.
        if !points.is_empty() && legs.peek().is_some() && leg.bulge() > CHORD_MM {
            return false;
        }
        let is_first = points.is_empty();
        let steps = leg.round.map_or(1.0, |round| {
            // As fine as the chords of a curve.
            let step = (CHORD_TURN_RAD / 1.5).min((2.0 * CHORD_MM / round.radius).sqrt());
            (round.sweep.abs() / step).ceil().clamp(1.0, STEPS_MAX)
        }) as u32;
        let length = leg.length() / f64::from(steps);
        // Of the first and the last leg only the ends at the corner count.
        if is_first {
            points.extend([leg.at(length * f64::from(steps - 1)), leg.to]);
            first_end = 1;
            continue;
        }
        last_start = points.len() - 1;
        if legs.peek().is_none() {
            points.push(leg.at(length));
            continue;
        }
        points.extend((1..steps).map(|step| leg.at(length * f64::from(step))));
        points.push(leg.to);
    }
    let from_joint = |point: &Point| (point - joint).norm();
    // The corner is the point farthest from the tool, between the two legs that it touches.
    let corner = (first_end..=last_start)
        .max_by(|&a, &b| from_joint(&points[a]).total_cmp(&from_joint(&points[b])));
    let Some(corner) = corner else { return false };
    let before = thinned(points[..=corner].iter().rev().copied());
    let after = thinned(points[corner..].iter().copied());
    let (Some(backward), Some(forward)) = (first_chord(&before), first_chord(&after)) else {
        return false;
    };
    // Both directions lead away from the corner.
    let turn = cross(-backward, forward) * d_mm.signum();
    (turn > CHORD_TURN_RAD || backward.dot(&forward) > 0.0 && turn > 0.0)
        && is_curve(&before)
        && is_curve(&after)
}

fn first_chord(points: &[Point]) -> Option<Point> {
    Some(unit(points.get(1)? - points[0]))
}

/// Drops points that are near to the one before; keeps the last.
fn thinned(points: impl Iterator<Item = Point>) -> Vec<Point> {
    let mut thinned: Vec<Point> = Vec::new();
    let mut skipped = None;
    for point in points {
        match thinned.last() {
            Some(last) if (point - last).norm() < SHORT_MM => skipped = Some(point),
            _ => {
                thinned.push(point);
                skipped = None;
            }
        }
    }
    if let Some(last) = skipped {
        if thinned.len() > 1 {
            thinned.pop();
        }
        thinned.push(last);
    }
    thinned
}

/// Whether a polyline bends as chords of a curve do.
fn is_curve(points: &[Point]) -> bool {
    points.windows(3).all(|points| {
        let (a, b) = (points[1] - points[0], points[2] - points[1]);
        let sine = cross(unit(a), unit(b)).abs();
        a.dot(&b) > 0.0 && sine <= CHORD_TURN_RAD && a.norm().min(b.norm()) * sine / 4.0 <= CHORD_MM
    })
}
