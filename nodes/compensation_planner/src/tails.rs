//! What is left of the first and the last element of a pass without its tails.
//!
//! A tail is the piece from a free end to the first place where the pass
//! crosses itself: a contour that is entered and left by legs that cross has
//! no wall beyond the crossing (M12). Only asked for when a lead seems to cut.

use crate::distance::is_on;
use crate::element::{Element, Vec2};
use crate::intersect::crossings;
use crate::span::Run;
use crate::tolerance::MERGE_MM;

/// Runs from the free end that are searched for the crossing; with every run of
/// the pass as the other one. A longer tail counts as a wall.
const RUNS_MAX: usize = 64;

/// The wall in the first element; `None` when all of it is a tail.
pub(crate) fn wall_at_start(runs: &[Run]) -> Option<Element> {
    wall(runs.len(), |index| runs[index].element)
}

/// The wall in the last element; `None` when all of it is a tail.
pub(crate) fn wall_at_end(runs: &[Run]) -> Option<Element> {
    let last = runs.len() - 1;
    wall(runs.len(), |index| reversed(&runs[last - index].element))
}

fn wall(count: usize, element: impl Fn(usize) -> Element) -> Option<Element> {
    for index in 0..count.min(RUNS_MAX) {
        let this = element(index);
        let first = (index + 1..count)
            .filter_map(|other| {
                let shared = (other == index + 1).then(|| this.end());
                first_crossing(&this, &element(other), shared)
            })
            .min_by(f64::total_cmp);
        match first {
            Some(along) if index == 0 => return without_start(&this, along),
            Some(_) => return None,
            None => {}
        }
    }
    (count > 0).then(|| element(0))
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
