//! What the tool does at an outside corner.
//!
//! Arc: around the corner (S06). Intersection: on along both offsets, lines and circles, until they
//! meet (O05). Extend by radius: the intersection for obtuse corners; for acute ones both tangents,
//! lengthened by the radius and joined (S08, S26). Lines are lengthened themselves; arcs continue
//! along their tangents.

use crate::geometry::element::{Arc, Element, Vec2, left};
use crate::geometry::intersect::crossings;
use crate::geometry::tolerance::{LENGTH_MM, REVERSAL};
use crate::span::Span;
use crate::span::chain::{ChainLink, Placed, Role, gap, line_corner};
use crate::span::links::Links;
use cnc_msgs::contour::OutsideCorner;
use std::f64::consts::{PI, TAU};

/// How the tool goes around a corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Around {
    Arc,
    /// An arc, because the intersection does not exist (O08).
    NoIntersection,
    Lines(Lines),
}

/// Corner points in order, without the lines that lengthen the neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lines {
    points: [Vec2; 3],
    count: usize,
    /// Where the element before ends, and by how much it is lengthened, mm.
    pub before_end: Vec2,
    pub before_longer: f64,
    /// By how much the element after is lengthened at its start, mm.
    pub after_longer: f64,
}

impl Lines {
    /// Nothing between the two elements, which meet there.
    fn meeting(point: Vec2, before_longer: f64, after_longer: f64) -> Self {
        Self { points: [point; 3], count: 0, before_end: point, before_longer, after_longer }
    }

    /// Ends of the generated lines.
    pub(crate) fn points(&self) -> &[Vec2] {
        &self.points[..self.count]
    }

    /// Where the generated lines end and the element after them continues.
    pub(crate) fn last(&self) -> Vec2 {
        self.points().last().copied().unwrap_or(self.before_end)
    }

    fn push(&mut self, point: Vec2) {
        self.points[self.count] = point;
        self.count += 1;
    }
}

/// Knows how the tool goes around each corner of a span.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Corners<'a> {
    pub span: &'a Span<'a>,
    /// Corners between two arcs whose ends are nearer than twice this get an arc, mm (S69).
    pub short_mm: f64,
}

impl Corners<'_> {
    /// The mode of the corner before a leg; the number of legs means before the lead-off.
    pub(crate) fn mode(&self, next_leg: usize) -> OutsideCorner {
        self.span.legs.get(next_leg).map_or(self.span.exit_corner, |leg| leg.corner)
    }

    /// The shape of what is placed there; a corner that was cut short stays an arc.
    pub(crate) fn around(&self, links: Links<'_>, placed: &[Placed], index: usize) -> Around {
        let place = &placed[index];
        let Role::Corner { next_leg } = links.role(place.link) else { return Around::Arc };
        let mode = self.mode(next_leg);
        if mode == OutsideCorner::Arc || place.trim_in > 0.0 || place.trim_out > 0.0 {
            return Around::Arc;
        }
        let ChainLink { element: Element::Arc(arc), d_in_mm, .. } = links.at(place.link) else {
            return Around::Arc;
        };
        let Some((before, after)) = neighbours(links, placed, index) else { return Around::Arc };
        let is_short = !before.is_line()
            && !after.is_line()
            && gap(arc.from, arc.to, d_in_mm) < 2.0 * self.short_mm;
        if is_short { Around::Arc } else { around(mode, &arc, (&before, &after), d_in_mm) }
    }

    /// The lines around what is placed there, if it is a corner that has them.
    pub(crate) fn lines(&self, links: Links<'_>, placed: &[Placed], index: usize) -> Option<Lines> {
        placed.get(index)?;
        match self.around(links, placed, index) {
            Around::Lines(lines) => Some(lines),
            Around::Arc | Around::NoIntersection => None,
        }
    }

    /// How the tool goes around a corner that is not an arc, and how far its neighbours are
    /// lengthened.
    pub(crate) fn pieces(
        &self,
        links: Links<'_>,
        placed: &[Placed],
        index: usize,
    ) -> Option<[Option<Element>; PIECES]> {
        let lines = self.lines(links, placed, index)?;
        let (before, after) = neighbours(links, placed, index)?;
        let d_mm = links.at(placed[index].link).d_in_mm;
        // A merged run ends a hair off the corner; that must not become a whole turn.
        let on = |element: &Element, longer: f64, from: Vec2, to: Vec2| match element.offset(d_mm) {
            Some(Element::Arc(arc)) if longer > LENGTH_MM => {
                Element::arc(from, to, arc.center, arc.turn > 0.0, 0)
            }
            _ => Element::line(from, to),
        };
        let mut pieces = [None; PIECES];
        let mut at = lines.before_end;
        pieces[0] = on(&before, lines.before_longer, placed[index].start, at);
        for (piece, &point) in pieces[1..].iter_mut().zip(lines.points()) {
            *piece = Element::line(at, point);
            at = point;
        }
        pieces[PIECES - 1] = on(&after, lines.after_longer, at, placed[index].end);
        Some(pieces)
    }
}

/// The most pieces of a corner.
pub(crate) const PIECES: usize = 5;

/// The elements that a corner joins, if both still exist.
fn neighbours(links: Links<'_>, placed: &[Placed], index: usize) -> Option<(Element, Element)> {
    let link = placed[index].link;
    let before = placed.get(index.checked_sub(1)?)?.link;
    let after = placed.get(index + 1)?.link;
    (before + 1 == link && link + 1 == after)
        .then(|| (links.at(before).element, links.at(after).element))
}

/// Shapes the corner that `corner` stands for: an arc of radius 0 about it.
///
/// `before` and `after` are the elements that it joins.
fn around(
    mode: OutsideCorner,
    corner: &Arc,
    (before, after): (&Element, &Element),
    d_mm: f64,
) -> Around {
    match mode {
        OutsideCorner::Arc => Around::Arc,
        OutsideCorner::Intersection => {
            intersection(corner, before, after, d_mm).map_or(Around::NoIntersection, Around::Lines)
        }
        OutsideCorner::ExtendByRadius => {
            Around::Lines(along_tangents(corner, (before.is_line(), after.is_line()), d_mm))
        }
    }
}

/// The tool side's normals at the corner, turned into tangents.
fn tangents(corner: &Arc, d_mm: f64) -> (Vec2, Vec2) {
    let side = d_mm.signum();
    (-left(corner.from) * side, -left(corner.to) * side)
}

/// Both offsets lengthened until they meet; `None` when they do not, or far away.
fn intersection(corner: &Arc, before: &Element, after: &Element, d_mm: f64) -> Option<Lines> {
    let (t_before, t_after) = tangents(corner, d_mm);
    if before.is_line() && after.is_line() {
        if 1.0 + t_before.dot(&t_after) < REVERSAL {
            return None;
        }
        let point = line_corner(corner.center, t_before, t_after, d_mm);
        let longer = (point - corner.center).dot(&t_before);
        return Some(Lines::meeting(point, longer, longer));
    }
    let (before_offset, after_offset) = (before.offset(d_mm)?, after.offset(d_mm)?);
    let candidates = crossings(&before_offset, &after_offset, LENGTH_MM);
    let longer = candidates.points().iter().map(|&point| {
        let before_longer =
            lengthened(&before_offset, -before_offset.back_from_end(point, LENGTH_MM));
        let after_longer =
            lengthened(&after_offset, -after_offset.along_from_start(point, LENGTH_MM));
        Lines::meeting(point, before_longer, after_longer)
    });
    let most = d_mm.abs() / REVERSAL.sqrt();
    longer
        .filter(|lines| lines.before_longer >= -LENGTH_MM && lines.after_longer >= -LENGTH_MM)
        .filter(|lines| lines.before_longer.max(lines.after_longer) <= most)
        .min_by(|a, b| {
            (a.before_longer + a.after_longer).total_cmp(&(b.before_longer + b.after_longer))
        })
}

/// How much longer an element becomes, mm; on circles less than half a turn is meant.
fn lengthened(element: &Element, longer: f64) -> f64 {
    match element {
        Element::Arc(arc) if longer < -PI * arc.radius => longer + TAU * arc.radius,
        _ => longer,
    }
}

/// Follows the tangents to their intersection, or cuts the corner short beyond a right angle.
fn along_tangents(corner: &Arc, is_line: (bool, bool), d_mm: f64) -> Lines {
    let (before, after) = tangents(corner, d_mm);
    let radius = d_mm.abs();
    let (first, last) = (corner.center + corner.from * radius, corner.center + corner.to * radius);
    let cuts_short = before.dot(&after) < -1e-12;
    let (out, back) = if cuts_short {
        (first + before * radius, last - after * radius)
    } else {
        let point = line_corner(corner.center, before, after, d_mm);
        (point, point)
    };
    let longer = (out - first).dot(&before);
    let mut lines = Lines::meeting(first, 0.0, 0.0);
    if is_line.0 {
        (lines.before_end, lines.before_longer) = (out, longer);
    } else {
        lines.push(out);
    }
    if cuts_short {
        lines.push(back);
    }
    if is_line.1 {
        lines.after_longer = longer;
    } else {
        lines.push(last);
    }
    lines
}
