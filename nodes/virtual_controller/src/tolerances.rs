//! Every tolerance of this crate, with its unit and its reason.

/// Ways shorter than this are done, mm: a millionth of a step, far above rounding.
pub(crate) const NEGLIGIBLE_MM: f64 = 1e-9;

/// Speeds closer than this are equal, mm/s: rounding of a ramp's end.
pub(crate) const NEGLIGIBLE_MM_PER_S: f64 = 1e-9;

/// Components of a direction below this do not move their axis.
pub(crate) const NEGLIGIBLE_SHARE: f64 = 1e-12;

/// Corners whose cosine is closer to 1 or -1 than this go straight on or straight back; the firmware's.
pub(crate) const STRAIGHT: f64 = 1e-6;

/// The end of an arc may miss its circle by this, mm; the firmware's rule for error 33.
pub(crate) const RADIUS_MISMATCH_MM: f32 = 0.005;

/// It never may miss it by more than this, mm; the same rule.
pub(crate) const RADIUS_MISMATCH_MM_MAX: f32 = 0.5;

/// Between both, by this share of the radius; the same rule.
pub(crate) const RADIUS_MISMATCH_SHARE: f32 = 0.001;

/// A sweep below this is a full circle, radians; the firmware's.
pub(crate) const FULL_CIRCLE_RAD: f32 = 5e-7;

/// Chords are never finer than for this deviation, mm, whatever `$12` says: it may be zero.
pub(crate) const CHORD_MM_MIN: f64 = 1e-4;

/// A switch closes this far behind its nominal place, mm, so that standing on it exactly is not yet pressing.
pub(crate) const SWITCH_MM: f64 = 1e-6;
