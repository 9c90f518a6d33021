//! What the tool may cut while it follows something, however large it is.
//!
//! A tool of radius r stands at p + r n, where it touches p. It cuts a point q only if
//! |q - p|² < 2 r (q - p)·n: nothing behind the tangent at p is cut by any tool. Boxes of p and of n
//! decide that for many points at once. Boxes of the tool centre do not: a large tool is far from
//! what it follows, and as near to everything else.

use crate::geometry::bounds::Bounds;
use crate::geometry::element::{Arc, Element, Line, Vec2, left};

/// Tells whether a box of a tree may be near to a box of another one; `()` by the gap between them.
pub(crate) trait Nearness: Copy {
    /// Of both boxes together.
    fn and(self, other: Self) -> Self;

    /// Whether anything in this box may be nearer than `reach` mm to anything in the other one.
    fn is_near(self, bounds: &Bounds, other: &Bounds, reach: f64) -> bool;
}

impl Nearness for () {
    fn and(self, (): Self) {}

    #[inline]
    fn is_near(self, bounds: &Bounds, other: &Bounds, reach: f64) -> bool {
        bounds.gap_squared(other) <= reach * reach
    }
}

/// The directions from the points that a tool touches to its centre: unit vectors in a box.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Normals(Bounds);

impl Normals {
    pub(crate) const NONE: Self = Self(Bounds::EMPTY);
}

impl Nearness for Normals {
    fn and(self, other: Self) -> Self {
        Self(self.0.union(other.0))
    }

    /// The box is that of the touched points, and `reach` the largest radius.
    #[inline]
    fn is_near(self, bounds: &Bounds, other: &Bounds, reach: f64) -> bool {
        let gap_squared = bounds.gap_squared(other);
        if gap_squared > 4.0 * reach * reach {
            return false;
        }
        let (least, most) = (other.low - bounds.high, other.high - bounds.low);
        let Self(Bounds { low, high }) = self;
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let ahead = |low: f64, high: f64, least: f64, most: f64| {
            larger(larger(low * least, low * most), larger(high * least, high * most))
        };
        let ahead = ahead(low.x, high.x, least.x, most.x) + ahead(low.y, high.y, least.y, most.y);
        gap_squared < 2.0 * reach * ahead
    }
}

/// The box of the points that a tool at a signed distance touches along an element of its path, and
/// the directions from them to its centre.
pub(crate) fn contact(path: &Element, d_mm: f64) -> (Bounds, Normals) {
    let side = d_mm.signum();
    match *path {
        Element::Line(line) => {
            let normal = left(line.tangent) * side;
            let touched = Line { start: line.start - normal * d_mm.abs(), ..line };
            let normals = Bounds { low: normal, high: normal };
            (Bounds::of(&Element::Line(touched)), Normals(normals))
        }
        Element::Arc(arc) => {
            let radius = (arc.radius + d_mm * arc.turn).max(0.0);
            let touched = Bounds::of(&Element::Arc(Arc { radius, ..arc }));
            let unit = Arc { center: Vec2::zeros(), radius: 1.0, ..arc };
            let Bounds { low, high } = Bounds::of(&Element::Arc(unit));
            let is_outside = side * arc.turn < 0.0;
            let normals = if is_outside { [low, high] } else { [-high, -low] };
            (touched, Normals(Bounds { low: normals[0], high: normals[1] }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(range: f64) -> impl Strategy<Value = Vec2> {
        (-range..range, -range..range).prop_map(|(x, y)| Vec2::new(x, y))
    }

    proptest! {
        /// Points in a box that a tool cuts anywhere on an element are near to it.
        #[test]
        fn nothing_that_is_cut_is_behind(
            ends in (vector(5.0), vector(5.0)),
            center in prop::option::of(vector(5.0)),
            is_ccw: bool,
            d_mm in prop_oneof![-9.0..-0.1_f64, 0.1..9.0_f64, 100.0..1e4_f64],
            low in vector(9.0),
            size in (0.0..2.0_f64, 0.0..2.0_f64),
        ) {
            let wall = match center {
                Some(center) => Element::arc(ends.0, ends.1, center, is_ccw, 0),
                None => Element::line(ends.0, ends.1),
            };
            let Some(path) = wall.and_then(|wall| wall.offset(d_mm)) else { return Ok(()) };
            let high = low + Vec2::new(size.0, size.1);
            let other = Bounds { low, high };
            let (touched, normals) = contact(&path, d_mm);
            let is_cut = (0..=200).any(|part| {
                let center = path.point_at(path.length() * f64::from(part) / 200.0);
                let nearest = center.sup(&low).inf(&high);
                (center - nearest).norm() < d_mm.abs() - 1e-8
            });
            let is_near = normals.is_near(&touched, &other, d_mm.abs());
            prop_assert!(!is_cut || is_near);
            // Together with any other box it still is.
            let all = normals.and(Normals(Bounds { low: Vec2::x(), high: Vec2::x() }));
            prop_assert!(!is_near || all.is_near(&touched.with(Vec2::zeros()), &other, d_mm.abs()));
        }
    }

    #[test]
    fn a_convex_contour_is_behind_however_large_the_tool_is() {
        let corner = |index: usize| {
            let (y, x) = (index as f64).to_radians().sin_cos();
            Vec2::new(x, y) * 50.0
        };
        let walls: Vec<Element> =
            (0..360).filter_map(|index| Element::line(corner(index), corner(index + 1))).collect();
        for d_mm in [-1.0, -1e3, -1e6] {
            let near = |path: &Element| {
                let (touched, normals) = contact(&path.offset(d_mm).expect("a line"), d_mm);
                let is_near =
                    |wall: &&Element| normals.is_near(&touched, &Bounds::of(wall), d_mm.abs());
                walls.iter().filter(is_near).count()
            };
            let most = walls.iter().map(near).max();
            assert!(most.is_some_and(|most| most < 40), "{d_mm}: {most:?}");
        }
    }
}
