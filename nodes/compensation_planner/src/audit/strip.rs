//! A strip tree: which pieces of two long chains may be nearer to each other than a limit.
//!
//! A node stands for consecutive pieces by the chord between their ends and how far they are
//! at most from it. The nodes of a level lie in a row, so that a tree is one vector of widths.

use super::planar::{Piece, Point, chords_apart_squared};
use std::ops::Range;

/// Pieces of a node of the lowest level.
const LEAF: usize = 4;

/// Nodes that may be looked at for each piece, and for any chain.
const VISITS: (usize, usize) = (96, 100_000);

/// A tree over so many pieces of a chain.
#[derive(Debug)]
pub(super) struct StripTree {
    count: usize,
    /// How far the pieces of each node are from its chord, mm: level by level, lowest first.
    widths: Vec<f64>,
    /// Where each level begins in `widths`.
    levels: Vec<usize>,
}

/// A chain: what its pieces are and where they begin and end.
pub(super) trait Chain {
    fn count(&self) -> usize;
    fn piece(&self, index: usize) -> Piece;
    fn begin(&self, index: usize) -> Point;
    fn end(&self, index: usize) -> Point;
}

impl StripTree {
    pub(super) fn new(chain: &impl Chain) -> Self {
        let count = chain.count();
        let leaves = count.div_ceil(LEAF);
        let mut tree = Self { count, widths: Vec::with_capacity(2 * leaves + 8), levels: vec![0] };
        if count == 0 {
            return tree;
        }
        for leaf in 0..leaves {
            let range = leaf * LEAF..((leaf + 1) * LEAF).min(count);
            let chord = (chain.begin(range.start), chain.end(range.end - 1));
            let width = range.fold(0.0_f64, |width, index| {
                let piece = chain.piece(index);
                width.max(off(chord, piece.from).max(off(chord, piece.to)) + piece.bulge())
            });
            tree.widths.push(width);
        }
        let (mut below, mut level) = (leaves, 0);
        while below > 1 {
            let from = tree.levels[level];
            tree.levels.push(tree.widths.len());
            level += 1;
            for node in 0..below.div_ceil(2) {
                let range = tree.range(level, node);
                let chord = (chain.begin(range.start), chain.end(range.end - 1));
                let children = 2 * node..(2 * node + 2).min(below);
                let width = children.fold(0.0_f64, |width, child| {
                    let range = tree.range(level - 1, child);
                    let ends = (chain.begin(range.start), chain.end(range.end - 1));
                    let apart = off(chord, ends.0).max(off(chord, ends.1));
                    width.max(apart + tree.widths[from + child])
                });
                tree.widths.push(width);
            }
            below = below.div_ceil(2);
        }
        tree
    }

    fn range(&self, level: usize, node: usize) -> Range<usize> {
        let size = LEAF << level;
        node * size..((node + 1) * size).min(self.count)
    }

    fn width(&self, level: usize, node: usize) -> f64 {
        self.widths[self.levels[level] + node]
    }

    fn nodes(&self, level: usize) -> usize {
        self.count.div_ceil(LEAF << level)
    }
}

/// Calls `each` for all leaves of two chains whose pieces may be nearer than `limit` mm, until
/// it says no. False when there were too many to look at.
pub(super) fn near<A: Chain, B: Chain>(
    (a, tree_a): (&A, &StripTree),
    (b, tree_b): (&B, &StripTree),
    limit: f64,
    mut each: impl FnMut(Range<usize>, Range<usize>) -> bool,
) -> bool {
    if tree_a.count == 0 || tree_b.count == 0 || limit <= 0.0 {
        return true;
    }
    let mut visits = VISITS.0 * (tree_a.count + tree_b.count) + VISITS.1;
    let mut open = vec![((tree_a.levels.len() - 1, 0), (tree_b.levels.len() - 1, 0))];
    while let Some(((level_a, node_a), (level_b, node_b))) = open.pop() {
        if visits == 0 {
            return false;
        }
        visits -= 1;
        let (range_a, range_b) = (tree_a.range(level_a, node_a), tree_b.range(level_b, node_b));
        let chord_a = (a.begin(range_a.start), a.end(range_a.end - 1));
        let chord_b = (b.begin(range_b.start), b.end(range_b.end - 1));
        let (width_a, width_b) = (tree_a.width(level_a, node_a), tree_b.width(level_b, node_b));
        let reach = limit + width_a + width_b;
        if chords_apart_squared(chord_a, chord_b) >= reach * reach {
            continue;
        }
        match (level_a, level_b) {
            (0, 0) => {
                if !each(range_a, range_b) {
                    return false;
                }
            }
            _ if level_a > level_b || (level_a == level_b && width_a >= width_b) => {
                let last = tree_a.nodes(level_a - 1);
                for child in (2 * node_a..(2 * node_a + 2).min(last)).rev() {
                    open.push(((level_a - 1, child), (level_b, node_b)));
                }
            }
            _ => {
                let last = tree_b.nodes(level_b - 1);
                for child in (2 * node_b..(2 * node_b + 2).min(last)).rev() {
                    open.push(((level_a, node_a), (level_b - 1, child)));
                }
            }
        }
    }
    true
}

fn off(chord: (Point, Point), point: Point) -> f64 {
    chords_apart_squared(chord, (point, point)).sqrt()
}
