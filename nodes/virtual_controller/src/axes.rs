//! Three axes as plain vectors.
//!
//! Arithmetic on X, Y and Z. Units and frames are in the names of the callers' variables.

use crate::tolerances::NEGLIGIBLE_SHARE;

/// Number of axes of the controller.
pub const AXES: usize = 3;

/// The letters of the axes, in the order of every vector here.
pub const AXIS_LETTERS: [char; AXES] = ['X', 'Y', 'Z'];

/// X, Y and Z.
pub type Vector = [f64; AXES];

pub(crate) fn add(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] + b[i])
}

pub(crate) fn subtract(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(crate) fn scale(a: Vector, factor: f64) -> Vector {
    a.map(|component| component * factor)
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    (0..AXES).map(|i| a[i] * b[i]).sum()
}

pub(crate) fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// Returns the largest factor for `unit` with which no axis exceeds its limit.
pub(crate) fn limit_along(unit: Vector, limits: Vector) -> f64 {
    (0..AXES)
        .filter(|&i| unit[i].abs() > NEGLIGIBLE_SHARE)
        .map(|i| limits[i] / unit[i].abs())
        .fold(f64::INFINITY, f64::min)
}
