//! Whether the tool on one element cuts into the element next to it.
//!
//! Joints keep the tool off both elements where they meet; an arc may still
//! bend back to where the tool has been or will be. Looks at what was put out,
//! one run and the next; distant parts of a contour are not seen here.

use crate::chain::{Link, Placed, Role as LinkRole};
use crate::distance::nearest_on_way;
use crate::element::{Element, Vec2};
use crate::tails::Walls;
use crate::tolerance::{GOUGE_MM, LENGTH_MM};

/// The tool on one run comes too near to the other.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cut {
    /// The run that the tool is on, and the one it cuts into.
    pub on: usize,
    pub into: usize,
    pub at: Vec2,
    pub radius_mm: f64,
    pub distance_mm: f64,
    /// One of both is a closed loop, so that they are two passes.
    pub is_other_pass: bool,
}

/// All cuts, at most one a pair of neighbours: the deepest one.
///
/// `tolerance` is how much nearer the tool may be where something between both
/// was consumed, mm.
pub(crate) fn cuts(
    walls: &Walls<'_>,
    links: &[Link],
    placed: &[Placed],
    tolerance: f64,
) -> Vec<Cut> {
    let mut found = Vec::new();
    let mut before: Option<Stay<'_>> = None;
    let mut corner = None;
    for place in placed {
        let link = &links[place.link];
        match link.role {
            LinkRole::Run(run) => {
                let after = Stay { run, link, place };
                if let Some(before) = before {
                    let slack = if run == before.run + 1 { 0.0 } else { tolerance };
                    found.extend(cut(walls, [before, after], corner, GOUGE_MM + slack));
                }
                before = Some(after);
                corner = None;
            }
            LinkRole::Corner { .. } => corner = way(link, place),
            LinkRole::Entry | LinkRole::Exit => {}
        }
    }
    found
}

/// A run that the tool follows.
#[derive(Clone, Copy)]
struct Stay<'a> {
    run: usize,
    link: &'a Link,
    place: &'a Placed,
}

/// The deepest cut of a pair, on either run or on the corner between them.
fn cut(walls: &Walls<'_>, pair: [Stay<'_>; 2], corner: Option<Element>, slack: f64) -> Option<Cut> {
    // Lines that are joined cannot come back to each other.
    if pair.iter().all(|stay| stay.link.element.is_line()) {
        return None;
    }
    let offsets = pair.iter().flat_map(|stay| [stay.link.d_in_mm, stay.link.d_out_mm]);
    let radius_mm = offsets.map(f64::abs).fold(f64::INFINITY, f64::min);
    let [first, second] = pair.map(|stay| way(stay.link, stay.place));
    let mut deepest: Option<Cut> = None;
    // A corner belongs to the block after it (S07).
    for (way, on, into) in [(first, 0, 1), (second, 1, 0), (corner, 1, 0), (corner, 1, 1)] {
        let Some(way) = way else { continue };
        // The quick look first: tails are searched for only where something is cut.
        if nearest_on_way(&way, &pair[into].link.element).distance >= radius_mm - slack {
            continue;
        }
        let Some(wall) = walls.of(pair[into].run) else { continue };
        let near = nearest_on_way(&way, &wall);
        let is_deepest = deepest.is_none_or(|other| near.distance < other.distance_mm);
        if near.distance < radius_mm - slack && is_deepest {
            deepest = Some(Cut {
                on: pair[on].run,
                into: pair[into].run,
                at: near.on_wall,
                radius_mm,
                distance_mm: near.distance,
                is_other_pass: pair.iter().any(|stay| is_closed(&stay.link.element)),
            });
        }
    }
    deepest
}

/// The way of the tool along an element, without what joints cut off.
fn way(link: &Link, place: &Placed) -> Option<Element> {
    match link.element.offset(link.d_in_mm)? {
        Element::Line(_) => Element::line(place.start, place.end),
        Element::Arc(mut arc) => {
            if arc.radius <= LENGTH_MM {
                return None;
            }
            let (skipped, left_out) = (place.trim_in / arc.radius, place.trim_out / arc.radius);
            arc.from = (arc.point_at_angle(skipped) - arc.center) / arc.radius;
            arc.sweep = (arc.sweep - skipped - left_out).max(0.0);
            arc.to = (arc.point_at_angle(arc.sweep) - arc.center) / arc.radius;
            Some(Element::Arc(arc))
        }
    }
}

fn is_closed(element: &Element) -> bool {
    !element.is_line() && (element.end() - element.start()).norm() <= LENGTH_MM
}
