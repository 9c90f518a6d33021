//! What the tool does at an outside corner.
//!
//! Arc: around the corner (S06). Intersection: on along both tangents until they
//! meet. Extend by radius: the intersection for obtuse corners, for acute ones
//! both tangents lengthened by the radius and joined (S08, S26). Lines are
//! lengthened themselves; of arcs the tangents are followed in lines.

use crate::chain::line_corner;
use crate::element::{Arc, Vec2, left};
use crate::tolerance::REVERSAL;
use cnc_msgs::contour::OutsideCorner;

/// How a corner is gone around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Around {
    Arc,
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
/// `is_line` says of the elements before and after whether they are lines.
pub(crate) fn around(
    mode: OutsideCorner,
    corner: &Arc,
    is_line: (bool, bool),
    d_mm: f64,
) -> Around {
    let side = d_mm.signum();
    // The tool side's normals, turned into tangents.
    let (before, after) = (-left(corner.from) * side, -left(corner.to) * side);
    let cosine = before.dot(&after);
    let cuts_short = match mode {
        OutsideCorner::Arc => return Around::Arc,
        OutsideCorner::Intersection => 1.0 + cosine < REVERSAL,
        OutsideCorner::ExtendByRadius => cosine < -1e-12,
    };
    let radius = d_mm.abs();
    let (first, last) = (corner.center + corner.from * radius, corner.center + corner.to * radius);
    let (out, back) = if cuts_short {
        (first + before * radius, last - after * radius)
    } else {
        let point = line_corner(corner.center, before, after, d_mm);
        (point, point)
    };
    let longer = (out - first).dot(&before);
    let mut lines = Lines {
        points: [first; 3],
        count: 0,
        before_end: first,
        before_longer: 0.0,
        after_longer: 0.0,
    };
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
    Around::Lines(lines)
}
