//! The layers of G71 and G72.
//!
//! All within a [`Frame`](super::frame::Frame): the tool comes from above and cuts along. A layer begins where the
//! profile comes down to its height and ends where it next reaches it again. The tool leaves it under 45 degrees, goes
//! back above it, and comes down to its beginning under 45 degrees. The first way down is from the start of the cycle,
//! in rapid.

use super::piece::{Circle, Piece, Point};
use super::{Move, SAME_MM, Trouble};

/// Which parts of a profile that goes down again are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pockets {
    /// G71, G72: all.
    All,
    /// G71.1, G72.1: only what comes before them.
    None,
    /// G71.2, G72.2: only they are.
    Only,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Passes {
    pub(super) pockets: Pockets,
    /// I, R, mm.
    pub(super) step_mm: f64,
    pub(super) retract_mm: f64,
    pub(super) moves_max: f64,
}

/// The moves for a path that keeps its distance from the profile already. `begin` is the upper end of the way to it.
pub(super) fn rough(path: &[Piece], begin: Point, passes: Passes) -> Result<Vec<Move>, Trouble> {
    let first = path[0].from;
    let mut pieces = vec![Piece::line(begin, first, path[0].origin)];
    pieces.extend(path.iter().flat_map(split));
    let last = path[path.len() - 1];
    if last.to[1] < begin[1] - SAME_MM {
        pieces.push(Piece::line(last.to, [last.to[0], begin[1]], last.origin));
    }
    let falls: f64 = pieces.iter().map(|it| (it.from[1] - it.to[1]).max(0.0)).sum();
    let count = 5.0 * (falls / passes.step_mm + pieces.len() as f64);
    if count.is_nan() || count > passes.moves_max {
        return Err(Trouble::Moves { count });
    }
    let mut roughing = Roughing { pieces, passes, moves: Vec::new() };
    roughing.moves.push(Move::rapid(begin));
    roughing.run();
    Ok(roughing.moves)
}

struct Roughing {
    /// The way down, the path, and the way up at its end.
    pieces: Vec<Piece>,
    passes: Passes,
    moves: Vec<Move>,
}

impl Roughing {
    fn run(&mut self) {
        let top = self.pieces[0].from[1];
        let mut at = self.pieces[0].from;
        // No piece but those that go down has come yet.
        let mut is_first_fall = true;
        // Of G71.2: the height where the outermost pocket begins, and the piece where it ends.
        let mut pocket = (top, 0);
        let mut index = 0;
        while index < self.pieces.len() {
            let piece = self.pieces[index].between(at, self.pieces[index].to);
            let falls = piece.to[1] < piece.from[1] - SAME_MM;
            let is_pocket = falls && !is_first_fall;
            if is_pocket && self.passes.pockets == Pockets::None {
                // Above the height where the cycle begins nothing is left to cut.
                if self.next_at(index, at[1]).is_none() {
                    return;
                }
                let (end, to) = self.reaches(index, at[1]);
                if end > index {
                    self.go(to, false, None, None);
                    (index, at) = (end, to);
                    continue;
                }
            }
            if is_pocket && index > pocket.1 {
                pocket = (at[1], self.reaches(index, at[1]).0);
            }
            let top = match self.passes.pockets {
                Pockets::Only => pocket.0,
                _ => top,
            };
            let cuts = falls && (is_pocket || self.passes.pockets != Pockets::Only);
            if cuts {
                self.layers(index, piece, top);
            }
            // Over the lowest place of an arc it goes in one move.
            let next = self.pieces.get(index + 1);
            if !(falls
                && piece.circle.is_some()
                && next.is_some_and(|it| it.circle == piece.circle))
            {
                self.go(piece.to, index == 0 && falls, piece.circle, self.origin(index));
            }
            is_first_fall &= falls;
            at = piece.to;
            index += 1;
        }
    }

    /// The motion of the profile that a piece follows; the ways there and out follow none.
    fn origin(&self, index: usize) -> Option<usize> {
        let is_way = index == 0
            || index + 1 == self.pieces.len()
                && self.pieces[index].to[0] == self.pieces[index].from[0]
                && self.pieces[index].circle.is_none();
        (!is_way).then(|| self.pieces[index].origin)
    }

    /// The layers that begin on a piece that goes down. `top` is the height of the first layer of all.
    fn layers(&mut self, index: usize, piece: Piece, top: f64) {
        let step = self.passes.step_mm;
        let mut layer = ((top - piece.from[1] - SAME_MM) / step).ceil().max(0.0);
        let is_rapid = index == 0;
        loop {
            let height = top - layer * step;
            if height <= piece.to[1] + SAME_MM {
                break;
            }
            layer += 1.0;
            let from = place_at(&piece, height);
            self.go(from, is_rapid, piece.circle, self.origin(index));
            let (_, to) = self.reaches(index, height);
            self.go(to, false, None, None);
            let retract = self.passes.retract_mm.min((to[0] - from[0]) / 2.0).max(0.0);
            self.go([to[0] - retract, height + retract], true, None, None);
            self.go([from[0] + retract, height + retract], true, None, None);
            self.go(from, is_rapid, None, None);
        }
    }

    /// Where the path next reaches a height after a piece on which it goes below it: the piece, and the place.
    fn reaches(&self, index: usize, height: f64) -> (usize, Point) {
        match self.next_at(index, height) {
            Some((end, piece)) if piece.from[1] >= height - SAME_MM => {
                (end, [piece.from[0], height])
            }
            Some((end, piece)) => (end, place_at(piece, height)),
            // The path ends as high as it begins, or higher.
            None => {
                let last = self.pieces.len() - 1;
                (last, [self.pieces[last].to[0], height])
            }
        }
    }

    /// The first of the later pieces that is at this height or above it.
    fn next_at(&self, index: usize, height: f64) -> Option<(usize, &Piece)> {
        let mut later = self.pieces.iter().enumerate().skip(index + 1);
        later.find(|(_, it)| it.from[1].max(it.to[1]) >= height - SAME_MM)
    }

    fn go(&mut self, to: Point, is_rapid: bool, circle: Option<Circle>, origin: Option<usize>) {
        self.moves.push(Move { to, is_rapid, circle, origin });
    }
}

/// An arc over its highest or lowest place becomes two.
fn split(piece: &Piece) -> impl Iterator<Item = Piece> {
    let summit = piece.circle.and_then(|Circle { center, counterclockwise }| {
        let radius = piece.radius();
        let height = if counterclockwise { center[1] - radius } else { center[1] + radius };
        let is_inside = piece.from[0] < center[0] - SAME_MM && center[0] + SAME_MM < piece.to[0];
        is_inside.then_some([center[0], height])
    });
    let (first, second) = match summit {
        Some(summit) => (piece.between(piece.from, summit), Some(piece.between(summit, piece.to))),
        None => (*piece, None),
    };
    std::iter::once(first).chain(second)
}

/// Where a piece that only rises or only falls has this height.
fn place_at(piece: &Piece, height: f64) -> Point {
    let [from, to] = [piece.from, piece.to];
    let first = match piece.circle {
        None => from[0] + (to[0] - from[0]) * ((height - from[1]) / (to[1] - from[1])),
        Some(Circle { center, .. }) => {
            let radius = piece.radius();
            let off = height - center[1];
            let half = ((radius - off) * (radius + off)).max(0.0).sqrt();
            let is_left = f64::midpoint(from[0], to[0]) < center[0];
            if is_left { center[0] - half } else { center[0] + half }
        }
    };
    [first.clamp(from[0].min(to[0]), from[0].max(to[0])), height]
}
