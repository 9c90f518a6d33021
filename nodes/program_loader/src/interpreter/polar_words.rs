//! `@` and `^`: a distance from the zero of the program and an angle from X, in place of X and Y.
//!
//! They become X and Y before anything else reads the block. Under G91 they count from where the
//! tool is, around the zero.

use super::{Interpreter, Scene};
use crate::dialect::{Distance, Group};
use crate::limits::COORDINATE_MM_MAX;
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::{AxisSet, Plane, Position};

/// The values of `@` and `^`, and their places in the block.
pub(super) type PolarWords = [Option<(f64, usize)>; 2];

impl Interpreter<'_> {
    /// They are for moves: reports them elsewhere, before X and Y would be missed there.
    #[cold]
    pub(super) fn check_polar_words(&mut self, scene: &mut Scene<'_>) {
        let Some(&(_, at)) = self.request.polar.iter().flatten().next() else { return };
        let others = [Group::NonModal, Group::MachineCoordinates];
        if others.iter().any(|&group| self.request.g(group).is_some()) || self.only_sets_offsets() {
            let message = format!("{} in a block that is no move", scene.quote(at));
            self.report_at(scene, at, Code::Syntax, message, "write X and Y");
            self.request.polar = [None; 2];
            self.request.set(b'X', f64::NAN, at);
            self.request.set(b'Y', f64::NAN, at);
        }
    }

    #[cold]
    pub(super) fn polar_words(&mut self, scene: &mut Scene<'_>, words: PolarWords) {
        let Some(&(_, at)) = words.iter().flatten().next() else { return };
        if words.iter().flatten().any(|(value, _)| value.is_nan()) {
            // It has been reported why; X and Y are not known after it.
            self.request.set(b'X', f64::NAN, at);
            return self.request.set(b'Y', f64::NAN, at);
        }
        if self.modal.plane != Plane::Xy {
            let message = format!("{} outside the plane XY", scene.quote(at));
            self.report_at(scene, at, Code::Plane, message, "write G17 before it, or X and Y");
            self.request.set(b'X', f64::NAN, at);
            return self.request.set(b'Y', f64::NAN, at);
        }
        let has = |letter| self.request.present.contains(letter);
        if let Some(letter) = [b'X', b'Y'].into_iter().find(|&letter| has(letter)) {
            let message = format!("{} and {} in one block", scene.quote(at), char::from(letter));
            let help = "write either X and Y, or @ and ^";
            return self.report_at(scene, at, Code::ModalConflict, message, help);
        }
        let is_relative = self.modal.distance == Distance::Incremental;
        let [radius, angle] = words.map(|word| word.map(|(value, _)| value));
        let mut here = [0.0; 2];
        if is_relative || radius.is_none() || angle.is_none() {
            if self.modal.compensation.is_selected() {
                let message = format!(
                    "{} counts from where the tool is, under cutter radius compensation",
                    scene.quote(at)
                );
                let help = "write @ and ^ under G90, or X and Y";
                let code = Code::ForbiddenUnderCompensation;
                return self.report_at(scene, at, code, message, help);
            }
            if !self.relies(scene, AxisSet::NONE.with(0).with(1)) {
                self.request.is_damaged = true;
                return;
            }
            let scale = self.scale();
            here = [0, 1].map(|axis| (self.axes.position[axis] - self.modal.shift[axis]) / scale);
        }
        let [x, y] = here;
        let now = [x.hypot(y), y.atan2(x).to_degrees()];
        if (is_relative || angle.is_none()) && now[0] == 0.0 {
            let message = format!("{} at the zero, where there is no angle", scene.quote(at));
            return self.report_at(scene, at, Code::Axes, message, "write @ and ^ under G90");
        }
        let base = if is_relative { now } else { [0.0; 2] };
        let value = |word: Option<f64>, part: usize| word.map_or(now[part], |it| base[part] + it);
        let (radius, angle) = (value(radius, 0), value(angle, 1));
        if radius.abs() > COORDINATE_MM_MAX {
            let message = format!("{} is beyond {COORDINATE_MM_MAX} mm", scene.quote(at));
            return self.report_at(scene, at, Code::Limit, message, "look for a missing point");
        }
        let [sine, cosine] = sine_and_cosine(angle);
        let start = if is_relative { here } else { [0.0; 2] };
        // X may be a diameter; a distance is none.
        let double = if self.modal.x_is_diameter { 2.0 } else { 1.0 };
        self.request.set(b'X', double * (radius * cosine - start[0]), at);
        self.request.set(b'Y', radius * sine - start[1], at);
    }
}

impl Interpreter<'_> {
    /// Where a cycle that is repeated under G91 drills next, if its block has `@` or `^`: they count on
    /// from this hole. NaN where there is no angle.
    #[cold]
    pub(super) fn next_polar(&self, hole: Position) -> Option<Position> {
        if self.request.polar == [None; 2] {
            return None;
        }
        let [radius, angle] = self.request.polar.map(|word| word.map_or(0.0, |(value, _)| value));
        let [x, y] = [0, 1].map(|axis| hole[axis] - self.modal.shift[axis]);
        if (x, y) == (0.0, 0.0) {
            return Some([f64::NAN, f64::NAN, hole[2]]);
        }
        let radius = x.hypot(y) + radius * self.scale();
        let [sine, cosine] = sine_and_cosine(y.atan2(x).to_degrees() + angle);
        let [x0, y0, _] = self.modal.shift;
        Some([x0 + radius * cosine, y0 + radius * sine, hole[2]])
    }
}

/// Exact where the axes only change places.
fn sine_and_cosine(degrees: f64) -> [f64; 2] {
    match degrees.rem_euclid(360.0) {
        0.0 => [0.0, 1.0],
        90.0 => [1.0, 0.0],
        180.0 => [0.0, -1.0],
        270.0 => [-1.0, 0.0],
        angle => angle.to_radians().sin_cos().into(),
    }
}
