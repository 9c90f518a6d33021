//! Boxes over elements, to find pairs that are near.
//!
//! A binary tree in arrays: the lowest boxes hold a few consecutive elements each, or a part of a
//! long one; every box above holds two. The lowest boxes are sorted along a Hilbert curve, so that
//! a box above holds what is near in the plane: the turns of a spiral are far apart along the
//! contour. A node also knows the *chain* of its elements.
//! Pairs within a chain need no check; that makes long smooth contours cheap.

use crate::geometry::bounds::Bounds;
use crate::geometry::chains::NO_CHAIN;
use crate::geometry::element::Element;
use crate::geometry::tolerance::LENGTH_MM;
use std::cell::Cell;
use std::ops::{ControlFlow, Range};

/// Boxes that may be visited for each element, plus a constant.
const BUDGET: (usize, usize) = (2048, 2_000_000);

/// The boxes that may be visited for a contour of `count` elements.
pub(crate) const fn budget(count: usize) -> usize {
    BUDGET.0 * count + BUDGET.1
}

/// Elements in a lowest box.
pub(crate) const LEAF: usize = 8;

/// The most boxes of one element.
const PARTS_MAX: f64 = 16.0;

/// Up to so many elements, no more than the bits of a word, each has a box of its own, and all boxes
/// are compared: a tree would cost more than it saves.
pub(crate) const FLAT_MAX: usize = 48;

/// The boxes of elements that share a lowest box.
fn boxes_of(items: Range<usize>, bounds: impl Fn(usize) -> Bounds) -> [Bounds; LEAF] {
    let mut boxes = [Bounds::EMPTY; LEAF];
    for (slot, item) in boxes.iter_mut().zip(items) {
        *slot = bounds(item);
    }
    boxes
}

#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds,
    chain: u32,
}

/// Boxes over elements, which are known by index.
#[derive(Debug, Clone)]
pub(crate) struct Tree {
    leaves: Vec<Leaf>,
    /// The boxes above, level by level; the last one holds all.
    above: Vec<Node>,
    /// No lowest box is wider in both directions, mm.
    pub widest_mm: f64,
    /// Whether there are so few elements that each has a box of its own, in order.
    is_flat: bool,
}

/// A lowest box of a tree.
#[derive(Debug, Clone, Copy)]
struct Leaf {
    node: Node,
    /// Its elements: the first, and how many.
    first: u32,
    count: u32,
}

impl Leaf {
    fn items(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// The lowest boxes of a tree that is being built.
#[derive(Debug, Default)]
struct Leaves {
    leaves: Vec<Leaf>,
    widest_mm: f64,
}

impl Tree {
    /// Over boxes with their chains, in order. Empty boxes are near nothing.
    pub(crate) fn new(items: impl Iterator<Item = (Bounds, u32)>) -> Self {
        Self::of_boxes(items, f64::INFINITY)
    }

    /// The same; no lowest box holds several that are wider together than this in both directions.
    pub(crate) fn of_boxes(items: impl Iterator<Item = (Bounds, u32)>, widest_mm: f64) -> Self {
        if is_flat(&items) {
            return Self::flat(items, widest_mm);
        }
        let mut leaves = Leaves { widest_mm, ..Leaves::default() };
        for (index, (bounds, chain)) in items.enumerate() {
            leaves.push(index, Node { bounds, chain });
        }
        leaves.tree()
    }

    /// A box for each element, and none above.
    fn flat(items: impl Iterator<Item = (Bounds, u32)>, widest_mm: f64) -> Self {
        let leaf =
            |(first, (bounds, chain))| Leaf { node: Node { bounds, chain }, first, count: 1 };
        let mut leaves: Vec<Leaf> = Vec::with_capacity(items.size_hint().1.unwrap_or(0));
        leaves.extend((0..).zip(items).map(leaf).filter(|leaf| !leaf.node.bounds.is_empty()));
        Self { leaves, above: Vec::new(), widest_mm, is_flat: true }
    }

    /// Over elements with their chains, in order; `None` is near nothing. No lowest box is wider
    /// than `widest_mm` in both directions: a long element across the axes has several.
    pub(crate) fn of_elements(
        items: impl Iterator<Item = (Option<Element>, u32)>,
        widest_mm: f64,
    ) -> Self {
        if is_flat(&items) {
            let bounds =
                |element: Option<Element>| element.map_or(Bounds::EMPTY, |it| Bounds::of(&it));
            return Self::flat(items.map(|(element, chain)| (bounds(element), chain)), widest_mm);
        }
        let mut leaves = Leaves { widest_mm, ..Leaves::default() };
        for (index, (element, chain)) in items.enumerate() {
            let Some(element) = element else { continue };
            let bounds = Bounds::of(&element);
            let parts = (bounds.width() / widest_mm).ceil().clamp(1.0, PARTS_MAX);
            if parts.is_nan() || parts <= 1.0 {
                leaves.push(index, Node { bounds, chain });
                continue;
            }
            let end = |part: f64| element.length() * part / parts;
            for part in 0..parts as usize {
                let (from, to) = (end(part as f64), end(part as f64 + 1.0));
                let part = element.before(to).and_then(|part| part.after(from)).unwrap_or(element);
                leaves.push(index, Node { bounds: Bounds::of(&part), chain });
            }
        }
        leaves.tree()
    }

    /// Visits all pairs of elements whose boxes are no farther apart than `reach` mm, except those
    /// within one chain; `boxes` has the box of each element of both trees. Long elements may be
    /// visited several times. Returns whether it saw all pairs: it gives up when the budget is used
    /// up, where a visit counts as a box for each element.
    pub(crate) fn near_pairs(
        &self,
        other: &Self,
        reach: f64,
        budget: &mut usize,
        boxes: (impl Fn(usize) -> Bounds, impl Fn(usize) -> Bounds),
        mut visit: impl FnMut(usize, usize) -> ControlFlow<()>,
    ) -> bool {
        let reach_squared = reach * reach;
        let is_near = |a: &Bounds, b: &Bounds| a.gap_squared(b) <= reach_squared;
        if self.is_flat && other.is_flat {
            return compare_all(&self.leaves, &other.leaves, reach_squared, budget, visit);
        }
        let visit = |a: &Leaf, b: &Leaf| {
            let boxes_of_b = boxes_of(b.items(), &boxes.1);
            for a in a.items() {
                let box_of_a = boxes.0(a);
                for (b, box_of_b) in b.items().zip(&boxes_of_b) {
                    if is_near(&box_of_a, box_of_b) {
                        visit(a, b)?;
                    }
                }
            }
            ControlFlow::Continue(())
        };
        search_all([self, other], reach, budget, visit)
    }

    /// The same within one tree: each pair once, the earlier first. Pairs within one chain may be
    /// visited too.
    pub(crate) fn near_itself(
        &self,
        reach: f64,
        budget: &mut usize,
        bounds: impl Fn(usize) -> Bounds,
        mut visit: impl FnMut(usize, usize) -> ControlFlow<()>,
    ) -> bool {
        let reach_squared = reach * reach;
        if self.is_flat {
            return compare_each(&self.leaves, reach_squared, budget, visit);
        }
        let visit = |early: &Leaf, late: &Leaf| {
            let (early, late) = (early.items(), late.items());
            if early.start > late.start {
                return ControlFlow::Continue(());
            }
            let early_boxes = boxes_of(early.clone(), &bounds);
            for late in late {
                let late_box = bounds(late);
                for (early, early_box) in (early.start..early.end.min(late)).zip(&early_boxes) {
                    if early_box.gap_squared(&late_box) <= reach_squared {
                        visit(early, late)?;
                    }
                }
            }
            ControlFlow::Continue(())
        };
        search_all([self, self], reach, budget, visit)
    }

    /// Visits the lowest boxes near a box that belongs to no chain.
    pub(crate) fn near_box(
        &self,
        bounds: &Bounds,
        reach: f64,
        budget: &mut usize,
        mut visit: impl FnMut(Range<usize>) -> ControlFlow<()>,
    ) -> bool {
        let node = Node { bounds: *bounds, chain: NO_CHAIN };
        let one = Leaf { node, first: 0, count: 1 };
        let mut visit = |_: &Leaf, leaf: &Leaf| visit(leaf.items());
        if bounds.is_empty() {
            return true;
        }
        if self.is_flat {
            for leaf in &self.leaves {
                let is_near = node.bounds.gap_squared(&leaf.node.bounds) <= reach * reach;
                if is_near && visit(&one, leaf).is_break() {
                    break;
                }
            }
            return true;
        }
        search([Boxes::of_one(&one), self.boxes()], reach, budget, visit)
    }

    fn boxes(&self) -> Boxes<'_> {
        Boxes { leaves: &self.leaves, above: &self.above }
    }
}

/// Whether there are so few elements that no tree is built.
fn is_flat<T>(items: &impl Iterator<Item = T>) -> bool {
    items.size_hint().1.is_some_and(|most| most <= FLAT_MAX)
}

/// See [`Tree::near_pairs`], between flat trees.
fn compare_all(
    a: &[Leaf],
    b: &[Leaf],
    reach_squared: f64,
    budget: &mut usize,
    mut visit: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> bool {
    if *budget == 0 {
        return false;
    }
    let all = |leaves: &[Leaf]| {
        leaves.iter().fold(Bounds::EMPTY, |all, leaf| all.union(leaf.node.bounds))
    };
    let is_near = |a: &Bounds, b: &Bounds| a.gap_squared(b) <= reach_squared;
    // One contour inside another is near to a few of its elements only.
    let (all_a, all_b) = (all(a), all(b));
    let bit =
        |(index, leaf): (usize, &Leaf)| u64::from(is_near(&leaf.node.bounds, &all_a)) << index;
    let near_b = b.iter().enumerate().map(bit).fold(0, |all, bit| all | bit);
    let count = near_b.count_ones() as usize;
    for a in a.iter().filter(|leaf| is_near(&leaf.node.bounds, &all_b)) {
        *budget = budget.saturating_sub(count / LEAF);
        let mut left = near_b;
        while left != 0 {
            let b = &b[left.trailing_zeros() as usize];
            left &= left - 1;
            let is_chain = a.node.chain == b.node.chain && a.node.chain != NO_CHAIN;
            if !is_chain
                && is_near(&a.node.bounds, &b.node.bounds)
                && visit(a.first as usize, b.first as usize).is_break()
            {
                return true;
            }
        }
    }
    true
}

/// See [`Tree::near_itself`], of a flat tree.
fn compare_each(
    leaves: &[Leaf],
    reach_squared: f64,
    budget: &mut usize,
    mut visit: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> bool {
    if *budget == 0 {
        return false;
    }
    *budget = budget.saturating_sub(leaves.len() * leaves.len() / (2 * LEAF));
    for (index, early) in leaves.iter().enumerate() {
        for late in &leaves[index + 1..] {
            if early.node.bounds.gap_squared(&late.node.bounds) <= reach_squared
                && visit(early.first as usize, late.first as usize).is_break()
            {
                return true;
            }
        }
    }
    true
}

/// [`search`], where the boxes of a flat tree are looked for one after another.
fn search_all(
    trees: [&Tree; 2],
    reach: f64,
    budget: &mut usize,
    mut visit: impl FnMut(&Leaf, &Leaf) -> ControlFlow<()>,
) -> bool {
    let [a, b] = trees;
    if !a.is_flat && !b.is_flat {
        return search([a.boxes(), b.boxes()], reach, budget, visit);
    }
    let is_over = Cell::new(false);
    let mut visit = |a: &Leaf, b: &Leaf| {
        let next = visit(a, b);
        is_over.set(next.is_break());
        next
    };
    let flat = if a.is_flat { a } else { b };
    flat.leaves.iter().all(|leaf| {
        let one = Boxes::of_one(leaf);
        let pair = if a.is_flat { [one, b.boxes()] } else { [a.boxes(), one] };
        is_over.get() || search(pair, reach, budget, &mut visit)
    })
}

/// See [`Tree::near_pairs`].
fn search(
    trees: [Boxes<'_>; 2],
    reach: f64,
    budget: &mut usize,
    visit: impl FnMut(&Leaf, &Leaf) -> ControlFlow<()>,
) -> bool {
    let [Some(a), Some(b)] = trees.map(Boxes::top) else { return true };
    let mut search = Search { trees, reach_squared: reach * reach, budget, visit };
    search.pairs(a, b) != ControlFlow::Break(Stop::NoBudget)
}

/// Why a search ends early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stop {
    ByVisitor,
    NoBudget,
}

struct Search<'a, V> {
    trees: [Boxes<'a>; 2],
    reach_squared: f64,
    budget: &'a mut usize,
    visit: V,
}

impl<V: FnMut(&Leaf, &Leaf) -> ControlFlow<()>> Search<'_, V> {
    /// Visits what is near below a pair of boxes. As deep as both trees together.
    fn pairs(&mut self, a: Place, b: Place) -> ControlFlow<Stop> {
        if *self.budget == 0 {
            return ControlFlow::Break(Stop::NoBudget);
        }
        *self.budget -= 1;
        let [tree_a, tree_b] = self.trees;
        let (node_a, node_b) = (tree_a.node(a), tree_b.node(b));
        if (node_a.chain == node_b.chain && node_a.chain != NO_CHAIN)
            || node_a.bounds.gap_squared(&node_b.bounds) > self.reach_squared
        {
            return ControlFlow::Continue(());
        }
        if a.level == 0 && b.level == 0 {
            *self.budget = self.budget.saturating_sub(LEAF);
            let (a, b) = (&tree_a.leaves[a.index], &tree_b.leaves[b.index]);
            return (self.visit)(a, b).map_break(|()| Stop::ByVisitor);
        }
        if a.level >= b.level {
            tree_a.children(a).rev().try_for_each(|child| self.pairs(child, b))
        } else {
            tree_b.children(b).rev().try_for_each(|child| self.pairs(a, child))
        }
    }
}

/// The boxes of a tree.
#[derive(Clone, Copy)]
struct Boxes<'a> {
    leaves: &'a [Leaf],
    above: &'a [Node],
}

/// A box of a tree.
#[derive(Clone, Copy)]
struct Place {
    /// 0 for the lowest.
    level: u32,
    /// The first box above the lowest that is on its level.
    first: usize,
    /// Its number on its level.
    index: usize,
}

impl<'a> Boxes<'a> {
    const fn of_one(leaf: &'a Leaf) -> Self {
        Self { leaves: std::slice::from_ref(leaf), above: &[] }
    }

    /// The box that holds all others; `None` without any.
    fn top(self) -> Option<Place> {
        let level = self.leaves.len().checked_next_power_of_two()?.trailing_zeros();
        let first = self.above.len().saturating_sub(1);
        (!self.leaves.is_empty()).then_some(Place { level, first, index: 0 })
    }

    fn node(self, at: Place) -> &'a Node {
        match at.level {
            0 => &self.leaves[at.index].node,
            _ => &self.above[at.first + at.index],
        }
    }

    /// The boxes in a box that is not one of the lowest.
    fn children(self, of: Place) -> impl DoubleEndedIterator<Item = Place> {
        let level = of.level - 1;
        let count = ((self.leaves.len() - 1) >> level) + 1;
        let first = of.first.saturating_sub(count);
        (2 * of.index..(2 * of.index + 2).min(count)).map(move |index| Place {
            level,
            first,
            index,
        })
    }
}

impl Leaves {
    fn push(&mut self, index: usize, node: Node) {
        if node.bounds.is_empty() {
            return;
        }
        if let Some(last) = self.leaves.last_mut()
            && (last.count as usize) < LEAF
            && last.items().end == index
        {
            let both = last.node.and(&node);
            if both.bounds.width() <= self.widest_mm {
                (last.count, last.node) = (last.count + 1, both);
                return;
            }
        }
        self.leaves.push(Leaf { node, first: index as u32, count: 1 });
    }

    /// Sorts them along a curve that fills their bounds, and builds the boxes above.
    fn tree(self) -> Tree {
        let Self { mut leaves, widest_mm } = self;
        let all = leaves.iter().fold(Bounds::EMPTY, |all, leaf| all.union(leaf.node.bounds));
        let side = f64::from(HILBERT_SIDE - 1);
        let scale = (all.high - all.low).map(|extent| side / extent.max(LENGTH_MM));
        leaves.sort_by_cached_key(|leaf| {
            let Bounds { low, high } = leaf.node.bounds;
            let cell = ((low + high) / 2.0 - all.low).component_mul(&scale);
            hilbert(cell.x as u32, cell.y as u32)
        });
        let mut above: Vec<Node> = Vec::new();
        if leaves.len() > 1 {
            above.reserve_exact(leaves.len() + leaves.len().ilog2() as usize + 1);
            above.extend(leaves.chunks(2).map(|pair| match pair {
                [left, right] => left.node.and(&right.node),
                _ => pair[0].node,
            }));
        }
        let mut from = 0;
        while above.len() - from > 1 {
            let to = above.len();
            for left in (from..to).step_by(2) {
                let both = match left + 1 < to {
                    true => above[left].and(&above[left + 1]),
                    false => above[left],
                };
                above.push(both);
            }
            from = to;
        }
        Tree { leaves, above, widest_mm, is_flat: false }
    }
}

/// Cells along one side of the square that a Hilbert curve fills.
const HILBERT_SIDE: u32 = 1 << 16;

/// The place of a cell along the Hilbert curve.
fn hilbert(mut x: u32, mut y: u32) -> u32 {
    let mut along = 0;
    let mut side = HILBERT_SIDE / 2;
    while side > 0 {
        let (right, top) = (u32::from(x & side > 0), u32::from(y & side > 0));
        along += side * side * ((3 * right) ^ top);
        if top == 0 {
            if right == 1 {
                (x, y) = (HILBERT_SIDE - 1 - x, HILBERT_SIDE - 1 - y);
            }
            (x, y) = (y, x);
        }
        side /= 2;
    }
    along
}

impl Node {
    fn and(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(other.bounds),
            chain: if self.chain == other.chain { self.chain } else { NO_CHAIN },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::element::Vec2;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn line(&[x, y, dx, dy]: &[f64; 4]) -> Element {
        let start = Vec2::new(x, y);
        Element::line(start, start + Vec2::new(dx, dy)).expect("a length")
    }

    proptest! {
        #[test]
        fn no_pair_that_is_near_is_missed(
            lines in prop::collection::vec(prop::array::uniform4(0.1..20.0_f64), 1..120),
            others in prop::collection::vec(prop::array::uniform4(0.1..20.0_f64), 1..120),
            reach in 0.0..5.0_f64,
        ) {
            let boxes = |lines: &[[f64; 4]]| -> Vec<Bounds> {
                lines.iter().map(|numbers| Bounds::of(&line(numbers))).collect()
            };
            let (a, b) = (boxes(&lines), boxes(&others));
            let tree = |boxes: &[Bounds]| Tree::new(boxes.iter().map(|bounds| (*bounds, NO_CHAIN)));
            let mut seen = BTreeSet::new();
            let both = (|one: usize| a[one], |other: usize| b[other]);
            let mut all = usize::MAX;
            let is_complete = tree(&a).near_pairs(&tree(&b), reach, &mut all, both, |a, b| {
                seen.insert((a, b));
                ControlFlow::Continue(())
            });
            prop_assert!(is_complete);
            let mut within = BTreeSet::new();
            tree(&a).near_itself(reach, &mut all, |one| a[one], |early, late| {
                within.insert((early, late));
                ControlFlow::Continue(())
            });
            for (late, early) in (0..a.len()).flat_map(|late| (0..late).map(move |it| (late, it))) {
                let is_near = a[early].gap_squared(&a[late]) <= reach * reach;
                prop_assert_eq!(is_near, within.contains(&(early, late)), "{} {}", early, late);
            }
            let mut seen_alone = BTreeSet::new();
            for (i, one) in a.iter().enumerate() {
                tree(&b).near_box(one, reach, &mut usize::MAX.clone(), |b| {
                    seen_alone.extend(b.map(|b| (i, b)));
                    ControlFlow::Continue(())
                });
            }
            for (i, one) in a.iter().enumerate() {
                for (j, other) in b.iter().enumerate() {
                    let is_near = one.gap_squared(other) <= reach * reach;
                    prop_assert_eq!(is_near, seen.contains(&(i, j)), "{} {}", i, j);
                    prop_assert!(!is_near || seen_alone.contains(&(i, j)), "{i} {j}");
                }
            }
        }
    }

    /// Boxes visited for each line of a spiral of so many lines of 2 mm, with 12 mm between its
    /// turns, to find what is near.
    fn visits_of_a_spiral(count: usize) -> f64 {
        let point = |index: usize| {
            let radius = (12.0 * 2.0 * index as f64 / std::f64::consts::PI).sqrt();
            let (y, x) = (radius / 12.0 * std::f64::consts::TAU).sin_cos();
            Vec2::new(x, y) * radius
        };
        let lines = (0..count).map(|index| Element::line(point(index), point(index + 1)));
        let tree = Tree::of_elements(lines.map(|line| (line, NO_CHAIN)), 24.0);
        let all = usize::MAX;
        let mut left = all;
        let bounds = |_| Bounds::EMPTY;
        assert!(tree.near_itself(3.0, &mut left, bounds, |_, _| ControlFlow::Continue(())));
        (all - left) as f64 / count as f64
    }

    #[test]
    fn ten_times_as_long_a_spiral_takes_about_ten_times_as_many_visits() {
        let [short, long] = [10_000, 100_000].map(visits_of_a_spiral);
        assert!(long < 1.5 * short, "{short} and {long} a line");
    }

    #[test]
    fn a_long_element_has_several_boxes_and_short_ones_share_one() {
        let lines = [[0.0, 0.0, 80.0, 60.0], [80.0, 60.0, 1.0, 1.0], [81.0, 61.0, 1.0, 2.0]];
        // Few elements would have a box each.
        let none = std::iter::repeat_n((None, NO_CHAIN), FLAT_MAX);
        let items = lines.iter().map(|numbers| (Some(line(numbers)), NO_CHAIN)).chain(none);
        let tree = Tree::of_elements(items, 20.0);
        let mut items: Vec<_> = tree.leaves.iter().map(|leaf| (leaf.first, leaf.count)).collect();
        items.sort_unstable();
        assert_eq!(items, [(0, 1), (0, 1), (0, 1), (1, 2)]);
    }

    #[test]
    fn the_curve_visits_each_cell_once_and_goes_to_a_neighbour_each_time() {
        let shift = HILBERT_SIDE / 16;
        let mut cells: Vec<(u32, [u32; 2])> = (0..256)
            .map(|cell| [cell % 16, cell / 16])
            .map(|[x, y]| (hilbert(x * shift, y * shift) / (shift * shift), [x, y]))
            .collect();
        cells.sort_unstable();
        for (index, (along, _)) in cells.iter().enumerate() {
            assert_eq!(*along as usize, index);
        }
        for pair in cells.windows(2) {
            let [[ax, ay], [bx, by]] = [pair[0].1, pair[1].1];
            assert_eq!(ax.abs_diff(bx) + ay.abs_diff(by), 1);
        }
    }
}
