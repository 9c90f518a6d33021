//! One way to look at each case: the profile runs towards plus, and the tool is above it.
//!
//! A [`Frame`] exchanges Z and X for G72 and mirrors each of them where the profile runs towards minus, or the cycle
//! begins below it. Within it, the first coordinate is along the profile and the second one the height above the part.

use super::piece::{Circle, Piece, Point};
use super::{Along, Move, RUNS_BACK_MM_MAX, SAME_MM, Trouble};

#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    along: Along,
    /// 1 or -1 for each coordinate within.
    signs: [f64; 2],
}

impl Frame {
    /// The frame in which the profile runs towards plus, below the start of the cycle. An error where it does not run
    /// one way along that axis.
    pub(super) fn of(pieces: &[Piece], start: Point, axis: Along) -> Result<Self, Trouble> {
        let (first, last) = (pieces[0].from, pieces[pieces.len() - 1].to);
        let (along, across) = (axis.axis(), axis.other().axis());
        let runs = last[along] - first[along];
        let rises = last[across] - first[across];
        let above = start[across] - first[across];
        let above = if above.abs() > SAME_MM { above } else { rises };
        let frame = Self { along: axis, signs: [runs.signum(), above.signum()] };
        let back = frame.within(pieces).into_iter().find(|piece| !runs_on(piece));
        if let Some(Piece { origin, .. }) = back {
            return Err(Trouble::RunsBack { along: Some(axis), origin });
        }
        if runs.abs() <= SAME_MM {
            let origin = pieces[pieces.len() - 1].origin;
            return Err(Trouble::RunsBack { along: Some(axis), origin });
        }
        Ok(frame)
    }

    /// The axis of the heights.
    pub(super) fn across(&self) -> Along {
        self.along.other()
    }

    /// Whether the profile runs along Z towards plus, or along X.
    pub(super) fn runs_towards_plus(&self) -> bool {
        self.signs[0] > 0.0
    }

    /// Whether left within is right outside.
    pub(super) fn is_mirrored(&self) -> bool {
        let exchanges = if self.along == Along::X { -1.0 } else { 1.0 };
        exchanges * self.signs[0] * self.signs[1] < 0.0
    }

    pub(super) fn point_within(&self, at: Point) -> Point {
        let (along, across) = (self.along.axis(), self.across().axis());
        [self.signs[0] * at[along], self.signs[1] * at[across]]
    }

    fn point_without(&self, at: Point) -> Point {
        let mut point = [0.0; 2];
        point[self.along.axis()] = self.signs[0] * at[0];
        point[self.across().axis()] = self.signs[1] * at[1];
        point
    }

    /// [`beside`] of a start that is not within.
    pub(super) fn beside(&self, within: &[Piece], start: Point) -> Point {
        self.point_without(beside(within, self.point_within(start)))
    }

    fn turned(&self, circle: Circle, center: Point) -> Circle {
        Circle { center, counterclockwise: circle.counterclockwise != self.is_mirrored() }
    }

    pub(super) fn within(&self, pieces: &[Piece]) -> Vec<Piece> {
        let inside = |piece: &Piece| Piece {
            from: self.point_within(piece.from),
            to: self.point_within(piece.to),
            circle: piece.circle.map(|it| self.turned(it, self.point_within(it.center))),
            ..*piece
        };
        pieces.iter().map(inside).collect()
    }

    pub(super) fn without_pieces(&self, mut pieces: Vec<Piece>) -> Vec<Piece> {
        for piece in &mut pieces {
            piece.from = self.point_without(piece.from);
            piece.to = self.point_without(piece.to);
            piece.circle = piece.circle.map(|it| self.turned(it, self.point_without(it.center)));
        }
        pieces
    }

    pub(super) fn without(&self, mut moves: Vec<Move>) -> Vec<Move> {
        for it in &mut moves {
            it.to = self.point_without(it.to);
            it.circle = it.circle.map(|it| self.turned(it, self.point_without(it.center)));
        }
        moves
    }

    /// Whether the profile goes away from where the cycle begins: layers from there would not come to it. All within.
    pub(super) fn check_rise(&self, pieces: &[Piece], start: Point) -> Result<(), Trouble> {
        let (first, last) = (pieces[0].from[1], pieces[pieces.len() - 1].to[1]);
        if last >= first - SAME_MM {
            return Ok(());
        }
        let [start, first, last] = [start[1], first, last].map(|height| self.signs[1] * height);
        Err(Trouble::Falls { across: self.across(), start, first, last })
    }

    /// Whether the profile ends as high as it begins.
    pub(super) fn is_flat(&self, pieces: &[Piece]) -> bool {
        let across = self.across().axis();
        (pieces[pieces.len() - 1].to[across] - pieces[0].from[across]).abs() <= SAME_MM
    }

    /// Whether the start is as high as the first point, so that it does not say what is above.
    pub(super) fn is_level(&self, pieces: &[Piece], start: Point) -> bool {
        let across = self.across().axis();
        (start[across] - pieces[0].from[across]).abs() <= SAME_MM
    }
}

/// Where the tool is at the height of the start, but not beyond the beginning of the profile. All within.
pub(super) fn beside(pieces: &[Piece], start: Point) -> Point {
    [start[0].min(pieces[0].from[0]), start[1]]
}

/// Whether a piece within a frame never goes towards minus.
fn runs_on(piece: &Piece) -> bool {
    let Some(Circle { center, counterclockwise }) = piece.circle else {
        return piece.to[0] >= piece.from[0] - SAME_MM;
    };
    let radius = piece.radius();
    // It must stay on the lower half of a circle that is run counterclockwise.
    let beyond = |at: Point| match counterclockwise {
        true => at[1] > center[1],
        false => at[1] < center[1],
    };
    let before = if beyond(piece.from) { piece.from[0] - center[0] + radius } else { 0.0 };
    let after = if beyond(piece.to) { center[0] + radius - piece.to[0] } else { 0.0 };
    before.max(after) <= RUNS_BACK_MM_MAX && piece.to[0] > piece.from[0]
}
