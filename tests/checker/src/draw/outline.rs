//! Contours as they would be on a drawing: closed and open, of lines and arcs.

use crate::piece::{Piece, Point, point};
use crate::random::Random;
use std::f64::consts::{PI, TAU};

/// A closed contour that begins in the middle of an element, or at a corner.
pub(super) fn closed(random: &mut Random, radius: f64) -> Vec<Piece> {
    let mut ring = match random.below(7) {
        0 | 1 => circle(random, radius),
        2 => slot(random, radius),
        _ => star(random, radius),
    };
    if random.once_in(2) {
        ring.reverse();
        ring.iter_mut().for_each(|piece| *piece = piece.reversed());
    }
    let first = random.below(ring.len());
    ring.rotate_left(first);
    if !random.once_in(4) {
        // Not at a corner.
        let longest =
            (0..ring.len()).max_by(|&a, &b| ring[a].length().total_cmp(&ring[b].length()));
        ring.rotate_left(longest.unwrap_or(0));
        if let (Piece::Line { .. }, true) = (ring[0], ring.len() > 1) {
            let at = random.between(0.3, 0.7);
            let first = ring[0];
            ring[0] = first.between(at, 1.0);
            ring.push(first.between(0.0, at));
        }
    }
    ring
}

/// In one to four blocks.
fn circle(random: &mut Random, radius: f64) -> Vec<Piece> {
    let size = radius * random.of(&[0.9, 1.0, 1.001, 1.3, 2.0, 3.0, 7.0]);
    let any = random.between(0.0, TAU);
    let from = random.of(&[0.0, PI / 2.0, PI, any]);
    let count = 1 + random.below(4);
    let whole = Piece::Arc { center: point(0.0, 0.0), radius: size, from, sweep: TAU };
    let part = |index: usize| index as f64 / count as f64;
    (0..count).map(|index| whole.between(part(index), part(index + 1))).collect()
}

/// A rectangle with rounded corners, as a boss or as a slot that is about as wide as the tool.
fn slot(random: &mut Random, radius: f64) -> Vec<Piece> {
    let width = radius * random.of(&[1.9, 2.0, 2.001, 2.2, 3.0, 6.0]);
    let length = width * random.between(1.0, 4.0);
    let corners = [(0.0, 0.0), (length, 0.0), (length, width), (0.0, width)];
    let corners = corners.map(|(u, v)| point(u, v));
    let fillet =
        random.of(&[0.0, 0.3 * radius, radius, 1.001 * radius, 1.2 * radius, 0.49 * width]);
    rounded(&corners, &[fillet; 4], true)
}

/// Around a middle, with corners that turn either way.
fn star(random: &mut Random, radius: f64) -> Vec<Piece> {
    let count = 3 + random.below(7);
    let size = radius * random.of(&[2.0, 4.0, 8.0, 15.0, 30.0]);
    let rough = random.between(0.0, 0.6);
    let mut corners = Vec::new();
    for index in 0..count {
        let angle = TAU * (index as f64 + random.between(0.0, 0.7)) / count as f64;
        let out = size * (1.0 - random.between(0.0, rough));
        corners.push(point(out, 0.0).turned(angle));
        if random.once_in(8) {
            // A small element.
            let small = random.of(&[0.004, 0.02, 0.1, 0.5]);
            let aside = point(small, 0.0).turned(random.between(0.0, TAU));
            corners.push(corners[corners.len() - 1] + aside);
        }
    }
    let fillets = fillets(random, radius, corners.len());
    let mut ring = rounded(&corners, &fillets, true);
    bend(random, &mut ring);
    ring
}

/// A contour with two free ends.
pub(super) fn open(random: &mut Random, radius: f64) -> Vec<Piece> {
    if random.once_in(3) {
        let mut part = star(random, radius);
        let left = 1 + random.below(part.len());
        part.truncate(left);
        return part;
    }
    let mut corners = vec![point(0.0, 0.0)];
    let mut angle = random.between(0.0, TAU);
    for _ in 0..1 + random.below(8) {
        let length = radius * random.of(&[0.3, 1.0, 2.0, 4.0, 8.0]) * random.between(0.8, 1.2);
        let last = corners[corners.len() - 1];
        corners.push(last + point(length, 0.0).turned(angle));
        let (any, small) = (random.between(-2.4, 2.4), random.between(-0.9, 0.9));
        angle += random.of(&[PI / 2.0, -PI / 2.0, any, small]);
    }
    let fillets = fillets(random, radius, corners.len());
    let mut way = rounded(&corners, &fillets, false);
    if random.once_in(2) {
        bend(random, &mut way);
    }
    way
}

fn fillets(random: &mut Random, radius: f64, count: usize) -> Vec<f64> {
    let most = random.of(&[0.0, 0.3, 0.6, 1.0]);
    let one = |random: &mut Random| {
        let times = random.of(&[0.1, 0.5, 0.9, 1.0, 1.0, 1.002, 1.1, 1.5, 3.0]);
        if random.between(0.0, 1.0) < most { times * radius } else { 0.0 }
    };
    (0..count).map(|_| one(random)).collect()
}

/// Lines from corner to corner, with fillets where they have room.
fn rounded(corners: &[Point], fillets: &[f64], is_closed: bool) -> Vec<Piece> {
    let count = corners.len();
    let is_end = |index: usize| !is_closed && (index == 0 || index + 1 == count);
    let ends: Vec<(Point, Point, Option<Piece>)> = (0..count)
        .map(|index| {
            let (at, fillet) = (corners[index], fillets[index]);
            let sharp = (at, at, None);
            if is_end(index) || fillet == 0.0 {
                return sharp;
            }
            let (before, after) =
                (corners[(index + count - 1) % count], corners[(index + 1) % count]);
            let (ahead, next) = ((at - before).unit(), (after - at).unit());
            let turn = ahead.cross(next).atan2(ahead.dot(next));
            let cut = fillet * (turn.abs() / 2.0).tan();
            if turn.abs() < 0.02 || cut > 0.495 * before.to(at).min(at.to(after)) {
                return sharp;
            }
            let (from, to) = (at - ahead * cut, at + next * cut);
            let center = from + ahead.left() * (fillet * turn.signum());
            (from, to, Some(Piece::arc(from, to, center, turn > 0.0)))
        })
        .collect();
    let mut pieces = Vec::new();
    let lines = if is_closed { count } else { count - 1 };
    for index in 0..lines {
        let next = (index + 1) % count;
        let (from, to) = (ends[index].1, ends[next].0);
        if from.to(to) > 1e-6 {
            pieces.push(Piece::line(from, to));
        }
        pieces.extend(ends[next].2);
    }
    pieces
}

/// Some straights become arcs.
fn bend(random: &mut Random, pieces: &mut [Piece]) {
    for index in 0..pieces.len() {
        let is_free = |other: usize| matches!(pieces[other % pieces.len()], Piece::Line { .. });
        let Piece::Line { start, end } = pieces[index] else { continue };
        let are_free = is_free(index + 1) && is_free(index + pieces.len() - 1);
        if !are_free || !random.once_in(4) || start.to(end) < 0.2 {
            continue;
        }
        let sweep = random.between(0.15, 2.2) * random.of(&[1.0, -1.0]);
        let half = (end - start) * 0.5;
        let center = start + half + half.left() * (1.0 / (sweep / 2.0).tan());
        pieces[index] = Piece::arc(start, end, center, sweep > 0.0);
    }
}
