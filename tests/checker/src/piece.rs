//! Lines and arcs in a plane, and exact distances between them.
//!
//! Written from the definitions, and slow: every distance is the least of all pairs of points
//! at which it can be least. Nothing here comes from the planner.

use std::f64::consts::TAU;
use std::ops::{Add, Mul, Sub};

/// A point or a vector in the plane of compensation, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    pub u: f64,
    pub v: f64,
}

pub const fn point(u: f64, v: f64) -> Point {
    Point { u, v }
}

impl Add for Point {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        point(self.u + other.u, self.v + other.v)
    }
}

impl Sub for Point {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        point(self.u - other.u, self.v - other.v)
    }
}

impl Mul<f64> for Point {
    type Output = Self;
    fn mul(self, by: f64) -> Self {
        point(self.u * by, self.v * by)
    }
}

impl Point {
    pub fn dot(self, other: Self) -> f64 {
        self.u * other.u + self.v * other.v
    }

    pub fn cross(self, other: Self) -> f64 {
        self.u * other.v - self.v * other.u
    }

    pub fn length(self) -> f64 {
        self.u.hypot(self.v)
    }

    pub fn to(self, other: Self) -> f64 {
        (other - self).length()
    }

    /// Of length 1; whatever has no length stays as it is.
    #[must_use]
    pub fn unit(self) -> Self {
        let length = self.length();
        if length == 0.0 { self } else { self * (1.0 / length) }
    }

    /// A quarter turn counter-clockwise.
    #[must_use]
    pub fn left(self) -> Self {
        point(-self.v, self.u)
    }

    /// Turned counter-clockwise by an angle, rad.
    #[must_use]
    pub fn turned(self, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        point(self.u * cos - self.v * sin, self.u * sin + self.v * cos)
    }
}

/// A line, or an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Piece {
    Line {
        start: Point,
        end: Point,
    },
    /// `from` is the angle of the start seen from the centre, rad; `sweep` is positive
    /// counter-clockwise.
    Arc {
        center: Point,
        radius: f64,
        from: f64,
        sweep: f64,
    },
}

impl Piece {
    pub const fn line(start: Point, end: Point) -> Self {
        Self::Line { start, end }
    }

    /// An arc whose centre is moved to where both ends are equally far; a whole turn where
    /// both ends are the same.
    pub fn arc(start: Point, end: Point, center: Point, is_ccw: bool) -> Self {
        let chord = end - start;
        let off = if chord.length() < 1e-9 {
            point(0.0, 0.0)
        } else {
            let along = chord.unit();
            along * along.dot((start + end) * 0.5 - center)
        };
        let center = center + off;
        let angle = |p: Point| (p.v - center.v).atan2(p.u - center.u);
        let from = angle(start);
        let ccw = match chord.length() < 1e-9 {
            true => TAU,
            false => (angle(end) - from).rem_euclid(TAU),
        };
        let sweep = match (is_ccw, chord.length() < 1e-9) {
            (true, _) => ccw,
            (false, true) => -TAU,
            (false, false) => ccw - TAU,
        };
        Self::Arc { center, radius: center.to(start), from, sweep }
    }

    /// The point at this part of its length, from 0 to 1.
    pub fn at(&self, part: f64) -> Point {
        match *self {
            Self::Line { start, end } => start + (end - start) * part,
            Self::Arc { center, radius, from, sweep } => {
                center + point(radius, 0.0).turned(from + sweep * part)
            }
        }
    }

    pub fn start(&self) -> Point {
        self.at(0.0)
    }

    pub fn end(&self) -> Point {
        self.at(1.0)
    }

    /// The direction of motion at this part of its length.
    pub fn direction(&self, part: f64) -> Point {
        match *self {
            Self::Line { start, end } => (end - start).unit(),
            Self::Arc { from, sweep, .. } => point(0.0, sweep.signum()).turned(from + sweep * part),
        }
    }

    pub fn length(&self) -> f64 {
        match *self {
            Self::Line { start, end } => start.to(end),
            Self::Arc { radius, sweep, .. } => radius * sweep.abs(),
        }
    }

    /// The piece between two parts of its length.
    #[must_use]
    pub fn between(&self, low: f64, high: f64) -> Self {
        match *self {
            Self::Line { .. } => Self::line(self.at(low), self.at(high)),
            Self::Arc { center, radius, from, sweep } => {
                Self::Arc { center, radius, from: from + sweep * low, sweep: sweep * (high - low) }
            }
        }
    }

    /// The same in reverse.
    #[must_use]
    pub fn reversed(&self) -> Self {
        match *self {
            Self::Line { start, end } => Self::line(end, start),
            Self::Arc { center, radius, from, sweep } => {
                Self::Arc { center, radius, from: from + sweep, sweep: -sweep }
            }
        }
    }

    /// The same somewhere else: turned about the origin, then moved.
    #[must_use]
    pub fn placed(&self, angle: f64, by: Point) -> Self {
        match *self {
            Self::Line { start, end } => {
                Self::line(start.turned(angle) + by, end.turned(angle) + by)
            }
            Self::Arc { center, radius, from, sweep } => {
                Self::Arc { center: center.turned(angle) + by, radius, from: from + angle, sweep }
            }
        }
    }

    /// The path of the centre of a tool at this distance on its left; negative on its
    /// right. Inside an arc that is smaller than the tool the path lies beyond the centre.
    #[must_use]
    pub fn offset(&self, left: f64) -> Self {
        match *self {
            Self::Line { start, end } => {
                let aside = (end - start).unit().left() * left;
                Self::line(start + aside, end + aside)
            }
            Self::Arc { center, radius, from, sweep } => {
                let out = radius - left * sweep.signum();
                let turn = if out < 0.0 { TAU / 2.0 } else { 0.0 };
                Self::Arc { center, radius: out.abs(), from: from + turn, sweep }
            }
        }
    }

    /// Which part of the length a direction from the centre of an arc is; `None` outside the arc.
    fn part_of(&self, towards: Point) -> Option<f64> {
        let Self::Arc { from, sweep, .. } = *self else { return None };
        let turned = ((towards.v.atan2(towards.u) - from) * sweep.signum()).rem_euclid(TAU);
        // Just before the start is the start.
        let turned = if TAU - turned < 1e-12 { 0.0 } else { turned };
        (turned <= sweep.abs() + 1e-12).then(|| (turned / sweep.abs()).min(1.0))
    }

    /// How far a point is from the nearest place of this.
    pub fn distance(&self, from: Point) -> f64 {
        let ends = from.to(self.start()).min(from.to(self.end()));
        match *self {
            Self::Line { start, end } => {
                let along = end - start;
                let part = (from - start).dot(along) / along.dot(along);
                if part > 0.0 && part < 1.0 { from.to(self.at(part)) } else { ends }
            }
            Self::Arc { center, radius, .. } => match self.part_of(from - center) {
                Some(_) => (center.to(from) - radius).abs(),
                None => ends,
            },
        }
    }

    /// How far the two nearest places of both are from each other.
    pub fn apart(&self, other: &Self) -> f64 {
        if self.crosses(other) {
            return 0.0;
        }
        let mut least = [self.start(), self.end()].map(|end| other.distance(end));
        let others = [other.start(), other.end()].map(|end| self.distance(end));
        least[0] = least[0].min(least[1]).min(others[0]).min(others[1]);
        // Between the ends the shortest line is perpendicular to both.
        let mut inner = |arc: &Self, towards: Point, from: &Self| {
            let Self::Arc { center, radius, .. } = *arc else { return };
            if towards.length() < 1e-12 {
                // About one centre all places are as far; through the centre any line is as good.
                return;
            }
            for towards in [towards, towards * -1.0] {
                if arc.part_of(towards).is_some() {
                    least[0] = least[0].min(from.distance(center + towards.unit() * radius));
                }
            }
        };
        match (*self, *other) {
            (Self::Line { .. }, Self::Line { .. }) => {}
            (Self::Line { start, end }, Self::Arc { center, .. }) => {
                inner(other, foot(center, start, end) - center, self);
                inner(other, (end - start).left(), self);
            }
            (Self::Arc { center, .. }, Self::Line { start, end }) => {
                inner(self, foot(center, start, end) - center, other);
                inner(self, (end - start).left(), other);
            }
            (Self::Arc { center: a, .. }, Self::Arc { center: b, .. }) => {
                inner(self, b - a, other);
                inner(other, b - a, self);
            }
        }
        least[0]
    }

    /// The places that both have in common.
    pub fn meets(&self, other: &Self) -> Vec<Point> {
        let places = other.parts_at_carrier(self).into_iter().map(|part| other.at(part));
        places.filter(|at| self.distance(*at) < 1e-9).collect()
    }

    fn crosses(&self, other: &Self) -> bool {
        !self.meets(other).is_empty()
    }

    /// Parts of this piece at which it crosses the whole line or circle that another lies on.
    fn parts_at_carrier(&self, other: &Self) -> Vec<f64> {
        match *other {
            Self::Line { start, end } => self.parts_at_line(start, (end - start).unit()),
            Self::Arc { center, radius, .. } => self.parts_at_circle(center, radius),
        }
    }

    /// Parts of this piece at which it crosses a line through a point, `along` of length 1.
    pub fn parts_at_line(&self, through: Point, along: Point) -> Vec<f64> {
        match *self {
            Self::Line { start, end } => {
                let slope = along.cross(end - start);
                let part = along.cross(through - start) / slope;
                if part.is_finite() && (0.0..=1.0).contains(&part) { vec![part] } else { vec![] }
            }
            Self::Arc { center, radius, .. } => {
                let foot = through + along * along.dot(center - through);
                let half = radius * radius - (foot - center).dot(foot - center);
                if half < 0.0 {
                    return vec![];
                }
                [-1.0, 1.0]
                    .into_iter()
                    .filter_map(|sign| self.part_of(foot + along * (sign * half.sqrt()) - center))
                    .collect()
            }
        }
    }

    /// Parts of this piece at which it crosses a circle.
    pub fn parts_at_circle(&self, center: Point, radius: f64) -> Vec<f64> {
        match *self {
            Self::Line { start, end } => {
                let along = (end - start).unit();
                let middle = (center - start).dot(along);
                let off = start + along * middle - center;
                let half = radius * radius - off.dot(off);
                if half < 0.0 {
                    return vec![];
                }
                let length = start.to(end);
                [-1.0, 1.0]
                    .into_iter()
                    .map(|sign| (middle + sign * half.sqrt()) / length)
                    .filter(|part| (0.0..=1.0).contains(part))
                    .collect()
            }
            Self::Arc { center: own, radius: mine, .. } => {
                let apart = own.to(center);
                if apart == 0.0 || apart > mine + radius || apart < (mine - radius).abs() {
                    return vec![];
                }
                let along = (center - own).unit();
                let far = (apart * apart + mine * mine - radius * radius) / (2.0 * apart);
                let half = (mine * mine - far * far).max(0.0).sqrt();
                [-1.0, 1.0]
                    .into_iter()
                    .filter_map(|sign| self.part_of(along * far + along.left() * (sign * half)))
                    .collect()
            }
        }
    }

    /// Parts of this piece, in order, between which it is either nearer to a wall than `limit`
    /// all the time or never.
    fn parts_at_distance(&self, wall: &Self, limit: f64) -> Vec<f64> {
        let mut parts = vec![0.0, 1.0];
        for end in [wall.start(), wall.end()] {
            parts.extend(self.parts_at_circle(end, limit));
        }
        match *wall {
            Self::Line { start, end } => {
                let along = (end - start).unit();
                for aside in [limit, -limit] {
                    parts.extend(self.parts_at_line(start + along.left() * aside, along));
                }
            }
            Self::Arc { center, radius, .. } => {
                parts.extend(self.parts_at_circle(center, radius + limit));
                parts.extend(self.parts_at_circle(center, (radius - limit).abs()));
            }
        }
        parts.sort_by(f64::total_cmp);
        parts
    }

    /// The stretches of this piece that are nearer to a wall than `limit`, as parts of its length.
    pub fn too_near(&self, wall: &Self, limit: f64) -> Vec<(f64, f64)> {
        let parts = self.parts_at_distance(wall, limit);
        let is_near = |pair: &&[f64]| {
            pair[1] > pair[0] && wall.distance(self.at((pair[0] + pair[1]) / 2.0)) < limit
        };
        parts.windows(2).filter(is_near).map(|pair| (pair[0], pair[1])).collect()
    }

    /// Low and high corner of a box around it.
    pub fn bounds(&self) -> (Point, Point) {
        let around = |points: &[Point]| {
            let fold = |f: fn(f64, f64) -> f64| {
                let first = points[0];
                points.iter().fold(first, |a, b| point(f(a.u, b.u), f(a.v, b.v)))
            };
            (fold(f64::min), fold(f64::max))
        };
        match *self {
            Self::Line { start, end } => around(&[start, end]),
            Self::Arc { center, radius, .. } => {
                let far = point(radius, radius);
                (center - far, center + far)
            }
        }
    }

    /// Whether the boxes around both are at least this far apart.
    pub fn is_far_from(&self, other: &Self, distance: f64) -> bool {
        let ((low, high), (other_low, other_high)) = (self.bounds(), other.bounds());
        low.u - other_high.u > distance
            || other_low.u - high.u > distance
            || low.v - other_high.v > distance
            || other_low.v - high.v > distance
    }
}

fn foot(of: Point, start: Point, end: Point) -> Point {
    let along = (end - start).unit();
    start + along * along.dot(of - start)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// On a grid now and then, where centres and ends coincide.
    fn any_piece(random: &mut Random) -> Piece {
        if random.once_in(2) {
            let mut number = || random.below(5) as f64 - 2.0;
            let (start, center) = (point(number(), number()), point(number(), number()));
            let end = center + (start - center).left();
            return match center == start || number() < 0.0 {
                true => Piece::line(start, center + point(0.0, 4.0)),
                false => Piece::arc(start, end, center, number() < 0.0),
            };
        }
        let mut place = || point(random.between(-5.0, 5.0), random.between(-5.0, 5.0));
        let (start, end) = (place(), place());
        match random.below(3) {
            0 => Piece::line(start, end),
            _ => {
                let (from, sweep) = (random.between(-9.0, 9.0), random.between(-6.2, 6.2));
                Piece::Arc { center: start, radius: random.between(0.1, 4.0), from, sweep }
            }
        }
    }

    #[test]
    fn distances_are_those_of_very_many_points() {
        let mut random = Random::new(1);
        for _ in 0..400 {
            let (a, b) = (any_piece(&mut random), any_piece(&mut random));
            let count = 3000;
            let points = (0..=count).map(|step| f64::from(step) / f64::from(count));
            let least = points.map(|part| b.distance(a.at(part))).fold(f64::INFINITY, f64::min);
            let exact = a.apart(&b);
            let step = a.length() / f64::from(count);
            assert!(exact <= least + 1e-9 && least <= exact + step, "{exact} {least}: {a:?} {b:?}");
            assert!((exact - b.apart(&a)).abs() < 1e-9, "{a:?} {b:?}");
        }
    }

    #[test]
    fn a_point_is_as_far_as_the_nearest_of_very_many() {
        let mut random = Random::new(2);
        for _ in 0..400 {
            let piece = any_piece(&mut random);
            let from = point(random.between(-9.0, 9.0), random.between(-9.0, 9.0));
            let least = (0..=3000)
                .map(|step| from.to(piece.at(f64::from(step) / 3000.0)))
                .fold(f64::INFINITY, f64::min);
            let exact = piece.distance(from);
            assert!(exact <= least + 1e-9 && least <= exact + 0.01, "{exact} {least} {piece:?}");
        }
    }

    #[test]
    fn stretches_that_are_too_near_are_those_of_very_many_points() {
        let mut random = Random::new(3);
        for _ in 0..400 {
            let (way, wall) = (any_piece(&mut random), any_piece(&mut random));
            let limit = random.between(0.1, 3.0);
            let near = way.too_near(&wall, limit);
            for step in 0..=500 {
                let part = f64::from(step) / 500.0;
                let distance = wall.distance(way.at(part));
                let is_in = near.iter().any(|(low, high)| (*low..=*high).contains(&part));
                if (distance - limit).abs() > 1e-6 {
                    assert_eq!(is_in, distance < limit, "{part} {limit} {way:?} {wall:?}");
                }
            }
        }
    }
}
