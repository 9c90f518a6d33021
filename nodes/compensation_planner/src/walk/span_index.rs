//! Finds the earlier spans that are near to a new one, among a hundred thousand.

use crate::geometry::bounds::Bounds;
use crate::geometry::chains::NO_CHAIN;
use crate::geometry::tree::{Tree, budget};
use std::ops::ControlFlow;

/// Spans that wait for a tree.
const WAITING: usize = 32;

/// The boxes of spans, by number. Trees of doubling sizes: every span moves to a larger tree only a
/// few times.
#[derive(Debug, Default)]
pub(crate) struct SpanIndex {
    all: Vec<Bounds>,
    /// Each with its first span; the sizes fall.
    trees: Vec<(usize, Tree)>,
    /// The first span without a tree.
    waiting: usize,
}

impl SpanIndex {
    /// Adds the next span.
    pub(crate) fn push(&mut self, bounds: Bounds) {
        self.all.push(bounds);
        if self.all.len() - self.waiting < WAITING {
            return;
        }
        let mut from = self.waiting;
        while let Some((first, _)) = self.trees.pop_if(|(first, _)| {
            let (last, behind) = (from - *first, self.all.len() - from);
            last <= behind
        }) {
            from = first;
        }
        let boxes = self.all[from..].iter().map(|bounds| (*bounds, NO_CHAIN));
        // The order of spans may be any, so that boxes of several of them would be everywhere.
        self.trees.push((from, Tree::of_boxes(boxes, 0.0)));
        self.waiting = self.all.len();
    }

    /// The box of a span.
    pub(crate) fn bounds(&self, span: usize) -> &Bounds {
        &self.all[span]
    }

    /// The spans whose boxes are nearer to a box than this, mm; the latest first.
    pub(crate) fn near(&self, bounds: &Bounds, reach: f64) -> Vec<usize> {
        let is_near = |span: &usize| self.all[*span].gap_squared(bounds) < reach * reach;
        let mut found: Vec<usize> = (self.waiting..self.all.len()).filter(is_near).collect();
        for (first, tree) in &self.trees {
            tree.near_box(bounds, reach, &mut budget(self.all.len()), |spans| {
                found.extend(spans.map(|span| first + span).filter(is_near));
                ControlFlow::Continue(())
            });
        }
        found.sort_unstable_by(|a, b| b.cmp(a));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::element::{Element, Vec2};

    #[test]
    fn the_spans_near_a_box_are_found_the_latest_first() {
        let place = |span: usize| Vec2::new((span % 20) as f64, (span / 20) as f64) * 10.0;
        let bounds = |span: usize| {
            let at = place(span);
            Bounds::of(&Element::line(at, at + Vec2::new(3.0, 4.0)).expect("a length"))
        };
        let mut index = SpanIndex::default();
        for span in 0..777 {
            let near: Vec<usize> = (0..span)
                .rev()
                .filter(|it| bounds(*it).gap_squared(&bounds(span)) < 64.0)
                .collect();
            assert_eq!(index.near(&bounds(span), 8.0), near, "{span}");
            index.push(bounds(span));
        }
        assert!(index.trees.len() < 8);
    }
}
