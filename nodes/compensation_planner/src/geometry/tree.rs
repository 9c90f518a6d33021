//! Boxes over elements, to find pairs that are near.
//!
//! A binary tree in arrays: the lowest boxes hold a few consecutive elements each, or a part of a
//! long one; every box above holds two. The lowest boxes are sorted along a Hilbert curve, so that
//! a box above holds what is near in the plane: the turns of a spiral are far apart along the
//! contour. A node also knows the *chain* of its elements.
//! Pairs within a chain need no check; that makes long smooth contours cheap.

mod flat;
mod hilbert;

use crate::geometry::bounds::Bounds;
use crate::geometry::chains::NO_CHAIN;
use crate::geometry::contact::Nearness;
use crate::geometry::element::Element;
use crate::geometry::tolerance::LENGTH_MM;
pub(crate) use flat::FLAT_MAX;
use flat::{compare_all, compare_each, is_flat};
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

/// The boxes of elements that share a lowest box.
fn boxes_of(items: Range<usize>, bounds: impl Fn(usize) -> Bounds) -> [Bounds; LEAF] {
    let mut boxes = [Bounds::EMPTY; LEAF];
    for (slot, item) in boxes.iter_mut().zip(items) {
        *slot = bounds(item);
    }
    boxes
}

#[derive(Debug, Clone, Copy)]
struct Node<N = ()> {
    bounds: Bounds,
    chain: u32,
    nearness: N,
}

/// Boxes over elements, which are known by index.
#[derive(Debug, Clone)]
pub(crate) struct Tree<N = ()> {
    leaves: Vec<Leaf<N>>,
    /// The boxes above, level by level; the last one holds all.
    above: Vec<Node<N>>,
    /// No lowest box is wider in both directions, mm.
    pub widest_mm: f64,
    /// Whether there are so few elements that each has a box of its own, in order.
    is_flat: bool,
}

/// A lowest box of a tree.
#[derive(Debug, Clone, Copy)]
struct Leaf<N = ()> {
    node: Node<N>,
    /// Its elements: the first, and how many.
    first: u32,
    count: u32,
}

impl<N> Leaf<N> {
    fn items(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// The lowest boxes of a tree that is being built.
#[derive(Debug)]
struct Leaves<N> {
    leaves: Vec<Leaf<N>>,
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
            let mut leaves: Vec<Leaf> = Vec::with_capacity(items.size_hint().1.unwrap_or(0));
            let leaf = |(first, (bounds, chain))| Leaf {
                node: Node { bounds, chain, nearness: () },
                first,
                count: 1,
            };
            leaves.extend((0..).zip(items).map(leaf).filter(|leaf| !leaf.node.bounds.is_empty()));
            return Self { leaves, above: Vec::new(), widest_mm, is_flat: true };
        }
        let mut leaves = Leaves { leaves: Vec::new(), widest_mm };
        for (index, (bounds, chain)) in items.enumerate() {
            leaves.push(index, Node { bounds, chain, nearness: () });
        }
        leaves.tree()
    }
}

impl<N> Tree<N> {
    /// Its memory.
    pub(crate) fn bytes(&self) -> usize {
        let leaves = self.leaves.capacity() * size_of::<Leaf<N>>();
        size_of::<Self>() + leaves + self.above.capacity() * size_of::<Node<N>>()
    }
}

impl<N: Nearness> Tree<N> {
    /// Over elements with their chains, in order; `None` is near nothing. `box_of` has the box of
    /// an element of this index, or of a part of it. No lowest box is wider
    /// than `widest_mm` in both directions: a long element across the axes has several.
    pub(crate) fn of_elements(
        items: impl Iterator<Item = (Option<Element>, u32)>,
        widest_mm: f64,
        box_of: impl Fn(usize, &Element) -> (Bounds, N),
    ) -> Self {
        let node = |index: usize, element: &Element, chain: u32| {
            let (bounds, nearness) = box_of(index, element);
            Node { bounds, chain, nearness }
        };
        if is_flat(&items) {
            let mut leaves = Vec::with_capacity(items.size_hint().1.unwrap_or(0));
            for (index, (element, chain)) in items.enumerate() {
                let Some(element) = element else { continue };
                let node = node(index, &element, chain);
                leaves.push(Leaf { node, first: index as u32, count: 1 });
            }
            return Self { leaves, above: Vec::new(), widest_mm, is_flat: true };
        }
        let mut leaves = Leaves { leaves: Vec::new(), widest_mm };
        for (index, (element, chain)) in items.enumerate() {
            let Some(element) = element else { continue };
            let whole = node(index, &element, chain);
            let parts = (whole.bounds.width() / widest_mm).ceil().clamp(1.0, PARTS_MAX);
            if parts.is_nan() || parts <= 1.0 {
                leaves.push(index, whole);
                continue;
            }
            let end = |part: f64| element.length() * part / parts;
            for part in 0..parts as usize {
                let (from, to) = (end(part as f64), end(part as f64 + 1.0));
                let part = element.before(to).and_then(|part| part.after(from)).unwrap_or(element);
                leaves.push(index, node(index, &part, chain));
            }
        }
        leaves.tree()
    }

    /// Visits all pairs of elements whose boxes are near within `reach` mm, except those
    /// within one chain; `boxes` has the box of each element of both trees. Long elements may be
    /// visited several times. Returns whether it saw all pairs: it gives up when the budget is used
    /// up, where a visit counts as a box for each element.
    pub(crate) fn near_pairs(
        &self,
        other: &Tree,
        reach: f64,
        budget: &mut usize,
        boxes: (impl Fn(usize) -> (Bounds, N), impl Fn(usize) -> Bounds),
        mut visit: impl FnMut(usize, usize) -> ControlFlow<()>,
    ) -> bool {
        if self.is_flat && other.is_flat {
            return compare_all(&self.leaves, &other.leaves, reach, budget, visit);
        }
        let visit = |a: &Leaf<N>, b: &Leaf| {
            let boxes_of_b = boxes_of(b.items(), &boxes.1);
            for a in a.items() {
                let (box_of_a, nearness) = boxes.0(a);
                for (b, box_of_b) in b.items().zip(&boxes_of_b) {
                    if nearness.is_near(&box_of_a, box_of_b, reach) {
                        visit(a, b)?;
                    }
                }
            }
            ControlFlow::Continue(())
        };
        search_all(self, other, reach, budget, visit)
    }

    fn boxes(&self) -> Boxes<'_, N> {
        Boxes { leaves: &self.leaves, above: &self.above }
    }
}

impl Tree {
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
        search_all(self, self, reach, budget, visit)
    }

    /// Visits the lowest boxes near a box that belongs to no chain.
    pub(crate) fn near_box(
        &self,
        bounds: &Bounds,
        reach: f64,
        budget: &mut usize,
        mut visit: impl FnMut(Range<usize>) -> ControlFlow<()>,
    ) -> bool {
        let node = Node { bounds: *bounds, chain: NO_CHAIN, nearness: () };
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
        search(Boxes::of_one(&one), self.boxes(), reach, budget, visit)
    }
}

/// [`search`], where the boxes of a flat tree are looked for one after another.
fn search_all<N: Nearness>(
    a: &Tree<N>,
    b: &Tree,
    reach: f64,
    budget: &mut usize,
    mut visit: impl FnMut(&Leaf<N>, &Leaf) -> ControlFlow<()>,
) -> bool {
    if !a.is_flat && !b.is_flat {
        return search(a.boxes(), b.boxes(), reach, budget, visit);
    }
    let is_over = Cell::new(false);
    let mut visit = |a: &Leaf<N>, b: &Leaf| {
        let next = visit(a, b);
        is_over.set(next.is_break());
        next
    };
    match a.is_flat {
        true => a.leaves.iter().all(|leaf| {
            let one = Boxes::of_one(leaf);
            is_over.get() || search(one, b.boxes(), reach, budget, &mut visit)
        }),
        false => b.leaves.iter().all(|leaf| {
            let one = Boxes::of_one(leaf);
            is_over.get() || search(a.boxes(), one, reach, budget, &mut visit)
        }),
    }
}

/// See [`Tree::near_pairs`].
fn search<N: Nearness>(
    a: Boxes<'_, N>,
    b: Boxes<'_>,
    reach: f64,
    budget: &mut usize,
    visit: impl FnMut(&Leaf<N>, &Leaf) -> ControlFlow<()>,
) -> bool {
    let (Some(top_a), Some(top_b)) = (a.top(), b.top()) else { return true };
    let mut search = Search { a, b, reach, budget, visit };
    search.pairs(top_a, top_b) != ControlFlow::Break(Stop::NoBudget)
}

/// Why a search ends early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stop {
    ByVisitor,
    NoBudget,
}

struct Search<'a, N, V> {
    a: Boxes<'a, N>,
    b: Boxes<'a>,
    reach: f64,
    budget: &'a mut usize,
    visit: V,
}

impl<N: Nearness, V: FnMut(&Leaf<N>, &Leaf) -> ControlFlow<()>> Search<'_, N, V> {
    /// Visits what is near below a pair of boxes. As deep as both trees together.
    fn pairs(&mut self, a: Place, b: Place) -> ControlFlow<Stop> {
        if *self.budget == 0 {
            return ControlFlow::Break(Stop::NoBudget);
        }
        *self.budget -= 1;
        let (tree_a, tree_b) = (self.a, self.b);
        let (node_a, node_b) = (tree_a.node(a), tree_b.node(b));
        if (node_a.chain == node_b.chain && node_a.chain != NO_CHAIN)
            || !node_a.nearness.is_near(&node_a.bounds, &node_b.bounds, self.reach)
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
struct Boxes<'a, N = ()> {
    leaves: &'a [Leaf<N>],
    above: &'a [Node<N>],
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

impl<'a, N> Boxes<'a, N> {
    const fn of_one(leaf: &'a Leaf<N>) -> Self {
        Self { leaves: std::slice::from_ref(leaf), above: &[] }
    }

    /// The box that holds all others; `None` without any.
    fn top(&self) -> Option<Place> {
        let level = self.leaves.len().checked_next_power_of_two()?.trailing_zeros();
        let first = self.above.len().saturating_sub(1);
        (!self.leaves.is_empty()).then_some(Place { level, first, index: 0 })
    }

    fn node(&self, at: Place) -> &'a Node<N> {
        match at.level {
            0 => &self.leaves[at.index].node,
            _ => &self.above[at.first + at.index],
        }
    }

    /// The boxes in a box that is not one of the lowest.
    fn children(&self, of: Place) -> impl DoubleEndedIterator<Item = Place> + use<N> {
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

impl<N: Nearness> Leaves<N> {
    fn push(&mut self, index: usize, node: Node<N>) {
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
    fn tree(self) -> Tree<N> {
        let Self { mut leaves, widest_mm } = self;
        let all = leaves.iter().fold(Bounds::EMPTY, |all, leaf| all.union(leaf.node.bounds));
        let side = f64::from(hilbert::SIDE - 1);
        let scale = (all.high - all.low).map(|extent| side / extent.max(LENGTH_MM));
        leaves.sort_by_cached_key(|leaf| {
            let Bounds { low, high } = leaf.node.bounds;
            let cell = ((low + high) / 2.0 - all.low).component_mul(&scale);
            hilbert::along(cell.x as u32, cell.y as u32)
        });
        let mut above: Vec<Node<N>> = Vec::new();
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

impl<N: Nearness> Node<N> {
    fn and(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(other.bounds),
            chain: if self.chain == other.chain { self.chain } else { NO_CHAIN },
            nearness: self.nearness.and(other.nearness),
        }
    }
}

#[cfg(test)]
mod tests;
