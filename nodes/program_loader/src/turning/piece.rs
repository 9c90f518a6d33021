//! A line or an arc, and what is measured on it.

use super::{Move, SAME_MM};

/// Z and X in the plane, or along and across the profile in a [`Frame`](super::frame::Frame), mm.
pub(crate) type Point = [f64; 2];

/// Directions whose cross product is below this are parallel.
pub(super) const PARALLEL: f64 = 1e-9;

/// The circle of an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Circle {
    pub(crate) center: Point,
    pub(crate) counterclockwise: bool,
}

/// A line or an arc of less than a whole circle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    pub(crate) from: Point,
    pub(crate) to: Point,
    pub(crate) circle: Option<Circle>,
    /// The motion of the profile that it is a part of, by its index.
    pub(crate) origin: usize,
}

pub(super) fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

/// A point, and so much of a direction.
pub(super) fn along(a: Point, direction: Point, by: f64) -> Point {
    [a[0] + by * direction[0], a[1] + by * direction[1]]
}

pub(super) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn apart(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// To the left of a direction.
pub(super) fn left([first, second]: Point) -> Point {
    [-second, first]
}

fn unit(a: Point) -> Point {
    let length = a[0].hypot(a[1]);
    [a[0] / length, a[1] / length]
}

impl Piece {
    pub(super) fn line(from: Point, to: Point, origin: usize) -> Self {
        Self { from, to, circle: None, origin }
    }

    /// An arc, about the centre that both ends are equally far from.
    pub(crate) fn arc(from: Point, to: Point, circle: Circle, origin: usize) -> Self {
        let chord = minus(to, from);
        let length = chord[0].hypot(chord[1]);
        let middle = along(from, chord, 0.5);
        let across = left(unit(chord));
        let mut center = circle.center;
        if length > SAME_MM && apart(center, from) != apart(center, to) {
            center = along(middle, across, dot(minus(center, middle), across));
        }
        Self { from, to, circle: Some(Circle { center, ..circle }), origin }
    }

    /// The same from or to another place on it.
    pub(super) fn between(&self, from: Point, to: Point) -> Self {
        Self { from, to, ..*self }
    }

    pub(super) fn feed(&self) -> Move {
        Move { to: self.to, is_rapid: false, circle: self.circle, origin: Some(self.origin) }
    }

    pub(super) fn radius(&self) -> f64 {
        self.circle.map_or(f64::INFINITY, |circle| apart(circle.center, self.from))
    }

    /// The direction of travel at a place on it, of length 1.
    pub(super) fn direction(&self, at: Point) -> Point {
        match self.circle {
            None => unit(minus(self.to, self.from)),
            Some(Circle { center, counterclockwise }) => {
                let [first, second] = left(unit(minus(at, center)));
                if counterclockwise { [first, second] } else { [-first, -second] }
            }
        }
    }

    /// How far a place on it is from its start, along it, mm.
    pub(super) fn way(&self, to: Point) -> f64 {
        match self.circle {
            None => dot(minus(to, self.from), self.direction(self.from)),
            Some(_) => self.angle(to) * self.radius(),
        }
    }

    pub(super) fn length(&self) -> f64 {
        self.way(self.to)
    }

    /// From the start to a place on an arc, in the direction of travel: 0 to below 2 π, or just below 0.
    fn angle(&self, to: Point) -> f64 {
        const TURN: f64 = std::f64::consts::TAU;
        let Some(Circle { center, counterclockwise }) = self.circle else { return 0.0 };
        let (from, to) = (minus(self.from, center), minus(to, center));
        let angle = cross(from, to).atan2(dot(from, to));
        let angle = if counterclockwise { angle } else { -angle };
        // A place at the start must not count as one a turn later.
        let hair = SAME_MM / self.radius();
        if angle < -hair { angle + TURN } else { angle }
    }

    /// The place so far from its start, mm.
    pub(super) fn at(&self, way: f64) -> Point {
        let Some(Circle { center, counterclockwise }) = self.circle else {
            return along(self.from, self.direction(self.from), way);
        };
        let angle = way / self.radius();
        let (sine, cosine) = (if counterclockwise { angle } else { -angle }).sin_cos();
        let [first, second] = minus(self.from, center);
        along(center, [first * cosine - second * sine, first * sine + second * cosine], 1.0)
    }

    /// Whether a place on its line or circle is on it, ends included.
    pub(super) fn has(&self, at: Point) -> bool {
        let way = self.way(at);
        way >= -SAME_MM && way <= self.length() + SAME_MM
    }

    /// How near a place is to it, mm.
    pub(super) fn distance(&self, at: Point) -> f64 {
        let to_ends = apart(at, self.from).min(apart(at, self.to));
        match self.circle {
            None => {
                let direction = self.direction(self.from);
                let way = dot(minus(at, self.from), direction);
                match way > 0.0 && way < self.length() {
                    true => cross(direction, minus(at, self.from)).abs(),
                    false => to_ends,
                }
            }
            Some(Circle { center, .. }) => {
                let off = apart(at, center);
                let radius = self.radius();
                match off > 0.0 && self.has(along(center, minus(at, center), radius / off)) {
                    true => (off - radius).abs(),
                    false => to_ends,
                }
            }
        }
    }

    /// The same, to the left by a distance, or to the right by one below 0; `None` where nothing is left of an arc.
    pub(super) fn shifted(&self, by: f64) -> Option<Self> {
        let shrinks = self.circle.is_some_and(|it| it.counterclockwise == (by > 0.0));
        if shrinks && self.radius() - by.abs() <= SAME_MM {
            return None;
        }
        let place = |at: Point| along(at, left(self.direction(at)), by);
        Some(self.between(place(self.from), place(self.to)))
    }

    /// Where the lines or circles of two pieces meet.
    pub(super) fn meets(&self, other: &Self) -> Vec<Point> {
        match (self.circle, other.circle) {
            (None, None) => {
                let (a, b) = (self.direction(self.from), other.direction(other.from));
                let sine = cross(a, b);
                if sine.abs() < PARALLEL {
                    return Vec::new();
                }
                vec![along(self.from, a, cross(minus(other.from, self.from), b) / sine)]
            }
            (None, Some(circle)) => line_and_circle(self, circle.center, other.radius()),
            (Some(circle), None) => line_and_circle(other, circle.center, self.radius()),
            (Some(one), Some(two)) => {
                circles((one.center, self.radius()), (two.center, other.radius()))
            }
        }
    }
}

/// A tangent is found where rounding lets it miss by this, mm.
const TANGENT_MM: f64 = 1e-9;

fn line_and_circle(line: &Piece, center: Point, radius: f64) -> Vec<Point> {
    let direction = line.direction(line.from);
    let foot = along(line.from, direction, dot(minus(center, line.from), direction));
    let off = apart(foot, center);
    if off > radius + TANGENT_MM {
        return Vec::new();
    }
    let half = ((radius - off) * (radius + off)).max(0.0).sqrt();
    vec![along(foot, direction, -half), along(foot, direction, half)]
}

fn circles((one, r1): (Point, f64), (two, r2): (Point, f64)) -> Vec<Point> {
    let between = apart(one, two);
    let (farthest, nearest) = (r1 + r2 + TANGENT_MM, (r1 - r2).abs() - TANGENT_MM);
    if between < SAME_MM || between > farthest || between < nearest {
        return Vec::new();
    }
    let direction = unit(minus(two, one));
    let foot = (between * between + (r1 - r2) * (r1 + r2)) / (2.0 * between);
    let half = ((r1 - foot) * (r1 + foot)).max(0.0).sqrt();
    let middle = along(one, direction, foot);
    vec![along(middle, left(direction), half), along(middle, left(direction), -half)]
}
