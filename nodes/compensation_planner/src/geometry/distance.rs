//! How near the tool comes to a line or an arc.

use crate::geometry::element::{Arc, Element, Line, Vec2, cross, left};
use crate::geometry::intersect::crossings;
use crate::geometry::tolerance::LENGTH_MM;

/// The distance, mm, and the nearest point of the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Nearest {
    pub distance: f64,
    /// Of the tool centre.
    pub on_path: Vec2,
    pub on_wall: Vec2,
}

/// The smallest distance between an element of the tool path and an element of the contour.
pub(crate) fn nearest_between(path: &Element, wall: &Element) -> Nearest {
    let mut best =
        Nearest { distance: f64::INFINITY, on_path: path.start(), on_wall: wall.start() };
    let mut offer = |on_path: Vec2, on_wall: Vec2| {
        let distance = (on_path - on_wall).norm();
        if distance < best.distance {
            best = Nearest { distance, on_path, on_wall };
        }
    };
    for end in [path.start(), path.end()] {
        offer(end, nearest_on_element(wall, end));
    }
    for end in [wall.start(), wall.end()] {
        offer(nearest_on_element(path, end), end);
    }
    // Inside both elements, the nearest points face each other across both.
    for (on_path, on_wall) in facing(path, wall) {
        if is_on(path, on_path) && is_on(wall, on_wall) {
            offer(on_path, on_wall);
        }
    }
    for &point in crossings(path, wall, 0.0).points() {
        if is_on(path, point) && is_on(wall, point) {
            offer(point, point);
        }
    }
    best
}

/// Whether two elements are certainly at least this far apart, mm. A few products show it: one lies on
/// one side of the other's line, inside its circle, outside its circle, or beyond its ends. This
/// decides most pairs whose boxes are near.
pub(crate) fn are_apart(a: &Element, b: &Element, limit_mm: f64) -> bool {
    match (a, b) {
        (Element::Line(a), Element::Line(b)) => {
            is_beside(a, b, limit_mm) || is_beside(b, a, limit_mm)
        }
        (Element::Line(line), Element::Arc(arc)) | (Element::Arc(arc), Element::Line(line)) => {
            let center_off = cross(line.tangent, arc.center - line.start).abs();
            let ends = [line.start, line.start + line.tangent * line.length];
            center_off - arc.radius > limit_mm
                || is_behind(arc, ends, limit_mm)
                || is_before_chord(arc, ends, 0.0, limit_mm)
        }
        (Element::Arc(a), Element::Arc(b)) => {
            let between = (a.center - b.center).norm();
            let nested = (a.radius - b.radius).abs() - between;
            nested.max(between - a.radius - b.radius) > limit_mm
                || is_before_chord(a, [b.center; 2], b.radius, limit_mm)
                || is_before_chord(b, [a.center; 2], a.radius, limit_mm)
        }
    }
}

fn is_beside(line: &Line, other: &Line, limit_mm: f64) -> bool {
    let off = |point: Vec2| cross(line.tangent, point - line.start);
    let [from, to] = [off(other.start), off(other.start + other.tangent * other.length)];
    from.min(to) > limit_mm || from.max(to) < -limit_mm
}

/// Whether a line between two points stays behind an arc of less than half a turn, seen from
/// outside its circle: so far back in each direction that the arc faces.
fn is_behind(arc: &Arc, ends: [Vec2; 2], limit_mm: f64) -> bool {
    let most = arc.radius - limit_mm;
    if most <= 0.0 || arc.sweep > SWEEP_MAX {
        return false;
    }
    ends.into_iter().all(|end| {
        let out = end - arc.center;
        let is_faced =
            cross(arc.from, out) * arc.turn >= 0.0 && cross(out, arc.to) * arc.turn >= 0.0;
        let ahead = arc.from.dot(&out).max(arc.to.dot(&out));
        ahead < most && (!is_faced || out.norm_squared() < most * most)
    })
}

/// Whether everything within `radius_mm` of two points is so far from the chord of an arc, on the
/// side where its centre is.
fn is_before_chord(arc: &Arc, points: [Vec2; 2], radius_mm: f64, limit_mm: f64) -> bool {
    if arc.sweep > SWEEP_MAX {
        return false;
    }
    let out = (arc.from + arc.to).normalize();
    let ahead = points.map(|point| out.dot(&(point - arc.center)));
    out.dot(&arc.from) * arc.radius - ahead[0].max(ahead[1]) - radius_mm > limit_mm
}

/// For such arcs, rad, the chord is on the far side of the centre.
const SWEEP_MAX: f64 = 0.75 * std::f64::consts::PI;

/// The pairs of points of two whole lines or circles that have a common normal.
fn facing(path: &Element, wall: &Element) -> impl Iterator<Item = (Vec2, Vec2)> {
    let normal = match (path, wall) {
        (Element::Line(_), Element::Line(_)) => None,
        (Element::Line(line), Element::Arc(_)) | (Element::Arc(_), Element::Line(line)) => {
            Some(left(line.tangent))
        }
        (Element::Arc(path), Element::Arc(wall)) => {
            let between = wall.center - path.center;
            (between.norm() > 0.0).then(|| between.normalize())
        }
    };
    let (path, wall) = (*path, *wall);
    let on = move |element: &Element, other: &Element, normal: Vec2, sign: f64| match element {
        Element::Arc(arc) => arc.center + normal * (arc.radius * sign),
        Element::Line(_) => match other {
            Element::Arc(arc) => element.project(arc.center),
            Element::Line(_) => element.start(),
        },
    };
    const SIGNS: [(f64, f64); 4] = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    normal.into_iter().flat_map(move |normal| {
        SIGNS.into_iter().map(move |(one, other)| {
            (on(&path, &wall, normal, one), on(&wall, &path, normal, other))
        })
    })
}

/// How far a point is from an element, mm.
pub(crate) fn distance_to(element: &Element, point: Vec2) -> f64 {
    (nearest_on_element(element, point) - point).norm()
}

/// Whether a point is on an element, within rounding.
pub(crate) fn is_near(element: &Element, point: Vec2) -> bool {
    distance_to(element, point) <= LENGTH_MM
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

pub(crate) fn nearest_on_element(element: &Element, point: Vec2) -> Vec2 {
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
