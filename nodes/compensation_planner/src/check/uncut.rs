//! Outlines what a tool that is too large leaves uncut.
//!
//! Where blocks are left out, the tool stands with one edge on either side of them. Whatever lies
//! between them and its circle stays. Outlines are exact: the contour's own lines and arcs, and an
//! arc of the tool. Where the contour begins or ends with blocks that are left out, a line closes
//! the outline. The fillets that every round tool leaves in sharp inside corners are not listed.

use crate::check::interference::Joined;
use crate::check::reach::left_out;
use crate::geometry::element::{Element, Vec2, cross};
use crate::geometry::frame::{height, in_work};
use crate::geometry::tessellate;
use crate::geometry::tolerance::LENGTH_MM;
use crate::span::chain::{ChainLink, Placed, Role};
use crate::span::links::Links;
use crate::span::{Run, Span};
use cnc_msgs::calls::Call;
use cnc_msgs::contour::Source;
use cnc_msgs::geometry::{Arc, Plane, Position, Shape};

/// Material that the path leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct UncutRegion {
    /// The first and the last block that is left out or cut short.
    pub first: Source,
    pub last: Source,
    /// The calls and loop passes that led to the first one.
    pub calls: Vec<Call>,
    pub area_mm2: f64,
    /// Where the outline begins, work frame, mm.
    pub start: Position,
    /// The closed outline: along the contour, and back along the edge of the tool.
    pub outline: Vec<OutlinePiece>,
}

/// One line or arc of an outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutlinePiece {
    pub shape: Shape,
    pub end: Position,
}

impl UncutRegion {
    /// Its extent along an axis, mm.
    fn widest(&self, axis: usize) -> f64 {
        let at = self.outline.iter().map(|piece| piece.end[axis]);
        let (low, high) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        high - low
    }

    /// Points along the outline, from its start back to it, within a chord error.
    pub fn points(&self, chord_error_mm: f64) -> Vec<Position> {
        let mut points = vec![self.start];
        let mut start = self.start;
        for piece in &self.outline {
            tessellate::along(start, &piece.shape, piece.end, chord_error_mm, |p| points.push(p));
            start = piece.end;
        }
        points
    }
}

/// All regions that stay uncut: at joints after which a loop was cut off, and where blocks were
/// left out by more than the tolerance, mm.
pub(crate) fn regions(
    joined: &Joined<'_>,
    runs: &[Run],
    cut_after: &[usize],
    tolerance: f64,
) -> Vec<UncutRegion> {
    let Joined { links, placed, corners } = *joined;
    let mut places: Vec<Option<usize>> = cut_after.iter().copied().map(Some).collect();
    places.extend(left_out(links, placed, tolerance));
    places.sort_unstable();
    places.dedup();
    let regions = places.into_iter().map(|at| region(corners.span, runs, (links, placed), at));
    // The noise of coordinates does not count.
    let is_deep = |region: &UncutRegion| {
        let [x, y, z] = std::array::from_fn(|axis| region.widest(axis));
        region.area_mm2 > tolerance * x.max(y).max(z)
    };
    regions.flatten().filter(is_deep).collect()
}

/// The region at the joint after `placed[index]`; before the first when `None`.
fn region(
    span: &Span<'_>,
    runs: &[Run],
    (links, placed): (Links<'_>, &[Placed]),
    index: Option<usize>,
) -> Option<UncutRegion> {
    let before = index.and_then(|index| placed.get(index));
    let after = placed.get(index.map_or(0, |index| index + 1));
    let joint = before.map(|place| place.end).or(after.map(|place| place.start))?;
    let from = before.map_or(0, |place| place.link + 1);
    let between = links.range(from, after.map_or(links.len(), |place| place.link));
    let mut touched: Vec<usize> = Vec::new();
    let mut outline: Vec<Element> = Vec::new();
    let mut feet = [None; 2];
    if let Some(place) = before {
        let (foot, rest) = split(&links.at(place.link), joint);
        feet[0] = foot;
        outline.extend(rest.1);
        touched.extend(run_of(&links.at(place.link)));
    }
    let left_out: Vec<usize> = between.iter().filter_map(|link| run_of(&link)).collect();
    outline.extend(left_out.iter().map(|&run| runs[run].element));
    if let Some(place) = after {
        let (foot, rest) = split(&links.at(place.link), joint);
        feet[1] = foot;
        outline.extend(rest.0);
        touched.extend(run_of(&links.at(place.link)));
    }
    let (first, last) = (outline.first()?.start(), outline.last()?.end());
    let tool = match feet {
        // The circle of the tool goes from the first foot to the second.
        [Some(from), Some(to)] if (to - from).norm() > LENGTH_MM => {
            Element::arc(to, from, joint, span.d_mm < 0.0, 0)
        }
        _ => Element::line(last, first),
    };
    outline.extend(tool);
    let blamed = if left_out.is_empty() { touched } else { left_out };
    let (first_run, last_run) = (*blamed.iter().min()?, *blamed.iter().max()?);
    let last_leg = &span.legs[runs[last_run].legs.end - 1];
    let at = height(span.plane, last_leg.motion.end);
    let area_mm2 = area(&outline, joint).abs();
    Some(UncutRegion {
        calls: Vec::new(),
        first: span.legs[runs[first_run].legs.start].source,
        last: last_leg.source,
        area_mm2,
        start: in_work(span.plane, outline.first()?.start(), at),
        outline: outline.iter().map(|element| piece(element, span.plane, at)).collect(),
    })
}

fn run_of(link: &ChainLink) -> Option<usize> {
    match link.role {
        Role::Run(run) => Some(run),
        _ => None,
    }
}

/// Where the tool at a joint touches a link, and the parts of the link before and after that.
fn split(link: &ChainLink, joint: Vec2) -> (Option<Vec2>, (Option<Element>, Option<Element>)) {
    match link.role {
        Role::Run(_) => {
            let foot = link.element.project(joint);
            let along = link.element.along_from_start(foot, LENGTH_MM);
            (Some(foot), (link.element.before(along), link.element.after(along)))
        }
        Role::Corner { .. } => (Some(link.element.project(joint)), (None, None)),
        Role::Entry | Role::Exit => (None, (None, None)),
    }
}

/// The signed area of a closed outline, mm²; computed about a near point, for precision.
fn area(outline: &[Element], near: Vec2) -> f64 {
    let of = |element: &Element| {
        let triangle = cross(element.start() - near, element.end() - near) / 2.0;
        match element {
            Element::Line(_) => triangle,
            Element::Arc(arc) => {
                let segment = arc.radius * arc.radius * (arc.sweep - arc.sweep.sin()) / 2.0;
                triangle + segment * arc.turn
            }
        }
    };
    outline.iter().map(of).sum()
}

fn piece(element: &Element, plane: Plane, at: f64) -> OutlinePiece {
    let shape = match element {
        Element::Line(_) => Shape::Line,
        Element::Arc(arc) => Shape::Arc(Arc {
            plane,
            center: in_work(plane, arc.center, at),
            clockwise: arc.turn < 0.0,
            turns: u16::from(element.is_closed()),
        }),
    };
    OutlinePiece { shape, end: in_work(plane, element.end(), at) }
}
