//! Rotated work systems: G10 L2 R.
//!
//! No controller here stores a rotation, so each move of the program is turned on its way out; the
//! loader itself counts in the coordinates of the program. A rotation ends with the program.

use super::axes::Cause;
use super::{Interpreter, Scene};
use crate::dialect::{Group, Mode};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{AxisSet, Plane, Position, Shape};

/// Degrees about Z of the work systems 1 to 9.
#[derive(Debug, Default)]
pub(super) struct Rotations {
    degrees: [f64; 9],
    has_warned: bool,
}

const XY: AxisSet = AxisSet::from_bits(0b011);

impl Interpreter<'_> {
    /// The sine and cosine of the rotation in force, `None` without one.
    #[inline]
    fn rotation(&self) -> Option<[f64; 2]> {
        let system = usize::from(self.modal.work_offset.clamp(1, 9)) - 1;
        let degrees = self.rotations.degrees[system];
        (degrees != 0.0).then(|| sine_and_cosine(degrees))
    }

    /// R of G10 L2.
    pub(super) fn set_rotation(&mut self, scene: &mut Scene<'_>, system: u8, degrees: f64) {
        let old = std::mem::replace(&mut self.rotations.degrees[usize::from(system) - 1], degrees);
        if old != degrees && system == self.modal.work_offset {
            self.axes.lose(XY, Cause { source: self.source, word: "G10" });
        }
        if degrees != 0.0 && !std::mem::replace(&mut self.rotations.has_warned, true) {
            let source = scene.source_of(self.request.word(b'R'));
            let message = "the rotation ends with the program: the controller cannot store it";
            let help = "write it into each program that needs it; R0 ends it earlier";
            scene.findings.push(Finding::warning(Code::Unsupported, source, message).help(help));
        }
    }

    /// Whether this work system is rotated.
    pub(super) fn is_rotated(&self, system: u8) -> bool {
        self.rotations.degrees[usize::from(system) - 1] != 0.0
    }

    /// In a rotated work system a move of X moves Y as well: where both are must be known.
    #[inline]
    pub(super) fn check_rotation(&mut self, scene: &mut Scene<'_>) {
        if self.rotation().is_none() || self.request.g(Group::MachineCoordinates).is_some() {
            return;
        }
        let present = self.request.present;
        let has = |letter| present.contains(letter);
        let named = AxisSet::from_bits(u8::from(has(b'X')) | u8::from(has(b'Y')) << 1);
        if !named.is_empty() && named != XY {
            self.relies(scene, XY.without(named));
        }
        let moves = !named.is_empty() || [b'I', b'J', b'K', b'Z'].into_iter().any(has);
        let is_arc = moves && matches!(self.modal.mode, Some(Mode::Arc { .. }));
        if is_arc && self.modal.plane != Plane::Xy {
            let message = "an arc outside the plane XY in a rotated work system".to_owned();
            let help = "write G17, or end the rotation with G10 L2 P0 R0 before it";
            self.report_block(scene, Code::Axes, message, help);
        }
    }

    /// A move as the controller counts; and the axes that it names there.
    #[inline]
    pub(super) fn rotated(
        &self,
        shape: Shape,
        end: Position,
        axes: AxisSet,
    ) -> (Shape, Position, AxisSet) {
        let Some(rotation) = self.rotation() else { return (shape, end, axes) };
        let shape = match shape {
            Shape::Line => Shape::Line,
            Shape::Arc(mut arc) => {
                arc.center = turned(arc.center, rotation);
                Shape::Arc(arc)
            }
        };
        let axes = if axes.without(XY) == axes { axes } else { axes.union(XY) };
        (shape, turned(end, rotation), axes)
    }

    /// Extends the bounds by a move.
    #[inline]
    pub(super) fn add_to_bounds(
        &mut self,
        start: Position,
        shape: Shape,
        end: Position,
        axes: AxisSet,
    ) {
        let start = self.rotation().map_or(start, |rotation| turned(start, rotation));
        let (shape, end, axes) = self.rotated(shape, end, axes);
        if let Shape::Arc(arc) = &shape {
            self.bounds.add_arc(start, end, arc);
        }
        self.bounds.add_end(end, axes);
    }
}

fn turned([x, y, z]: Position, [sine, cosine]: [f64; 2]) -> Position {
    [cosine * x - sine * y, sine * x + cosine * y, z]
}

/// Exact where the axes only change places.
pub(super) fn sine_and_cosine(degrees: f64) -> [f64; 2] {
    match degrees.rem_euclid(360.0) {
        0.0 => [0.0, 1.0],
        90.0 => [1.0, 0.0],
        180.0 => [0.0, -1.0],
        270.0 => [-1.0, 0.0],
        angle => angle.to_radians().sin_cos().into(),
    }
}
