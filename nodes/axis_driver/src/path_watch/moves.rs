//! The way of one line, in the machine frame, and how far a place is off it.

use crate::vectors::{dot, minus, norm};
use cnc_msgs::geometry::{Plane, Position};
use std::f64::consts::TAU;

/// Where the tool goes while a line is under way; machine frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Way {
    /// Where it begins or ends is not known: any place will do.
    Anywhere,
    Line {
        from: Position,
        to: Position,
    },
    Arc(ArcWay),
}

/// Less than a full circle; the radius may grow a little from one end to the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ArcWay {
    pub(super) plane: Plane,
    pub(super) clockwise: bool,
    from: Position,
    to: Position,
    /// In the two axes of the plane.
    center: [f64; 2],
    start_angle: f64,
    /// Along the direction of motion, rad.
    sweep: f64,
    radii: [f64; 2],
}

/// The nearest place of a way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Nearest {
    pub(super) distance_mm: f64,
    /// The share of the way before it, 0 to 1.
    pub(super) part: f64,
    pub(super) place: Position,
}

impl Way {
    pub(super) fn length_mm(&self) -> f64 {
        match self {
            Self::Anywhere => 0.0,
            Self::Line { from, to } => norm(minus(*to, *from)),
            Self::Arc(arc) => arc.length_mm(),
        }
    }

    /// What is left of the way after a share of it.
    pub(super) fn rest_mm(&self, part: f64) -> f64 {
        (1.0 - part) * self.length_mm()
    }

    /// The place of the way nearest to a position, not before a share of it.
    pub(super) fn nearest(&self, position: Position, from_part: f64) -> Nearest {
        match self {
            Self::Anywhere => Nearest { distance_mm: 0.0, part: from_part, place: position },
            Self::Line { from, to } => {
                let along = minus(*to, *from);
                let squared = dot(along, along);
                let part = match squared > 0.0 {
                    true => (dot(minus(position, *from), along) / squared).clamp(from_part, 1.0),
                    false => 1.0,
                };
                let place = [0, 1, 2].map(|axis| from[axis] + along[axis] * part);
                Nearest { distance_mm: norm(minus(position, place)), part, place }
            }
            Self::Arc(arc) => arc.nearest(position, from_part),
        }
    }
}

impl ArcWay {
    /// `None` where the ends and the centre are not an arc.
    pub(super) fn new(
        plane: Plane,
        clockwise: bool,
        [from, to]: [Position; 2],
        center: [f64; 2],
    ) -> Option<Self> {
        let [a, b, _] = plane.axes();
        let polar = |place: Position| {
            let [x, y] = [place[a] - center[0], place[b] - center[1]];
            (x.hypot(y), y.atan2(x))
        };
        let (start, end) = (polar(from), polar(to));
        let turned = if clockwise { start.1 - end.1 } else { end.1 - start.1 };
        let sweep = turned.rem_euclid(TAU);
        let is_arc = start.0 > 0.0 && end.0 > 0.0 && sweep.is_finite();
        let (start_angle, radii) = (start.1, [start.0, end.0]);
        is_arc.then_some(Self { plane, clockwise, from, to, center, start_angle, sweep, radii })
    }

    fn length_mm(&self) -> f64 {
        let normal = self.plane.axes()[2];
        (self.radii[0] * self.sweep).hypot(self.to[normal] - self.from[normal])
    }

    fn place(&self, part: f64) -> Position {
        let [a, b, normal] = self.plane.axes();
        let swept = self.sweep * part;
        let angle = self.start_angle + if self.clockwise { -swept } else { swept };
        let radius = self.radii[0] + (self.radii[1] - self.radii[0]) * part;
        let mut place = self.from;
        place[a] = self.center[0] + radius * angle.cos();
        place[b] = self.center[1] + radius * angle.sin();
        place[normal] = self.from[normal] + (self.to[normal] - self.from[normal]) * part;
        place
    }

    fn nearest(&self, position: Position, from_part: f64) -> Nearest {
        let [a, b, _] = self.plane.axes();
        let angle = (position[b] - self.center[1]).atan2(position[a] - self.center[0]);
        let turned = angle - self.start_angle;
        let turned = if self.clockwise { -turned } else { turned }.rem_euclid(TAU);
        let part = if self.sweep > 0.0 { turned / self.sweep } else { 1.0 };
        let candidates = [part.clamp(from_part, 1.0), from_part, 1.0].map(|part| {
            let place = self.place(part);
            Nearest { distance_mm: norm(minus(position, place)), part, place }
        });
        candidates
            .into_iter()
            .min_by(|a, b| a.distance_mm.total_cmp(&b.distance_mm))
            .unwrap_or(candidates[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_place_is_not_behind_what_was_reached() {
        let way = Way::Line { from: [0.0; 3], to: [10.0, 0.0, 0.0] };
        let at = |x: f64, from: f64| way.nearest([x, 1.0, 0.0], from);
        assert_eq!(at(4.0, 0.0).distance_mm, 1.0);
        assert_eq!(at(4.0, 0.0).part, 0.4);
        assert_eq!(at(4.0, 0.7).part, 0.7);
        assert!((at(4.0, 0.7).distance_mm - 10.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(at(12.0, 0.0).part, 1.0);
    }

    #[test]
    fn an_arc_is_followed_in_every_plane_and_direction() {
        for plane in [Plane::Xy, Plane::Zx, Plane::Yz] {
            let [a, b, normal] = plane.axes();
            let place = |radius: f64, degrees: f64, height: f64| {
                let mut place = [0.0; 3];
                place[a] = 3.0 + radius * degrees.to_radians().cos();
                place[b] = -2.0 + radius * degrees.to_radians().sin();
                place[normal] = height;
                place
            };
            for clockwise in [false, true] {
                // From 10 degrees over 300 of them, rising by 30 mm.
                let sign = if clockwise { -1.0 } else { 1.0 };
                let ends = [place(20.0, 10.0, 0.0), place(20.0, 10.0 + sign * 300.0, 30.0)];
                let arc = ArcWay::new(plane, clockwise, ends, [3.0, -2.0]).unwrap();
                let way = Way::Arc(arc);
                let at = |radius, part: f64| place(radius, 10.0 + sign * 300.0 * part, 30.0 * part);
                let near = way.nearest(at(20.0, 0.25), 0.0);
                assert!(near.distance_mm < 1e-9 && (near.part - 0.25).abs() < 1e-9, "{near:?}");
                let near = way.nearest(at(20.5, 0.9), 0.3);
                assert!((near.distance_mm - 0.5).abs() < 1e-9, "{near:?}");
                assert!(way.nearest(at(20.0, 0.25), 0.3).distance_mm > 1.0);
                let gap = way.nearest(place(20.0, 10.0 - sign * 30.0, 30.0), 0.0);
                assert_eq!(gap.part, 1.0, "{gap:?}");
            }
        }
    }
}
