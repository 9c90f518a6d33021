//! G10 L2 R: a work system that is rotated about Z.
//!
//! The program counts in the rotated system, and so does the interpreter. The path is in the system
//! that the controller has, which is not rotated: what is emitted is turned. A move along X of the
//! program is one of X and Y of the machine.

use super::axes::{Cause, Reliance};
use super::moves::End;
use super::{Interpreter, Scene};
use crate::parameter_file::{Left, Stored};
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Position, Shape};
use std::collections::BTreeMap;

/// The axes that a rotation mixes.
pub(super) const TURNED: AxisSet = AxisSet::NONE.with(0).with(1);

/// The number of the rotation of a work system, in degrees.
pub(super) const fn rotation_number(system: u32) -> u32 {
    5210 + 20 * system
}

/// Whether a parameter is the rotation of a work system.
pub(super) const fn is_rotation(number: u32) -> bool {
    matches!(number, 5230..=5390) && (number - 5230).is_multiple_of(20)
}

/// The rotations that a program has set.
#[derive(Debug, Clone, Default)]
pub(super) struct Rotations {
    set: BTreeMap<u32, SetRotation>,
    /// The work systems in which it has moved, as bits.
    moved_in: u16,
}

/// A rotation that a program has set.
#[derive(Debug, Clone, Copy)]
struct SetRotation {
    /// The last block that has.
    source: Source,
    /// The program has moved before as it was rotated at the beginning.
    is_read: bool,
}

/// A rotation about Z, counterclockwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Turn {
    cosine: f64,
    sine: f64,
}

impl Turn {
    /// `None` for whole turns. Quarters are exact.
    pub(super) fn new(degrees: f64) -> Option<Self> {
        let (sine, cosine) = match degrees.rem_euclid(360.0) {
            // Of a hair below 0 the remainder is 360.
            0.0 | 360.0 => return None,
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            degrees => degrees.to_radians().sin_cos(),
        };
        Some(Self { cosine, sine })
    }

    /// A place of the program in the work system of the controller.
    fn out([x, y, z]: Position, turn: Option<Self>) -> Position {
        let Some(Self { cosine, sine }) = turn else { return [x, y, z] };
        [x * cosine - y * sine, x * sine + y * cosine, z]
    }

    /// The other way.
    fn back(place: Position, turn: Option<Self>) -> Position {
        Self::out(place, turn.map(|it| Self { sine: -it.sine, ..it }))
    }
}

/// Both X and Y for one of them.
#[inline]
fn mixed(turn: Option<Turn>, axes: AxisSet) -> AxisSet {
    match turn {
        Some(_) if axes.contains(0) || axes.contains(1) => axes.union(TURNED),
        _ => axes,
    }
}

impl Interpreter<'_> {
    /// The rotation of a work system, in degrees.
    pub(super) fn rotation(&self, system: u32) -> f64 {
        self.stored.get(&rotation_number(system)).copied().unwrap_or(0.0)
    }

    /// Counts as the work system in force is rotated; the tool stays where it is.
    pub(super) fn turn_to(&mut self, system: u32, cause: Cause) {
        let turn = Turn::new(self.rotation(system));
        if turn == self.modal.turn {
            return;
        }
        let place = Turn::out(self.axes.position, self.modal.turn);
        self.axes.position = Turn::back(place, turn);
        self.modal.turn = turn;
        match self.axes.rely_on(TURNED) {
            Reliance::Known | Reliance::Assumed(_) => {}
            Reliance::Poisoned => self.axes.poison(TURNED),
            Reliance::Unknown(_) => self.axes.lose(TURNED, cause),
        }
    }

    /// G10 L2 R.
    pub(super) fn set_rotation(&mut self, system: u32, degrees: f64) {
        self.stored.insert(rotation_number(system), degrees);
        let is_read = self.rotations.moved_in >> system & 1 == 1;
        let first = SetRotation { source: self.source, is_read };
        self.rotations.set.entry(system).or_insert(first).source = self.source;
        if system == u32::from(self.modal.work_offset) {
            self.turn_to(system, Cause { source: self.source, word: "G10" });
        }
    }

    /// The axes of the controller that a move of these axes of the program concerns.
    #[inline]
    pub(super) fn turned_axes(&self, axes: AxisSet) -> AxisSet {
        mixed(self.modal.turn, axes)
    }

    /// The same in another work system.
    pub(super) fn turned_axes_in(&self, system: u32, axes: AxisSet) -> AxisSet {
        mixed(Turn::new(self.rotation(system)), axes)
    }

    /// The end of a straight move: in a rotated system it relies on where both axes are.
    #[inline]
    pub(super) fn turned_end(&mut self, scene: &mut Scene<'_>) -> End {
        let end = self.end(scene);
        self.with_turned_axes(end)
    }

    /// The same for an end that was read.
    #[inline]
    pub(super) fn with_turned_axes(&self, end: End) -> End {
        let named = self.turned_axes(end.named);
        let relative = end.relative.union(named.without(end.named));
        End { named, relative, ..end }
    }

    /// A place of the program in the work system of the controller.
    #[inline]
    pub(super) fn out(&self, place: Position) -> Position {
        Turn::out(place, self.modal.turn)
    }

    /// A place in the work system of the controller, as the program counts.
    pub(super) fn back(&self, place: Position) -> Position {
        Turn::back(place, self.modal.turn)
    }

    /// A place in another work system of the program, in that of the controller.
    pub(super) fn out_from(&self, system: u32, place: Position) -> Position {
        Turn::out(place, Turn::new(self.rotation(system)))
    }

    /// The program moves in the work system in force.
    #[inline]
    pub(super) fn moves_in_system(&mut self) {
        self.rotations.moved_in |= 1 << self.modal.work_offset;
    }

    /// A shape in the work system of the controller. Arcs are in XY.
    #[inline]
    pub(super) fn shape_out(&self, shape: Shape) -> Shape {
        match shape {
            Shape::Arc(arc) => Shape::Arc(Arc { center: self.out(arc.center), ..arc }),
            Shape::Line => Shape::Line,
        }
    }

    /// Refuses what would be across a plane that is tilted in the system of the controller.
    #[inline]
    pub(super) fn check_plane(&mut self, scene: &mut Scene<'_>, what: &str) {
        if self.modal.turn.is_some() && self.modal.plane != Plane::Xy {
            self.report_plane(scene, what);
        }
    }

    #[cold]
    fn report_plane(&mut self, scene: &mut Scene<'_>, what: &str) {
        let system = u32::from(self.modal.work_offset);
        let plane = match self.modal.plane {
            Plane::Zx => "ZX (G18)",
            _ => "YZ (G19)",
        };
        let message = format!(
            "{what} in the plane {plane}, and the work system is rotated by {} degrees",
            self.rotation(system)
        );
        let help =
            "turn the part in the CAM system in place of the work system, or post it for G17";
        self.report_block(scene, Code::Axes, message, help);
    }

    /// Where the tool stands at the beginning, and how the first work system is rotated.
    pub(super) fn begin_turned(&mut self) {
        self.modal.turn = Turn::new(self.rotation(1));
        self.axes.position = self.back(self.axes.position);
    }

    /// The rotations that the program has set last.
    pub(crate) fn rotations_left(&self) -> impl Iterator<Item = RotationLeft> {
        self.rotations.set.iter().map(|(&system, &set)| RotationLeft {
            system,
            degrees: self.rotation(system),
            set,
        })
    }
}

/// How a program leaves a work system.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RotationLeft {
    system: u32,
    degrees: f64,
    set: SetRotation,
}

impl RotationLeft {
    /// For the parameter file. `begun` are its values before.
    pub(crate) fn left(&self, begun: &[Stored]) -> Left {
        let number = rotation_number(self.system);
        let began = begun.iter().find(|it| it.number == number).map_or(0.0, |it| it.value);
        Left { number, began, value: self.degrees, is_read: self.set.is_read }
    }

    /// Without a file: says that the rotation ends with the program, if there is one.
    pub(crate) fn forgotten(&self) -> Option<Finding> {
        let Self { system, degrees, set: SetRotation { source, .. } } = *self;
        Turn::new(degrees)?;
        let message = format!(
            "work system {system} is rotated by {degrees} degrees until this program ends, and not \
             in the next one"
        );
        let help = format!(
            "keep it in a parameter file (`kerf plan --parameters`, the loader's `parameter_file`), \
             or end the program with G10 L2 P{system} R0"
        );
        Some(Finding::warning(Code::Unsupported, source, message).help(help))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_turn_out_and_back() {
        for (degrees, wanted) in [
            (0.0, [3.0, 4.0, 5.0]),
            (90.0, [-4.0, 3.0, 5.0]),
            (-270.0, [-4.0, 3.0, 5.0]),
            (180.0, [-3.0, -4.0, 5.0]),
            (630.0, [4.0, -3.0, 5.0]),
            (720.0, [3.0, 4.0, 5.0]),
            (-1e-20, [3.0, 4.0, 5.0]),
        ] {
            let turn = Turn::new(degrees);
            assert_eq!(Turn::out([3.0, 4.0, 5.0], turn), wanted, "{degrees}");
            assert_eq!(Turn::back(wanted, turn), [3.0, 4.0, 5.0], "{degrees}");
        }
        let [x, y, _] = Turn::out([2.0, 0.0, 0.0], Turn::new(30.0));
        assert!((x - 3f64.sqrt()).abs() < 1e-15 && (y - 1.0).abs() < 1e-15, "{x} {y}");
    }
}
