//! Merges legs that follow one line or arc into a run.
//!
//! A post processor splits lines and arcs, and the tool path must not depend on where. Legs within
//! [`MERGE_MM`] of one line or arc become one for the geometry; `span_writer` splits them again at
//! the normal points. Lines may be merged more coarsely, where the rounding of posted coordinates
//! hides them.

use crate::geometry::element::{Arc, Element, Vec2, cross, left};
use crate::geometry::frame::{element_from, in_plane};
use crate::geometry::tolerance::{LENGTH_MM, MERGE_MM};
use crate::span::{AtChange, Leg, Run, Span};
use cnc_msgs::geometry::Shape;

/// How many legs may lead to a closed contour, plus one.
const LEADING_LEGS: usize = 4;

/// How far from the end of its last leg a merged arc may end, mm: less than what counts as one
/// place. A tangent element that begins there would meet its offset far away, or not at all.
const ENDS_MM: f64 = 0.1 * LENGTH_MM;

/// The runs of a span, and each leg's place in its run.
///
/// Points within `straight_mm` of a line, at least [`MERGE_MM`], are on it. Runs next to a change
/// of side are merged as coarsely as [`Span::at_change`] says.
pub(crate) fn runs(span: &mut Span<'_>, straight_mm: f64) -> Vec<Run> {
    some_runs(span, straight_mm, usize::MAX)
}

/// The first two runs of a span.
pub(crate) fn first_runs(span: &Span<'_>, straight_mm: f64) -> Vec<Run> {
    let mut runs = some_runs(&mut span.clone(), straight_mm, 2);
    runs.truncate(2);
    runs
}

/// The last two runs of a span.
pub(crate) fn last_runs(span: &Span<'_>, straight_mm: f64) -> Vec<Run> {
    let mut runs = some_runs(&mut span.clone(), straight_mm, usize::MAX);
    runs.split_off(runs.len().saturating_sub(2))
}

/// The first runs: `count` of them and one more at most.
fn some_runs(span: &mut Span<'_>, straight_mm: f64, most: usize) -> Vec<Run> {
    let [from, to] = span.at_change.clone();
    let ends = [from.as_ref().map(|from| from.legs.end), to.as_ref().map(|to| to.legs.start)];
    let width_of = |index: usize| {
        let is_here = |change: &&AtChange| change.legs.contains(&index);
        from.iter().chain(&to).find(is_here).map_or(straight_mm, |change| change.straight_mm)
    };
    let mut runs: Vec<Run> = Vec::with_capacity(span.legs.len().min(most));
    let mut d_mm = span.d_mm;
    let mut cone = Cone::at(Vec2::zeros(), straight_mm);
    for index in 0..span.legs.len() {
        if runs.len() > most {
            break;
        }
        let straight_mm = width_of(index);
        let leg = span.legs[index];
        // After an arc that has taken in a short piece, a line starts where the arc ends.
        let arc = runs.last().map(|run| &run.element).filter(|element| !element.is_line());
        let start = arc
            .map(Element::end)
            .filter(|&end| leg.motion.shape == Shape::Line && is_off(end, leg.start));
        let start = start.unwrap_or(leg.start);
        let Some(element) = element_from(span.plane, start, leg.motion) else { continue };
        let end = in_plane(span.plane, leg.motion.end);
        let changes = leg.d_out_mm != d_mm;
        let closes = element.is_line() && closes(&span.legs[..index], leg.start);
        let ends = ends.contains(&Some(index)) || changes || closes;
        let open = runs.last_mut().filter(|run| !ends && run.d_in_mm == run.d_out_mm);
        let reach = open.and_then(|run| {
            let reach = extend(run, &element, end, &mut cone)?;
            run.legs.end = index + 1;
            Some(reach)
        });
        span.legs[index].reach = match reach {
            Some(reach) => reach,
            None => {
                if let Some(run) = runs.last() {
                    settle(run, span);
                }
                cone = Cone::new(&element, end, straight_mm);
                runs.push(Run {
                    element,
                    legs: index..index + 1,
                    d_in_mm: d_mm,
                    d_out_mm: leg.d_out_mm,
                });
                full_reach(&element)
            }
        };
        d_mm = leg.d_out_mm;
    }
    if let Some(run) = runs.last() {
        settle(run, span);
    }
    runs
}

/// Whether a contour returns to where it began, or to the end of what leads to it. A line merged
/// across that point would miss it by the merging tolerance.
fn closes(before: &[Leg<'_>], start: Vec2) -> bool {
    let is_there = |leg: &Leg<'_>| (leg.start - start).norm() <= LENGTH_MM;
    before.iter().take(LEADING_LEGS).any(is_there)
}

/// Whether two points are farther apart than rounding and nearer than what is merged.
fn is_off(a: Vec2, b: Vec2) -> bool {
    (LENGTH_MM..=MERGE_MM).contains(&(a - b).norm())
}

fn full_reach(element: &Element) -> f64 {
    match element {
        Element::Line(line) => line.length,
        Element::Arc(arc) => arc.sweep,
    }
}

/// Lengthens a run by a leg, if both are one line or arc; gives the leg's reach.
fn extend(run: &mut Run, leg: &Element, end: Vec2, cone: &mut Cone) -> Option<f64> {
    let is_short = leg.length() <= MERGE_MM;
    match (&mut run.element, leg) {
        (Element::Arc(arc), Element::Arc(next)) => {
            let off = (arc.center - next.center).norm() + (arc.radius - next.radius).abs();
            let longer = Arc { sweep: arc.sweep + next.sweep, to: next.to, ..*arc };
            let goes_on = arc.turn == next.turn && arc.to.dot(&next.from) > 0.5;
            let ends_there = (Element::Arc(longer).end() - end).norm() <= ENDS_MM;
            if goes_on && off <= MERGE_MM && ends_there {
                *arc = longer;
                return Some(arc.sweep);
            }
        }
        (Element::Line(_), Element::Arc(_)) if cone.far <= MERGE_MM && !is_short => {
            run.element = *leg;
            return Some(full_reach(leg));
        }
        (Element::Line(_), _) if is_short || leg.is_line() => {
            let line = cone.extend(end)?;
            run.element = line.unwrap_or(run.element);
            return Some(0.0);
        }
        _ => {}
    }
    let arc = run.element;
    (is_short && !arc.is_line() && (end - arc.end()).norm() <= MERGE_MM).then(|| full_reach(&arc))
}

/// Gives the legs of a finished run of lines their places on the final line.
fn settle(run: &Run, span: &mut Span<'_>) {
    let legs = run.legs.clone();
    match run.element {
        _ if legs.len() == 1 => {}
        Element::Line(line) => {
            let mut reach = 0.0_f64;
            for leg in &mut span.legs[legs.clone()] {
                let along = (in_plane(span.plane, leg.motion.end) - line.start).dot(&line.tangent);
                reach = reach.max(along.min(line.length));
                leg.reach = reach;
            }
            span.legs[legs.end - 1].reach = line.length;
        }
        Element::Arc(_) => {
            // Short lines before an arc are no part of it.
            for leg in &mut span.legs[legs] {
                if leg.motion.shape != Shape::Line {
                    break;
                }
                leg.reach = 0.0;
            }
        }
    }
}

/// The directions in which a line from a start passes all points so far within the tolerance.
#[derive(Debug, Clone, Copy)]
struct Cone {
    start: Vec2,
    /// The tolerance, mm.
    width: f64,
    /// The rightmost and leftmost direction; none while all points are near.
    bounds: Option<(Vec2, Vec2)>,
    /// The farthest point so far, mm.
    far: f64,
}

impl Cone {
    fn at(start: Vec2, width: f64) -> Self {
        Self { start, width, bounds: None, far: 0.0 }
    }

    fn new(element: &Element, end: Vec2, width: f64) -> Self {
        let start = element.start();
        let mut cone = Self::at(start, width);
        if element.is_line() {
            cone.narrow(end - start, (end - start).norm());
        }
        cone
    }

    /// Takes another point as the end of the line. The inner `None` means that the line is still
    /// one point.
    fn extend(&mut self, end: Vec2) -> Option<Option<Element>> {
        let out = end - self.start;
        let distance = out.norm();
        if distance < self.far - self.width {
            return None;
        }
        if let Some((right, left)) = self.bounds {
            let within = cross(right, out) >= 0.0 && cross(out, left) >= 0.0;
            // Near the start the bounds are up to a half turn apart.
            if !within || (right + left).dot(&out) <= 0.0 {
                return None;
            }
        }
        self.narrow(out, distance);
        Some(Element::line(self.start, end))
    }

    fn narrow(&mut self, out: Vec2, distance: f64) {
        self.far = self.far.max(distance);
        if distance <= self.width {
            return;
        }
        let unit = out / distance;
        let sine = self.width / distance;
        let cosine = (1.0 - sine * sine).sqrt();
        let right = unit * cosine - left(unit) * sine;
        let to_left = unit * cosine + left(unit) * sine;
        self.bounds = Some(match self.bounds {
            None => (right, to_left),
            Some((old_right, old_left)) => (
                if cross(old_right, right) > 0.0 { right } else { old_right },
                if cross(old_left, to_left) < 0.0 { to_left } else { old_left },
            ),
        });
    }
}
