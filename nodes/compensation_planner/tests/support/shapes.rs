//! Random closed contours, and distances measured in short chords.

use super::{contour, sinumerik};
use cnc_msgs::contour::ContourEventKind;
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use compensation_planner::{Plan, tessellate};

/// Corners of a closed contour of straight and bent edges about the origin, from the
/// middle of its first edge on, each with the bulge of the edge after it.
pub fn vertices(corners: &[(f64, f64)], bends: &[f64]) -> Vec<([f64; 2], f64)> {
    let count = corners.len();
    let corner = |index: usize| {
        let (radius, jitter) = corners[index % count];
        let angle = (index as f64 + 0.6 * jitter) / count as f64 * std::f64::consts::TAU;
        [radius * angle.cos(), radius * angle.sin()]
    };
    let [a, b] = [corner(0), corner(1)];
    let middle = [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
    let bend = |index: usize| Some(bends[index % bends.len()]).filter(|bend| bend.abs() >= 0.1);
    let bulge = |index: usize| if index >= count { 0.0 } else { bend(index + 1).unwrap_or(0.0) };
    let others = (1..=count).map(|index| (corner(index), bulge(index)));
    std::iter::once((middle, 0.0)).chain(others).collect()
}

/// The contour as a program that enters it where it begins.
pub fn closed(corners: &[(f64, f64)], bends: &[f64], side: &str) -> String {
    let vertices = vertices(corners, bends);
    let [x, y] = vertices[0].0;
    let mut text = format!("G0 X0 Y0\n{side} D1 G456 G1 X{x} Y{y} F100\n");
    for (index, (from, bulge)) in vertices.iter().enumerate() {
        text += &edge(*from, vertices[(index + 1) % vertices.len()].0, *bulge);
    }
    text + "G40 G456 G1 X0 Y0"
}

/// A line, or an arc through a point next to the middle of the chord.
pub fn edge(from: [f64; 2], to: [f64; 2], bend: f64) -> String {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    if bend == 0.0 {
        return format!("G1 X{} Y{}\n", to[0], to[1]);
    }
    // The centre is this far left of the middle of the chord.
    let off = (1.0 - bend * bend) / (2.0 * bend);
    let (i, j) = (dx / 2.0 - dy * off / 2.0, dy / 2.0 + dx * off / 2.0);
    let word = if bend > 0.0 { "G3" } else { "G2" };
    format!("{word} X{} Y{} I{i} J{j}\n", to[0], to[1])
}

/// The smallest distance of the tool from the programmed contour, both in short chords.
pub fn clearance(text: &str, plan: &Plan) -> f64 {
    let elements = if plan.accepted() { &plan.path.elements } else { &plan.refused };
    let mut way = Vec::new();
    let mut at = [0.0; 3];
    for element in elements {
        if matches!(element.role, Role::Contour | Role::Corner) {
            way.extend(chords(at, element));
        }
        at = element.end;
    }
    let walls = walls(text);
    let pairs = way.iter().flat_map(|way| walls.iter().map(move |wall| apart(*way, *wall)));
    pairs.fold(f64::INFINITY, f64::min)
}

/// The distance of a point from the programmed contour.
pub fn clearance_at(text: &str, [x, y, _]: Position) -> f64 {
    let from = |[a, b]: [[f64; 2]; 2]| from_chord([x, y], a, b);
    walls(text).into_iter().map(from).fold(f64::INFINITY, f64::min)
}

/// The contour without its leads.
fn walls(text: &str) -> Vec<[[f64; 2]; 2]> {
    let mut walls = Vec::new();
    let mut at = [0.0; 3];
    for event in &contour(text, &sinumerik()).events {
        let ContourEventKind::Motion(motion) = event.kind else { continue };
        let element = PathElement {
            shape: motion.shape,
            end: motion.end,
            feed_mm_per_min: None,
            role: Role::None,
            side: None,
            axes: motion.axes,
            source: event.source,
        };
        // The leads are the first two and the last motion.
        if event.source.line > 2 && event.source.line != text.lines().count() as u32 {
            walls.extend(chords(at, &element));
        }
        at = motion.end;
    }
    walls
}

/// Where the tool begins and ends next to a closed contour, if it fits there.
pub fn fits_at_entry(text: &str, is_left: bool, radius: f64) -> bool {
    let mut ends =
        contour(text, &sinumerik()).events.into_iter().filter_map(|event| match event.kind {
            ContourEventKind::Motion(motion) => Some(motion.end),
            _ => None,
        });
    let (Some(from), Some(to)) = (ends.nth(1), ends.next()) else { return false };
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let across = radius / dx.hypot(dy) * if is_left { 1.0 } else { -1.0 };
    clearance_at(text, [from[0] - dy * across, from[1] + dx * across, 0.0]) > radius - 1e-3
}

pub fn chords(start: Position, element: &PathElement) -> Vec<[[f64; 2]; 2]> {
    let mut from = [start[0], start[1]];
    let mut chords = Vec::new();
    tessellate::points(start, element, 1e-3, |to| {
        let to = [to[0], to[1]];
        chords.push([from, to]);
        from = to;
    });
    chords
}

pub fn apart([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2]) -> f64 {
    let side = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    if side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0 {
        return 0.0;
    }
    let ends = [from_chord(a, c, d), from_chord(b, c, d), from_chord(c, a, b), from_chord(d, a, b)];
    ends.into_iter().fold(f64::INFINITY, f64::min)
}

fn from_chord(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let squared = dx * dx + dy * dy;
    let along = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / squared.max(f64::MIN_POSITIVE);
    let along = along.clamp(0.0, 1.0);
    (p[0] - a[0] - dx * along).hypot(p[1] - a[1] - dy * along)
}

/// Whether edges that are not neighbours meet.
pub fn crosses_itself(text: &str) -> bool {
    let mut at = [0.0; 3];
    let mut edges = Vec::new();
    for event in &contour(text, &sinumerik()).events {
        let ContourEventKind::Motion(motion) = event.kind else { continue };
        let element = PathElement {
            shape: motion.shape,
            end: motion.end,
            feed_mm_per_min: None,
            role: Role::None,
            side: None,
            axes: motion.axes,
            source: event.source,
        };
        edges.push(chords(at, &element));
        at = motion.end;
    }
    // Without the rapid and both leads.
    let edges = &edges[2..edges.len() - 1];
    let count = edges.len();
    (0..count).any(|i| {
        (i + 1..count).any(|j| {
            let is_neighbour = j == i + 1 || (i == 0 && j + 1 == count);
            let (a, b) = (&edges[i], &edges[j]);
            let skip = usize::from(is_neighbour);
            let near = |a: &[[[f64; 2]; 2]], b: &[[[f64; 2]; 2]]| {
                a.iter().any(|a| b.iter().any(|b| apart(*a, *b) < 1e-3))
            };
            if is_neighbour && j == i + 1 {
                near(&a[..a.len() - skip], b) || near(a, &b[skip..])
            } else if is_neighbour {
                near(&a[skip..], b) || near(a, &b[..b.len() - skip])
            } else {
                near(a, b)
            }
        })
    })
}

/// Area within the closed part of a path, by its elements: signed, arcs exact.
pub fn area_of(path: &CompensatedPath) -> f64 {
    let mut area = 0.0;
    for (index, element) in path.elements.iter().enumerate() {
        if !matches!(element.role, Role::Contour | Role::Corner) {
            continue;
        }
        let (a, b) = (path.start_of(index), element.end);
        area += (a[0] * b[1] - a[1] * b[0]) / 2.0;
        if let Shape::Arc(arc) = element.shape {
            let sweep = tessellate::sweep(a, &arc, b);
            let radius = (a[0] - arc.center[0]).hypot(a[1] - arc.center[1]);
            let segment = radius * radius * (sweep - sweep.sin()) / 2.0;
            area += if arc.clockwise { -segment } else { segment };
        }
    }
    area
}
