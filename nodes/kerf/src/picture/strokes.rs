//! The drawing commands of contours and paths, and the area that they take.
//!
//! Nothing is kept of a motion that has been drawn, so a picture may have millions.

use super::look::Look;
use super::view::{Point, View};
use cnc_msgs::contour::{ContourEventKind, MotionClass, ProgrammedContour};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::PathElement;
use compensation_planner::UncutRegion;
use std::io::{self, Write};

/// A line or arc, and the class of its look.
pub(super) struct Motion<'a> {
    class: &'static str,
    start: Position,
    shape: &'a Shape,
    end: Position,
}

/// The motions of the programmed contour.
pub(super) fn programmed(contour: &ProgrammedContour) -> impl Iterator<Item = Motion<'_>> {
    let mut position = contour.start;
    contour.events.iter().filter_map(move |event| {
        let ContourEventKind::Motion(motion) = &event.kind else { return None };
        let class =
            if motion.class == MotionClass::Feed { "programmed" } else { "programmed rapid" };
        let start = std::mem::replace(&mut position, motion.end);
        Some(Motion { class, start, shape: &motion.shape, end: motion.end })
    })
}

/// The motions of a path.
pub(super) fn compensated(
    start: Position,
    elements: &[PathElement],
) -> impl Iterator<Item = Motion<'_>> {
    let mut position = start;
    elements.iter().map(move |element| {
        let class = match Look::of(element) {
            Look::Lead => "path lead",
            Look::Rapid => "path rapid",
            Look::Corner => "path corner",
            Look::Cut => "path",
        };
        let start = std::mem::replace(&mut position, element.end);
        Motion { class, start, shape: &element.shape, end: element.end }
    })
}

/// Draws motions; neighbours of one look are one stroke.
pub(super) fn write<'a>(
    svg: &mut impl Write,
    motions: impl Iterator<Item = Motion<'a>>,
    view: View,
) -> io::Result<()> {
    let mut drawn = None;
    for Motion { class, start, shape, end } in motions {
        if drawn != Some(class) {
            if drawn.is_some() {
                close(svg)?;
            }
            open(svg, class, view.project(start))?;
            drawn = Some(class);
        }
        add(svg, start, shape, end, view)?;
    }
    if drawn.is_some() { close(svg) } else { Ok(()) }
}

/// Draws the area that stays uncut, filled.
pub(super) fn write_uncut(
    svg: &mut impl Write,
    region: &UncutRegion,
    view: View,
) -> io::Result<()> {
    open(svg, "uncut", view.project(region.start))?;
    let mut start = region.start;
    for piece in &region.outline {
        add(svg, start, &piece.shape, piece.end, view)?;
        start = piece.end;
    }
    close(svg)
}

fn open(svg: &mut impl Write, class: &str, start: Point) -> io::Result<()> {
    write!(svg, "<path class=\"{class}\" d=\"M{:.6} {:.6}", start[0], start[1])
}

fn close(svg: &mut impl Write) -> io::Result<()> {
    svg.write_all(b"\"/>\n")
}

fn add(
    svg: &mut impl Write,
    start: Position,
    shape: &Shape,
    end: Position,
    view: View,
) -> io::Result<()> {
    let (from, to) = (view.project(start), view.project(end));
    match shape {
        Shape::Arc(arc) if arc.plane == view.plane => {
            let center = view.project(arc.center);
            let radius = (from[0] - center[0]).hypot(from[1] - center[1]);
            let clockwise = view.turns_clockwise(arc.clockwise);
            let mut arc_to = |is_major: bool, point: Point| {
                write!(
                    svg,
                    "A{radius:.6} {radius:.6} 0 {} {} {:.6} {:.6}",
                    u8::from(is_major),
                    u8::from(clockwise),
                    point[0],
                    point[1]
                )
            };
            if arc.turns > 0 {
                arc_to(false, [2.0 * center[0] - from[0], 2.0 * center[1] - from[1]])?;
                arc_to(false, from)?;
            }
            arc_to(is_major(from, to, center, clockwise), to)
        }
        _ => write!(svg, "L{:.6} {:.6}", to[0], to[1]),
    }
}

/// Whether the arc is longer than half a circle, on paper with y downwards.
fn is_major(from: Point, to: Point, center: Point, clockwise: bool) -> bool {
    let (a, b) =
        ([from[0] - center[0], from[1] - center[1]], [to[0] - center[0], to[1] - center[1]]);
    let cross = a[0] * b[1] - a[1] * b[0];
    // With y downwards a clockwise turn has a positive cross product.
    if clockwise { cross < 0.0 } else { cross > 0.0 }
}

/// The smallest rectangle around points; of none when a bound is not finite.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) min: Point,
    pub(super) max: Point,
}

impl Bounds {
    pub(super) fn new() -> Self {
        Self { min: [f64::INFINITY; 2], max: [f64::NEG_INFINITY; 2] }
    }

    pub(super) fn add(&mut self, point: Point) {
        self.min = std::array::from_fn(|axis| self.min[axis].min(point[axis]));
        self.max = std::array::from_fn(|axis| self.max[axis].max(point[axis]));
    }

    /// Adds motions; of an arc what it passes, which is little of a large circle.
    pub(super) fn add_motions<'a>(
        &mut self,
        motions: impl Iterator<Item = Motion<'a>>,
        view: View,
    ) {
        for Motion { start, shape, end, .. } in motions {
            let from = view.project(start);
            self.add(from);
            self.add(view.project(end));
            if let Shape::Arc(arc) = shape {
                for (axis, value) in arc.outermost(start, end) {
                    let mut point = start;
                    point[axis] = value;
                    self.add(view.project(point));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::geometry::{Arc, Plane};

    /// The box around an arc about (0, -1000) that is nearly a line.
    #[test]
    fn a_nearly_straight_arc_takes_no_more_room_than_a_line() {
        let arc = |clockwise| {
            Shape::Arc(Arc { center: [0.0, -1000.0, 0.0], plane: Plane::Xy, clockwise, turns: 0 })
        };
        let reaches = |clockwise| {
            let view = View { plane: Plane::Xy, is_mirrored: false };
            let (start, end) = ([-10.0, -0.05, 0.0], [10.0, -0.05, 0.0]);
            let shape = arc(clockwise);
            let motion = Motion { class: "", start, shape: &shape, end };
            let mut bounds = Bounds::new();
            bounds.add_motions(std::iter::once(motion), view);
            bounds
        };
        let near = reaches(true);
        assert!(near.max[1] - near.min[1] < 0.1, "{near:?}");
        assert!((near.min[1] - 0.0).abs() < 0.01, "it passes the highest point: {near:?}");
        let far = reaches(false);
        assert!(far.max[1] > 1999.0, "the other way round: {far:?}");
    }
}
