//! Arcs: from words to a centre, from a centre to chords.
//!
//! Knows geometry in one plane plus the third axis.

use crate::axes::Vector;
use crate::codes::ErrorCode;
use crate::gcode::Plane;
use crate::tolerances::{
    FULL_CIRCLE_RAD, RADIUS_MISMATCH_MM, RADIUS_MISMATCH_MM_MAX, RADIUS_MISMATCH_SHARE,
};

/// An arc whose words are checked.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Arc {
    pub(crate) plane: Plane,
    pub(crate) start: Vector,
    pub(crate) end: Vector,
    /// Of the two axes of the plane, the third is not used.
    pub(crate) center: Vector,
    pub(crate) clockwise: bool,
}

impl Arc {
    /// Builds an arc from the offsets of its centre from its start (I, J, K).
    pub(crate) fn from_offsets(
        plane: Plane,
        start: Vector,
        end: Vector,
        offset: Vector,
        clockwise: bool,
    ) -> Result<Self, ErrorCode> {
        let (a, b, _) = plane.axes();
        let mut center = start;
        center[a] += offset[a];
        center[b] += offset[b];
        let radius = offset[a].hypot(offset[b]);
        let end_radius = (end[a] - center[a]).hypot(end[b] - center[b]);
        let mismatch = (end_radius - radius).abs();
        if mismatch > RADIUS_MISMATCH_MM
            && (mismatch > RADIUS_MISMATCH_MM_MAX || mismatch > RADIUS_MISMATCH_SHARE * radius)
        {
            return Err(ErrorCode::InvalidTarget);
        }
        Ok(Self { plane, start, end, center, clockwise })
    }

    /// Builds an arc from its radius; a negative one asks for the long way round.
    pub(crate) fn from_radius(
        plane: Plane,
        start: Vector,
        end: Vector,
        radius: f64,
        clockwise: bool,
    ) -> Result<Self, ErrorCode> {
        let (a, b, _) = plane.axes();
        let chord = [end[a] - start[a], end[b] - start[b]];
        let chord_length = chord[0].hypot(chord[1]);
        if end == start || chord_length == 0.0 {
            return Err(ErrorCode::InvalidTarget);
        }
        let height_squared = radius * radius - chord_length * chord_length / 4.0;
        if height_squared < 0.0 {
            return Err(ErrorCode::ArcRadius);
        }
        // The centre is left of the chord for a short counterclockwise arc.
        let side = if clockwise == (radius < 0.0) { 1.0 } else { -1.0 };
        let height = side * height_squared.sqrt() / chord_length;
        let mut center = start;
        center[a] += chord[0] / 2.0 - height * chord[1];
        center[b] += chord[1] / 2.0 + height * chord[0];
        Ok(Self { plane, start, end, center, clockwise })
    }

    /// Returns the ends of the chords, none farther than `tolerance_mm` from the circle.
    pub(crate) fn chords(self, tolerance_mm: f64) -> Chords {
        let (a, b, c) = self.plane.axes();
        let from = [self.start[a] - self.center[a], self.start[b] - self.center[b]];
        let to = [self.end[a] - self.center[a], self.end[b] - self.center[b]];
        let radius = from[0].hypot(from[1]);
        let cross = from[0] * to[1] - from[1] * to[0];
        let mut sweep = cross.atan2(from[0] * to[0] + from[1] * to[1]);
        if self.clockwise && sweep >= -FULL_CIRCLE_RAD {
            sweep -= std::f64::consts::TAU;
        } else if !self.clockwise && sweep <= FULL_CIRCLE_RAD {
            sweep += std::f64::consts::TAU;
        }
        let tolerance = tolerance_mm.min(radius);
        let half_chord = (tolerance * (2.0 * radius - tolerance)).max(0.0).sqrt();
        let count =
            if half_chord > 0.0 { (sweep.abs() * radius / 2.0 / half_chord).floor() } else { 0.0 };
        Chords {
            rise: self.end[c] - self.start[c],
            start_angle: from[1].atan2(from[0]),
            count: (count as u32).max(1),
            next: 1,
            radius,
            sweep,
            arc: self,
        }
    }
}

/// The chords of an arc, one end point after the other; the last is the programmed end.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chords {
    arc: Arc,
    radius: f64,
    start_angle: f64,
    sweep: f64,
    rise: f64,
    pub(crate) count: u32,
    next: u32,
}

impl Chords {
    /// Have all of them been handed out?
    pub(crate) fn is_done(&self) -> bool {
        self.next > self.count
    }
}

impl Iterator for Chords {
    type Item = Vector;

    fn next(&mut self) -> Option<Vector> {
        if self.next > self.count {
            return None;
        }
        let share = f64::from(self.next) / f64::from(self.count);
        self.next += 1;
        if self.next > self.count {
            return Some(self.arc.end);
        }
        let (a, b, c) = self.arc.plane.axes();
        let angle = self.start_angle + self.sweep * share;
        let mut point = self.arc.center;
        point[a] += self.radius * angle.cos();
        point[b] += self.radius * angle.sin();
        point[c] = self.arc.start[c] + self.rise * share;
        Some(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn middle(radius: f64, clockwise: bool) -> Vector {
        let arc =
            Arc::from_radius(Plane::Xy, [0.0; 3], [10.0, 0.0, 0.0], radius, clockwise).unwrap();
        let chords: Vec<_> = arc.chords(1e-3).collect();
        chords[chords.len() / 2 - 1]
    }

    #[test]
    fn a_radius_word_chooses_the_side_by_its_sign() {
        let close = |point: Vector, y: f64| (point[1] - y).abs() < 0.3;
        // Sagitta of the short arc: 10 - sqrt(75) = 1.34; of the long one 18.66.
        assert!(close(middle(10.0, true), 1.34));
        assert!(close(middle(10.0, false), -1.34));
        assert!(close(middle(-10.0, true), 18.66));
        assert!(close(middle(-10.0, false), -18.66));
    }

    #[test]
    fn chords_stay_within_the_tolerance_of_the_circle() {
        for (plane, offset) in [
            (Plane::Xy, [5.0, 0.0, 0.0]),
            (Plane::Zx, [0.0, 0.0, 5.0]),
            (Plane::Yz, [0.0, 5.0, 0.0]),
        ] {
            let arc = Arc::from_offsets(plane, [0.0; 3], [0.0; 3], offset, true).unwrap();
            let (a, b, _) = plane.axes();
            let center = arc.center;
            let mut last = arc.start;
            for point in arc.chords(0.002) {
                let mid: Vector = std::array::from_fn(|i| (last[i] + point[i]) / 2.0);
                let radius = (mid[a] - center[a]).hypot(mid[b] - center[b]);
                assert!((5.0 - radius) <= 0.0021, "{plane:?}: chord {} mm inside", 5.0 - radius);
                last = point;
            }
            assert_eq!(last, [0.0; 3]);
        }
    }
}
