//! Draws the contours of a program and the places of their leads.

use super::{Job, outline};
use crate::piece::{Piece, Point, point};
use crate::program::Role;
use crate::random::Random;
use std::f64::consts::PI;

/// A block of a contour before it is written.
pub(super) struct Planned {
    pub piece: Piece,
    pub pass: usize,
    pub role: Role,
    pub is_copy: bool,
    /// Before it the tool goes down.
    pub goes_down: bool,
}

impl Planned {
    const fn wall(piece: Piece) -> Self {
        Self { piece, pass: 0, role: Role::Wall, is_copy: false, goes_down: false }
    }
}

/// Where a lead begins or ends.
pub(super) fn lead(
    at: Point,
    direction: Point,
    side: f64,
    radius_mm: f64,
    random: &mut Random,
) -> Point {
    let normal = direction.left() * side;
    let angle = random.of(&[
        0.0, 0.0, 0.0, 0.0, 20.0, -20.0, 45.0, -45.0, 70.0, -70.0, 90.0, -90.0, 120.0, -120.0,
        180.0,
    ]);
    let angle = match random.below(8) {
        0 | 1 => random.between(-100.0, 100.0),
        2..6 => 0.0,
        _ => angle,
    };
    let length = radius_mm * random.of(&[1.01, 1.2, 1.5, 2.0, 3.0, 6.0]) + 0.01;
    at + normal.turned(angle * PI / 180.0) * length
}

/// A closed contour with what is before and after it; and whether its legs cross.
pub(super) fn closed(
    job: &mut Job,
    side: f64,
    angle: f64,
    origin: Point,
    random: &mut Random,
) -> (Vec<Planned>, bool) {
    let radius_mm = job.radius_mm;
    let may_be_whole = job.language.has_full_circle;
    let mut ring: Vec<Piece> = outline::closed(random, job.drawn_mm);
    while ring.len() == 1 && !may_be_whole {
        ring = outline::closed(random, job.drawn_mm);
    }
    let ring: Vec<Piece> = ring.iter().map(|piece| piece.placed(angle, origin)).collect();
    let (first, last) = (ring[0], ring[ring.len() - 1]);
    let is_smooth = last.direction(1.0).dot(first.direction(0.0)) > 1.0 - 1e-9;
    let mut planned: Vec<Planned> = ring.iter().copied().map(Planned::wall).collect();
    if let (false, Piece::Line { start, .. }, Piece::Line { end, .. }, true) =
        (is_smooth, first, last, random.once_in(2))
    {
        job.features.push("legs that cross");
        let mut out = || radius_mm * random.between(0.3, 3.0);
        let count = planned.len();
        let from = start - first.direction(0.0) * out();
        planned[0].piece = Piece::line(from, first.end());
        let to = end + last.direction(1.0) * out();
        planned[count - 1].piece = Piece::line(last.start(), to);
        return (planned, true);
    }
    match random.below(4) {
        0 => {
            job.features.push("overlap");
            let more = random.of(&[0.01, 0.1, 0.5, 1.0, 1.3, ring.len() as f64]);
            for (index, piece) in ring.iter().enumerate() {
                let part = (more - index as f64).clamp(0.0, 1.0);
                let piece = piece.between(0.0, part);
                if piece.length() > 0.01 {
                    planned.push(Planned { is_copy: true, ..Planned::wall(piece) });
                }
            }
        }
        1 if job.language.has_depths => {
            job.features.push("several depths");
            for pass in 1..=1 + random.below(2) {
                let at_depth = ring.iter().enumerate().map(|(index, &piece)| Planned {
                    pass,
                    goes_down: index == 0,
                    ..Planned::wall(piece)
                });
                planned.extend(at_depth);
            }
        }
        _ => {}
    }
    let Some(end) = planned
        .last()
        .map(|planned| (planned.piece.end(), planned.piece.direction(1.0), planned.pass))
    else {
        return (planned, false);
    };
    if is_smooth && !random.once_in(4) {
        job.features.push("roll in");
        let tail = roll(first.start(), first.direction(0.0), side, radius_mm, random);
        let role = Role::Tail { is_at_end: false };
        let tail = tail.into_iter().rev().map(|piece| Planned { role, ..Planned::wall(piece) });
        planned.splice(0..0, tail);
    }
    let (at, direction, pass) = end;
    if is_smooth && !random.once_in(4) {
        job.features.push("roll out");
        // The same as rolling in, backwards, with the tool on the other side.
        let tail = roll(at, direction * -1.0, -side, radius_mm, random);
        let role = Role::Tail { is_at_end: true };
        planned.extend(tail.into_iter().map(|piece| Planned {
            role,
            pass,
            ..Planned::wall(piece.reversed())
        }));
    }
    (planned, false)
}

/// An arc that rolls onto a contour at a place, and sometimes a straight before it; the arc first.
fn roll(at: Point, direction: Point, side: f64, radius_mm: f64, random: &mut Random) -> Vec<Piece> {
    let size = radius_mm * random.of(&[0.8, 1.05, 1.2, 1.5, 2.0, 3.0]);
    let sweep = side * PI / 180.0 * random.of(&[90.0, 90.0, 45.0, 30.0, 120.0]);
    let center = at + direction.left() * (side * size);
    let to = at - center;
    let arc = Piece::Arc { center, radius: size, from: to.v.atan2(to.u) - sweep, sweep };
    let mut tail = vec![arc];
    if random.once_in(3) {
        let length = radius_mm * random.between(0.5, 2.0);
        tail.push(Piece::line(arc.start() - arc.direction(0.0) * length, arc.start()));
    }
    tail
}

/// An open contour.
pub(super) fn open(job: &Job, angle: f64, origin: Point, random: &mut Random) -> Vec<Planned> {
    let way = outline::open(random, job.drawn_mm);
    let start = way.first().map_or(point(0.0, 0.0), Piece::start).turned(angle);
    way.iter().map(|piece| Planned::wall(piece.placed(angle, origin - start))).collect()
}
