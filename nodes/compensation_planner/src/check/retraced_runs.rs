//! Finds runs of a span that lie on each other.
//!
//! A contour that is cut at several depths, or that continues over what it has already cut,
//! retraces its own wall. Its copies are one wall, and each wall is checked once.

use crate::geometry::element::{Element, Vec2};
use crate::geometry::tolerance::LENGTH_MM;
use crate::span::Run;
use std::collections::BTreeMap;
use std::ops::Range;

/// Which runs are the same, in the same direction.
#[derive(Debug, Clone)]
pub(crate) struct RetracedRuns {
    /// For each run, the first run that is the same.
    firsts: Vec<usize>,
    /// Pairs of first and copy, sorted.
    copies: Vec<(usize, usize)>,
}

impl RetracedRuns {
    /// Runs that do not count have no copies.
    pub(crate) fn of(runs: &[Run], counts: impl Fn(usize) -> bool) -> Self {
        let mut known: BTreeMap<[i64; 8], usize> = BTreeMap::new();
        let first = |(index, run): (usize, &Run)| match counts(index) {
            true => *known.entry(key(&run.element)).or_insert(index),
            false => index,
        };
        let firsts: Vec<usize> = runs.iter().enumerate().map(first).collect();
        let mut copies: Vec<(usize, usize)> =
            firsts.iter().enumerate().map(|(run, first)| (*first, run)).collect();
        copies.sort_unstable();
        Self { firsts, copies }
    }

    /// Whether a run is the first of its copies.
    pub(crate) fn is_first(&self, run: usize) -> bool {
        self.firsts[run] == run
    }

    /// All runs that are the same as this one, itself included, in order.
    pub(crate) fn of_run(&self, run: usize) -> impl DoubleEndedIterator<Item = usize> + '_ {
        self.within(run, 0..usize::MAX)
    }

    /// Those copies within a range.
    pub(crate) fn within(
        &self,
        run: usize,
        runs: Range<usize>,
    ) -> impl DoubleEndedIterator<Item = usize> + '_ {
        let first = self.firsts[run];
        let from = self.copies.partition_point(|copy| *copy < (first, runs.start));
        let to = self.copies.partition_point(|copy| *copy < (first, runs.end));
        self.copies[from..to].iter().map(|(_, copy)| *copy)
    }
}

/// A key that is equal for runs that are the same within the shortest length.
fn key(element: &Element) -> [i64; 8] {
    let round = |value: f64| (value / LENGTH_MM).round() as i64;
    let [start, end] = [element.start(), element.end()];
    let (center, turn, sweep) = match element {
        Element::Line(_) => (Vec2::zeros(), 0.0, 0.0),
        Element::Arc(arc) => (arc.center, arc.turn, arc.sweep),
    };
    let [a, b, c, d] = [start.x, start.y, end.x, end.y].map(round);
    [a, b, c, d, round(center.x), round(center.y), turn as i64, round(sweep)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_copies_when_they_go_the_same_way() {
        let square = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 0.0], [9.0, 0.0], [0.0, 0.0]];
        let point = |[x, y]: [f64; 2]| Vec2::new(x, y);
        let runs: Vec<Run> = (square.windows(2).enumerate())
            .map(|(index, ends)| Run {
                element: Element::line(point(ends[0]), point(ends[1])).expect("two points"),
                legs: index..index + 1,
                d_in_mm: 1.0,
                d_out_mm: 1.0,
            })
            .collect();
        let copies = RetracedRuns::of(&runs, |_| true);
        let all = |run| copies.of_run(run).collect::<Vec<_>>();
        assert_eq!([all(0), all(1), all(3), all(4)], [vec![0, 3], vec![1], vec![0, 3], vec![4]]);
        assert_eq!(copies.within(0, 1..4).collect::<Vec<_>>(), [3]);
        assert!(copies.is_first(0) && !copies.is_first(3) && copies.is_first(4));
    }
}
