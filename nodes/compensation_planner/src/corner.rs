//! What the tool does at an outside corner.
//!
//! Arc: around the corner (S06). Intersection: on along both offsets, lines and
//! circles, until they meet (O05). Extend by radius: the intersection for obtuse corners, for acute ones
//! both tangents lengthened by the radius and joined (S08, S26). Lines are
//! lengthened themselves; of arcs the tangents are followed in lines.

use crate::chain::line_corner;
use crate::element::{Arc, Element, Vec2, left};
use crate::intersect::crossings;
use crate::tolerance::{LENGTH_MM, REVERSAL};
use cnc_msgs::contour::OutsideCorner;
use std::f64::consts::{PI, TAU};

/// How a corner is gone around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Around {
    Arc,
    /// An arc in place of an intersection that is not there (O08).
    NoIntersection,
    Lines(Lines),
}

/// Corner points in order, without what the neighbouring lines do themselves.
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

    fn push(&mut self, point: Vec2) {
        self.points[self.count] = point;
        self.count += 1;
    }
}

/// Shapes the corner that `corner` stands for: an arc of radius 0 about it.
///
/// `before` and `after` are the elements that it joins.
pub(crate) fn around(
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
    let (behind, ahead) = (before.offset(d_mm)?, after.offset(d_mm)?);
    let candidates = crossings(&behind, &ahead, LENGTH_MM);
    let longer = candidates.points().iter().map(|&point| {
        let before_longer = lengthened(&behind, -behind.back_from_end(point, LENGTH_MM));
        let after_longer = lengthened(&ahead, -ahead.along_from_start(point, LENGTH_MM));
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

/// How much an element is longer, mm; of circles that less than half a turn is meant.
fn lengthened(element: &Element, longer: f64) -> f64 {
    match element {
        Element::Arc(arc) if longer < -PI * arc.radius => longer + TAU * arc.radius,
        _ => longer,
    }
}

/// Along the tangents to their intersection, or cut short beyond a right angle.
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
