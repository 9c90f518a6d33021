//! Boxes along the axes.

use crate::geometry::element::{Element, Vec2};

/// A box along the axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    pub low: Vec2,
    pub high: Vec2,
}

impl Bounds {
    /// Contains nothing.
    pub(crate) const EMPTY: Self = Self {
        low: Vec2::new(f64::INFINITY, f64::INFINITY),
        high: Vec2::new(f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// The box around an element.
    pub(crate) fn of(element: &Element) -> Self {
        let (start, end) = (element.start(), element.end());
        let mut bounds = Self { low: start.inf(&end), high: start.sup(&end) };
        let Element::Arc(arc) = element else { return bounds };
        if arc.faces(Vec2::x()) {
            bounds.high.x = bounds.high.x.max(arc.center.x + arc.radius);
        }
        if arc.faces(-Vec2::x()) {
            bounds.low.x = bounds.low.x.min(arc.center.x - arc.radius);
        }
        if arc.faces(Vec2::y()) {
            bounds.high.y = bounds.high.y.max(arc.center.y + arc.radius);
        }
        if arc.faces(-Vec2::y()) {
            bounds.low.y = bounds.low.y.min(arc.center.y - arc.radius);
        }
        bounds
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.low.x > self.high.x
    }

    pub(crate) fn union(self, other: Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    /// With a point more.
    #[must_use]
    pub(crate) fn with(self, point: Vec2) -> Self {
        Self { low: self.low.inf(&point), high: self.high.sup(&point) }
    }

    /// Wider on each side, mm.
    #[must_use]
    pub(crate) fn wider(self, by: f64) -> Self {
        Self { low: self.low.add_scalar(-by), high: self.high.add_scalar(by) }
    }

    /// The lesser of its extents, mm.
    pub(crate) fn width(&self) -> f64 {
        (self.high - self.low).min()
    }

    /// Its area, mm²; 0 when it holds nothing.
    pub(crate) fn area(&self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.high - self.low).product() }
    }

    /// The square of the distance between two boxes, mm²; 0 when they overlap.
    #[inline]
    pub(crate) fn gap_squared(&self, other: &Self) -> f64 {
        // One instruction, where `f64::max` also looks for NaN.
        let most = |a: f64, b: f64| if a > b { a } else { b };
        let x = most(most(self.low.x - other.high.x, other.low.x - self.high.x), 0.0);
        let y = most(most(self.low.y - other.high.y, other.low.y - self.high.y), 0.0);
        x * x + y * y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_of_an_arc_holds_it_and_is_no_larger() {
        let at = |degrees: f64| {
            let (y, x) = degrees.to_radians().sin_cos();
            Vec2::new(x, y) * 5.0
        };
        for (from, degrees) in [0.0, 10.0, 130.0, 250.0, 355.0]
            .into_iter()
            .flat_map(|from| [1.0, 30.0, 89.0, 91.0, 181.0, 200.0, 359.0].map(|to| (from, to)))
        {
            for ccw in [true, false] {
                let to = if ccw { from + degrees } else { from - degrees };
                let arc = Element::arc(at(from), at(to), Vec2::zeros(), ccw, 0).expect("an arc");
                let bounds = Bounds::of(&arc);
                let points =
                    (0..=3600).map(|step| arc.point_at(arc.length() * step as f64 / 3600.0));
                let all = points.fold(Bounds::EMPTY, |all, point| Bounds {
                    low: all.low.inf(&point),
                    high: all.high.sup(&point),
                });
                let off = (all.low - bounds.low).sup(&(bounds.high - all.high));
                let inside = (all.low - bounds.low).inf(&(bounds.high - all.high));
                assert!(inside.min() > -1e-9 && off.max() < 1e-5, "{from} {degrees}: {off}");
            }
        }
    }
}
