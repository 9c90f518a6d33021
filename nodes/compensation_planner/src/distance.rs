//! How near a straight move comes to a line or an arc.

use crate::element::{Arc, Element, Line, Vec2};
use crate::intersect::crossings;

/// The distance, mm, and the nearest point of the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Nearest {
    pub distance: f64,
    pub on_wall: Vec2,
}

/// The smallest distance between a straight move and an element.
pub(crate) fn nearest(from: Vec2, to: Vec2, wall: &Element) -> Nearest {
    let start = Nearest { distance: f64::INFINITY, on_wall: wall.start() };
    let mut best = start;
    let mut offer = |distance: f64, on_wall: Vec2| {
        if distance < best.distance {
            best = Nearest { distance, on_wall };
        }
    };
    for end in [from, to] {
        let point = nearest_on_element(wall, end);
        offer((point - end).norm(), point);
    }
    for end in [wall.start(), wall.end()] {
        offer((nearest_on_segment(from, to, end) - end).norm(), end);
    }
    if let Some(Element::Line(line)) = Element::line(from, to) {
        if let Element::Arc(arc) = wall {
            let near = nearest_on_segment(from, to, arc.center);
            if arc.faces(near - arc.center) {
                let point = wall.project(near);
                offer((point - near).norm(), point);
            }
        }
        for &point in crossings(&Element::Line(line), wall, 0.0).points() {
            if is_on_line(&line, point) && is_on(wall, point) {
                offer(0.0, point);
            }
        }
    }
    best
}

/// Whether a point of the whole line or circle is within the element.
pub(crate) fn is_on(element: &Element, point: Vec2) -> bool {
    match element {
        Element::Line(line) => is_on_line(line, point),
        Element::Arc(arc) => arc.faces(point - arc.center),
    }
}

fn is_on_line(line: &Line, point: Vec2) -> bool {
    let along = (point - line.start).dot(&line.tangent);
    (0.0..=line.length).contains(&along)
}

fn nearest_on_element(element: &Element, point: Vec2) -> Vec2 {
    match element {
        Element::Line(line) => {
            let along = (point - line.start).dot(&line.tangent);
            line.start + line.tangent * along.clamp(0.0, line.length)
        }
        Element::Arc(arc) => nearest_on_arc(element, arc, point),
    }
}

fn nearest_on_arc(element: &Element, arc: &Arc, point: Vec2) -> Vec2 {
    if arc.faces(point - arc.center) {
        return element.project(point);
    }
    let (start, end) = (element.start(), element.end());
    if (start - point).norm() <= (end - point).norm() { start } else { end }
}

fn nearest_on_segment(from: Vec2, to: Vec2, point: Vec2) -> Vec2 {
    match Element::line(from, to) {
        Some(line) => nearest_on_element(&line, point),
        None => from,
    }
}
