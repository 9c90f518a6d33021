//! Finds where a contour meets itself.
//!
//! The contour between two passings of one place is a loop. A loop without width does not count:
//! the contour went back over itself, or posted coordinates jumped to and fro.

use crate::check::retraced_runs::RetracedRuns;
use crate::geometry::bounds::Bounds;
use crate::geometry::distance::{are_apart, is_near};
use crate::geometry::element::{Arc, Element, Line, Vec2, cross};
use crate::geometry::intersect::crossings;
use crate::geometry::tolerance::{LENGTH_MM, LOOP_MM};
use crate::geometry::tree::{Tree, budget};
use crate::span::Run;
use std::ops::ControlFlow;

/// Meetings kept for each run, plus a constant; and the same before looking for retraced runs.
const MEETINGS_MAX: (usize, usize) = (4, 200_000);
const FEW: (usize, usize) = (4, 100);

/// A place on a run, mm from its start.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub(crate) struct PlaceOnRun {
    pub run: usize,
    pub along: f64,
}

/// The contour is at a place that it has passed before.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SelfMeeting {
    pub early: PlaceOnRun,
    pub late: PlaceOnRun,
    /// Whether the later run ends there.
    pub is_return: bool,
}

/// All places where the contour meets itself, in the order of the later place; `None` when there
/// are too many.
pub(crate) fn meetings(runs: &[Run], tree: &Tree) -> Option<Vec<SelfMeeting>> {
    places(runs, tree, FEW, |_| true, true).map(|found| wide(runs, found))
}

/// The same for a contour that retraces itself: for each run and its copies before it, the first
/// place and the last ones. The tree holds only the first of all copies.
pub(crate) fn meetings_of_copies(
    runs: &[Run],
    tree: &Tree,
    copies: &RetracedRuns,
) -> Option<Vec<SelfMeeting>> {
    let mut partners: Vec<Vec<(usize, SelfMeeting)>> = vec![Vec::new(); runs.len()];
    for meeting in places(runs, tree, MEETINGS_MAX, |run| copies.is_first(run), false)? {
        let SelfMeeting { early, late, .. } = meeting;
        partners[late.run].push((early.run, meeting));
        if early.run != late.run {
            let turned = SelfMeeting { early: late, late: early, is_return: false };
            partners[early.run].push((late.run, turned));
        }
    }
    for (index, run) in runs.iter().enumerate().filter(|(index, _)| copies.is_first(*index)) {
        for along in [0.0, run.element.length()] {
            let place = PlaceOnRun { run: index, along };
            partners[index]
                .push((index, SelfMeeting { early: place, late: place, is_return: false }));
        }
    }
    let mut found: Vec<SelfMeeting> = Vec::new();
    for late in 0..runs.len() {
        let Some(first) = copies.of_run(late).next() else { continue };
        for (partner, meeting) in &partners[first] {
            let is_own = *partner == first && meeting.early.along != meeting.late.along;
            let before = || copies.within(*partner, 0..late + usize::from(is_own));
            for early in before().take(1).chain(before().rev().take(2)) {
                found.extend(between(runs, meeting, early, late));
            }
        }
    }
    Some(wide(runs, found))
}

/// A meeting of copies, except the joint of two consecutive ones.
fn between(runs: &[Run], meeting: &SelfMeeting, early: usize, late: usize) -> Option<SelfMeeting> {
    let length = |run: usize| runs[run].element.length();
    let is_joint = early + 1 == late
        && meeting.late.along <= LENGTH_MM
        && meeting.early.along >= length(early) - LENGTH_MM;
    let place = |run: usize, along: f64| PlaceOnRun { run, along };
    (!is_joint).then(|| SelfMeeting {
        early: place(early, meeting.early.along),
        late: place(late, meeting.late.along),
        is_return: meeting.late.along >= length(late) - LENGTH_MM,
    })
}

/// Keeps the meetings whose loops have a width, in the order of the later place.
fn wide(runs: &[Run], mut found: Vec<SelfMeeting>) -> Vec<SelfMeeting> {
    if !found.is_empty() {
        let areas = Areas::of(runs);
        found.retain(|meeting| areas.width(meeting) > LOOP_MM);
    }
    let order = |meeting: &SelfMeeting| (meeting.late, meeting.early);
    found.sort_by(|a, b| order(a).partial_cmp(&order(b)).unwrap_or(std::cmp::Ordering::Equal));
    found
}

/// All places where runs that count meet; `None` when there are too many. The joint of two
/// consecutive runs is included only if their copies may meet there.
fn places(
    runs: &[Run],
    tree: &Tree,
    most: (usize, usize),
    counts: impl Fn(usize) -> bool,
    skips_joints: bool,
) -> Option<Vec<SelfMeeting>> {
    let mut found: Vec<SelfMeeting> = Vec::new();
    for (index, run) in runs.iter().enumerate().filter(|(index, _)| counts(*index)) {
        if run.element.is_closed() || run.element.goes_around() {
            let late = PlaceOnRun { run: index, along: run.element.length() };
            let early = PlaceOnRun { run: index, along: 0.0 };
            found.push(SelfMeeting { early, late, is_return: true });
        }
    }
    let most = most.0 * runs.len() + most.1;
    let bounds = |run: usize| Bounds::of(&runs[run].element);
    let is_complete =
        tree.near_itself(LENGTH_MM, &mut budget(runs.len()), bounds, |early, late| {
            if counts(early) && counts(late) {
                let joint = (skips_joints && early + 1 == late).then(|| runs[early].element.end());
                meet(runs, (early, late), joint, &mut found);
            }
            if found.len() < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
    (is_complete && found.len() < most).then_some(found)
}

fn meet(
    runs: &[Run],
    (early, late): (usize, usize),
    joint: Option<Vec2>,
    found: &mut Vec<SelfMeeting>,
) {
    let (a, b) = (&runs[early].element, &runs[late].element);
    if joint.is_some_and(|joint| is_bend(a, b, joint)) || are_apart(a, b, 2.0 * LENGTH_MM) {
        return;
    }
    let mut add = |point: Vec2, is_end_of_late: bool| {
        if joint.is_some_and(|joint| (joint - point).norm() <= LENGTH_MM)
            || !is_near(a, point)
            || !is_near(b, point)
        {
            return;
        }
        let length = b.length();
        let along = if is_end_of_late { length } else { b.along_from_start(point, LENGTH_MM) };
        found.push(SelfMeeting {
            early: PlaceOnRun {
                run: early,
                along: a.along_from_start(point, LENGTH_MM).clamp(0.0, a.length()),
            },
            late: PlaceOnRun { run: late, along: along.clamp(0.0, length) },
            is_return: is_end_of_late,
        });
    };
    add(b.end(), true);
    add(b.start(), false);
    add(a.start(), false);
    add(a.end(), false);
    for &point in crossings(a, b, 0.0).points() {
        add(point, false);
    }
}

/// Whether two elements part so clearly at their joint that they meet nowhere else.
fn is_bend(a: &Element, b: &Element, joint: Vec2) -> bool {
    const BEND: f64 = 1e-2;
    /// Beyond this, mm, rounding moves the crossing of the lines away from the joint.
    const FAR_MM: f64 = 1e6;
    if joint.amax() >= FAR_MM || (b.start() - joint).amax() >= 0.1 * LENGTH_MM {
        return false;
    }
    let goes_on = a.end_tangent().dot(&b.start_tangent()) > 0.0;
    let (a, b) = match (a, b) {
        (Element::Line(a), Element::Line(b)) => (a, b),
        _ if !goes_on => return false,
        (Element::Line(line), Element::Arc(arc)) => return leaves(line, line.start, arc, b.end()),
        (Element::Arc(arc), Element::Line(line)) => return leaves(line, b.end(), arc, a.start()),
        (Element::Arc(_), Element::Arc(_)) => return false,
    };
    let sine = cross(a.tangent, b.tangent).abs();
    sine > BEND && a.length.min(b.length) * sine > 4.0 * LENGTH_MM
}

/// Whether an arc of less than half a turn leaves its tangent at the joint for good: the other ends
/// of both are off the other one.
fn leaves(line: &Line, end_of_line: Vec2, arc: &Arc, end_of_arc: Vec2) -> bool {
    let center_off = cross(line.tangent, arc.center - line.start).abs();
    let is_tangent = (center_off - arc.radius).abs() < 1e-3 * arc.radius;
    let off_line = cross(line.tangent, end_of_arc - line.start).abs();
    let off_circle = ((end_of_line - arc.center).norm() - arc.radius).abs();
    is_tangent && arc.sweep < 3.0 && off_line.min(off_circle) > 4.0 * LENGTH_MM
}

/// For so short a loop the sums from the start of the contour have too few digits.
const FEW_BETWEEN: usize = 64;

/// Running areas and lengths along a contour, to measure its loops.
struct Areas<'a> {
    runs: &'a [Run],
    /// Before each run: twice the area swept from the origin, mm², and the length, mm.
    before: Vec<(f64, f64)>,
    origin: Vec2,
}

impl<'a> Areas<'a> {
    fn of(runs: &'a [Run]) -> Self {
        let origin = runs.first().map_or(Vec2::zeros(), |run| run.element.start());
        if runs.len() <= FEW_BETWEEN {
            return Self { runs, before: Vec::new(), origin };
        }
        let mut sum = (0.0, 0.0);
        let before = runs.iter().map(|run| {
            let before = sum;
            sum.0 += swept_area(&run.element, origin);
            sum.1 += run.element.length();
            before
        });
        Self { runs, before: before.collect(), origin }
    }

    /// The mean width of the loop between two passings of one place, mm.
    fn width(&self, &SelfMeeting { early, late, .. }: &SelfMeeting) -> f64 {
        if early.run == late.run {
            return f64::INFINITY;
        }
        let begin = self.runs[early.run].element.after(early.along);
        let end = self.runs[late.run].element.before(late.along);
        let between = early.run + 1..late.run;
        let (origin, mut area, mut length) = if between.len() <= FEW_BETWEEN {
            let origin = self.runs[early.run].element.end();
            let runs = self.runs[between].iter().map(|run| &run.element);
            let area = runs.clone().map(|element| swept_area(element, origin)).sum();
            (origin, area, runs.map(Element::length).sum())
        } else {
            let (from, to) = (self.before[between.start], self.before[between.end]);
            (self.origin, to.0 - from.0, to.1 - from.1)
        };
        for element in [begin, end].iter().flatten() {
            area += swept_area(element, origin);
            length += element.length();
        }
        area.abs() / length
    }
}

/// Twice the area that the line from a point sweeps along an element, mm².
fn swept_area(element: &Element, from: Vec2) -> f64 {
    let chord = cross(element.start() - from, element.end() - from);
    match element {
        Element::Line(_) => chord,
        Element::Arc(arc) => {
            chord + arc.turn * arc.radius * arc.radius * (arc.sweep - arc.sweep.sin())
        }
    }
}
