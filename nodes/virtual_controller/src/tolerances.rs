//! Every tolerance of this crate, with its unit and its reason.

/// Shorter distances count as done, mm: a millionth of a step, far above rounding.
pub(crate) const NEGLIGIBLE_MM: f64 = 1e-9;

/// Speeds closer than this are equal, mm/s: rounding of a ramp's end.
pub(crate) const NEGLIGIBLE_MM_PER_S: f64 = 1e-9;

/// Components of a direction below this do not move their axis.
pub(crate) const NEGLIGIBLE_SHARE: f64 = 1e-12;

/// Corners whose cosine is closer to 1 or -1 than this count as straight on or straight back; as in
/// the firmware.
pub(crate) const STRAIGHT: f64 = 1e-6;

/// The end of an arc may be off its circle by this, mm; the firmware's rule for error 33.
pub(crate) const RADIUS_MISMATCH_MM: f32 = 0.005;

/// It may never be off by more than this, mm; the same rule.
pub(crate) const RADIUS_MISMATCH_MM_MAX: f32 = 0.5;

/// In between it may be off by this share of the radius; the same rule.
pub(crate) const RADIUS_MISMATCH_SHARE: f32 = 0.001;

/// A sweep below this is a full circle, radians; as in the firmware.
pub(crate) const FULL_CIRCLE_RAD: f32 = 5e-7;

/// Chords are never finer than for this deviation, mm, even if `$12` is zero.
pub(crate) const CHORD_MM_MIN: f64 = 1e-4;

/// A switch closes this far past its nominal position, mm, so that an axis exactly on it does not
/// press it.
pub(crate) const SWITCH_MM: f64 = 1e-6;
