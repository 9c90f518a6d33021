//! Arithmetic in 32 bits, as the firmware's parser does it.
//!
//! Positions are `f64` here, but always hold 32 bit values: every sum and product of the parser
//! uses these functions.

/// A sum, rounded to 32 bits.
pub(crate) fn plus(a: f64, b: f64) -> f64 {
    f64::from(a as f32 + b as f32)
}

/// A difference, rounded to 32 bits.
pub(crate) fn minus(a: f64, b: f64) -> f64 {
    f64::from(a as f32 - b as f32)
}

/// A product, rounded to 32 bits.
pub(crate) fn times(a: f64, b: f64) -> f64 {
    f64::from(a as f32 * b as f32)
}
