//! The legs of a span and its elements, each computed once.

use crate::blocks::program::NONE;
use crate::blocks::spans::Span;
use crate::blocks::tool_path::ToolPath;
use crate::geometry::pieces::Pieces;
use crate::geometry::planar::{Piece, Point};

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
