//! What of a span bounds the tool: its passes without their tails.
//!
//! A pass ends where the contour returns to a point that it has already passed:
//! roughing and finishing loops, one after another. A tail is the piece from a
//! free end of a pass to the first place where the pass meets itself: a contour
//! that is entered and left by legs that cross has no wall beyond the crossing
//! (M12), but for a tool that runs along the same tail.

use crate::chain::{Link, Placed, Role};
use crate::element::{Element, Vec2, cross};
use crate::meeting::{Meeting, Place, meetings};
use crate::span::Run;
use crate::tolerance::{BEND_RAD, LENGTH_MM};
use crate::tree::{Bounds, Chains, NO_CHAIN, Tree};
use std::ops::Range;

/// The walls of a span.
#[derive(Debug)]
pub(crate) struct Walls<'a> {
    runs: &'a [Run],
    layout: Layout,
}

/// What bounds the tool, by number of run.
#[derive(Debug)]
pub(crate) struct Layout {
    passes: Vec<Pass>,
    /// Over all runs; those that the tool does not touch are in it too.
    tree: Tree,
    /// The chain of each run; of one that is consumed that of the run before.
    chains: Vec<u32>,
    /// Whether it may be cut into: it is followed, or all are judged.
    is_judged: Vec<bool>,
}

/// Runs without a return, and what of them bounds nothing.
#[derive(Debug, Clone)]
struct Pass {
    runs: Range<usize>,
    /// Walls begin and end here; `None`: there is no tail.
    begin: Option<Place>,
    end: Option<Place>,
}

impl<'a> Walls<'a> {
    /// `links` and `placed` tell which runs the tool follows; others are not judged.
    pub(crate) fn new(runs: &'a [Run], links: &[Link], placed: &[Placed]) -> Self {
        Self::with(runs, links, placed, false)
    }

    /// Those that the tool does not follow are walls too.
    pub(crate) fn all(runs: &'a [Run], links: &[Link], placed: &[Placed]) -> Self {
        Self::with(runs, links, placed, true)
    }

    fn with(runs: &'a [Run], links: &[Link], placed: &[Placed], judges_all: bool) -> Self {
        let mut chains = vec![NO_CHAIN; runs.len()];
        let mut is_judged = vec![false; runs.len()];
        let mut next = 0;
        let mut chain = Chains::new();
        let mut d_mm = None;
        for place in placed {
            let link = &links[place.link];
            let Role::Run(run) = link.role else { continue };
            // Between what is joined across a gap anything may happen.
            let is_across = judges_all && run != next;
            if d_mm.replace(link.d_out_mm) != Some(link.d_in_mm) || is_across {
                chain.cut();
            }
            // What was consumed is no reason to look closer at what is around it.
            let before = if judges_all || run == 0 { NO_CHAIN } else { chain.current() };
            chains[next.min(run)..run].fill(before);
            chains[run] = chain.next(&link.element);
            is_judged[run] = true;
            next = run + 1;
        }
        if judges_all {
            is_judged.fill(true);
        }
        let boxes = runs.iter().zip(&chains).map(|(run, &chain)| (Bounds::of(&run.element), chain));
        let tree = Tree::new(boxes);
        let meetings = meetings(runs, &tree);
        let passes = passes(runs, &meetings);
        Self { runs, layout: Layout { passes, tree, chains, is_judged } }
    }

    /// The same again, of the same runs.
    pub(crate) fn of_layout(runs: &'a [Run], layout: Layout) -> Self {
        Self { runs, layout }
    }

    /// What is left to keep when the runs are not borrowed any more.
    pub(crate) fn into_layout(self) -> Layout {
        self.layout
    }

    /// Number of runs.
    pub(crate) fn count(&self) -> usize {
        self.runs.len()
    }

    /// Boxes over all runs.
    pub(crate) fn tree(&self) -> &Tree {
        &self.layout.tree
    }

    /// Whether a run is one that must not be cut into.
    pub(crate) fn is_judged(&self, run: usize) -> bool {
        self.layout.is_judged[run]
    }

    /// All of the element of a run, tails too.
    pub(crate) fn element(&self, run: usize) -> &Element {
        &self.runs[run].element
    }

    /// The chain of a run.
    pub(crate) fn chain(&self, run: usize) -> u32 {
        self.layout.chains[run]
    }

    /// Number of the pass that a run belongs to.
    pub(crate) fn pass(&self, run: usize) -> usize {
        self.layout.passes.partition_point(|pass| pass.runs.end <= run)
    }

    /// Whether a run is of what leads at a tangent away from the loop that it begins on, as an
    /// arc behind a full circle does: it bounds nothing of the loop.
    pub(crate) fn leads_away(&self, run: usize) -> bool {
        const RUNS_MAX: usize = 2;
        let [.., _, last] = &self.layout.passes[..] else { return false };
        let is_few = last.runs.contains(&run) && last.runs.len() <= RUNS_MAX;
        is_few && last.begin.is_none() && last.end.is_none() && {
            let behind = self.runs[last.runs.start - 1].element.end_tangent();
            let ahead = self.runs[last.runs.start].element.start_tangent();
            behind.dot(&ahead) > 0.0 && cross(behind, ahead).abs() <= BEND_RAD
        }
    }

    /// Whether the walls of a pass begin on one of two runs and end on the other.
    pub(crate) fn are_ends(&self, one: usize, other: usize) -> bool {
        let Some(pass) = self.layout.passes.get(self.pass(one)) else { return false };
        let first = pass.begin.map_or(pass.runs.start, |begin| begin.run);
        let last = pass.end.map_or(pass.runs.end.saturating_sub(1), |end| end.run);
        first != last && (one.min(other), one.max(other)) == (first, last)
    }

    /// The wall in the element of a run; `None` when all of it is a tail.
    pub(crate) fn of(&self, run: usize) -> Option<Element> {
        self.seen_from(None, run)
    }

    /// The wall in the element of a run for a tool that follows a place of a run, mm from its
    /// start: a tail bounds what runs along it, and nothing else.
    pub(crate) fn seen_from(&self, on: Option<(usize, f64)>, run: usize) -> Option<Element> {
        let number = self.pass(run);
        let on = on.map(|(run, along)| Place { run, along });
        let on = on.filter(|on| self.pass(on.run) == number);
        let pass = self.layout.passes.get(number)?;
        let mut element = self.runs.get(run)?.element;
        if let Some(end) = pass.end.filter(|end| on.is_none_or(|on| on <= *end)) {
            if run > end.run {
                return None;
            }
            if run == end.run {
                element = element.before(end.along)?;
            }
        }
        if let Some(begin) = pass.begin.filter(|begin| on.is_none_or(|on| on >= *begin)) {
            if run < begin.run {
                return None;
            }
            if run == begin.run {
                element = element.after(begin.along)?;
            }
        }
        Some(element)
    }

    /// Where the tool is along a run that it follows, mm from its start.
    pub(crate) fn place(&self, run: usize, at: Vec2) -> (usize, f64) {
        let followed = self.element(run);
        let along = followed.along_from_start(followed.project(at), LENGTH_MM);
        (run, along.clamp(0.0, followed.length()))
    }
}

fn passes(runs: &[Run], meetings: &[Meeting]) -> Vec<Pass> {
    let mut passes: Vec<Range<usize>> = Vec::new();
    let mut start = 0;
    for meeting in meetings.iter().filter(|meeting| meeting.is_return) {
        if meeting.early.run >= start && meeting.late.run >= start {
            passes.push(start..meeting.late.run + 1);
            start = meeting.late.run + 1;
        }
    }
    if start < runs.len() {
        passes.push(start..runs.len());
    }
    let with_tails = |runs: Range<usize>| {
        let mut pass = Pass { runs, begin: None, end: None };
        // Meetings are in the order of their later place.
        let from = meetings.partition_point(|meeting| meeting.late.run < pass.runs.start);
        for meeting in &meetings[from..] {
            if meeting.late.run >= pass.runs.end {
                break;
            }
            if meeting.early.run < pass.runs.start {
                continue;
            }
            if pass.begin.is_none_or(|begin| meeting.early < begin) {
                pass.begin = Some(meeting.early);
            }
            if pass.end.is_none_or(|end| meeting.late > end) {
                pass.end = Some(meeting.late);
            }
        }
        pass
    };
    passes.into_iter().map(with_tails).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(points: &[[f64; 2]]) -> Vec<Run> {
        let element = |ends: &[[f64; 2]]| {
            let [a, b] = [ends[0], ends[1]].map(|[x, y]| Vec2::new(x, y));
            Element::line(a, b).expect("two points")
        };
        (points.windows(2).enumerate())
            .map(|(index, ends)| Run {
                element: element(ends),
                legs: index..index + 1,
                d_in_mm: 5.0,
                d_out_mm: 5.0,
            })
            .collect()
    }

    /// Start and end of the wall of each run.
    fn walls(points: &[[f64; 2]]) -> Vec<Option<[[f64; 2]; 2]>> {
        let runs = runs(points);
        let walls = Walls::new(&runs, &[], &[]);
        let ends = |wall: Element| [wall.start(), wall.end()].map(|point| [point.x, point.y]);
        (0..runs.len()).map(|run| walls.of(run).map(ends)).collect()
    }

    #[test]
    fn what_lies_beyond_a_crossing_is_no_wall() {
        let points = [
            [-30.0, -25.0],
            [0.0, -25.0],
            [100.0, -25.0],
            [100.0, -100.0],
            [25.0, -100.0],
            [25.0, 0.0],
            [25.0, 25.0],
        ];
        let expected = [
            None,
            Some([[25.0, -25.0], [100.0, -25.0]]),
            Some([[100.0, -25.0], [100.0, -100.0]]),
            Some([[100.0, -100.0], [25.0, -100.0]]),
            Some([[25.0, -100.0], [25.0, -25.0]]),
            None,
        ];
        assert_eq!(walls(&points), expected);
    }

    #[test]
    fn a_closed_contour_and_an_open_one_have_no_tails() {
        let square = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [0.0, 0.0]];
        for points in [&square[..], &square[..4]] {
            let whole: Vec<_> = points.windows(2).map(|ends| Some([ends[0], ends[1]])).collect();
            assert_eq!(walls(points), whole);
        }
    }

    #[test]
    fn a_loop_that_closes_is_a_pass_and_what_follows_is_the_next() {
        let points =
            [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 0.0]];
        let runs = runs(&points);
        let walls = Walls::new(&runs, &[], &[]);
        let passes: Vec<usize> = (0..6).map(|run| walls.pass(run)).collect();
        assert_eq!(passes, [0, 0, 0, 1, 1, 1]);
        assert!(walls.are_ends(2, 0) && !walls.are_ends(1, 0) && !walls.are_ends(2, 3));
    }
}
