//! How fast a corner between two straight blocks may be taken.

use crate::axes::{self, Axes};
use crate::settings::Settings;
use crate::tolerances::STRAIGHT;

/// Returns the speed at which the corner between two directions may be taken, mm/s.
///
/// The speed is that of a circle that touches both sides and stays within `$11` of the corner,
/// at the acceleration of the axes towards its centre.
pub(super) fn junction_speed(before: Axes, after: Axes, settings: &Settings) -> f64 {
    let cosine = axes::dot(before, after);
    if cosine > 1.0 - STRAIGHT {
        return f64::INFINITY;
    }
    if cosine < STRAIGHT - 1.0 {
        return 0.0;
    }
    let inward = axes::subtract(after, before);
    let inward = axes::scale(inward, 1.0 / axes::length(inward));
    let acceleration = axes::limit_along(inward, settings.acceleration_mm_per_s2());
    let sine_half = ((1.0 + cosine) / 2.0).sqrt();
    (acceleration * settings.junction_deviation_mm() * sine_half / (1.0 - sine_half)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_is_taken_as_fast_as_the_circle_within_the_deviation_allows() {
        let mut settings = Settings::default();
        (120..123).for_each(|n| settings.set(n, 100.0).unwrap());
        let axes = crate::axes::with_others_at_zero;
        let speed = |after| junction_speed(axes([1.0, 0.0, 0.0]), axes(after), &settings);
        // 90 degrees: both axes pull, 141.4 mm/s² inward; r = 0.01 * 0.7071 / 0.2929 mm.
        assert!((speed([0.0, 1.0, 0.0]) - 1.8478).abs() < 1e-3);
        assert_eq!(speed([-1.0, 0.0, 0.0]), 0.0);
        assert_eq!(speed([1.0, 0.0, 0.0]), f64::INFINITY);
    }
}
