//! Many pieces in flat arrays, each computed once.
//!
//! Each piece begins where the one before it ends, so a line is one point. Only arcs need more.

use crate::geometry::planar::{Piece, Point, Round, unit};
use std::f64::consts::PI;

/// In `bow_of`: the piece is a line.
const LINE: u32 = u32::MAX;

/// What an arc has besides its ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bow {
    pub round: Round,
    /// Its greatest distance from its chord, mm.
    pub bulge: f64,
    /// How far its end is from its circle, mm; a path may be wrong.
    pub uneven: f64,
}

impl Bow {
    /// `None` for a line.
    pub(crate) fn of(piece: &Piece) -> Option<Self> {
        let round = piece.round?;
        let out = piece.to - round.center;
        let uneven = (out.norm() - round.radius).abs();
        // Near half a circle a small part of the chord is much of the bulge.
        let on_circle = Piece { to: round.center + unit(out) * round.radius, ..*piece };
        let by_angle = round.radius * (1.0 - (round.sweep.abs() / 2.0).min(PI).cos());
        Some(Self { round, bulge: on_circle.bulge().max(by_angle) + uneven, uneven })
    }
}

#[derive(Debug)]
pub(crate) struct Pieces {
    /// One more point than there are pieces.
    points: Vec<Point>,
    bows: Vec<Bow>,
    /// The bow of each piece; empty while there are only lines.
    bow_of: Vec<u32>,
}

impl Pieces {
    pub(crate) fn new(pieces: impl ExactSizeIterator<Item = Piece>) -> Self {
        let count = pieces.len();
        let mut all =
            Self { points: Vec::with_capacity(count + 1), bows: Vec::new(), bow_of: Vec::new() };
        let mut end = Point::zeros();
        for (index, piece) in pieces.enumerate() {
            all.points.push(piece.from);
            end = piece.to;
            if let Some(bow) = Bow::of(&piece) {
                if all.bows.is_empty() {
                    all.bow_of.reserve_exact(count);
                }
                all.bow_of.resize(index, LINE);
                all.bow_of.push(all.bows.len() as u32);
                all.bows.push(bow);
            }
        }
        if !all.bows.is_empty() {
            all.bow_of.resize(count, LINE);
        }
        all.points.push(end);
        all
    }

    pub(crate) fn count(&self) -> usize {
        self.points.len() - 1
    }

    pub(crate) fn begin(&self, index: usize) -> Point {
        self.points[index]
    }

    pub(crate) fn end(&self, index: usize) -> Point {
        self.points[index + 1]
    }

    pub(crate) fn chord(&self, index: usize) -> (Point, Point) {
        (self.points[index], self.points[index + 1])
    }

    /// The bow of an arc; `None` for a line.
    pub(crate) fn bow(&self, index: usize) -> Option<&Bow> {
        self.bows.get(*self.bow_of.get(index)? as usize)
    }

    pub(crate) fn bulge(&self, index: usize) -> f64 {
        self.bow(index).map_or(0.0, |bow| bow.bulge)
    }

    pub(crate) fn piece(&self, index: usize) -> Piece {
        let (from, to) = self.chord(index);
        Piece { from, to, round: self.bow(index).map(|bow| bow.round) }
    }
}
