//! Paths as rows of numbers on the paper, and where two of them part.

use crate::picture::view::{Point, View};
use cnc_msgs::contour::{ContourEventKind, MotionClass, ProgrammedContour};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, Role};
use compensation_planner::UncutRegion;
use serde::Serialize;

/// Paths that are nearer than this are the same, mm.
const SAME_MM: f64 = 1e-6;

/// A path that can be switched on and off.
#[derive(Debug, Serialize)]
pub(crate) struct Layer {
    name: &'static str,
    color: &'static str,
    corner: &'static str,
    rapid: &'static str,
    /// Of lines, pixels.
    width: f64,
    start: Point,
    elements: Vec<Row>,
}

/// The outline of what stays uncut.
#[derive(Debug, Serialize)]
pub(crate) struct Outline {
    start: Point,
    elements: Vec<Row>,
}

/// Kind, end and centre on the paper, end in work coordinates, line, block, look, feed. The
/// names of the columns stand in `page.js`.
type Row = (u8, f64, f64, f64, f64, f64, f64, f64, u32, Option<u32>, u8, Option<f64>);

const CUT: u8 = 0;
const CORNER: u8 = 1;
const LEAD: u8 = 2;
const RAPID: u8 = 3;

impl Layer {
    /// What was programmed.
    pub(crate) fn programmed(contour: &ProgrammedContour, view: View) -> Self {
        let motions = contour.events.iter().filter_map(|event| match event.kind {
            ContourEventKind::Motion(motion) => Some((motion, event.source)),
            _ => None,
        });
        let rows = motions.map(|(motion, source)| {
            let is_feed = motion.class == MotionClass::Feed;
            let look = if is_feed { CUT } else { RAPID };
            // Feeds are told of paths.
            let feed = is_feed.then_some(0.0);
            row(view, &motion.shape, motion.end, (source.line, source.block), look, feed)
        });
        let (name, color, rapid) = ("programmed", "#7a7f87", "#b3b8bf");
        let elements = rows.collect();
        Self {
            name,
            color,
            corner: color,
            rapid,
            width: 1.2,
            start: view.project(contour.start),
            elements,
        }
    }

    /// A path of the tool.
    pub(crate) fn compensated(
        name: &'static str,
        start: Position,
        elements: &[PathElement],
        view: View,
    ) -> Self {
        let elements = elements.iter().map(|element| element_row(element, view)).collect();
        let (color, corner, rapid) = ("#7b2fbf", "#b565e8", "#2f8f5b");
        Self { name, color, corner, rapid, width: 2.2, start: view.project(start), elements }
    }

    /// The path of today above one that was recorded.
    pub(crate) fn now(start: Position, elements: &[PathElement], view: View) -> Self {
        let layer = Self::compensated("compensated now", start, elements, view);
        Self { color: "#e8590c", corner: "#e8590c", rapid: "#e8590c", width: 1.1, ..layer }
    }
}

impl Outline {
    pub(super) fn new(region: &UncutRegion, view: View) -> Self {
        let source = (region.first.line, None);
        let row = |piece: &compensation_planner::OutlinePiece| {
            row(view, &piece.shape, piece.end, source, CUT, Some(0.0))
        };
        Self {
            start: view.project(region.start),
            elements: region.outline.iter().map(row).collect(),
        }
    }
}

fn element_row(element: &PathElement, view: View) -> Row {
    let look = match (element.role, element.feed_mm_per_min) {
        (Role::LeadOn | Role::LeadOff | Role::Link, _) => LEAD,
        (_, None) => RAPID,
        (Role::Corner, _) => CORNER,
        _ => CUT,
    };
    let source = (element.source.line, element.source.block);
    row(view, &element.shape, element.end, source, look, element.feed_mm_per_min)
}

fn row(
    view: View,
    shape: &Shape,
    end: Position,
    (line, block): (u32, Option<u32>),
    look: u8,
    feed: Option<f64>,
) -> Row {
    // A millionth of a millimetre is far below a pixel, and shorter to write.
    let round = |value: f64| (value * 1e6).round() / 1e6;
    let [x, y] = view.project(end).map(round);
    let (kind, [cx, cy]) = match shape {
        Shape::Arc(arc) if arc.plane == view.plane => {
            let direction = if view.turns_clockwise(arc.clockwise) { 1 } else { 2 };
            let whole_turns = if arc.turns > 0 { 2 } else { 0 };
            (direction + whole_turns, view.project(arc.center).map(round))
        }
        _ => (0, [0.0; 2]),
    };
    let [end_x, end_y, end_z] = end.map(round);
    (kind, x, y, cx, cy, end_x, end_y, end_z, line, block, look, feed)
}

/// Where two paths part.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Apart {
    pub(super) position: Position,
    pub(super) line: u32,
    pub(super) text: String,
}

/// The first element that is not the same in both.
pub(super) fn first_difference(recorded: &CompensatedPath, now: &CompensatedPath) -> Option<Apart> {
    let place = |[x, y, z]: Position| format!("X{x:.6} Y{y:.6} Z{z:.6}");
    if distance(recorded.start, now.start) > SAME_MM {
        return Some(Apart {
            position: recorded.start,
            line: recorded.elements.first().map_or(0, |element| element.source.line),
            text: format!(
                "the path began at {} and begins at {} now",
                place(recorded.start),
                place(now.start)
            ),
        });
    }
    let pairs = recorded.elements.iter().zip(&now.elements).enumerate();
    for (index, (was, is)) in pairs {
        let apart_mm = distance(was.end, is.end).max(shape_distance(&was.shape, &is.shape));
        if apart_mm > SAME_MM {
            let how = if apart_mm.is_finite() {
                format!("{apart_mm:.6} mm apart")
            } else {
                "of another kind".to_owned()
            };
            return Some(Apart {
                position: was.end,
                line: was.source.line,
                text: format!(
                    "element {index} of line {} ended at {} and ends at {} now, {how}",
                    was.source.line,
                    place(was.end),
                    place(is.end)
                ),
            });
        }
    }
    let (before, after) = (recorded.elements.len(), now.elements.len());
    if before == after {
        return None;
    }
    let common = before.min(after);
    let longer = if before > after { recorded } else { now };
    Some(Apart {
        position: longer.elements[common].end,
        line: longer.elements[common].source.line,
        text: format!("there were {before} elements and are {after} now; {common} are the same"),
    })
}

fn distance(a: Position, b: Position) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

/// How far apart the centres are; infinite for a line and an arc, or other turns.
fn shape_distance(a: &Shape, b: &Shape) -> f64 {
    match (a, b) {
        (Shape::Line, Shape::Line) => 0.0,
        (Shape::Arc(a), Shape::Arc(b))
            if (a.plane, a.clockwise, a.turns) == (b.plane, b.clockwise, b.turns) =>
        {
            distance(a.center, b.center)
        }
        _ => f64::INFINITY,
    }
}
