//! Finds legs that lie on each other: a contour that is cut at several depths retraces its own
//! walls, and each wall is checked once.

use crate::geometry::pieces::Pieces;
use crate::geometry::planar::{Piece, Point};
use std::collections::BTreeMap;
use std::ops::Range;

/// Groups of legs that are the same, bit for bit and in the same direction.
#[derive(Debug)]
pub(crate) struct RetracedLegs {
    group_of: Vec<u32>,
    /// The legs of each group, in order.
    groups: Vec<Vec<usize>>,
}

impl RetracedLegs {
    /// Legs that do not count form groups of one.
    pub(crate) fn of(legs: &Pieces, counts: impl Fn(usize) -> bool) -> Self {
        let mut known: BTreeMap<[u64; 8], u32> = BTreeMap::new();
        let (mut groups, mut group_of) = (Vec::<Vec<usize>>::new(), Vec::new());
        for leg in 0..legs.count() {
            let new = groups.len() as u32;
            let group = match counts(leg) {
                true => *known.entry(bits(&legs.piece(leg))).or_insert(new),
                false => new,
            };
            if group == new {
                groups.push(Vec::new());
            }
            groups[group as usize].push(leg);
            group_of.push(group);
        }
        Self { group_of, groups }
    }

    /// All legs that are the same as this one, itself included.
    pub(crate) fn of_leg(&self, leg: usize) -> &[usize] {
        &self.groups[self.group_of[leg] as usize]
    }

    pub(crate) fn is_first(&self, leg: usize) -> bool {
        self.of_leg(leg)[0] == leg
    }

    /// The copy of a leg within a range; the leg itself if there is none.
    pub(crate) fn within(&self, leg: usize, legs: &Range<usize>) -> usize {
        let copies = self.of_leg(leg);
        let from = copies.partition_point(|copy| *copy < legs.start);
        copies.get(from).copied().filter(|copy| legs.contains(copy)).unwrap_or(leg)
    }

    /// The first and the last copies of a leg before a given leg.
    pub(crate) fn before(&self, leg: usize, end: usize) -> impl Iterator<Item = usize> + '_ {
        let copies = self.of_leg(leg);
        let copies = &copies[..copies.partition_point(|copy| *copy < end)];
        let last = copies.len().saturating_sub(2).max(1).min(copies.len());
        copies.iter().take(1).chain(&copies[last..]).copied()
    }
}

fn bits(piece: &Piece) -> [u64; 8] {
    // Zero has two signs.
    let of = |point: Point| [point.x, point.y].map(|value| (value + 0.0).to_bits());
    let (center, radius, sweep) = match piece.round {
        Some(round) => (round.center, round.radius, round.sweep),
        None => (Point::zeros(), 0.0, 0.0),
    };
    let ([a, b], [c, d], [e, f]) = (of(piece.from), of(piece.to), of(center));
    [a, b, c, d, e, f, radius.to_bits(), sweep.to_bits()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_that_go_the_same_way_again_are_copies() {
        let at = |x: f64| Point::new(x, 0.0);
        let ends = [(0.0, 1.0), (1.0, 0.0), (0.0, 1.0), (1.0, -0.0), (0.0, 1.0)];
        let pieces: Vec<Piece> = ends.iter().map(|(a, b)| Piece::line(at(*a), at(*b))).collect();
        let copies = RetracedLegs::of(&Pieces::new(pieces.into_iter()), |leg| leg != 4);
        assert_eq!(
            [copies.of_leg(2), copies.of_leg(3), copies.of_leg(4)],
            [&[0, 2][..], &[1, 3], &[4]]
        );
        assert_eq!((copies.within(0, &(2..4)), copies.within(0, &(3..5))), (2, 0));
        assert_eq!(copies.before(0, 9).collect::<Vec<_>>(), [0, 2]);
        assert_eq!(copies.before(0, 0).count(), 0);
    }
}
