//! An arc of the path as lines of grbl: a part of it at a time.

use super::arc::{self, Part, Piece, Undrawable};
use super::words::{to_grid, write_word};
use super::{EncodeProblem, Encoder, axis_words};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Position, Shape};
use cnc_msgs::path::PathElement;

/// The parts of an arc that are not encoded yet.
#[derive(Debug, Clone, Copy)]
pub(super) struct RestOfArc {
    pub(super) element: usize,
    /// The next.
    part: Part,
    /// Where it begins.
    from: Position,
}

impl Encoder {
    pub(super) fn encode_arc(
        &mut self,
        index: usize,
        element: &PathElement,
        start: Position,
        arc: &Arc,
    ) -> Result<(), EncodeProblem> {
        if element.feed_mm_per_min.is_none() {
            return Err(EncodeProblem::RapidArc);
        }
        let needed = arc.plane.axes().into_iter().filter(|&axis| {
            axis != arc.plane.axes()[2] || to_grid(start[axis]) != to_grid(element.end[axis])
        });
        let needed = needed.fold(AxisSet::NONE, AxisSet::with);
        let missing = needed.without(needed.without(self.modal.unknown));
        if !missing.is_empty() {
            return Err(EncodeProblem::UnknownStart {
                axes: missing.letters(),
                since: self.modal.unknown_since.clone(),
            });
        }
        let end = element.end;
        let first = Part::first(start, end, arc, &self.drawing_frame());
        let part = first.ok_or(EncodeProblem::Arc { start, end, center: arc.center })?;
        self.encode_arc_part(RestOfArc { element: index, part, from: start })
    }

    /// Encodes the next part of an arc; the rest of it waits until that has been taken.
    pub(super) fn encode_arc_part(&mut self, rest: RestOfArc) -> Result<(), EncodeProblem> {
        let RestOfArc { element: index, part, mut from } = rest;
        let (element, start) = (self.path.elements[index], self.path.start_of(index));
        let Shape::Arc(arc) = element.shape else { return Ok(()) };
        let (end, center) = (element.end, arc.center);
        let pieces = arc::pieces(start, end, &arc, &self.drawing_frame(), part);
        let pieces = pieces.map_err(|why| match why {
            Undrawable::Shape => EncodeProblem::Arc { start, end, center },
            Undrawable::Lines { count, max } => {
                EncodeProblem::ArcLines { start, end, center, count, max }
            }
        })?;
        for piece in pieces {
            match piece {
                Piece::Line { end } => {
                    self.encode_line(index, &element, from, end, FurtherAxes::NONE)?
                }
                Piece::Arc { end } => self.encode_arc_piece(index, &element, from, end, &arc)?,
            }
            from = piece.end();
        }
        self.rest = part.next().map(|part| RestOfArc { element: index, part, from });
        Ok(())
    }

    fn encode_arc_piece(
        &mut self,
        index: usize,
        element: &PathElement,
        start: Position,
        end: Position,
        arc: &Arc,
    ) -> Result<(), EncodeProblem> {
        self.push_outputs(element.source)?;
        let mut text = self.line_number(index);
        if self.modal.plane != arc.plane {
            self.modal.plane = arc.plane;
            text += match arc.plane {
                Plane::Xy => "G17",
                Plane::Zx => "G18",
                Plane::Yz => "G19",
            };
        }
        self.write_motion(&mut text, if arc.clockwise { 2 } else { 3 });
        let [first, second, _] = arc.plane.axes();
        // Its ends are apart in the plane, or it would not have passed as drawn.
        text += &axis_words(element.axes, start, end).1;
        for axis in [0, 1, 2].into_iter().filter(|axis| [first, second].contains(axis)) {
            let offset = to_grid(arc.center[axis]) - to_grid(start[axis]);
            if offset != 0 {
                write_word(&mut text, ['I', 'J', 'K'][axis], offset);
            }
        }
        self.write_feed(&mut text, element.feed_mm_per_min)?;
        let kind = self.write_speed(&mut text);
        self.push_motion(text, kind, index, element)
    }
}
