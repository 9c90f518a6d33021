//! A and C: fillets and chamfers between two motions of a profile.
//!
//! A fillet touches both motions, whether they are lines or arcs. A chamfer is a line between the same two places.

use super::piece::{Circle, PARALLEL, Piece, Point, along, apart, cross, dot, minus};
use super::{SAME_MM, Trouble};

/// What is between a motion and the next one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Bevel {
    /// A, with its radius, mm.
    Fillet(f64),
    /// C: a straight with the ends that a fillet of this radius has.
    Chamfer(f64),
}

/// A motion of the profile, and the corner at its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Corner {
    pub(crate) piece: Piece,
    pub(crate) bevel: Option<Bevel>,
}

/// The pieces of a profile with its fillets and chamfers. Motions of no length are left out.
pub(super) fn cut(profile: &[Corner]) -> Result<Vec<Piece>, Trouble> {
    let mut pieces: Vec<Piece> = Vec::with_capacity(2 * profile.len());
    let mut bevel = None;
    for corner in profile {
        let mut next = corner.piece;
        if next.circle.is_none() && apart(next.from, next.to) <= SAME_MM {
            bevel = corner.bevel.or(bevel);
            continue;
        }
        if let Some(last) = pieces.last_mut() {
            let (before, after) = (last.direction(last.to), next.direction(next.from));
            let turns = cross(before, after);
            if turns.abs() < PARALLEL && dot(before, after) < 0.0 {
                return Err(Trouble::Reverses { origin: next.origin });
            }
            if let Some(bevel) = bevel.filter(|_| turns.abs() >= PARALLEL) {
                let between = between(last, &mut next, bevel, turns > 0.0)?;
                // All of it may be cut away.
                if apart(last.from, last.to) <= SAME_MM {
                    pieces.pop();
                }
                pieces.push(between);
            }
        }
        bevel = corner.bevel;
        if apart(next.from, next.to) > SAME_MM || next.circle.is_some() {
            pieces.push(next);
        }
    }
    Ok(pieces)
}

/// Shortens two pieces that meet in a corner; returns what is between them then.
fn between(
    last: &mut Piece,
    next: &mut Piece,
    bevel: Bevel,
    is_left: bool,
) -> Result<Piece, Trouble> {
    let (Bevel::Fillet(radius) | Bevel::Chamfer(radius)) = bevel;
    let lengths_mm = [last.length(), next.length()];
    let too_large = Trouble::Corner { origin: last.origin, size_mm: radius, lengths_mm };
    let corner = last.to;
    let by = if is_left { radius } else { -radius };
    let (Some(one), Some(two)) = (last.shifted(by), next.shifted(by)) else {
        return Err(too_large);
    };
    let mut best: Option<(Point, Point, Point)> = None;
    for center in one.meets(&two) {
        let (from, to) = (touch(last, center), touch(next, center));
        let is_nearer = best.is_none_or(|it| apart(center, corner) < apart(it.0, corner));
        if last.has(from) && next.has(to) && is_nearer {
            best = Some((center, from, to));
        }
    }
    let Some((center, from, to)) = best else { return Err(too_large) };
    (last.to, next.from) = (from, to);
    let circle = Circle { center, counterclockwise: is_left };
    Ok(Piece {
        from,
        to,
        circle: matches!(bevel, Bevel::Fillet(_)).then_some(circle),
        origin: last.origin,
    })
}

/// Where a circle about this place touches the line or circle of a piece.
fn touch(piece: &Piece, center: Point) -> Point {
    match piece.circle {
        None => {
            let direction = piece.direction(piece.from);
            along(piece.from, direction, dot(minus(center, piece.from), direction))
        }
        Some(circle) => {
            let off = apart(center, circle.center);
            along(circle.center, minus(center, circle.center), piece.radius() / off)
        }
    }
}
