//! G10, G52, G92 and G28.1: where the program counts from.
//!
//! G52 and G92 move the zero of the program, and Kerf adds that to each coordinate: the path stays
//! in the work system that G54 to G59 select, and nothing is left in the controller when a run is
//! aborted. G10 changes a work system of the machine itself, and goes there.

use super::axes::Cause;
use super::turn::TURNED;
use super::{Interpreter, Scene};
use crate::dialect::{Distance, GWord, Group, LengthWord};
use crate::no_effect::TOOL_TABLE;
use cnc_msgs::contour::{Action, MotionClass};
use cnc_msgs::finding::Code;
use cnc_msgs::further::{FurtherAxes, FurtherMode};
use cnc_msgs::geometry::{AxisSet, Position, Shape};
use cnc_msgs::units::received_mm;

/// What a G word does to the zero of the program or to the machine's offsets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OffsetWord {
    /// G10.
    Set,
    /// G52: the zero is here in the work system.
    Local,
    /// G92: the tool stands here.
    Axis,
    /// G92.1, and G92.2, which keeps the offset for G92.3.
    AxisOff { keeps: bool },
    /// G92.3.
    AxisRestore,
    /// G28.1, G30.1: the tool stands at the reference position.
    StoreReference { second: bool },
}

impl OffsetWord {
    /// Whether axis words belong to it.
    pub(super) const fn names_axes(self) -> bool {
        matches!(self, Self::Set | Self::Local | Self::Axis)
    }
}

impl Interpreter<'_> {
    #[cold]
    pub(super) fn offsets(&mut self, scene: &mut Scene<'_>, word: OffsetWord, at: usize) {
        if self.modal.compensation.is_selected() {
            let quote = scene.quote(at);
            let message = format!("{quote} moves the coordinates under cutter radius compensation");
            let help = "cancel with G40 and a straight move before it";
            self.report_at(scene, at, Code::ForbiddenUnderCompensation, message, help);
        }
        match word {
            OffsetWord::Set => return self.set_work_offset(scene, at),
            OffsetWord::Local | OffsetWord::Axis => {}
            OffsetWord::AxisOff { keeps } => {
                if keeps && self.is_shifted() {
                    self.modal.kept_shift = self.modal.shift;
                    self.further.kept_shift = self.further.shift;
                } else if !keeps {
                    self.modal.kept_shift = [0.0; 3];
                    self.further.kept_shift = FurtherAxes::NONE;
                }
                return self.end_shift();
            }
            OffsetWord::AxisRestore => {
                return self.restore_shift();
            }
            OffsetWord::StoreReference { second } => {
                self.store_reference(second);
                return self.act(Action::StoreReference { second });
            }
        }
        let (named, values) = self.axis_values(scene);
        let further = self.further_values(scene);
        if named.is_empty() && further.is_empty() {
            let message = format!("{} without X, Y or Z", scene.quote(at));
            let help = "name the axes, or write G92.1 to count from the work offset again";
            return self.report_at(scene, at, Code::MissingWord, message, help);
        }
        if word == OffsetWord::Axis {
            let is_known = self.relies(scene, named) & self.relies_on_further(scene, further);
            if is_known {
                self.check_touched(scene, named, at);
            }
            if !is_known || self.request.is_damaged {
                self.further.poison(further);
                return self.axes.poison(named);
            }
        }
        if self.request.is_damaged {
            return;
        }
        let mut shift = self.modal.shift;
        for axis in (0..3).filter(|&axis| named.contains(axis)) {
            shift[axis] = match word {
                OffsetWord::Axis => self.axes.position[axis] - values[axis],
                _ => values[axis],
            };
        }
        let further = further.map(|axis, value| match word {
            OffsetWord::Axis => self.further_position().get(axis).unwrap_or(0.0) - value,
            _ => value,
        });
        self.modal.shift = shift;
        self.modal.kept_shift = shift;
        self.modal.is_shifted = true;
        self.further.shift = further.or(self.further.shift);
        self.further.kept_shift = self.further.shift;
    }

    /// Whether G52 or G92 is in force, which it is with an offset of 0, too.
    pub(super) fn is_shifted(&self) -> bool {
        self.modal.is_shifted
    }

    /// G92.3.
    pub(super) fn restore_shift(&mut self) {
        self.modal.shift = self.modal.kept_shift;
        self.modal.is_shifted = true;
        self.further.shift = self.further.kept_shift;
    }

    /// Counts from the work offset again.
    pub(super) fn end_shift(&mut self) {
        self.modal.shift = [0.0; 3];
        self.modal.is_shifted = false;
        self.further.shift = FurtherAxes::NONE;
    }

    /// Takes the axis words as they are written, in mm; none of them is a move.
    fn axis_values(&mut self, scene: &mut Scene<'_>) -> (AxisSet, Position) {
        let shift = std::mem::take(&mut self.modal.shift);
        let distance = std::mem::replace(&mut self.modal.distance, Distance::Absolute);
        let end = self.end(scene);
        self.modal.shift = shift;
        self.modal.distance = distance;
        (end.named, end.position)
    }

    /// G10 L2 and L20.
    fn set_work_offset(&mut self, scene: &mut Scene<'_>, at: usize) {
        let mode = self.take_number(scene, b'L');
        if mode == Some(0) {
            return self.has_no_effect(scene, self.request.word(b'L'), TOOL_TABLE);
        }
        let system = self.take_number(scene, b'P');
        if let Some(mode @ (1 | 10 | 11)) = mode {
            return self.set_tool(scene, mode, system, at);
        }
        let (named, values) = self.axis_values(scene);
        let further = self.further_values(scene);
        let degrees = self.take(b'R');
        let by_position = match mode {
            Some(2) => false,
            Some(20) => true,
            Some(other) => {
                let message = format!("G10 has no L{other}");
                return self.report(scene, b'L', Code::BadNumber, message, "write L2 or L20");
            }
            None if self.request.present.contains(b'L') => return,
            None => {
                let message = "G10 without L".to_owned();
                let help = "write L2 to set a work offset, or L20 to set it by the position";
                return self.report_at(scene, at, Code::MissingWord, message, help);
            }
        };
        let Some(system) = system else {
            if !self.request.present.contains(b'P') {
                let message = "G10 without P".to_owned();
                let help = "write P1 for G54, P2 for G55 and so on, or P0 for the one in force";
                self.report_at(scene, at, Code::MissingWord, message, help);
            }
            return;
        };
        if system > 9 {
            let message = format!("there is no work system {system}");
            let help = "write P0 to P9";
            return self.report(scene, b'P', Code::BadNumber, message, help);
        }
        let active = u32::from(self.modal.work_offset);
        let system = if system == 0 { active } else { system };
        if by_position && self.request.present.contains(b'R') {
            let message = "G10 L20 does not take R".to_owned();
            return self.report(scene, b'R', Code::Syntax, message, "delete R");
        }
        if degrees.is_some_and(f64::is_nan) {
            self.request.has_refused_word = true;
            return self.axes.poison(TURNED);
        }
        if self.request.is_damaged {
            return;
        }
        if let Some(degrees) = degrees {
            self.set_rotation(system, degrees);
        }
        if named.is_empty() && further.is_empty() {
            return;
        }
        match by_position {
            true => self.stand_in(scene, at, system, (named, values), further),
            false => self.put_zero(system, named, values, further),
        }
    }

    /// G10 L2: the zero of a work system comes to a place of the machine.
    fn put_zero(&mut self, system: u32, named: AxisSet, origin: Position, further: FurtherAxes) {
        if !further.is_empty() {
            self.act_further(further, FurtherMode::Along);
        }
        let axes = named;
        let number = system as u8;
        self.act(Action::SetWorkOffset { system: number, axes, origin, by_position: false });
        self.store_offset(system, named, Some(origin));
        self.store_further_offset(system, further, false);
        if system == u32::from(self.modal.work_offset) {
            let cause = Cause { source: self.source, word: "G10" };
            self.axes.lose(self.turned_axes(named), cause);
            self.further.lose(further, cause);
        }
    }

    /// G10 L20: the tool stands at a place of a work system.
    fn stand_in(
        &mut self,
        scene: &mut Scene<'_>,
        at: usize,
        system: u32,
        (named, values): (AxisSet, Position),
        further: FurtherAxes,
    ) {
        let is_active = system == u32::from(self.modal.work_offset);
        let mut place = self.axes.position;
        for axis in (0..3).filter(|&axis| named.contains(axis)) {
            place[axis] = values[axis] + self.modal.shift[axis];
        }
        // In a rotated system the other axis keeps its place.
        let axes = self.turned_axes_in(system, named);
        let kept = axes.without(named);
        if !kept.is_empty() && !is_active {
            let message = format!(
                "work system {system} is rotated, and where {} is in it is not known here",
                kept.letters()
            );
            let help = "name both X and Y, or select the work system and move both before it";
            return self.report_at(scene, at, Code::MissingWord, message, help);
        }
        if !self.relies(scene, kept) {
            return;
        }
        if is_active {
            self.check_touched(scene, axes, at);
        }
        if self.request.is_damaged {
            return;
        }
        let further =
            further.map(|axis, value| value + self.further.shift.get(axis).unwrap_or(0.0));
        if !further.is_empty() {
            self.act_further(further, FurtherMode::Along);
        }
        let out = self.out_from(system, place);
        let mut origin = [0.0; 3];
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            origin[axis] = out[axis];
        }
        let number = system as u8;
        self.act(Action::SetWorkOffset { system: number, axes, origin, by_position: true });
        self.store_offset(system, axes, None);
        self.store_further_offset(system, further, true);
        if is_active {
            self.stand(axes, place, further);
        }
    }

    /// The tool stands here now, because the frame has moved: a rapid of no length says so.
    pub(super) fn stand(&mut self, named: AxisSet, place: Position, further: FurtherAxes) {
        for axis in (0..3).filter(|&axis| named.contains(axis)) {
            self.axes.position[axis] = received_mm(place[axis]);
        }
        self.axes.know(named);
        self.further.arrive(further);
        if named.contains(self.modal.plane.axes()[2]) {
            // The height at which the cycles in force began was one of the other frame.
            self.modal.cycle.initial = None;
        }
        if !named.is_empty() {
            self.emit_motion(Shape::Line, self.axes.position, MotionClass::Rapid, named);
        }
    }

    /// Whether the block only names axes for an offset.
    pub(super) fn only_sets_offsets(&self) -> bool {
        let sets_length = matches!(
            self.request.g(Group::Length),
            Some((GWord::Length(LengthWord::Given | LengthWord::Added), _))
        );
        sets_length
            || matches!(
                self.request.g(Group::NonModal),
                Some((GWord::Offset(word), _)) if word.names_axes()
            )
    }
}
