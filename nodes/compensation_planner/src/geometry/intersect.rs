//! Where two whole lines or circles meet.
//!
//! Knows nothing of the ends of elements, except in [`meet`], which picks the meeting point that
//! shortens both. All differences are taken from a nearby point, so that large coordinates cost no
//! digits.

use crate::geometry::element::{Arc, Element, Line, Vec2, cross, left};
use crate::geometry::tolerance::{LENGTH_MM, PARALLEL_RAD};

/// None, one or two points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossings {
    points: [Vec2; 2],
    count: usize,
}

impl Crossings {
    const NONE: Self = Self { points: [Vec2::new(0.0, 0.0); 2], count: 0 };

    fn one(point: Vec2) -> Self {
        Self { points: [point; 2], count: 1 }
    }

    fn two(first: Vec2, second: Vec2) -> Self {
        Self { points: [first, second], count: 2 }
    }

    /// The points.
    pub(crate) fn points(&self) -> &[Vec2] {
        &self.points[..self.count]
    }
}

/// Where the whole lines or circles of two elements cross.
///
/// Two that miss each other by less than `gap` mm touch in one point. Parallel lines and concentric
/// circles do not cross.
pub(crate) fn crossings(a: &Element, b: &Element, gap: f64) -> Crossings {
    match (a, b) {
        (Element::Line(a), Element::Line(b)) => line_line(a, b),
        (Element::Line(a), Element::Arc(b)) => line_circle(a, b, gap),
        (Element::Arc(a), Element::Line(b)) => line_circle(b, a, gap),
        (Element::Arc(a), Element::Arc(b)) => circle_circle(a, b, gap),
    }
}

fn line_line(a: &Line, b: &Line) -> Crossings {
    let sine = cross(a.tangent, b.tangent);
    if sine.abs() < PARALLEL_RAD {
        return Crossings::NONE;
    }
    Crossings::one(b.start + b.tangent * (cross(a.start - b.start, a.tangent) / -sine))
}

fn line_circle(line: &Line, circle: &Arc, gap: f64) -> Crossings {
    let to_start = line.start - circle.center;
    let height = cross(line.tangent, -to_start);
    let foot = line.start - line.tangent * to_start.dot(&line.tangent);
    // r² - h² without the loss of digits of the squares.
    let square = (circle.radius - height.abs()) * (circle.radius + height.abs());
    if square <= 0.0 {
        return if height.abs() - circle.radius <= gap {
            Crossings::one(foot)
        } else {
            Crossings::NONE
        };
    }
    let half = line.tangent * square.sqrt();
    Crossings::two(foot - half, foot + half)
}

fn circle_circle(a: &Arc, b: &Arc, gap: f64) -> Crossings {
    let between = b.center - a.center;
    let distance = between.norm();
    if distance < LENGTH_MM.min(gap) {
        return Crossings::NONE;
    }
    let unit = between / distance;
    let along = 0.5 * (distance + (a.radius - b.radius) * (a.radius + b.radius) / distance);
    let square = (a.radius - along) * (a.radius + along);
    if square <= 0.0 {
        let apart = distance - (a.radius + b.radius);
        let within = (a.radius - b.radius).abs() - distance;
        return if apart.max(within) <= gap {
            Crossings::one(a.center + unit * a.radius.copysign(along))
        } else {
            Crossings::NONE
        };
    }
    let half = left(unit) * square.sqrt();
    let foot = a.center + unit * along;
    Crossings::two(foot - half, foot + half)
}

/// Where the tool leaves one element for the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Meeting {
    pub point: Vec2,
    /// How much of the first is cut off at its end, mm.
    pub trim_a: f64,
    /// How much of the second is cut off at its start, mm.
    pub trim_b: f64,
}

/// The meeting point nearest to the joint, wherever it is on both carriers.
///
/// Trims are negative where an element is lengthened.
pub(crate) fn meet_across(a: &Element, b: &Element) -> Option<Meeting> {
    let near = (a.end() + b.start()) / 2.0;
    let points = crossings(a, b, LENGTH_MM);
    let distance = |point: &&Vec2| (**point - near).norm();
    let nearest = points.points().iter().min_by(|p, q| distance(p).total_cmp(&distance(q)));
    nearest.map(|&point| Meeting {
        point,
        trim_a: signed(a, a.back_from_end(point, 0.0)),
        trim_b: signed(b, b.along_from_start(point, 0.0)),
    })
}

/// On a circle the shorter way counts: backwards when that is less than half.
fn signed(element: &Element, along: f64) -> f64 {
    match element {
        Element::Arc(arc) if along > std::f64::consts::PI * arc.radius => {
            along - std::f64::consts::TAU * arc.radius
        }
        _ => along,
    }
}

/// The meeting point nearest to the corner that shortens both elements.
///
/// `slack` is how far they may miss each other or be lengthened, mm. Elements
/// that run within `slack` of each other without crossing meet half-way.
pub(crate) fn meet(a: &Element, b: &Element, slack: f64) -> Option<Meeting> {
    let mut best: Option<Meeting> = None;
    for &point in crossings(a, b, slack).points() {
        // A trim of more than half a circle means lengthening the other way around.
        let trim_a = signed(a, a.back_from_end(point, slack));
        let trim_b = signed(b, b.along_from_start(point, slack));
        let shortens = trim_a >= -slack && trim_b >= -slack;
        if shortens && best.is_none_or(|best| trim_a + trim_b < best.trim_a + best.trim_b) {
            best = Some(Meeting { point, trim_a, trim_b });
        }
    }
    best.or_else(|| {
        let middle = (a.end() + b.start()) / 2.0;
        let (on_a, on_b) = (a.project(middle), b.project(middle));
        let trim_a = a.back_from_end(on_a, slack.max(LENGTH_MM));
        let trim_b = b.along_from_start(on_b, slack.max(LENGTH_MM));
        ((on_a - on_b).norm() <= slack && trim_a >= -slack && trim_b >= -slack).then_some(Meeting {
            point: on_a,
            trim_a,
            trim_b,
        })
    })
}
