//! What is left of the elements of a pass without its tails.
//!
//! A tail is the piece from a free end to the first place where the pass
//! crosses itself: a contour that is entered and left by legs that cross has
//! no wall beyond the crossing (M12). Only asked for when something seems to be cut.

use crate::distance::is_on;
use crate::element::{Element, Vec2};
use crate::intersect::crossings;
use crate::span::Run;
use crate::tolerance::MERGE_MM;
use std::cell::OnceCell;

/// Runs from the free end that are searched for the crossing; with every run of
/// the pass as the other one. A longer tail counts as a wall.
const RUNS_MAX: usize = 64;

/// The walls of a pass; its tails are searched for once, when the first is asked for.
pub(crate) struct Walls<'a> {
    runs: &'a [Run],
    tails: OnceCell<[Option<Tail>; 2]>,
}

/// All before this run, and this much of it, mm; counted from the free end.
#[derive(Debug, Clone, Copy)]
struct Tail {
    run: usize,
    along: f64,
}

impl<'a> Walls<'a> {
    pub(crate) fn new(runs: &'a [Run]) -> Self {
        Self { runs, tails: OnceCell::new() }
    }

    /// The wall in the element of a run; `None` when all of it is a tail.
    pub(crate) fn of(&self, run: usize) -> Option<Element> {
        let count = self.runs.len();
        let [start, end] = self.tails.get_or_init(|| {
            let backwards = |index: usize| reversed(&self.runs[count - 1 - index].element);
            [tail(count, |index| self.runs[index].element), tail(count, backwards)]
        });
        let element = without(self.runs.get(run)?.element, *start, run)?;
        Some(reversed(&without(reversed(&element), *end, count - 1 - run)?))
    }
}

fn without(element: Element, tail: Option<Tail>, run: usize) -> Option<Element> {
    match tail {
        Some(tail) if run < tail.run => None,
        Some(tail) if run == tail.run => without_start(&element, tail.along),
        _ => Some(element),
    }
}

fn tail(count: usize, element: impl Fn(usize) -> Element) -> Option<Tail> {
    (0..count.min(RUNS_MAX)).find_map(|run| {
        let this = element(run);
        let along = (run + 1..count)
            .filter_map(|other| {
                let shared = (other == run + 1).then(|| this.end());
                first_crossing(&this, &element(other), shared)
            })
            .min_by(f64::total_cmp)?;
        Some(Tail { run, along })
    })
}

fn first_crossing(this: &Element, other: &Element, shared: Option<Vec2>) -> Option<f64> {
    crossings(this, other, 0.0)
        .points()
        .iter()
        .filter(|&&point| is_on(this, point) && is_on(other, point))
        .filter(|&&point| shared.is_none_or(|shared| (point - shared).norm() > MERGE_MM))
        .map(|&point| this.along_from_start(point, MERGE_MM))
        .min_by(f64::total_cmp)
}

fn without_start(element: &Element, along: f64) -> Option<Element> {
    let left_over = element.length() - along;
    if left_over <= 0.0 {
        return None;
    }
    match *element {
        Element::Line(line) => Element::line(line.start + line.tangent * along, element.end()),
        Element::Arc(mut arc) => {
            let angle = along / arc.radius;
            arc.from = (arc.point_at_angle(angle) - arc.center) / arc.radius;
            arc.sweep -= angle;
            Some(Element::Arc(arc))
        }
    }
}

fn reversed(element: &Element) -> Element {
    match *element {
        Element::Line(mut line) => {
            line.start = element.end();
            line.tangent = -line.tangent;
            Element::Line(line)
        }
        Element::Arc(mut arc) => {
            std::mem::swap(&mut arc.from, &mut arc.to);
            arc.turn = -arc.turn;
            Element::Arc(arc)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_beyond_a_crossing_is_no_wall() {
        let at = Vec2::new;
        let points = [
            at(-30.0, -25.0),
            at(0.0, -25.0),
            at(100.0, -25.0),
            at(100.0, -100.0),
            at(25.0, -100.0),
            at(25.0, 0.0),
            at(25.0, 25.0),
        ];
        let runs: Vec<Run> = points
            .windows(2)
            .enumerate()
            .map(|(index, ends)| Run {
                element: Element::line(ends[0], ends[1]).expect("two points"),
                legs: index..index + 1,
                d_in_mm: 5.0,
                d_out_mm: 5.0,
            })
            .collect();
        let walls = Walls::new(&runs);
        let ends = |run| walls.of(run).map(|wall| (wall.start(), wall.end()));
        assert_eq!(ends(0), None);
        assert_eq!(ends(1), Some((at(25.0, -25.0), at(100.0, -25.0))));
        assert_eq!(ends(2), Some((at(100.0, -25.0), at(100.0, -100.0))));
        assert_eq!(ends(4), Some((at(25.0, -100.0), at(25.0, -25.0))));
        assert_eq!(ends(5), None);
    }
}
