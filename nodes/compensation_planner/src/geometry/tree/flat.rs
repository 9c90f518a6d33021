//! Trees of few elements: each has a box of its own, and all boxes are compared.

use super::{LEAF, Leaf, Node};
use crate::geometry::bounds::Bounds;
use crate::geometry::chains::NO_CHAIN;
use crate::geometry::contact::Nearness;
use std::ops::ControlFlow;

/// Up to so many elements, no more than the bits of a word, each has a box of its own, and all boxes
/// are compared: a tree would cost more than it saves.
pub(crate) const FLAT_MAX: usize = 48;

/// Whether there are so few elements that no tree is built.
pub(super) fn is_flat<T>(items: &impl Iterator<Item = T>) -> bool {
    items.size_hint().1.is_some_and(|most| most <= FLAT_MAX)
}

/// See [`Tree::near_pairs`], between flat trees.
pub(super) fn compare_all<N: Nearness>(
    a: &[Leaf<N>],
    b: &[Leaf],
    reach: f64,
    budget: &mut usize,
    mut visit: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> bool {
    if *budget == 0 {
        return false;
    }
    let is_near = |a: &Node<N>, bounds: &Bounds| a.nearness.is_near(&a.bounds, bounds, reach);
    // One contour inside another is near to a few of its elements only.
    let Some(all_a) = a.iter().map(|leaf| leaf.node).reduce(|all, node| all.and(&node)) else {
        return true;
    };
    let all_b = b.iter().fold(Bounds::EMPTY, |all, leaf| all.union(leaf.node.bounds));
    let bit =
        |(index, leaf): (usize, &Leaf)| u64::from(is_near(&all_a, &leaf.node.bounds)) << index;
    let near_b = b.iter().enumerate().map(bit).fold(0, |all, bit| all | bit);
    let count = near_b.count_ones() as usize;
    for a in a.iter().filter(|leaf| is_near(&leaf.node, &all_b)) {
        *budget = budget.saturating_sub(count / LEAF);
        let mut left = near_b;
        while left != 0 {
            let b = &b[left.trailing_zeros() as usize];
            left &= left - 1;
            let is_chain = a.node.chain == b.node.chain && a.node.chain != NO_CHAIN;
            if !is_chain
                && is_near(&a.node, &b.node.bounds)
                && visit(a.first as usize, b.first as usize).is_break()
            {
                return true;
            }
        }
    }
    true
}

/// See [`Tree::near_itself`], of a flat tree.
pub(super) fn compare_each(
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
