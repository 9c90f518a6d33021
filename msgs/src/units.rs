//! The one place where millimetres meet metres.
//!
//! Cores, part programs and people use mm, mm/min and rev/min; messages use
//! m, m/s and rad/s. Conversions read right to left. Coming back, a value is
//! rounded to 1e-9 of its unit, so that every decimal up to a million that a
//! part program can state survives the round trip bit for bit.

use crate::geometry::Position;
use crate::wire::geometry_msgs::msg::Point;
use std::f64::consts::TAU;

/// Decimals that survive a round trip.
const GRID: f64 = 1e9;

fn on_grid(scaled: f64) -> f64 {
    scaled.round() / GRID
}

/// Millimetres to metres.
pub fn m_from_mm(mm: f64) -> f64 {
    mm / 1e3
}

/// Square millimetres to square metres.
pub fn m2_from_mm2(mm2: f64) -> f64 {
    mm2 / 1e6
}

/// Metres to millimetres, on a grid of 1e-9 mm.
pub fn mm_from_m(m: f64) -> f64 {
    on_grid(m * (1e3 * GRID))
}

/// Millimetres a minute to metres a second.
pub fn m_per_s_from_mm_per_min(mm_per_min: f64) -> f64 {
    mm_per_min / 6e4
}

/// Metres a second to millimetres a minute, on a grid of 1e-9 mm/min.
pub fn mm_per_min_from_m_per_s(m_per_s: f64) -> f64 {
    on_grid(m_per_s * (6e4 * GRID))
}

/// Revolutions a minute to radians a second.
pub fn rad_per_s_from_rpm(rpm: f64) -> f64 {
    rpm * TAU / 60.0
}

/// Radians a second to revolutions a minute, on a grid of 1e-9 rev/min.
pub fn rpm_from_rad_per_s(rad_per_s: f64) -> f64 {
    on_grid(rad_per_s * 60.0 / TAU * GRID)
}

/// A length, mm, as the receiver of a message gets it.
pub fn received_mm(mm: f64) -> f64 {
    mm_from_m(m_from_mm(mm))
}

/// A feed, mm/min, as the receiver of a message gets it.
pub fn received_mm_per_min(mm_per_min: f64) -> f64 {
    mm_per_min_from_m_per_s(m_per_s_from_mm_per_min(mm_per_min))
}

/// Degrees to radians.
pub fn rad_from_degrees(degrees: f64) -> f64 {
    degrees.to_radians()
}

/// Radians to degrees, on a grid of 1e-9 degrees.
pub fn degrees_from_rad(rad: f64) -> f64 {
    on_grid(rad.to_degrees() * GRID)
}

/// Degrees a minute to radians a second.
pub fn rad_per_s_from_degrees_per_min(degrees_per_min: f64) -> f64 {
    degrees_per_min.to_radians() / 60.0
}

/// Radians a second to degrees a minute, on a grid of 1e-9 degrees/min.
pub fn degrees_per_min_from_rad_per_s(rad_per_s: f64) -> f64 {
    on_grid(rad_per_s.to_degrees() * 60.0 * GRID)
}

/// An angle, degrees, as the receiver of a message gets it.
pub fn received_degrees(degrees: f64) -> f64 {
    degrees_from_rad(rad_from_degrees(degrees))
}

/// A rate of turning, degrees/min, as the receiver of a message gets it.
pub fn received_degrees_per_min(degrees_per_min: f64) -> f64 {
    degrees_per_min_from_rad_per_s(rad_per_s_from_degrees_per_min(degrees_per_min))
}

/// A speed, rev/min, as the receiver of a message gets it.
pub fn received_rpm(rpm: f64) -> f64 {
    rpm_from_rad_per_s(rad_per_s_from_rpm(rpm))
}

/// A position in millimetres as a point in metres.
pub fn point_from_position(position: Position) -> Point {
    let [x, y, z] = position.map(m_from_mm);
    Point { x, y, z }
}

/// A point in metres as a position in millimetres.
pub fn position_from_point(point: &Point) -> Position {
    [point.x, point.y, point.z].map(mm_from_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_decimal_of_a_part_program_survives_the_round_trip() {
        let mut state = 1u64;
        for _ in 0..100_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let decimals = (state >> 60) % 8;
            let mm = ((state >> 20) as i64 % 2_000_000_000 - 1_000_000_000) as f64
                / 10f64.powi(decimals as i32);
            // No program has larger values: see the loader's limits.
            if mm.abs() > 1e6 {
                continue;
            }
            assert_eq!(mm_from_m(m_from_mm(mm)).to_bits(), mm.to_bits(), "{mm} mm");
            assert_eq!(
                degrees_from_rad(rad_from_degrees(mm)).to_bits(),
                mm.to_bits(),
                "{mm} degrees"
            );
            let positive = mm.abs();
            assert_eq!(
                degrees_per_min_from_rad_per_s(rad_per_s_from_degrees_per_min(positive)),
                positive
            );
            assert_eq!(mm_per_min_from_m_per_s(m_per_s_from_mm_per_min(positive)), positive);
            assert_eq!(rpm_from_rad_per_s(rad_per_s_from_rpm(positive)), positive);
        }
    }

    #[test]
    fn what_was_received_once_is_received_again_bit_for_bit() {
        let mut state = 1u64;
        for _ in 0..100_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let part = (state >> 11) as f64 / (1u64 << 53) as f64;
            let magnitude = 10f64.powi((state % 13) as i32 - 6);
            let value = (2.0 * part - 1.0) * magnitude;
            for received in [received_mm, received_mm_per_min, received_rpm, received_degrees] {
                let once = received(value);
                assert!((once - value).abs() <= 1e-9 + value.abs() * 1e-15, "{value}");
                assert_eq!(received(once).to_bits(), once.to_bits(), "{value}");
            }
        }
    }
}
