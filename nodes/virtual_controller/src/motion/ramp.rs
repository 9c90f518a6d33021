//! One stretch of constant acceleration along a path.
//!
//! Speeds, distances and seconds along one line; no axes.

use crate::tolerances::{NEGLIGIBLE_MM, NEGLIGIBLE_MM_PER_S};

/// A stretch of constant acceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ramp {
    pub(crate) acceleration_mm_per_s2: f64,
    pub(crate) duration_s: f64,
    pub(crate) distance_mm: f64,
    pub(crate) end_speed_mm_per_s: f64,
    /// The stretch ends where the block ends.
    pub(crate) finishes: bool,
}

/// Returns the next stretch of the fastest motion that leaves the block at `exit`.
///
/// `remaining` is the distance to the end of the block, `v` the speed now, `nominal` the desired
/// speed, `a` the acceleration; all are zero or positive, in mm and s. If `exit` cannot be
/// reached within the block, the block is left at the speed nearest to it.
pub(crate) fn next_ramp(remaining: f64, v: f64, nominal: f64, exit: f64, a: f64) -> Ramp {
    if remaining <= NEGLIGIBLE_MM {
        return Ramp {
            acceleration_mm_per_s2: 0.0,
            duration_s: 0.0,
            distance_mm: remaining.max(0.0),
            end_speed_mm_per_s: v,
            finishes: true,
        };
    }
    let exit = exit.min(nominal);
    let braking_mm = (v * v - exit * exit) / (2.0 * a);
    if v > exit && braking_mm >= remaining - NEGLIGIBLE_MM {
        let reached = if braking_mm > remaining + NEGLIGIBLE_MM {
            (v * v - 2.0 * a * remaining).max(0.0).sqrt()
        } else {
            exit
        };
        return over(remaining, v, reached, true);
    }
    if v > nominal + NEGLIGIBLE_MM_PER_S {
        let distance = (v * v - nominal * nominal) / (2.0 * a);
        return over(distance, v, nominal, false);
    }
    let peak = (a * remaining + (v * v + exit * exit) / 2.0).sqrt().min(nominal);
    if peak > v + NEGLIGIBLE_MM_PER_S {
        let distance = (peak * peak - v * v) / (2.0 * a);
        if distance >= remaining - NEGLIGIBLE_MM {
            let reached = (v * v + 2.0 * a * remaining).sqrt().min(nominal);
            return over(remaining, v, reached, true);
        }
        return over(distance, v, peak, false);
    }
    let cruise = remaining - braking_mm.max(0.0);
    over(cruise, v, v, cruise >= remaining - NEGLIGIBLE_MM)
}

/// Returns the next stretch of stopping as soon as possible.
pub(crate) fn braking_ramp(remaining: f64, v: f64, a: f64) -> Ramp {
    let stop_mm = v * v / (2.0 * a);
    if stop_mm > remaining {
        let reached = (v * v - 2.0 * a * remaining).max(0.0).sqrt();
        over(remaining, v, reached, true)
    } else {
        over(stop_mm, v, 0.0, stop_mm >= remaining - NEGLIGIBLE_MM)
    }
}

/// The ramp from speed `v` to `reached` over a distance.
fn over(distance: f64, v: f64, reached: f64, finishes: bool) -> Ramp {
    let mean = (v + reached) / 2.0;
    let duration_s = if mean > 0.0 { distance / mean } else { 0.0 };
    let acceleration_mm_per_s2 = if duration_s > 0.0 { (reached - v) / duration_s } else { 0.0 };
    Ramp {
        acceleration_mm_per_s2,
        duration_s,
        distance_mm: distance,
        end_speed_mm_per_s: reached,
        finishes,
    }
}

impl Ramp {
    /// Returns the distance and the speed after `t` seconds, started at speed `v`.
    pub(crate) fn after(&self, v: f64, t: f64) -> (f64, f64) {
        let a = self.acceleration_mm_per_s2;
        ((v + a * t / 2.0) * t, (v + a * t).max(0.0))
    }

    /// Returns the seconds until `distance` is covered, started at speed `v`.
    pub(crate) fn time_to(&self, v: f64, distance: f64) -> f64 {
        let a = self.acceleration_mm_per_s2;
        let reached = (v * v + 2.0 * a * distance).max(0.0).sqrt();
        let mean = (v + reached) / 2.0;
        if mean > 0.0 { (distance / mean).min(self.duration_s) } else { self.duration_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total_s(length: f64, nominal: f64, a: f64) -> f64 {
        let (mut remaining, mut v, mut t) = (length, 0.0, 0.0);
        for _ in 0..10 {
            let ramp = next_ramp(remaining, v, nominal, 0.0, a);
            t += ramp.duration_s;
            remaining -= ramp.distance_mm;
            v = ramp.end_speed_mm_per_s;
            if ramp.finishes {
                assert!(v < 1e-6, "left at {v} mm/s");
                return t;
            }
        }
        panic!("more than ten stretches for one block");
    }

    #[test]
    fn a_trapezoid_takes_its_analytical_time() {
        // 20 mm/s at 100 mm/s²: 0.2 s and 2 mm each end, 96 mm between them.
        assert!((total_s(100.0, 20.0, 100.0) - (0.4 + 96.0 / 20.0)).abs() < 1e-9);
    }

    #[test]
    fn a_triangle_takes_its_analytical_time() {
        assert!((total_s(1.0, 20.0, 100.0) - 2.0 * (1.0f64 / 100.0).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_block_too_short_to_slow_down_in_is_left_as_slowly_as_possible() {
        let ramp = next_ramp(1.0, 20.0, 5.0, 0.0, 100.0);
        assert!(ramp.finishes);
        assert!((ramp.end_speed_mm_per_s - 200f64.sqrt()).abs() < 1e-9);
    }
}
