//! The path of the tool centre in the plane, element by element, with the block of each element.
//!
//! If the path is that of the theoretical tip of a turning tool, the centre is computed here.

use crate::blocks::program::{BlockKind, NONE, Program};
use crate::geometry::planar::{Piece, Point, flat};
use cnc_msgs::geometry::{Plane, Position, Shape};
use cnc_msgs::path::{CompensatedPath, Role};

/// From the centre of the nose to the tip, in radii along the axes of the plane, by tip direction:
/// the corners 1 to 4 counter-clockwise from the first quadrant, then the sides 5 to 8.
const TIPS: [[f64; 2]; 10] = [
    [0.0, 0.0],
    [1.0, 1.0],
    [-1.0, 1.0],
    [-1.0, -1.0],
    [1.0, -1.0],
    [1.0, 0.0],
    [0.0, 1.0],
    [-1.0, 0.0],
    [0.0, -1.0],
    [0.0, 0.0],
];

#[derive(Debug)]
pub(crate) struct ToolPath<'a> {
    pub path: &'a CompensatedPath,
    pub program: Program<'a>,
    /// The block of each element; [`NONE`] if unknown.
    pub block_of: Vec<u32>,
    /// The role of each element, in an array of its own.
    pub roles: Vec<Role>,
}

impl ToolPath<'_> {
    pub(crate) fn position_before(&self, element: usize) -> Position {
        match element.checked_sub(1) {
            Some(before) => self.path.elements[before].end,
            None => self.path.start,
        }
    }

    fn plane(&self, element: usize) -> Plane {
        match self.block_of[element] {
            NONE => Plane::default(),
            block => self.program.offset(block).plane,
        }
    }

    fn is_free(&self, element: usize) -> bool {
        matches!(self.block_of[element], NONE) || self.path.elements[element].role == Role::None
    }

    /// From the centre to the point of the tool that the path describes at this element, mm.
    fn to_tip(&self, element: usize) -> Point {
        if self.is_free(element) {
            return Point::zeros();
        }
        let block = self.block_of[element];
        let offset = self.program.offset(block);
        let own = self.path.elements[element].role == Role::Contour
            || self.program.blocks[block as usize].kind == BlockKind::LeadOn;
        let (tip, d_mm) =
            if own { (offset.tip, offset.d_out) } else { (offset.tip_in, offset.d_in) };
        Point::from(TIPS[usize::from(tip.min(9))]) * d_mm.abs()
    }

    /// Where the centre is at the end of an element.
    pub(crate) fn end(&self, element: usize) -> Point {
        flat(self.plane(element), self.path.elements[element].end) - self.to_tip(element)
    }

    /// Where the centre is at the start of an element.
    pub(crate) fn start(&self, element: usize) -> Point {
        match element.checked_sub(1) {
            Some(before) if !self.is_free(before) => {
                flat(self.plane(element), self.path.elements[before].end) - self.to_tip(before)
            }
            _ => flat(self.plane(element), self.position_before(element)) - self.to_tip(element),
        }
    }

    pub(crate) fn piece(&self, element: usize) -> Piece {
        self.piece_from(None, element)
    }

    /// The same from a known start.
    pub(crate) fn piece_from(&self, start: Option<Point>, element: usize) -> Piece {
        let (from, to) = (start.unwrap_or_else(|| self.start(element)), self.end(element));
        let shape = &self.path.elements[element].shape;
        Piece::new(self.plane(element), from, to, shape, -self.to_tip(element))
    }

    /// What a block programs in the plane.
    pub(crate) fn leg(&self, block: u32) -> Piece {
        let (from, to) = self.program.ends(block);
        let motion = self.program.motion(block);
        match motion.shape {
            Shape::Line => Piece::line(from, to),
            Shape::Arc(_) => {
                let plane = self.program.offset(block).plane;
                Piece::new(plane, from, to, &motion.shape, Point::zeros()).centred()
            }
        }
    }
}
