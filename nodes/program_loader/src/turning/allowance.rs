//! D and E: the path that keeps a distance from the profile.
//!
//! All within a [`Frame`](super::frame::Frame): the path is to the left of the profile. Each piece is moved there,
//! outside corners become arcs, and of all that only remains what is nowhere nearer to the profile.

use super::piece::{Circle, PARALLEL, Piece, apart, cross, left};
use super::{SAME_MM, Trouble};

/// What remains of two pieces that meet may end so far apart, mm: it is shorter than a controller's unit.
const JOIN_MM: f64 = 1e-4;

pub(super) fn keep_distance(profile: &[Piece], mm: f64) -> Result<Vec<Piece>, Trouble> {
    if mm <= 0.0 {
        return Ok(profile.to_vec());
    }
    let moved = moved(profile, mm);
    let mut path: Vec<Piece> = Vec::with_capacity(moved.len());
    for (index, piece) in moved.iter().enumerate() {
        let mut ways = vec![0.0, piece.length()];
        for other in moved.iter().enumerate().filter(|it| it.0 != index).map(|it| it.1) {
            if are_apart(piece, other) {
                continue;
            }
            let places =
                piece.meets(other).into_iter().filter(|&at| piece.has(at) && other.has(at));
            ways.extend(places.map(|at| piece.way(at)));
        }
        ways.sort_by(f64::total_cmp);
        let mut from = 0.0;
        for &to in &ways[1..] {
            let to = to.min(piece.length());
            if to - from <= SAME_MM {
                continue;
            }
            let is_whole = from == 0.0 && to == piece.length();
            let part = match is_whole {
                true => *piece,
                false => piece.between(piece.at(from), piece.at(to)),
            };
            let middle = piece.at(f64::midpoint(from, to));
            from = to;
            if profile
                .iter()
                .all(|it| is_far(it, middle, mm) || it.distance(middle) >= mm - SAME_MM)
            {
                join(&mut path, part, mm)?;
            }
        }
    }
    match path.is_empty() {
        true => Err(Trouble::Distance { mm }),
        false => Ok(path),
    }
}

/// Adds the next part, which begins where the last one ends.
fn join(path: &mut Vec<Piece>, mut part: Piece, mm: f64) -> Result<(), Trouble> {
    if let Some(last) = path.last_mut() {
        if apart(last.to, part.from) > JOIN_MM {
            return Err(Trouble::Distance { mm });
        }
        part.from = last.to;
        let continues = last.origin == part.origin && last.circle == part.circle;
        let is_straight = last.circle.is_some()
            || cross(last.direction(last.to), part.direction(part.from)).abs() < PARALLEL;
        if continues && is_straight {
            last.to = part.to;
            return Ok(());
        }
    }
    path.push(part);
    Ok(())
}

/// Each piece at this distance, and arcs about the outside corners.
fn moved(profile: &[Piece], mm: f64) -> Vec<Piece> {
    let mut moved = Vec::with_capacity(2 * profile.len());
    let mut last: Option<&Piece> = None;
    for piece in profile {
        if let Some(last) = last {
            let (before, after) = (last.direction(last.to), piece.direction(piece.from));
            if cross(before, after) <= -PARALLEL {
                let place = |direction| super::piece::along(last.to, left(direction), mm);
                moved.push(Piece {
                    from: place(before),
                    to: place(after),
                    circle: Some(Circle { center: last.to, counterclockwise: false }),
                    origin: piece.origin,
                });
            }
        }
        moved.extend(piece.shifted(mm));
        last = Some(piece);
    }
    moved
}

/// Whether two pieces are so far from each other along the profile that they cannot meet.
fn are_apart(one: &Piece, other: &Piece) -> bool {
    one.from[0].max(one.to[0]) + SAME_MM < other.from[0].min(other.to[0])
        || other.from[0].max(other.to[0]) + SAME_MM < one.from[0].min(one.to[0])
}

/// Whether a piece is farther than this along the profile alone.
fn is_far(piece: &Piece, at: super::Point, mm: f64) -> bool {
    piece.from[0] - at[0] > mm + super::RUNS_BACK_MM_MAX
        || at[0] - piece.to[0] > mm + super::RUNS_BACK_MM_MAX
}
