//! A line or an arc in plane coordinates, and its offset.
//!
//! Knows tangents, parameters along the element and the offset to a side. The signed offset `d_mm`
//! is positive to the left of the direction of motion. An element may be one point: an arc of
//! radius 0 is a corner that the tool goes around. `intersect` joins two elements.

use crate::geometry::tolerance::{
    ARC_RADIUS_REL, CENTER_SHIFT_REL, LENGTH_MM, SHORT_ARC_SHIFT_REL,
};
use std::f64::consts::{PI, TAU};

/// A point or vector in the plane, mm.
pub(crate) type Vec2 = nalgebra::Vector2<f64>;

/// The vector turned left by a right angle.
#[inline]
pub(crate) fn left(v: Vec2) -> Vec2 {
    Vec2::new(-v.y, v.x)
}

/// Positive when `b` points to the left of `a`.
#[inline]
pub(crate) fn cross(a: Vec2, b: Vec2) -> f64 {
    a.x * b.y - a.y * b.x
}

/// One line or arc with a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Element {
    Line(Line),
    Arc(Arc),
}

/// A line from its start along a unit vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    pub start: Vec2,
    /// Unit vector.
    pub tangent: Vec2,
    pub length: f64,
}

/// An arc, possibly of several revolutions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Arc {
    pub center: Vec2,
    /// Never negative.
    pub radius: f64,
    /// 1 counter-clockwise, -1 clockwise.
    pub turn: f64,
    /// Unit vector from the centre to the start.
    pub from: Vec2,
    /// Unit vector from the centre to the end.
    pub to: Vec2,
    /// The angle from start to end, rad, positive.
    pub sweep: f64,
}

/// Angle from one unit vector to another in the direction of `turn`, rad, in [0, 2π).
pub(crate) fn swept(from: Vec2, to: Vec2, turn: f64) -> f64 {
    let angle = (cross(from, to) * turn).atan2(from.dot(&to));
    if angle < 0.0 { angle + TAU } else { angle }
}

impl Element {
    /// A line between two points; `None` when they are the same.
    pub(crate) fn line(start: Vec2, end: Vec2) -> Option<Self> {
        let span = end - start;
        // Scaled first, so that neither tiny nor huge spans lose digits.
        let scale = span.amax();
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let unscaled = (span / scale).norm();
        Some(Self::Line(Line { start, tangent: span / scale / unscaled, length: scale * unscaled }))
    }

    /// An arc from start to end about a centre, with whole extra revolutions.
    ///
    /// The centre is moved to where both ends are equally far; the ends are trusted. `None` when
    /// the radius or the sweep is zero or not finite.
    pub(crate) fn arc(start: Vec2, end: Vec2, center: Vec2, ccw: bool, turns: u16) -> Option<Self> {
        let turn = if ccw { 1.0 } else { -1.0 };
        let mut center = center;
        let (at_start, at_end) = ((start - center).norm(), (end - center).norm());
        let difference = at_end - at_start;
        if difference.abs() > ARC_RADIUS_REL * at_start {
            let chord = end - start;
            let length = chord.norm();
            let shift = difference * (at_end + at_start) / (2.0 * length);
            let is_minor = turns == 0 && cross(start - center, end - center) * turn > 0.0;
            let most = if is_minor { SHORT_ARC_SHIFT_REL } else { CENTER_SHIFT_REL };
            if shift.abs() <= most * at_start {
                center += chord * (shift / length);
            }
        }
        let radius = (start - center).norm();
        let (from, to) = (start - center, end - center);
        if !(radius > 0.0 && radius.is_finite() && to.norm() > 0.0) {
            return None;
        }
        let (from, to) = (from / radius, to / to.norm());
        let mut base = swept(from, to, turn);
        // A full circle whose end is a rounding error before its start.
        if turns > 0 && (TAU - base) * radius < LENGTH_MM {
            base = 0.0;
        }
        let sweep = base + TAU * f64::from(turns);
        (sweep > 0.0).then_some(Self::Arc(Arc { center, radius, turn, from, to, sweep }))
    }

    /// The corner between two unit tangents as an arc of radius 0 that the tool
    /// at `d_mm` runs around.
    pub(crate) fn corner(at: Vec2, before: Vec2, after: Vec2, d_mm: f64) -> Self {
        // At a reversal, the rounding of the cross product must not make a whole turn.
        let sweep = cross(before, after).abs().atan2(before.dot(&after));
        Self::bend(at, (before, after), d_mm, sweep)
    }

    /// The same of a known sweep, rad.
    pub(crate) fn bend(at: Vec2, (before, after): (Vec2, Vec2), d_mm: f64, sweep: f64) -> Self {
        let side = d_mm.signum();
        let (from, to) = (left(before) * side, left(after) * side);
        Self::Arc(Arc { center: at, radius: 0.0, turn: -side, from, to, sweep })
    }

    /// The element at a signed distance; `None` for an arc that the tool is too large for.
    pub(crate) fn offset(&self, d_mm: f64) -> Option<Self> {
        match *self {
            Self::Line(line) => {
                Some(Self::Line(Line { start: line.start + left(line.tangent) * d_mm, ..line }))
            }
            Self::Arc(arc) => {
                let radius = arc.radius - d_mm * arc.turn;
                (radius > -LENGTH_MM).then(|| Self::Arc(Arc { radius: radius.max(0.0), ..arc }))
            }
        }
    }

    /// Where it starts.
    pub(crate) fn start(&self) -> Vec2 {
        match self {
            Self::Line(line) => line.start,
            Self::Arc(arc) => arc.center + arc.from * arc.radius,
        }
    }

    /// Where it ends.
    pub(crate) fn end(&self) -> Vec2 {
        match self {
            Self::Line(line) => line.start + line.tangent * line.length,
            Self::Arc(arc) => arc.center + arc.to * arc.radius,
        }
    }

    /// Unit tangent at the start.
    pub(crate) fn start_tangent(&self) -> Vec2 {
        match self {
            Self::Line(line) => line.tangent,
            Self::Arc(arc) => left(arc.from) * arc.turn,
        }
    }

    /// Unit tangent at the end.
    pub(crate) fn end_tangent(&self) -> Vec2 {
        match self {
            Self::Line(line) => line.tangent,
            Self::Arc(arc) => left(arc.to) * arc.turn,
        }
    }

    /// Unit tangent at a point of the whole line or circle.
    pub(crate) fn tangent_at(&self, point: Vec2) -> Vec2 {
        match self {
            Self::Line(line) => line.tangent,
            Self::Arc(arc) => {
                left(point - arc.center).try_normalize(0.0).unwrap_or_default() * arc.turn
            }
        }
    }

    /// Length along the element, mm.
    pub(crate) fn length(&self) -> f64 {
        match self {
            Self::Line(line) => line.length,
            Self::Arc(arc) => arc.radius * arc.sweep,
        }
    }

    /// Curvature, 1/mm, positive to the left; 0 for a line.
    pub(crate) fn curvature(&self) -> f64 {
        match self {
            Self::Line(_) => 0.0,
            Self::Arc(arc) => arc.turn / arc.radius.max(f64::MIN_POSITIVE),
        }
    }

    /// The point this far along, mm. A line continues beyond its ends, an arc around its circle.
    pub(crate) fn point_at(&self, along: f64) -> Vec2 {
        match self {
            Self::Line(line) => line.start + line.tangent * along,
            Self::Arc(arc) => {
                arc.point_at_angle(if arc.radius > 0.0 { along / arc.radius } else { 0.0 })
            }
        }
    }

    /// How far along from the start the point lies, mm.
    ///
    /// Negative before the start of a line; of an arc, up to `slack` negative
    /// and else the way around.
    pub(crate) fn along_from_start(&self, point: Vec2, slack: f64) -> f64 {
        match self {
            Self::Line(line) => (point - line.start).dot(&line.tangent),
            Self::Arc(arc) => arc.around(arc.from, point, arc.turn, slack),
        }
    }

    /// How far back from the end the point lies, mm; see [`Self::along_from_start`].
    pub(crate) fn back_from_end(&self, point: Vec2, slack: f64) -> f64 {
        match self {
            Self::Line(line) => line.length - (point - line.start).dot(&line.tangent),
            Self::Arc(arc) => arc.around(arc.to, point, -arc.turn, slack),
        }
    }

    /// The nearest point of the whole line or circle.
    pub(crate) fn project(&self, point: Vec2) -> Vec2 {
        match self {
            Self::Line(line) => line.start + line.tangent * (point - line.start).dot(&line.tangent),
            Self::Arc(arc) => {
                let out = point - arc.center;
                let norm = out.norm();
                let unit = if norm > 0.0 { out / norm } else { arc.from };
                arc.center + unit * arc.radius
            }
        }
    }

    /// The element without its part before this length along it, mm; `None` when nothing is left.
    pub(crate) fn after(self, along: f64) -> Option<Self> {
        if along <= 0.0 {
            return Some(self);
        }
        if along >= self.length() {
            return None;
        }
        match self {
            Self::Line(line) => Self::line(line.start + line.tangent * along, self.end()),
            Self::Arc(mut arc) => {
                let angle = along / arc.radius;
                arc.from = (arc.point_at_angle(angle) - arc.center) / arc.radius;
                arc.sweep -= angle;
                Some(Self::Arc(arc))
            }
        }
    }

    /// The element without its part after this length along it, mm; `None` when nothing is left.
    pub(crate) fn before(self, along: f64) -> Option<Self> {
        if along >= self.length() {
            return Some(self);
        }
        if along <= 0.0 {
            return None;
        }
        match self {
            Self::Line(line) => Self::line(line.start, line.start + line.tangent * along),
            Self::Arc(mut arc) => {
                arc.sweep = along / arc.radius;
                arc.to = (arc.point_at_angle(arc.sweep) - arc.center) / arc.radius;
                Some(Self::Arc(arc))
            }
        }
    }

    /// Whether it ends where it starts.
    pub(crate) fn is_closed(&self) -> bool {
        !self.is_line() && (self.end() - self.start()).norm() <= LENGTH_MM
    }

    /// Whether it returns to a point that it has passed.
    pub(crate) fn goes_around(&self) -> bool {
        matches!(self, Self::Arc(arc) if arc.sweep > std::f64::consts::TAU)
    }

    /// How far off its circle an arc is programmed to end, mm; 0 if its centre could be moved to
    /// where both ends are equally far.
    pub(crate) fn unevenness(&self, programmed_end: Vec2) -> f64 {
        match self {
            Self::Line(_) => 0.0,
            Self::Arc(arc) => ((programmed_end - arc.center).norm() - arc.radius).abs(),
        }
    }

    /// Whether it is a line.
    pub(crate) fn is_line(&self) -> bool {
        matches!(self, Self::Line(_))
    }
}

impl Arc {
    /// The point at an angle from the start, rad.
    pub(crate) fn point_at_angle(&self, angle: f64) -> Vec2 {
        let (sin, cos) = (angle * self.turn).sin_cos();
        let out =
            Vec2::new(self.from.x * cos - self.from.y * sin, self.from.x * sin + self.from.y * cos);
        self.center + out * self.radius
    }

    /// Whether the direction from the centre is within the arc.
    pub(crate) fn faces(&self, out: Vec2) -> bool {
        let is_after_start = cross(self.from, out) * self.turn >= 0.0;
        let is_before_end = cross(out, self.to) * self.turn >= 0.0;
        match self.sweep {
            sweep if sweep >= TAU => true,
            _ if out == Vec2::zeros() => false,
            sweep if sweep <= PI => is_after_start && is_before_end,
            _ => is_after_start || is_before_end,
        }
    }

    fn around(&self, from: Vec2, point: Vec2, turn: f64, slack: f64) -> f64 {
        let out = point - self.center;
        if self.radius <= 0.0 {
            return 0.0;
        }
        let along = (cross(from, out) * turn).atan2(from.dot(&out)) * self.radius;
        if along < -slack { along + TAU * self.radius } else { along }
    }
}
