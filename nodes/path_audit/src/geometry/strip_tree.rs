//! A strip tree: finds the pieces of two long chains that may be nearer to each other than a limit.
//!
//! A node stands for consecutive pieces: the chord between their ends and their greatest distance
//! from it. The nodes of a level follow each other, so a tree is one vector of widths.
//!
//! A few pieces have no nodes: each has a box, and all boxes are compared.

use crate::geometry::direction_ranges::DirectionRange;
use crate::geometry::distance_bounds;
use crate::geometry::pieces::Pieces;
use crate::geometry::planar::{Point, on_segment};
use std::ops::Range;

/// Pieces in a node of the lowest level.
const LEAF: usize = 4;

/// Up to so many pieces are compared one by one.
const FLAT_MAX: usize = 64;

/// Nodes that may be visited for each piece, plus a constant.
const VISITS: (usize, usize) = (96, 100_000);

/// A tree over the pieces of a chain.
#[derive(Debug)]
pub(crate) struct StripTree<'a> {
    pub pieces: &'a Pieces,
    /// The greatest distance of the pieces of each node from its chord, mm: level by level, lowest
    /// first.
    widths: Vec<f64>,
    /// Where each level begins in `widths`.
    levels: Vec<usize>,
    /// The directions of each node, if needed.
    directions: Vec<DirectionRange>,
    /// The nodes without anything to check, if there are any; without nodes, the pieces.
    idle: Vec<bool>,
    /// The boxes of a few pieces, which have no nodes: their least and greatest coordinates.
    boxes: Vec<(Point, Point)>,
}

impl<'a> StripTree<'a> {
    pub(crate) fn new(pieces: &'a Pieces) -> Self {
        if pieces.count() > FLAT_MAX {
            return Self::with_nodes(pieces);
        }
        let of = |index: usize| {
            let (from, to) = pieces.chord(index);
            let bulge = pieces.bulge(index);
            (from.inf(&to).add_scalar(-bulge), from.sup(&to).add_scalar(bulge))
        };
        Self {
            pieces,
            widths: Vec::new(),
            levels: Vec::new(),
            directions: Vec::new(),
            idle: Vec::new(),
            boxes: (0..pieces.count()).map(of).collect(),
        }
    }

    fn with_nodes(pieces: &'a Pieces) -> Self {
        let leaves = pieces.count().div_ceil(LEAF);
        let widths = Vec::with_capacity(2 * leaves + 8);
        let mut tree = Self {
            pieces,
            widths,
            levels: vec![0],
            directions: Vec::new(),
            idle: Vec::new(),
            boxes: Vec::new(),
        };
        if leaves == 0 {
            return tree;
        }
        for leaf in 0..leaves {
            let range = tree.range(0, leaf);
            let chord = tree.chord(&range);
            // The chord begins and ends with the pieces.
            let (mut before, mut width) = (0.0, 0.0_f64);
            for index in range.clone() {
                let is_last = index + 1 == range.end;
                let after = if is_last { 0.0 } else { off(chord, pieces.end(index)) };
                width = width.max(f64::max(before, after) + pieces.bulge(index));
                before = after;
            }
            tree.widths.push(width);
        }
        let (mut below, mut level) = (leaves, 0);
        while below > 1 {
            let from = tree.levels[level];
            tree.levels.push(tree.widths.len());
            level += 1;
            for node in 0..below.div_ceil(2) {
                let chord = tree.chord(&tree.range(level, node));
                let first = tree.widths[from + 2 * node];
                let width = match tree.widths[from..from + below].get(2 * node + 1) {
                    Some(second) => {
                        let middle = tree.range(level - 1, 2 * node).end - 1;
                        off(chord, pieces.end(middle)) + first.max(*second)
                    }
                    None => first,
                };
                tree.widths.push(width);
            }
            below = below.div_ceil(2);
        }
        tree
    }

    /// Adds what [`near_itself`] needs.
    #[must_use]
    pub(crate) fn with_directions(mut self) -> Self {
        let mut directions = Vec::with_capacity(self.widths.len());
        for level in 0..self.levels.len() {
            for node in 0..self.nodes(level) {
                let range = match level.checked_sub(1) {
                    None => DirectionRange::of_all(self.pieces, self.range(0, node)),
                    Some(below) => {
                        let from = self.levels[below];
                        let first: DirectionRange = directions[from + 2 * node];
                        match 2 * node + 1 < self.nodes(below) {
                            true => first.and(directions[from + 2 * node + 1]),
                            false => first,
                        }
                    }
                };
                directions.push(range);
            }
        }
        self.directions = directions;
        self
    }

    /// Limits the tree to these pieces.
    #[must_use]
    pub(crate) fn holding(mut self, holds: impl Fn(usize) -> bool) -> Self {
        if self.is_flat() {
            self.idle = (0..self.boxes.len()).map(|piece| !holds(piece)).collect();
            return self;
        }
        let mut idle: Vec<bool> = Vec::with_capacity(self.widths.len());
        for level in 0..self.levels.len() {
            for node in 0..self.nodes(level) {
                let is_idle = match level {
                    0 => !self.range(0, node).any(&holds),
                    _ => self.children((level, node)).all(|(at, it)| idle[self.levels[at] + it]),
                };
                idle.push(is_idle);
            }
        }
        self.idle = idle;
        self
    }

    fn is_flat(&self) -> bool {
        !self.boxes.is_empty()
    }

    fn holds(&self, piece: usize) -> bool {
        self.idle.get(piece).is_none_or(|is_idle| !is_idle)
    }

    /// The same with nodes, next to a tree that has them.
    fn beside(&self, other: &Self) -> Option<Self> {
        let is_alone = self.is_flat() && !other.is_flat();
        is_alone.then(|| match self.idle.is_empty() {
            true => Self::with_nodes(self.pieces),
            false => Self::with_nodes(self.pieces).holding(|piece| self.holds(piece)),
        })
    }

    fn is_idle(&self, (level, node): Node) -> bool {
        self.idle.get(self.levels[level] + node).is_some_and(|idle| *idle)
    }

    fn range(&self, level: usize, node: usize) -> Range<usize> {
        let size = LEAF << level;
        node * size..((node + 1) * size).min(self.pieces.count())
    }

    fn chord(&self, range: &Range<usize>) -> (Point, Point) {
        (self.pieces.begin(range.start), self.pieces.end(range.end - 1))
    }

    fn width(&self, (level, node): Node) -> f64 {
        self.widths[self.levels[level] + node]
    }

    fn directions_of(&self, (level, node): Node) -> DirectionRange {
        self.directions[self.levels[level] + node]
    }

    fn nodes(&self, level: usize) -> usize {
        self.pieces.count().div_ceil(LEAF << level)
    }

    fn children(&self, (level, node): Node) -> impl DoubleEndedIterator<Item = Node> {
        let last = self.nodes(level - 1);
        (2 * node..(2 * node + 2).min(last)).map(move |child| (level - 1, child))
    }

    fn root(&self) -> Node {
        (self.levels.len() - 1, 0)
    }
}

/// Level and number.
type Node = (usize, usize);

/// Calls `each` for all pairs of leaves whose pieces may be nearer than `limit` mm, until it
/// returns false. False when that happened, or when there were too many pairs to visit.
pub(crate) fn near(
    a: &StripTree<'_>,
    b: &StripTree<'_>,
    limit: f64,
    mut each: impl FnMut(Range<usize>, Range<usize>) -> bool,
) -> bool {
    if a.pieces.count() == 0 || b.pieces.count() == 0 || limit <= 0.0 {
        return true;
    }
    if a.is_flat() && b.is_flat() {
        return (0..a.boxes.len()).all(|of_a| {
            (0..b.boxes.len()).all(|of_b| {
                let is_near = b.holds(of_b) && are_near(&a.boxes[of_a], &b.boxes[of_b], limit);
                !is_near || each(of_a..of_a + 1, of_b..of_b + 1)
            })
        });
    }
    let with_nodes = [a.beside(b), b.beside(a)];
    let (a, b) = (with_nodes[0].as_ref().unwrap_or(a), with_nodes[1].as_ref().unwrap_or(b));
    let mut visits = VISITS.0 * (a.pieces.count() + b.pieces.count()) + VISITS.1;
    let mut open = vec![(a.root(), b.root())];
    while let Some((node_a, node_b)) = open.pop() {
        if visits == 0 {
            return false;
        }
        visits -= 1;
        if b.is_idle(node_b) {
            continue;
        }
        let (range_a, range_b) = (a.range(node_a.0, node_a.1), b.range(node_b.0, node_b.1));
        let (width_a, width_b) = (a.width(node_a), b.width(node_b));
        let reach = limit + width_a + width_b;
        let (chord_a, chord_b) = (a.chord(&range_a), b.chord(&range_b));
        // Mostly the tool runs along a wall from the start of both.
        let is_near = (chord_a.0 - chord_b.0).norm_squared() < reach * reach;
        if !is_near && distance_bounds::are_chords_apart(chord_a, chord_b, reach) {
            continue;
        }
        match (node_a.0, node_b.0) {
            (0, 0) => {
                if !each(range_a, range_b) {
                    return false;
                }
            }
            (of_a, of_b) if of_a == of_b => {
                for child in a.children(node_a).rev() {
                    open.extend(b.children(node_b).rev().map(|other| (child, other)));
                }
            }
            (of_a, of_b) if of_a > of_b => {
                open.extend(a.children(node_a).rev().map(|child| (child, node_b)));
            }
            _ => open.extend(b.children(node_b).rev().map(|child| (node_a, child))),
        }
    }
    true
}

/// The same within one chain: each pair once, the earlier first, without neighbours of similar
/// direction.
pub(crate) fn near_itself(
    tree: &StripTree<'_>,
    limit: f64,
    mut each: impl FnMut(Range<usize>, Range<usize>) -> bool,
) -> bool {
    if tree.pieces.count() == 0 {
        return true;
    }
    if tree.is_flat() {
        let count = tree.boxes.len();
        return (0..count).filter(|early| tree.holds(*early)).all(|early| {
            (early + 1..count).filter(|late| tree.holds(*late)).all(|late| {
                let is_near = are_near(&tree.boxes[early], &tree.boxes[late], limit);
                let goes_on = || {
                    late == early + 1
                        && DirectionRange::of_all(tree.pieces, early..late + 1).is_any()
                };
                !is_near || goes_on() || each(early..early + 1, late..late + 1)
            })
        });
    }
    let mut visits = VISITS.0 * tree.pieces.count() + VISITS.1;
    let mut open = vec![(tree.root(), tree.root())];
    while let Some((early, late)) = open.pop() {
        if visits == 0 {
            return false;
        }
        visits -= 1;
        if tree.is_idle(early) || tree.is_idle(late) {
            continue;
        }
        let (of_early, of_late) = (tree.range(early.0, early.1), tree.range(late.0, late.1));
        if early == late {
            if tree.directions_of(early).is_any() {
                continue;
            }
            if early.0 == 0 {
                if !each(of_early.clone(), of_late) {
                    return false;
                }
                continue;
            }
            let mut children = tree.children(early);
            let Some(first) = children.next() else { continue };
            if let Some(second) = children.next() {
                open.extend([(second, second), (first, second)]);
            }
            open.push((first, first));
            continue;
        }
        let follows = of_early.end == of_late.start;
        if follows
            && tree.directions_of(early).is_any()
            && tree.directions_of(early).and(tree.directions_of(late)).is_any()
        {
            continue;
        }
        let reach = limit + tree.width(early) + tree.width(late);
        if !follows
            && distance_bounds::are_chords_apart(tree.chord(&of_early), tree.chord(&of_late), reach)
        {
            continue;
        }
        if early.0 == 0 && late.0 == 0 {
            if !each(of_early, of_late) {
                return false;
            }
        } else if early.0 >= late.0 {
            open.extend(tree.children(early).rev().map(|child| (child, late)));
        } else {
            open.extend(tree.children(late).rev().map(|child| (early, child)));
        }
    }
    true
}

/// Whether two boxes are nearer than a limit, mm, along both axes.
fn are_near(a: &(Point, Point), b: &(Point, Point), limit: f64) -> bool {
    let apart = (a.0 - b.1).sup(&(b.0 - a.1));
    apart.x <= limit && apart.y <= limit
}

fn off((from, to): (Point, Point), point: Point) -> f64 {
    (on_segment(from, to, point) - point).norm()
}
