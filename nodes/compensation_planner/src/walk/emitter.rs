//! Writes motions and actions, in order.
//!
//! Every element starts where the one before it ended, because only ends are kept. Elements too
//! short for any machine are dropped; the next one then starts a hair earlier. Other files decide
//! what an element is.

use crate::geometry::element::{Arc, Element, Vec2, swept};
use crate::geometry::frame::{height, in_plane, in_work, plane_axes};
use crate::geometry::tolerance::LENGTH_MM;
use crate::span::feed;
use cnc_msgs::contour::{Action, CutterSide, Motion, Source};
use cnc_msgs::further::{FurtherMode, FurtherMove};
use cnc_msgs::geometry::{self, AxisSet, Plane, Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, PathEvent, Role};
use std::f64::consts::{PI, TAU};

/// The properties of an element besides its geometry.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Label {
    pub role: Role,
    pub source: Source,
    pub feed_mm_per_min: Option<f64>,
    pub axes: AxisSet,
}

/// The path so far.
#[derive(Debug)]
pub(crate) struct Emitter {
    pub path: CompensatedPath,
    pub position: Position,
    /// Axes that the controller has already been sent, so that repeating them has no effect.
    sent: AxisSet,
    /// The next element ends where nobody knows: it is a probe, or begins where one has ended.
    ends_unknown: bool,
    /// The last feed of any element.
    pub last_feed_mm_per_min: Option<f64>,
    /// Lines whose elements end in an exact stop, in order.
    exact_stops: Vec<u32>,
    /// The side that the tool runs on now.
    pub side: Option<CutterSide>,
}

impl Emitter {
    pub(crate) fn new(start: Position, assumed_axes: AxisSet) -> Self {
        let path = CompensatedPath { start, assumed_axes, ..CompensatedPath::default() };
        Self {
            path,
            position: start,
            sent: AxisSet::NONE,
            ends_unknown: false,
            last_feed_mm_per_min: None,
            exact_stops: Vec::new(),
            side: None,
        }
    }

    /// The path so far; the next one starts where it ends.
    pub(crate) fn take_path(&mut self) -> CompensatedPath {
        let CompensatedPath { start, assumed_axes, ref elements, .. } = self.path;
        let start = elements.last().map_or(start, |element| element.end);
        let next = CompensatedPath { start, assumed_axes, ..CompensatedPath::default() };
        std::mem::replace(&mut self.path, next)
    }

    /// Makes every element of this block end in an exact stop.
    pub(crate) fn stop_exactly_in(&mut self, source: Source) {
        // Calls of subprograms lead back in the text.
        if let Err(at) = self.exact_stops.binary_search(&source.line) {
            self.exact_stops.insert(at, source.line);
        }
    }

    /// Writes an action where the tool is.
    pub(crate) fn action(&mut self, action: Action, source: Source) {
        match action {
            // The next element is written even where it stays: it is more than its motion.
            Action::Further(FurtherMove { mode: FurtherMode::Along, .. })
            | Action::SpindleSync { .. } => self.sent = AxisSet::NONE,
            Action::Probe(_) | Action::Relative { .. } => {
                self.sent = AxisSet::NONE;
                self.ends_unknown = true;
            }
            // From here on positions have another meaning.
            Action::Reference { .. }
            | Action::Home { .. }
            | Action::MachineMove { .. }
            | Action::WorkOffset { .. }
            | Action::SetWorkOffset { .. }
            | Action::ToolLength { .. }
            | Action::Stretch { .. }
            | Action::ChangeTool { .. } => self.sent = AxisSet::NONE,
            _ => {}
        }
        self.path.events.push(PathEvent { at_element: self.path.elements.len(), action, source });
    }

    /// Writes a motion as programmed.
    pub(crate) fn programmed(&mut self, motion: &Motion, source: Source, role: Role) {
        let label = Label { role, source, feed_mm_per_min: feed(motion), axes: motion.axes };
        self.push(motion.shape, motion.end, label);
    }

    /// Writes a motion of the normal axis where the tool is in the plane.
    pub(crate) fn off_plane(&mut self, plane: Plane, motion: &Motion, source: Source) {
        let here = in_plane(plane, self.position);
        let end = in_work(plane, here, height(plane, motion.end));
        let feed_mm_per_min = feed(motion);
        let axes = motion.axes.without(plane_axes(plane)).with(plane.axes()[2]);
        self.push(Shape::Line, end, Label { role: Role::OffPlane, source, feed_mm_per_min, axes });
    }

    /// A line to a point in the plane at a height.
    pub(crate) fn line_to(&mut self, plane: Plane, point: Vec2, height: f64, label: Label) {
        self.push(Shape::Line, in_work(plane, point, height), label);
    }

    /// Along a compensated arc, `sweep` rad, to a point on it at a height.
    pub(crate) fn arc_to(
        &mut self,
        plane: Plane,
        arc: &Arc,
        sweep: f64,
        mut point: Vec2,
        end_height: f64,
        label: Label,
    ) {
        let start = in_plane(plane, self.position);
        if arc.radius * sweep <= LENGTH_MM {
            return;
        }
        let mut base = 0.0;
        let gap_mm = (point - start).norm();
        // A whole turn, except for a hair: if its ends stayed apart, it would be as short as that.
        // Its joints may have moved each end by more.
        let whole = TAU * (sweep / TAU).round();
        let goes_around = whole > 0.0 && gap_mm <= LENGTH_MM && (sweep - whole).abs() < 0.5;
        if goes_around || (gap_mm < 1e-3 * LENGTH_MM && sweep > 1.0) {
            point = start;
        } else {
            let (from, to) = (start - arc.center, point - arc.center);
            base = swept(from, to, arc.turn);
        }
        let turns = ((sweep - base) / TAU).round();
        if turns < 0.0 {
            return;
        }
        let shape = Shape::Arc(geometry::Arc {
            center: in_work(plane, arc.center, height(plane, self.position)),
            plane,
            clockwise: arc.turn < 0.0,
            turns: turns as u16,
        });
        let end = in_work(plane, point, end_height);
        // Most of a circle also ends near its start, and is a long move.
        let stays = sweep < PI && self.stays_at(end);
        self.push_unless(stays && turns <= 0.0, shape, end, label);
    }

    fn push(&mut self, shape: Shape, end: Position, label: Label) {
        let turns_around = matches!(shape, Shape::Arc(arc) if arc.turns > 0);
        self.push_unless(self.stays_at(end) && !turns_around, shape, end, label);
    }

    fn stays_at(&self, end: Position) -> bool {
        let moves = (0..3).map(|axis| (end[axis] - self.position[axis]).abs());
        moves.fold(0.0, f64::max) <= LENGTH_MM
    }

    /// Writes an element, unless it moves nothing and names no new axis.
    fn push_unless(&mut self, stays: bool, shape: Shape, end: Position, label: Label) {
        if stays {
            let is_programmed = matches!(label.role, Role::None | Role::OffPlane);
            let says_nothing = !is_programmed || label.axes.without(self.sent).is_empty();
            if says_nothing {
                return;
            }
        }
        let moved =
            (0..3).filter(|&axis| end[axis] != self.position[axis]).fold(label.axes, AxisSet::with);
        self.sent = self.sent.union(label.axes);
        if label.feed_mm_per_min.is_some() {
            self.last_feed_mm_per_min = label.feed_mm_per_min;
        }
        self.path.elements.push(PathElement {
            shape,
            end,
            feed_mm_per_min: label.feed_mm_per_min,
            role: label.role,
            side: self.side,
            axes: if label.role == Role::None { label.axes } else { moved },
            source: label.source,
        });
        self.position = end;
        if std::mem::take(&mut self.ends_unknown) {
            self.sent = AxisSet::NONE;
        }
        if !self.exact_stops.is_empty()
            && self.exact_stops.binary_search(&label.source.line).is_ok()
        {
            self.action(Action::ExactStop, label.source);
        }
    }
}

/// A line or an arc alike: from where the tool is to a point on a compensated element, `along` mm
/// (line) or rad (arc) further.
pub(crate) fn follow(
    out: &mut Emitter,
    plane: Plane,
    element: &Element,
    along: f64,
    point: Vec2,
    end_height: f64,
    label: Label,
) {
    match element {
        Element::Line(_) => out.line_to(plane, point, end_height, label),
        Element::Arc(arc) => out.arc_to(plane, arc, along, point, end_height, label),
    }
}
