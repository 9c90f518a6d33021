//! The legs of a span and its elements in flat arrays, each computed once.
//!
//! Each piece begins where the one before it ends, so a line is one point. Only arcs need more.

use crate::planar::{Piece, Point, Round, unit};
use crate::program::NONE;
use crate::spans::Span;
use crate::tool_path::ToolPath;
use std::f64::consts::PI;

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
                all.bow_of.resize(index, NONE);
                all.bow_of.push(all.bows.len() as u32);
                all.bows.push(bow);
            }
        }
        if !all.bows.is_empty() {
            all.bow_of.resize(count, NONE);
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

/// The legs and the elements of a span.
#[derive(Debug)]
pub(crate) struct Chains<'a> {
    pub span: &'a Span,
    /// The legs of all spans.
    pub all_legs: &'a [u32],
    pub legs: Pieces,
    pub elements: Pieces,
}

impl<'a> Chains<'a> {
    pub(crate) fn of(tool_path: &ToolPath<'_>, span: &'a Span, all_legs: &'a [u32]) -> Self {
        let legs = all_legs[span.legs.clone()].iter().map(|&leg| tool_path.leg(leg));
        // The end of the element before, if this one begins there.
        let mut before = None;
        let elements = span.elements.clone().map(|element| {
            if tool_path.block_of[element] == NONE {
                // An element without a block becomes a point.
                let at = before.take().unwrap_or_else(Point::zeros);
                return Piece::line(at, at);
            }
            let piece = tool_path.piece_from(before, element);
            before = Some(piece.to);
            piece
        });
        Self { span, all_legs, legs: Pieces::new(legs), elements: Pieces::new(elements) }
    }

    /// The blocks of its legs.
    pub(crate) fn blocks(&self) -> &'a [u32] {
        &self.all_legs[self.span.legs.clone()]
    }

    /// A leg by its index among all legs.
    pub(crate) fn leg(&self, tool_path: &ToolPath<'_>, index: usize) -> Piece {
        if self.span.legs.contains(&index) {
            self.legs.piece(index - self.span.legs.start)
        } else {
            tool_path.leg(self.all_legs[index])
        }
    }

    /// An element by its index in the path.
    pub(crate) fn element(&self, element: usize) -> Piece {
        self.elements.piece(element - self.span.elements.start)
    }
}
