//! Contours and paths as sets of points, for which `cavalier_contours` measures distances.

use cavalier_contours::core::math::Vector2;
use cavalier_contours::polyline::{PlineSource, PlineSourceMut, Polyline};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use compensation_planner::tessellate;

/// A closed contour of points, each with the bulge of the edge after it.
pub fn polyline(vertices: &[([f64; 2], f64)]) -> Polyline<f64> {
    let mut pline = Polyline::new_closed();
    for ([x, y], bulge) in vertices {
        pline.add(*x, *y, *bulge);
    }
    pline
}

/// The offsets that are more than a point or a line.
pub fn offsets(shape: &Polyline<f64>, left_mm: f64) -> Vec<Polyline<f64>> {
    shape.parallel_offset(left_mm).into_iter().filter(|offset| area_above(offset, 1e-3)).collect()
}

pub fn area_above(shape: &Polyline<f64>, least: f64) -> bool {
    shape.area().abs() > least
}

/// The elements that follow the contour, with their starts.
pub fn closed_part(path: &CompensatedPath) -> impl Iterator<Item = (Position, &PathElement)> {
    let starts = (0..path.elements.len()).map(|index| path.start_of(index));
    let all = starts.zip(&path.elements);
    all.filter(|(_, element)| matches!(element.role, Role::Contour | Role::Corner))
}

/// Its points, each with the bulge of the element after it.
pub fn bulges(path: &CompensatedPath) -> Vec<([f64; 2], f64)> {
    let bulge = |(start, element): (Position, &PathElement)| {
        let bulge = match element.shape {
            Shape::Line => 0.0,
            Shape::Arc(arc) => {
                let part = (tessellate::sweep(start, &arc, element.end) / 4.0).tan();
                if arc.clockwise { -part } else { part }
            }
        };
        ([start[0], start[1]], bulge)
    };
    closed_part(path).map(bulge).collect()
}

/// The part of a path that follows the contour.
pub fn outline(path: &CompensatedPath) -> Polyline<f64> {
    polyline(&bulges(path))
}

/// Points of the part of a path that follows the contour: joints and points between them.
pub fn samples(path: &CompensatedPath) -> Vec<Position> {
    let between = [0.0, 0.07, 0.25, 0.5, 0.75, 0.93, 1.0];
    let points = |(start, element)| between.map(|part| along(start, element, part));
    closed_part(path).flat_map(points).collect()
}

/// Points of a closed contour.
pub fn samples_of(shape: &Polyline<f64>) -> Vec<Position> {
    let length = shape.path_length();
    let at = |part: u32| shape.find_point_at_path_length(length * f64::from(part) / 500.0).ok();
    let corners = shape.iter_vertexes().map(|vertex| [vertex.x, vertex.y, 0.0]);
    corners.chain((0..500).filter_map(at).map(|(_, at)| [at.x, at.y, 0.0])).collect()
}

/// The distance of a point from a contour.
pub fn distance(shape: &Polyline<f64>, point: Position) -> f64 {
    let closest = shape.closest_point(Vector2::new(point[0], point[1]), 1e-12);
    closest.map_or(f64::INFINITY, |closest| closest.distance)
}

/// How far the farthest of these points is from a contour.
pub fn farthest(points: &[Position], shape: &Polyline<f64>) -> f64 {
    points.iter().map(|&point| distance(shape, point)).fold(0.0, f64::max)
}

/// How far two closed paths are apart where they are farthest, to within what lies between
/// the points that are looked at.
pub fn hausdorff(a: &CompensatedPath, b: &CompensatedPath) -> f64 {
    farthest(&samples(a), &outline(b)).max(farthest(&samples(b), &outline(a)))
}

/// The point at a part of an element.
pub fn along(start: Position, element: &PathElement, part: f64) -> Position {
    match element.shape {
        Shape::Line => {
            std::array::from_fn(|axis| start[axis] + (element.end[axis] - start[axis]) * part)
        }
        Shape::Arc(arc) => {
            let sweep = tessellate::sweep(start, &arc, element.end) * part;
            let (sin, cos) = (if arc.clockwise { -sweep } else { sweep }).sin_cos();
            let (x, y) = (start[0] - arc.center[0], start[1] - arc.center[1]);
            [arc.center[0] + x * cos - y * sin, arc.center[1] + x * sin + y * cos, start[2]]
        }
    }
}
