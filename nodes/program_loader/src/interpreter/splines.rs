//! G5, G5.1, and G5.2 to G5.3: curves in XY, as lines and arcs.
//!
//! Knows the words of curves; [`curve`](crate::curve) knows their geometry. The errors are
//! LinuxCNC's, and a few where it goes on without a word: a curve that nothing ends, weights of 0.

use super::moves::End;
use super::{Interpreter, Scene, arc};
use crate::curve::{ControlPoint, Curve, PIECES_MAX, WEIGHT_RATIO_MAX};
use crate::dialect::{GWord, Group, MWord, Mode};
use crate::limits::COORDINATE_MM_MAX;
use cnc_msgs::contour::{MotionClass, Source};
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::{Arc, AxisSet, Plane, Position, Shape};

/// A word for a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Spline {
    /// G5.
    Cubic,
    /// G5.1.
    Quadratic,
    /// G5.2: collects control points.
    Open,
    /// G5.3: the curve through them.
    Close,
}

impl Spline {
    /// Its G number times ten.
    pub(super) const fn number(self) -> f64 {
        match self {
            Self::Cubic => 50.0,
            Self::Quadratic => 51.0,
            Self::Open => 52.0,
            Self::Close => 53.0,
        }
    }
}

/// The order of a curve of G5.2, without L and at most.
const ORDER: u32 = 3;
const ORDER_MAX: u32 = 10;
/// A smaller weight than this, or a larger one than its inverse, is as good as 0.
const WEIGHT_MIN: f64 = 1e-6;

/// Control points since G5.2.
#[derive(Debug, Clone)]
pub(super) struct OpenCurve {
    points: Vec<ControlPoint>,
    order: u32,
    /// A control point was rejected.
    is_broken: bool,
    /// The block of G5.2.
    source: Source,
}

impl Interpreter<'_> {
    /// The line in which a curve begins that nothing has ended.
    pub(crate) fn open_curve(&self) -> Option<Source> {
        self.open_curve.as_ref().map(|curve| curve.source)
    }

    /// Between G5.2 and G5.3 there are control points only: neither another motion nor the end of
    /// the program, nor what moves the tool or its coordinates otherwise.
    #[cold]
    pub(super) fn check_open_curve(&mut self, scene: &mut Scene<'_>) {
        let is_part = |spline| matches!(spline, Spline::Open | Spline::Close);
        let moves_otherwise = match self.request.g(Group::Motion) {
            Some((GWord::Motion(Mode::Spline(spline)), _)) => !is_part(spline),
            Some(_) => true,
            None => false,
        };
        let others = [Group::NonModal, Group::MachineCoordinates, Group::CycleCancel];
        let has_other = others.iter().any(|&group| self.request.g(group).is_some());
        let is_end = |meaning| matches!(meaning, MWord::ProgramEnd { .. } | MWord::ChangeTool);
        let ends = self.request.m().any(|(meaning, ..)| is_end(meaning));
        if !(moves_otherwise || has_other || ends) {
            return;
        }
        let Some(curve) = self.open_curve.take() else { return };
        let message =
            format!("the curve that G5.2 begins in line {} has no G5.3", curve.source.line);
        self.report_block(scene, Code::MissingWord, message, "write G5.3 before this block");
        self.modal.mode = None;
    }

    #[cold]
    pub(super) fn spline(&mut self, scene: &mut Scene<'_>, spline: Spline) {
        let end = self.end(scene);
        if let Some(since) = scene.under_compensation {
            let message = format!(
                "a curve under cutter radius compensation, which is on since line {}",
                since.line
            );
            let help = "cancel with G40 and a straight move before it, or post arcs";
            self.report_block(scene, Code::ForbiddenUnderCompensation, message, help);
        } else if self.modal.plane != Plane::Xy {
            let help = "write G17 before it";
            self.report_block(scene, Code::Axes, "a curve outside the plane XY".to_owned(), help);
        } else if end.named.contains(2) {
            let message = "a curve has no Z".to_owned();
            self.report(scene, b'Z', Code::Axes, message, "move Z before it or after it");
        }
        match spline {
            Spline::Cubic => self.cubic(scene, &end),
            Spline::Quadratic => self.quadratic(scene, &end),
            Spline::Open => self.control_point(scene, &end),
            Spline::Close => self.close_curve(scene),
        }
    }

    fn cubic(&mut self, scene: &mut Scene<'_>, end: &End) {
        let before = self.last_cubic.take();
        let into = self.pair(scene, b'P', b'Q');
        let out = match self.pair(scene, b'I', b'J') {
            // Without a corner, where a G5 has come before it.
            None if !self.has_any(b"IJ") => before.map(|[x, y]| [-x, -y]),
            out => out,
        };
        let (Some(out), Some(into)) = (out, into) else {
            let message = "G5 has not all of I, J, P and Q".to_owned();
            let help = "write P and Q into each G5, and I and J into the first";
            if !self.request.is_damaged {
                self.report_block(scene, Code::MissingWord, message, help);
            }
            return self.arrive_at_fault(end);
        };
        let start = [self.axes.position[0], self.axes.position[1]];
        let to = [end.position[0], end.position[1]];
        let points =
            [start, [start[0] + out[0], start[1] + out[1]], [to[0] + into[0], to[1] + into[1]], to];
        if self.follow(scene, &points.map(|point| (point, 1.0)), 4, end) {
            self.last_cubic = Some(into);
        }
    }

    fn quadratic(&mut self, scene: &mut Scene<'_>, end: &End) {
        let Some(out) = self.pair(scene, b'I', b'J') else {
            let message = "G5.1 without I and J".to_owned();
            let help = match self.take(b'Q') {
                // Fanuc's look-ahead.
                Some(_) => "delete it: with Q alone it is a setting of another control",
                None => "write I and J: from the start to the control point",
            };
            if !self.request.is_damaged {
                self.report_block(scene, Code::MissingWord, message, help);
            }
            return self.arrive_at_fault(end);
        };
        let start = [self.axes.position[0], self.axes.position[1]];
        let to = [end.position[0], end.position[1]];
        let points = [start, [start[0] + out[0], start[1] + out[1]], to];
        self.follow(scene, &points.map(|point| (point, 1.0)), 3, end);
    }

    /// A block of G5.2: the first may only give the weight of where the tool is.
    fn control_point(&mut self, scene: &mut Scene<'_>, end: &End) {
        let weight = self.take(b'P').unwrap_or(1.0);
        let has_order = self.request.present.contains(b'L');
        let order = self.take_number(scene, b'L');
        let has_both = end.named.contains(0) && end.named.contains(1);
        if weight <= WEIGHT_MIN || weight > 1.0 / WEIGHT_MIN {
            let message = format!("P{weight} is not the weight of a control point");
            self.report(
                scene,
                b'P',
                Code::BadNumber,
                message,
                "write P with a weight above 0, or leave it out for 1",
            );
        } else if has_order && order.is_some_and(|it| !(ORDER..=ORDER_MAX).contains(&it)) {
            let message = format!("the order of a curve is from {ORDER} to {ORDER_MAX}");
            self.report(scene, b'L', Code::BadNumber, message, "write L3, or leave L out");
        } else if !has_both && (end.named.contains(0) || end.named.contains(1)) {
            let message = "a control point has X and Y".to_owned();
            self.report_block(scene, Code::MissingWord, message, "write both into each block");
        } else if !has_both && self.open_curve.is_some() {
            let message = "a control point without X and Y".to_owned();
            let help = "only the first block of G5.2 may have P alone: the weight of the start";
            self.report_block(scene, Code::MissingWord, message, help);
        }
        let is_known = self.relies(scene, AxisSet::NONE.with(0).with(1));
        if self.request.is_damaged || !is_known {
            self.axes.poison(end.named);
            let source = self.source;
            let broken = || OpenCurve { points: Vec::new(), order: ORDER, is_broken: true, source };
            self.open_curve.get_or_insert_with(broken).is_broken = true;
            return;
        }
        let start = [self.axes.position[0], self.axes.position[1]];
        let source = self.source;
        let curve = self.open_curve.get_or_insert_with(|| {
            let weight = if has_both { 1.0 } else { weight };
            OpenCurve { points: vec![(start, weight)], order: ORDER, is_broken: false, source }
        });
        if let Some(order) = order {
            curve.order = order;
        }
        if has_both {
            curve.points.push(([end.position[0], end.position[1]], weight));
        }
    }

    fn close_curve(&mut self, scene: &mut Scene<'_>) {
        self.modal.mode = None;
        let Some(curve) = self.open_curve.take() else {
            let message = "G5.3 without G5.2".to_owned();
            let help = "begin the curve with G5.2 and its control points";
            return self.report_block(scene, Code::MissingWord, message, help);
        };
        if curve.is_broken {
            self.request.is_damaged = true;
            return self.axes.poison(AxisSet::NONE.with(0).with(1));
        }
        let Some(&([x, y], _)) = curve.points.last() else { return };
        let in_plane = AxisSet::NONE.with(0).with(1);
        let position = [x, y, self.axes.position[2]];
        let end = End { position, named: in_plane, relative: AxisSet::NONE };
        let order = curve.order as usize;
        if curve.points.len() < order {
            let count = curve.points.len();
            let message =
                format!("a curve of order {order} needs {order} control points, and has {count}");
            let help = "the start is one of them; write more before G5.3, or a smaller L";
            self.report_block(scene, Code::MissingWord, message, help);
            return self.arrive_at_fault(&end);
        }
        self.follow(scene, &curve.points, order, &end);
    }

    /// Moves along a curve; returns whether it does.
    fn follow(
        &mut self,
        scene: &mut Scene<'_>,
        points: &[ControlPoint],
        order: usize,
        end: &End,
    ) -> bool {
        let in_plane = AxisSet::NONE.with(0).with(1);
        let is_sound = self.relies(scene, in_plane) & self.has_feed(scene, MotionClass::Feed);
        let is_far = points.iter().any(|(at, _)| at.iter().any(|it| it.abs() > COORDINATE_MM_MAX));
        if is_far && !self.request.is_damaged {
            let message = format!("a control point is beyond {COORDINATE_MM_MAX} mm");
            let help = "look for a missing decimal point, and for inches taken as millimetres";
            self.report_block(scene, Code::Limit, message, help);
        }
        if self.request.is_damaged || !is_sound {
            self.arrive_at_fault(end);
            return false;
        }
        let curve = Curve { points, order };
        if !curve.has_fair_weights() {
            let message =
                format!("the weights of the curve differ by more than {WEIGHT_RATIO_MAX} times");
            let help = "write P with weights that are closer to each other";
            self.report_block(scene, Code::Limit, message, help);
            self.arrive_at_fault(end);
            return false;
        }
        let Some(pieces) = curve.pieces() else {
            let message = format!("the curve has more than {PIECES_MAX} lines and arcs");
            self.report_block(scene, Code::Limit, message, "split the curve");
            return false;
        };
        // Measured: a piece of a curve of order 3, 4 and 10 takes as long as 3, 5 and 30 moves.
        self.curve_work += pieces.len() as u64 * (order * order) as u64 / 3;
        if self.is_too_long_with(pieces.len()) {
            let message = "the program has too many moves".to_owned();
            self.report_block(scene, Code::Limit, message, "split the program");
            return false;
        }
        let mut from = self.axes.position;
        let mut moves: Vec<(Shape, Position)> = Vec::with_capacity(pieces.len());
        let mut length_mm = 0.0;
        for piece in &pieces {
            let to = [piece.end[0], piece.end[1], from[2]];
            let shape = match piece.arc {
                None => Shape::Line,
                Some(([x, y], clockwise)) => {
                    let center = [x, y, from[2]];
                    Shape::Arc(Arc { center, plane: Plane::Xy, clockwise, turns: 0 })
                }
            };
            length_mm += match &shape {
                Shape::Line => super::moves::distance(from, to),
                Shape::Arc(arc) => arc::length(from, to, arc),
            };
            moves.push((shape, to));
            from = to;
        }
        self.feed_of_length(MotionClass::Feed, || length_mm);
        let mut from = self.axes.position;
        for (shape, to) in moves {
            let arc = if let Shape::Arc(arc) = &shape { Some(arc) } else { None };
            self.feed_at_surface(MotionClass::Feed, from, to, arc);
            self.add_to_bounds(from, shape, to, in_plane);
            self.emit_motion(shape, to, MotionClass::Feed, in_plane);
            from = to;
        }
        self.axes.position = from;
        self.axes.know(in_plane);
        true
    }

    /// A vector of two words; `None` without one of them, which is an error if the other is there.
    fn pair(&mut self, scene: &mut Scene<'_>, first: u8, second: u8) -> Option<[f64; 2]> {
        let scale = self.scale();
        let mut value = |letter| self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm");
        match (value(first), value(second)) {
            (Some(x), Some(y)) if x.is_finite() && y.is_finite() => Some([x, y]),
            (Some(_), None) | (None, Some(_)) => {
                let (first, second) = (char::from(first), char::from(second));
                let message = format!("one of {first} and {second} without the other");
                let help = format!("write both {first} and {second}");
                self.report_block(scene, Code::MissingWord, message, &help);
                None
            }
            _ => None,
        }
    }

    fn has_any(&self, letters: &[u8]) -> bool {
        letters.iter().any(|&letter| self.request.present.contains(letter))
    }

    /// After an error: the axes that are named absolutely are known.
    fn arrive_at_fault(&mut self, end: &End) {
        self.request.is_damaged = true;
        self.arrive(end);
    }
}
