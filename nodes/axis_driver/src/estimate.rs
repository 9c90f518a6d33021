//! How long a path takes.
//!
//! Each element at its feed rate, or at the rapid rates of the controller; what the
//! machine loses at corners is the time to slow down and speed up again, in
//! proportion to how sharply the path turns. It is an estimate for a progress bar,
//! not a model of the planner. Overrides are the caller's business.

use cnc_msgs::contour::Action;
use cnc_msgs::geometry::{Arc, Position, Shape};
use cnc_msgs::path::CompensatedPath;
use std::f64::consts::TAU;

/// What the machine can do; used for rapids and corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    /// X, Y, Z, mm/min (`$110` to `$112`).
    pub rapid_mm_per_min: [f64; 3],
    /// X, Y, Z, mm/s² (`$120` to `$122`).
    pub acceleration_mm_per_s2: [f64; 3],
}

impl Default for Rates {
    fn default() -> Self {
        Self { rapid_mm_per_min: [1000.0; 3], acceleration_mm_per_s2: [200.0; 3] }
    }
}

/// Adds up the seconds of a path, element by element.
#[derive(Debug, Clone)]
pub struct Estimate {
    rates: Rates,
    next_element: usize,
    next_event: usize,
    seconds: f64,
}

impl Estimate {
    /// Nothing done yet; the path begins with this element.
    pub fn new(rates: Rates, path: &CompensatedPath, first_element: usize) -> Self {
        let next_event = path.events.partition_point(|event| event.at_element < first_element);
        Self { rates, next_element: first_element, next_event, seconds: 0.0 }
    }

    /// Seconds of all elements before this one; it never goes back.
    pub fn advance_to(&mut self, path: &CompensatedPath, element: usize) -> f64 {
        while self.next_element < element.min(path.elements.len()) {
            self.seconds += self.element_seconds(path, self.next_element);
            self.next_element += 1;
        }
        while let Some(event) =
            path.events.get(self.next_event).filter(|event| event.at_element <= self.next_element)
        {
            if let Action::Dwell { seconds } = event.action {
                self.seconds += seconds;
            }
            self.next_event += 1;
        }
        self.seconds
    }

    fn element_seconds(&self, path: &CompensatedPath, index: usize) -> f64 {
        let element = &path.elements[index];
        let start = path.start_of(index);
        let length = length_mm(&element.shape, start, element.end);
        if length <= 0.0 {
            return 0.0;
        }
        let direction = start_direction(&element.shape, start, element.end);
        let rapid = slowest(direction, self.rates.rapid_mm_per_min);
        let speed = element.feed_mm_per_min.unwrap_or(rapid).min(rapid) / 60.0;
        let acceleration = slowest(direction, self.rates.acceleration_mm_per_s2);
        let turn = match index.checked_sub(1) {
            Some(before) => {
                let incoming = end_direction(
                    &path.elements[before].shape,
                    path.start_of(before),
                    path.elements[before].end,
                );
                // 0 straight on, 1 back.
                (1.0 - dot(incoming, direction)) / 2.0
            }
            None => 1.0,
        };
        // A move too short for its speed never reaches it.
        let reached = speed.min((acceleration * length).sqrt());
        length / speed + turn * reached / acceleration
    }
}

/// The length of one element, mm.
pub(crate) fn length_mm(shape: &Shape, start: Position, end: Position) -> f64 {
    match shape {
        Shape::Line => norm(minus(end, start)),
        Shape::Arc(arc) => {
            let [a, b, normal] = arc.plane.axes();
            let radius = (start[a] - arc.center[a]).hypot(start[b] - arc.center[b]);
            (radius * sweep(arc, start, end)).hypot(end[normal] - start[normal])
        }
    }
}

/// The angle of an arc along its direction, all turns together, rad.
pub(crate) fn sweep(arc: &Arc, start: Position, end: Position) -> f64 {
    let [a, b, _] = arc.plane.axes();
    let angle = |point: Position| (point[b] - arc.center[b]).atan2(point[a] - arc.center[a]);
    let turned = angle(end) - angle(start);
    let turned = if arc.clockwise { -turned } else { turned }.rem_euclid(TAU);
    let is_whole = arc.turns > 0 && (end[a] - start[a]).hypot(end[b] - start[b]) < 1e-6;
    if is_whole { 0.0 } else { turned }.mul_add(1.0, TAU * f64::from(arc.turns))
}

fn start_direction(shape: &Shape, start: Position, end: Position) -> Position {
    match shape {
        Shape::Line => unit(minus(end, start)),
        Shape::Arc(arc) => tangent(arc, start),
    }
}

fn end_direction(shape: &Shape, start: Position, end: Position) -> Position {
    match shape {
        Shape::Line => unit(minus(end, start)),
        Shape::Arc(arc) => tangent(arc, end),
    }
}

fn tangent(arc: &Arc, point: Position) -> Position {
    let [a, b, _] = arc.plane.axes();
    let sign = if arc.clockwise { -1.0 } else { 1.0 };
    let mut direction = [0.0; 3];
    direction[a] = -sign * (point[b] - arc.center[b]);
    direction[b] = sign * (point[a] - arc.center[a]);
    unit(direction)
}

/// The greatest rate along a direction at which no axis exceeds its own.
fn slowest(direction: Position, limits: [f64; 3]) -> f64 {
    let share = |axis: usize| direction[axis].abs() / limits[axis].max(1e-6);
    let worst = share(0).max(share(1)).max(share(2));
    if worst > 0.0 { 1.0 / worst } else { limits[0].max(1e-6) }
}

pub(crate) fn minus(a: Position, b: Position) -> Position {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn dot(a: Position, b: Position) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn norm(a: Position) -> f64 {
    dot(a, a).sqrt()
}

fn unit(a: Position) -> Position {
    let length = norm(a);
    if length > 0.0 { a.map(|value| value / length) } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::path::{PathElement, PathEvent, Role};

    fn line(end: Position, feed: Option<f64>) -> PathElement {
        PathElement {
            side: None,
            shape: Shape::Line,
            end,
            feed_mm_per_min: feed,
            role: Role::None,
            axes: Default::default(),
            source: Default::default(),
        }
    }

    #[test]
    fn a_straight_cut_takes_length_over_feed_and_a_corner_costs_more() {
        let straight = CompensatedPath {
            elements: vec![
                line([50.0, 0.0, 0.0], Some(600.0)),
                line([100.0, 0.0, 0.0], Some(600.0)),
            ],
            ..Default::default()
        };
        let mut corner = straight.clone();
        corner.elements[1].end = [50.0, 50.0, 0.0];
        let rates = Rates::default();
        let seconds = |path| Estimate::new(rates, path, 0).advance_to(path, 2);
        // 100 mm at 10 mm/s, and 10/200 s to get going.
        assert!((seconds(&straight) - 10.05).abs() < 1e-9);
        assert!((seconds(&corner) - 10.075).abs() < 1e-9);
    }

    #[test]
    fn dwells_and_rapids_count() {
        let path = CompensatedPath {
            elements: vec![line([0.0, 0.0, 10.0], None)],
            events: vec![PathEvent {
                at_element: 1,
                action: Action::Dwell { seconds: 2.5 },
                source: Default::default(),
            }],
            ..Default::default()
        };
        let mut estimate = Estimate::new(Rates::default(), &path, 0);
        assert_eq!(estimate.advance_to(&path, 0), 0.0);
        let seconds = estimate.advance_to(&path, 1);
        // 10 mm at 1000 mm/min, plus starting, plus the dwell.
        assert!((3.1..3.3).contains(&seconds), "{seconds}");
        assert_eq!(estimate.advance_to(&path, 1), seconds);
    }
}
