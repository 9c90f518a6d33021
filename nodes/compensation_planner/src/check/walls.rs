//! The parts of a span that act as walls: its passes without their tails.
//!
//! A pass ends where the contour returns to a point that it has already passed: roughing and
//! finishing loops, one after another. A tail is the piece from a free end of a pass to the first
//! place where the pass meets itself. So a contour whose first and last legs cross has no wall
//! beyond the crossing (M12), except for a tool that runs along the same tail.

use crate::check::retraced_runs::RetracedRuns;
use crate::check::self_meeting::{PlaceOnRun, SelfMeeting, meetings, meetings_of_copies};
use crate::geometry::bounds::Bounds;
use crate::geometry::chains::{Chains, NO_CHAIN};
use crate::geometry::element::{Element, Vec2};
use crate::geometry::tolerance::{LENGTH_MM, MERGE_MM};
use crate::geometry::tree::{FLAT_MAX, Tree};
use crate::span::Run;
use crate::span::chain::{Placed, Role};
use crate::span::links::Links;
use cnc_msgs::finding::Severity;
use cnc_msgs::profile::Strictness;
use std::borrow::Cow;
use std::ops::Range;

/// How many radii of the tool a lowest box may be wide.
pub(crate) const BOX_REACHES: f64 = 8.0;

/// The walls of a span.
#[derive(Debug)]
pub(crate) struct Walls<'a> {
    runs: &'a [Run],
    layout: Cow<'a, Layout>,
}

/// What bounds the tool, by number of run.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    passes: Vec<Pass>,
    /// Over all runs, also those that the tool does not touch.
    tree: Tree,
    /// The chain of each run; a consumed run has that of the run before.
    chains: Vec<u32>,
    /// Whether a cut into it counts: the tool follows it, or all runs are judged.
    is_judged: Vec<bool>,
    /// Set where the contour retraces itself so often that each wall is checked once.
    copies: Option<RetracedRuns>,
    /// Whether all places where it meets itself were found.
    is_complete: bool,
    /// Whether a cut where the contour closes is only a warning.
    forgives_closing: bool,
}

/// Consecutive runs without a return, and their tails.
#[derive(Debug, Clone)]
struct Pass {
    runs: Range<usize>,
    /// Where the walls begin and end; `None`: there is no tail.
    begin: Option<PlaceOnRun>,
    end: Option<PlaceOnRun>,
}

impl<'a> Walls<'a> {
    /// The walls of the runs that the tool follows, by `links` and `placed`; others are not judged.
    pub(crate) fn new(runs: &'a [Run], links: Links<'_>, placed: &[Placed]) -> Self {
        Self::with(runs, links, placed, false)
    }

    /// The same, with the runs that the tool does not follow.
    pub(crate) fn all(runs: &'a [Run], links: Links<'_>, placed: &[Placed]) -> Self {
        Self::with(runs, links, placed, true)
    }

    fn with(runs: &'a [Run], links: Links<'_>, placed: &[Placed], judges_all: bool) -> Self {
        let mut chains = vec![NO_CHAIN; runs.len()];
        let mut is_judged = vec![false; runs.len()];
        let mut next = 0;
        let mut chain = Chains::new();
        let mut d_mm = None;
        for place in placed {
            let link = &links.at(place.link);
            let Role::Run(run) = link.role else { continue };
            // Across a gap anything may happen.
            let is_across = judges_all && run != next;
            if d_mm.replace(link.d_out_mm) != Some(link.d_in_mm) || is_across {
                chain.cut();
            }
            // A consumed run is no reason to look closer at its neighbours.
            let before = if judges_all || run == 0 { NO_CHAIN } else { chain.current() };
            chains[next.min(run)..run].fill(before);
            chains[run] = chain.next(&link.element);
            is_judged[run] = true;
            next = run + 1;
        }
        if judges_all {
            is_judged.fill(true);
        }
        let widest_mm = if runs.len() > FLAT_MAX { widest_box(runs) } else { f64::INFINITY };
        let tree = tree_of(runs, &chains, widest_mm, |_| true);
        let mut copies = None;
        let found = meetings(runs, &tree).or_else(|| {
            let copies = copies.insert(RetracedRuns::of(runs, |_| true));
            let firsts = tree_of(runs, &chains, widest_mm, |run| copies.is_first(run));
            meetings_of_copies(runs, &firsts, copies)
        });
        let is_complete = found.is_some();
        let passes = passes(runs, &found.unwrap_or_default());
        let (forgives_closing, copies) = (false, copies.filter(|_| !judges_all));
        let retraces = copies.is_some();
        let layout =
            Layout { passes, tree, chains, is_judged, copies, is_complete, forgives_closing };
        let mut walls = Self { runs, layout: Cow::Owned(layout) };
        if retraces {
            walls.look_once();
        }
        walls
    }

    /// Of equal whole walls the tree keeps the first.
    fn look_once(&mut self) {
        let copies = RetracedRuns::of(self.runs, |run| self.is_whole(run));
        let is_judged = |run: usize| copies.of_run(run).any(|copy| self.is_judged(copy));
        let is_judged = (0..self.runs.len()).map(|run| copies.is_first(run) && is_judged(run));
        let is_judged: Vec<bool> = is_judged.collect();
        let Layout { chains, tree, .. } = &*self.layout;
        let tree = tree_of(self.runs, chains, tree.widest_mm, |run| copies.is_first(run));
        let layout = self.layout.to_mut();
        for (run, is_any_judged) in layout.is_judged.iter_mut().enumerate() {
            let first = copies.of_run(run).next().unwrap_or(run);
            *is_any_judged = is_judged[first];
        }
        layout.tree = tree;
        layout.copies = Some(copies);
    }

    /// Forgives what a control allows whose manual begins a closed contour in an inside corner.
    #[must_use]
    pub(crate) fn forgiving_closing(mut self, rule: Strictness) -> Self {
        self.layout.to_mut().forgives_closing = rule.severity() == Severity::Warning;
        self
    }

    /// Whether a cut between the first and the last wall of a pass is forgiven.
    pub(crate) fn forgives_closing(&self) -> bool {
        self.layout.forgives_closing
    }

    /// Rebuilds the walls from their layout and the same runs.
    pub(crate) fn of_layout(runs: &'a [Run], layout: &'a Layout) -> Self {
        Self { runs, layout: Cow::Borrowed(layout) }
    }

    /// The layout, which can be kept after the borrow of the runs ends.
    pub(crate) fn into_layout(self) -> Layout {
        self.layout.into_owned()
    }

    /// Number of runs.
    pub(crate) fn count(&self) -> usize {
        self.runs.len()
    }

    /// Boxes over all runs.
    pub(crate) fn tree(&self) -> &Tree {
        &self.layout.tree
    }

    /// Whether all places where the contour meets itself were found.
    pub(crate) fn is_complete(&self) -> bool {
        self.layout.is_complete
    }

    /// All runs that are the same wall as one that the tree holds.
    pub(crate) fn copies(&self, run: usize) -> impl Iterator<Item = usize> + '_ {
        let copies = self.layout.copies.as_ref();
        let others = copies.into_iter().flat_map(move |copies| copies.of_run(run));
        std::iter::once(run).chain(others)
    }

    /// The copy of a wall that is in the pass of a run; the wall itself if there is none.
    pub(crate) fn in_pass_of(&self, on: usize, into: usize) -> usize {
        let Some(copies) = &self.layout.copies else { return into };
        let pass = self.layout.passes[self.pass(on)].runs.clone();
        copies.within(into, pass).next().unwrap_or(into)
    }

    /// Whether no part of a run is a tail.
    fn is_whole(&self, run: usize) -> bool {
        let Some(pass) = self.layout.passes.get(self.pass(run)) else { return false };
        let length = self.runs[run].element.length();
        pass.begin.is_none_or(|begin| begin <= PlaceOnRun { run, along: 0.0 })
            && pass.end.is_none_or(|end| end >= PlaceOnRun { run, along: length })
    }

    /// Whether a cut into a run counts.
    pub(crate) fn is_judged(&self, run: usize) -> bool {
        self.layout.is_judged[run]
    }

    /// The whole element of a run, tails included.
    pub(crate) fn element(&self, run: usize) -> &Element {
        &self.runs[run].element
    }

    /// The chain of a run.
    pub(crate) fn chain(&self, run: usize) -> u32 {
        self.layout.chains[run]
    }

    /// Number of passes.
    pub(crate) fn passes(&self) -> usize {
        self.layout.passes.len()
    }

    /// Number of the pass that a run belongs to.
    pub(crate) fn pass(&self, run: usize) -> usize {
        self.layout.passes.partition_point(|pass| pass.runs.end <= run)
    }

    /// Whether the walls of a pass begin on one of two runs and close on the other.
    pub(crate) fn close_on(&self, one: usize, other: usize) -> bool {
        let (first, last) = (one.min(other), one.max(other));
        let closes = || {
            let ends = self.of(first).zip(self.of(last));
            ends.is_some_and(|(first, last)| (first.start() - last.end()).norm() <= MERGE_MM)
        };
        self.are_ends_of_pass(first, last) && closes()
    }

    /// Whether the walls of a pass begin on the first of these runs and end on the last.
    pub(crate) fn are_ends_of_pass(&self, first: usize, last: usize) -> bool {
        let Some(pass) = self.layout.passes.get(self.pass(first)) else { return false };
        first != last
            && first == pass.begin.map_or(pass.runs.start, |begin| begin.run)
            && last == pass.end.map_or(pass.runs.end.saturating_sub(1), |end| end.run)
    }

    /// The wall part of a run's element; `None` when all of it is a tail.
    pub(crate) fn of(&self, run: usize) -> Option<Element> {
        self.seen_from(None, run)
    }

    /// The wall part of a run's element for a tool that follows a place of a run, mm from its
    /// start. A tail bounds only what runs along it.
    pub(crate) fn seen_from(&self, on: Option<(usize, f64)>, run: usize) -> Option<Element> {
        let number = self.pass(run);
        let on = on.map(|(run, along)| PlaceOnRun { run, along });
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

/// The tree over the runs that `holds` selects.
fn tree_of(runs: &[Run], chains: &[u32], widest_mm: f64, holds: impl Fn(usize) -> bool) -> Tree {
    let element = |run: usize| holds(run).then_some(runs[run].element);
    let elements = (0..runs.len()).map(|run| (element(run), chains[run]));
    Tree::of_elements(elements, widest_mm, |_, element| (Bounds::of(element), ()))
}

/// How wide a box may be, mm: so little that it overlaps only a few others where the contour fills
/// the plane, and so much that there are few.
fn widest_box(runs: &[Run]) -> f64 {
    let reach = runs.iter().fold(0.0_f64, |reach, run| reach.max(run.d_in_mm.abs()));
    let (mut length, mut all) = (0.0, Bounds::EMPTY);
    for run in runs {
        length += run.element.length();
        all = all.union(Bounds::of(&run.element));
    }
    let least = length / (2 * runs.len().max(1)) as f64;
    (BOX_REACHES * reach).max(2.0 * all.area() / length).max(least)
}

fn passes(runs: &[Run], meetings: &[SelfMeeting]) -> Vec<Pass> {
    let mut passes: Vec<Pass> = Vec::new();
    let mut closings: Vec<SelfMeeting> = Vec::new();
    let mut start = 0;
    for meeting in meetings.iter().filter(|meeting| meeting.is_return) {
        if meeting.early.run >= start && meeting.late.run >= start {
            passes.push(Pass { runs: start..meeting.late.run + 1, begin: None, end: None });
            closings.push(*meeting);
            start = meeting.late.run + 1;
        }
    }
    if start < runs.len() {
        passes.push(Pass { runs: start..runs.len(), begin: None, end: None });
    }
    // Meetings are in the order of their later place.
    let mut next = 0;
    for pass in &mut passes {
        while let Some(meeting) = meetings.get(next).filter(|it| it.late.run < pass.runs.end) {
            next += 1;
            if meeting.early.run >= pass.runs.start {
                pass.take(meeting);
            }
        }
    }
    let free_ends = closings.first().zip(closings.last());
    if let (Some((first, last)), [front, .., back]) = (free_ends, &mut passes[..]) {
        // The piece that leads to the first loop and the one that leads away from the last may
        // cross each other: that is no wall.
        let leads_on = meetings.iter().filter(|meeting| meeting.late <= last.late);
        front.begin = leads_on.map(|meeting| meeting.early).reduce(PlaceOnRun::first);
        if back.runs.start > last.late.run {
            let leads_off = meetings.iter().filter(|meeting| meeting.early >= first.early);
            let start = PlaceOnRun { run: back.runs.start, along: 0.0 };
            back.end =
                leads_off.map(|meeting| meeting.late).chain([start]).reduce(PlaceOnRun::last);
        }
    }
    passes
}

impl PlaceOnRun {
    fn first(self, other: Self) -> Self {
        if other < self { other } else { self }
    }

    fn last(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
}

impl Pass {
    /// Moves the ends of the walls to where the pass meets itself.
    fn take(&mut self, meeting: &SelfMeeting) {
        self.begin = Some(self.begin.map_or(meeting.early, |begin| begin.first(meeting.early)));
        self.end = Some(self.end.map_or(meeting.late, |end| end.last(meeting.late)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::span::links::ChainLinks;

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
        let walls = Walls::new(&runs, ChainLinks::default().of(&runs), &[]);
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
        let walls = Walls::new(&runs, ChainLinks::default().of(&runs), &[]);
        let passes: Vec<usize> = (0..6).map(|run| walls.pass(run)).collect();
        assert_eq!(passes, [0, 0, 0, 1, 1, 1]);
        assert!(walls.close_on(2, 0) && !walls.close_on(1, 0) && !walls.close_on(2, 3));
    }
}
