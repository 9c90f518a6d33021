//! Positions, planes and the shape of one motion.
//!
//! Everything is in millimetres, in the active work frame, right-handed.
//! This file knows where things are, not what they mean to a program.

use serde::{Deserialize, Serialize};

/// A position in millimetres: x, y, z.
pub type Position = [f64; 3];

/// A direction: x, y, z, of any length but 0.
pub type Direction = [f64; 3];

/// The plane of arcs and of cutter radius compensation (G17, G18, G19).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Plane {
    /// G17: first axis X, second axis Y, normal Z.
    #[default]
    Xy,
    /// G18: first axis Z, second axis X, normal Y.
    Zx,
    /// G19: first axis Y, second axis Z, normal X.
    Yz,
}

impl Plane {
    /// Indexes into a [`Position`]: first in-plane axis, second in-plane axis, normal.
    ///
    /// The three are right-handed, so that "counter-clockwise" and "left" mean
    /// the same in every plane, seen from the positive end of the normal.
    pub const fn axes(self) -> [usize; 3] {
        match self {
            Self::Xy => [0, 1, 2],
            Self::Zx => [2, 0, 1],
            Self::Yz => [1, 2, 0],
        }
    }

    /// The name used in JSON and YAML: `xy`, `zx`, `yz`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Xy => "xy",
            Self::Zx => "zx",
            Self::Yz => "yz",
        }
    }
}

/// A set of the axes X, Y, Z; in YAML its letters: `XY`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct AxisSet(u8);

impl TryFrom<String> for AxisSet {
    type Error = String;

    fn try_from(letters: String) -> Result<Self, String> {
        Self::from_letters(&letters).ok_or_else(|| format!("{letters:?} are not axes of X, Y, Z"))
    }
}

impl From<AxisSet> for String {
    fn from(axes: AxisSet) -> Self {
        axes.letters()
    }
}

impl AxisSet {
    /// No axis.
    pub const NONE: Self = Self(0);
    /// X, Y and Z.
    pub const ALL: Self = Self(0b111);

    /// The set as bits: X 1, Y 2, Z 4. Higher bits are dropped.
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits & 0b111)
    }

    /// The bits: X 1, Y 2, Z 4.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The set with the axis of this [`Position`] index in it.
    #[must_use]
    pub const fn with(self, axis: usize) -> Self {
        Self(self.0 | (1 << axis) & 0b111)
    }

    /// All axes that are in either set.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The axes that are in this set and not in the other.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether the axis of this [`Position`] index is in the set.
    pub const fn contains(self, axis: usize) -> bool {
        self.0 & (1 << axis) != 0
    }

    /// Whether no axis is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The set of these letters, which are X, Y and Z; `None` for others.
    pub fn from_letters(letters: &str) -> Option<Self> {
        letters.chars().try_fold(Self::NONE, |set, letter| {
            Some(set.with(AXIS_LETTERS.iter().position(|&axis| axis == letter)?))
        })
    }

    /// The letters of the set, in order: `"XZ"`.
    pub fn letters(self) -> String {
        (0..3).filter(|&axis| self.contains(axis)).map(|axis| AXIS_LETTERS[axis]).collect()
    }
}

/// The letter of each [`Position`] index.
pub const AXIS_LETTERS: [char; 3] = ['X', 'Y', 'Z'];

/// How a motion gets from its start to its end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Shape {
    /// A straight line.
    Line,
    /// A circular arc, or a helix when the normal coordinate changes.
    Arc(Arc),
}

/// A circular arc about `center`, in `plane`; a helix when start and end
/// differ along the plane's normal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Arc {
    /// Centre. Its coordinate along the normal is that of the start.
    pub center: Position,
    /// Plane of the circle.
    pub plane: Plane,
    /// Direction seen from the positive end of the normal (G2).
    pub clockwise: bool,
    /// Whole extra revolutions; a full circle has start = end and 1.
    pub turns: u16,
}

impl Arc {
    /// How far the arc reaches out where it passes a quadrant: axis and coordinate, mm.
    pub fn outermost(
        &self,
        start: Position,
        end: Position,
    ) -> impl Iterator<Item = (usize, f64)> + use<> {
        let [first, second, _] = self.plane.axes();
        let from = [start[first] - self.center[first], start[second] - self.center[second]];
        let to = [end[first] - self.center[first], end[second] - self.center[second]];
        let radius = from[0].hypot(from[1]).max(to[0].hypot(to[1]));
        let (from, to) = if self.clockwise { (to, from) } else { (from, to) };
        let (is_round, center) = (self.turns > 0, self.center);
        let quadrants = [
            (first, [1.0, 0.0]),
            (first, [-1.0, 0.0]),
            (second, [0.0, 1.0]),
            (second, [0.0, -1.0]),
        ];
        quadrants
            .into_iter()
            .filter(move |(_, unit)| is_round || is_between(from, *unit, to))
            .map(move |(axis, unit)| (axis, center[axis] + radius * (unit[0] + unit[1])))
    }
}

/// Whether an arc from `from` to `to`, counter-clockwise, passes `direction`.
fn is_between(from: [f64; 2], direction: [f64; 2], to: [f64; 2]) -> bool {
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    if cross(from, to) >= 0.0 {
        cross(from, direction) >= 0.0 && cross(direction, to) >= 0.0
    } else {
        !(cross(to, direction) > 0.0 && cross(direction, from) > 0.0)
    }
}
