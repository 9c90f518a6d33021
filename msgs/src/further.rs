//! The axes besides X, Y and Z: A, B and C turn, U, V and W are straight.
//!
//! Geometry is in X, Y and Z alone: compensation, gouges and bounds know nothing of these axes. A
//! program moves them together with a motion, or alone; both are an action of the contour and of
//! the path, so that a program without them costs nothing. Degrees and millimetres.

use crate::units::{received_degrees, received_mm};
use serde::{Deserialize, Serialize};

/// The letter of each further axis, in the order of their bits.
pub const FURTHER_LETTERS: [char; 6] = ['A', 'B', 'C', 'U', 'V', 'W'];

/// A value for some of the further axes: degrees for A, B and C, mm for U, V and W.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FurtherAxes {
    named: u8,
    /// 0 where the axis is not named.
    values: [f64; 6],
}

impl FurtherAxes {
    /// No axis.
    pub const NONE: Self = Self { named: 0, values: [0.0; 6] };

    /// The index of a letter; `None` for X, Y, Z and all that is no axis.
    pub fn index_of(letter: char) -> Option<usize> {
        FURTHER_LETTERS.iter().position(|&known| known == letter)
    }

    /// Whether the axis of this index turns: its unit is the degree.
    pub const fn is_rotary(axis: usize) -> bool {
        axis < 3
    }

    /// The axes with one more, or with another value of it.
    #[must_use]
    pub fn with(mut self, axis: usize, value: f64) -> Self {
        self.named |= 1 << axis;
        self.values[axis] = value;
        self
    }

    /// The axes without one.
    #[must_use]
    pub fn without(mut self, axis: usize) -> Self {
        self.named &= !(1 << axis);
        self.values[axis] = 0.0;
        self
    }

    /// The axes without those that the other names.
    #[must_use]
    pub fn without_all(self, other: Self) -> Self {
        other.iter().fold(self, |all, (axis, _)| all.without(axis))
    }

    /// These values, and those of the other for all axes that this does not name.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        self.iter().fold(other, |all, (axis, value)| all.with(axis, value))
    }

    /// The value of an axis, if it is named.
    pub fn get(&self, axis: usize) -> Option<f64> {
        (self.named >> axis & 1 == 1).then(|| self.values[axis])
    }

    /// Index and value of each axis that is named, in order.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        let Self { named, values } = *self;
        (0..6).filter(move |axis| named >> axis & 1 == 1).map(move |axis| (axis, values[axis]))
    }

    /// Whether no axis is named.
    pub const fn is_empty(&self) -> bool {
        self.named == 0
    }

    /// Whether axes are named, and all of them turn.
    pub const fn only_turns(&self) -> bool {
        self.named != 0 && self.named & 0b11_1000 == 0
    }

    /// The axes that are named: A 1, B 2, C 4, U 8, V 16, W 32.
    pub const fn bits(&self) -> u8 {
        self.named
    }

    /// The letters, in order: `AC`.
    pub fn letters(&self) -> String {
        self.iter().map(|(axis, _)| FURTHER_LETTERS[axis]).collect()
    }

    /// The words, with a blank before each: ` A90 U5`.
    pub fn words(&self) -> String {
        self.iter().map(|(axis, value)| format!(" {}{value}", FURTHER_LETTERS[axis])).collect()
    }

    /// The values with another for each axis.
    #[must_use]
    pub fn map(self, value: impl Fn(usize, f64) -> f64) -> Self {
        self.iter().fold(Self::NONE, |all, (axis, is)| all.with(axis, value(axis, is)))
    }

    /// Whether both name the same axes, with values that differ by no more than this.
    pub fn is_near(self, other: Self, tolerance: f64) -> bool {
        let is_near = |(axis, value): (usize, f64)| (value - other.values[axis]).abs() <= tolerance;
        self.named == other.named && self.iter().all(is_near)
    }

    /// The values as the receiver of a message gets them.
    #[must_use]
    pub fn received(self) -> Self {
        self.map(|axis, value| match Self::is_rotary(axis) {
            true => received_degrees(value),
            false => received_mm(value),
        })
    }
}

/// Index and value of each axis.
impl FromIterator<(usize, f64)> for FurtherAxes {
    fn from_iter<T: IntoIterator<Item = (usize, f64)>>(values: T) -> Self {
        values.into_iter().fold(Self::NONE, |all, (axis, value)| all.with(axis, value))
    }
}

/// How further axes move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FurtherMode {
    /// With the motion of the same block, which is the next element; or with its move in machine
    /// coordinates, its reference point or its work offset, which is the next action.
    Along,
    /// Alone, as fast as they can.
    Rapid,
    /// Alone, at this rate: mm/min along U, V and W; degrees/min where only A, B and C are named.
    Feed(f64),
}

/// What one block does with the further axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FurtherMove {
    /// Where they go, in the work frame; or the words of the function that they belong to.
    pub axes: FurtherAxes,
    pub mode: FurtherMode,
}

impl FurtherMove {
    /// `A90`, `G0 A90`, `G1 A90 F500`.
    pub fn text(&self) -> String {
        let words = self.axes.words();
        match self.mode {
            FurtherMode::Along => words.trim_start().to_owned(),
            FurtherMode::Rapid => format!("G0{words}"),
            FurtherMode::Feed(feed) => format!("G1{words} F{feed}"),
        }
    }
}

/// How far axes move: along U, V and W if one of them does, else the degrees of A, B and C.
pub fn further_distance(from: FurtherAxes, to: FurtherAxes) -> f64 {
    let way = |turns: bool| {
        let moved = to.iter().filter(move |(axis, _)| FurtherAxes::is_rotary(*axis) == turns);
        moved.map(|(axis, end)| (end - from.get(axis).unwrap_or(end)).powi(2)).sum::<f64>().sqrt()
    };
    let along = way(false);
    if along > 0.0 { along } else { way(true) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_named_one_by_one_and_keep_their_order() {
        let axes = FurtherAxes::NONE.with(3, 2.5).with(0, -90.0);
        assert_eq!((axes.letters(), axes.bits()), ("AU".to_owned(), 0b1001));
        assert_eq!(axes.words(), " A-90 U2.5");
        assert_eq!([axes.get(0), axes.get(1), axes.get(3)], [Some(-90.0), None, Some(2.5)]);
        assert!(!axes.only_turns() && axes.without(3).only_turns());
        assert!(!FurtherAxes::NONE.only_turns() && FurtherAxes::NONE.is_empty());
        assert_eq!(axes.without(0).without(3), FurtherAxes::NONE);
        let both = FurtherAxes::NONE.with(0, 1.0).or(axes.with(1, 7.0));
        assert_eq!([both.get(0), both.get(1), both.get(3)], [Some(1.0), Some(7.0), Some(2.5)]);
    }

    #[test]
    fn a_way_is_that_of_the_straight_axes_or_else_the_angle() {
        let at = |a: f64, b: f64, u: f64| FurtherAxes::NONE.with(0, a).with(1, b).with(3, u);
        for (to, way) in [
            (at(0.0, 0.0, 0.0), 0.0),
            (at(3.0, 4.0, 0.0), 5.0),
            (at(3.0, 4.0, -2.0), 2.0),
            (FurtherAxes::NONE.with(1, -7.0), 7.0),
        ] {
            assert!((further_distance(at(0.0, 0.0, 0.0), to) - way).abs() < 1e-12, "{to:?}");
        }
    }
}
