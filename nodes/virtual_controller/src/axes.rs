//! Up to six axes as plain vectors, and which letters they have.
//!
//! Axes that a controller does not have stay at zero. Units and frames are in the names of the
//! callers' variables; A, B and C are in degrees wherever the others are in millimetres.

use crate::tolerances::NEGLIGIBLE_SHARE;

/// The most axes of a controller.
pub const AXES: usize = 6;

/// X, Y and Z, which every controller has first.
pub type Vector = [f64; 3];

/// All axes.
pub type Axes = [f64; AXES];

/// X, Y and Z, and the others at zero.
pub(crate) fn with_others_at_zero([x, y, z]: Vector) -> Axes {
    [x, y, z, 0.0, 0.0, 0.0]
}

/// X, Y and Z of all axes.
pub(crate) fn without_others([x, y, z, ..]: Axes) -> Vector {
    [x, y, z]
}

/// The axes of a controller by their letters, in the order of its reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AxisLetters {
    letters: [char; AXES],
    count: usize,
}

impl Default for AxisLetters {
    fn default() -> Self {
        Self::XYZ
    }
}

/// A text that does not name the axes of a controller.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` are not axes: write XYZ, then up to three of A, B, C, U, V and W")]
pub struct UnknownAxes(String);

impl std::str::FromStr for AxisLetters {
    type Err = UnknownAxes;

    fn from_str(text: &str) -> Result<Self, UnknownAxes> {
        let unknown = || UnknownAxes(text.to_owned());
        let more: Vec<char> = text.strip_prefix("XYZ").ok_or_else(unknown)?.chars().collect();
        let mut axes = Self::default();
        for letter in more {
            let is_new = !axes.all().contains(&letter);
            if axes.count == AXES || !"ABCUVW".contains(letter) || !is_new {
                return Err(unknown());
            }
            axes.letters[axes.count] = letter;
            axes.count += 1;
        }
        Ok(axes)
    }
}

impl AxisLetters {
    /// X, Y and Z alone.
    pub const XYZ: Self = Self { letters: ['X', 'Y', 'Z', 'A', 'B', 'C'], count: 3 };

    /// The letters, in order.
    pub fn all(&self) -> &[char] {
        &self.letters[..self.count]
    }

    /// How many axes there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Does an axis count degrees?
    pub(crate) fn is_rotary(&self, axis: usize) -> bool {
        matches!(self.letters[axis], 'A' | 'B' | 'C')
    }
}

pub(crate) fn add(a: Axes, b: Axes) -> Axes {
    std::array::from_fn(|i| a[i] + b[i])
}

pub(crate) fn subtract(a: Axes, b: Axes) -> Axes {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(crate) fn scale(a: Axes, factor: f64) -> Axes {
    a.map(|component| component * factor)
}

pub(crate) fn dot(a: Axes, b: Axes) -> f64 {
    (0..AXES).map(|i| a[i] * b[i]).sum()
}

pub(crate) fn length(a: Axes) -> f64 {
    dot(a, a).sqrt()
}

/// Returns the largest factor for `unit` with which no axis exceeds its limit.
pub(crate) fn limit_along(unit: Axes, limits: Axes) -> f64 {
    (0..AXES)
        .filter(|&i| unit[i].abs() > NEGLIGIBLE_SHARE)
        .map(|i| limits[i] / unit[i].abs())
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_xyz_and_up_to_three_others() {
        for (text, count) in [("XYZ", 3), ("XYZA", 4), ("XYZCW", 5), ("XYZABC", 6)] {
            let axes: AxisLetters = text.parse().expect("axes");
            assert_eq!((axes.count(), axes.all().iter().collect::<String>()), (count, text.into()));
        }
        for text in ["", "XY", "XYA", "XYZX", "XYZAA", "XYZD", "XYZa", "XYZABCU"] {
            assert_eq!(text.parse::<AxisLetters>(), Err(UnknownAxes(text.to_owned())));
        }
        let axes: AxisLetters = "XYZUA".parse().expect("axes");
        assert_eq!([2, 3, 4].map(|axis| axes.is_rotary(axis)), [false, false, true]);
    }
}
