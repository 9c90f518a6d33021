//! Arcs: from words to a centre, from a centre to chords, as the firmware computes them.
//!
//! grbl and FluidNC compute in 32 bits, and so does this file. It follows `mc_arc` of grbl 1.1h
//! operation for operation, with its angle, small-angle rotation and corrections. If rounding
//! moves the centre of a full circle the wrong way, the angle is almost zero there and the
//! circle is not cut. grblHAL keeps centre and radius vector in 64 bits, and cuts it.

use crate::axes::{AXES, Axes};
use crate::codes::ErrorCode;
use crate::gcode::Plane;
use crate::tolerances::{
    FULL_CIRCLE_RAD, RADIUS_MISMATCH_MM, RADIUS_MISMATCH_MM_MAX, RADIUS_MISMATCH_SHARE,
};

/// Chords between two exact ones; the firmware's `N_ARC_CORRECTION`.
const CHORDS_PER_CORRECTION: u8 = 12;

/// In how many bits a family keeps the centre of an arc and the radius vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ArcPrecision {
    Single,
    Double,
}

/// An arc whose words are checked; all in 32 bits, mm.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Arc {
    plane: Plane,
    start: [f32; AXES],
    pub(crate) end: Axes,
    /// Centre relative to the start, in the two axes of the plane.
    offset: [f32; 2],
    radius: f32,
    clockwise: bool,
}

impl Arc {
    /// Builds an arc from its centre relative to its start (I, J, K).
    pub(crate) fn from_offsets(
        plane: Plane,
        start: Axes,
        end: Axes,
        offset: Axes,
        clockwise: bool,
    ) -> Result<Self, ErrorCode> {
        let (a, b, _) = plane.axes();
        let (from, to) = (single(start), single(end));
        let offset = [offset[a] as f32, offset[b] as f32];
        let radius = hypotenuse(offset[0], offset[1]);
        let end_radius = hypotenuse(to[a] - from[a] - offset[0], to[b] - from[b] - offset[1]);
        let mismatch = (end_radius - radius).abs();
        if mismatch > RADIUS_MISMATCH_MM
            && (mismatch > RADIUS_MISMATCH_MM_MAX || mismatch > RADIUS_MISMATCH_SHARE * radius)
        {
            return Err(ErrorCode::InvalidTarget);
        }
        Ok(Self { plane, start: from, end, offset, radius, clockwise })
    }

    /// Builds an arc from its radius; a negative one means the arc of more than half a circle.
    pub(crate) fn from_radius(
        plane: Plane,
        start: Axes,
        end: Axes,
        radius: f64,
        clockwise: bool,
    ) -> Result<Self, ErrorCode> {
        let (a, b, _) = plane.axes();
        let (from, to, radius) = (single(start), single(end), radius as f32);
        let (x, y) = (to[a] - from[a], to[b] - from[b]);
        if to == from || (x == 0.0 && y == 0.0) {
            return Err(ErrorCode::InvalidTarget);
        }
        let height_squared = 4.0 * radius * radius - x * x - y * y;
        if height_squared < 0.0 {
            return Err(ErrorCode::ArcRadius);
        }
        // The centre is left of the chord for a short counterclockwise arc.
        let side = if clockwise == (radius < 0.0) { 1.0 } else { -1.0 };
        let height = side * height_squared.sqrt() / hypotenuse(x, y);
        let offset = [0.5 * (x - y * height), 0.5 * (y + x * height)];
        Ok(Self { plane, start: from, end, offset, radius: radius.abs(), clockwise })
    }

    /// Returns the end points of the firmware's chords with this `$12`, mm.
    pub(crate) fn chords(self, tolerance_mm: f64, precision: ArcPrecision) -> Chords {
        let (a, b, c) = self.plane.axes();
        let to = single(self.end);
        let towards = [-self.offset[0], -self.offset[1]];
        let sweep = match precision {
            ArcPrecision::Single => {
                let center = [self.start[a] + self.offset[0], self.start[b] + self.offset[1]];
                let last = [to[a] - center[0], to[b] - center[1]];
                let cross = towards[0] * last[1] - towards[1] * last[0];
                cross.atan2(towards[0] * last[0] + towards[1] * last[1])
            }
            ArcPrecision::Double => {
                let from = towards.map(f64::from);
                let center =
                    [f64::from(self.start[a]) - from[0], f64::from(self.start[b]) - from[1]];
                let last = [f64::from(to[a]) - center[0], f64::from(to[b]) - center[1]];
                let cross = from[0] * last[1] - from[1] * last[0];
                cross.atan2(from[0] * last[0] + from[1] * last[1]) as f32
            }
        };
        let sweep = match self.clockwise {
            true if sweep >= -FULL_CIRCLE_RAD => sweep - std::f32::consts::TAU,
            false if sweep <= FULL_CIRCLE_RAD => sweep + std::f32::consts::TAU,
            _ => sweep,
        };
        let tolerance = tolerance_mm as f32;
        let half_chord = (tolerance * (2.0 * self.radius - tolerance)).sqrt();
        // NaN where the whole circle is within the tolerance: no chord in between.
        let count = ((0.5 * sweep * self.radius).abs() / half_chord).floor();
        let count = if count.is_finite() { count as u32 & 0xFFFF } else { 0 };
        let share = |of: f32| if count > 0 { of / count as f32 } else { 0.0 };
        let angle = share(sweep);
        let cosine = 2.0 - angle * angle;
        let sine = angle * 0.166_666_67 * (cosine + 4.0);
        Chords {
            count: count.max(1),
            next: 1,
            corrected: 0,
            towards: towards.map(f64::from),
            angle,
            rotation: [cosine * 0.5, sine],
            rise: share(to[c] - self.start[c]),
            height: self.start[c],
            precision,
            arc: self,
        }
    }
}

/// The chords of an arc as end points, one after the other; the last is the programmed end.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chords {
    arc: Arc,
    precision: ArcPrecision,
    /// From the centre to the end of the last chord.
    towards: [f64; 2],
    /// Angle of one chord, rad.
    angle: f32,
    /// Approximate cosine and sine of that angle.
    rotation: [f32; 2],
    rise: f32,
    height: f32,
    pub(crate) count: u32,
    next: u32,
    /// Chords since the last exact one.
    corrected: u8,
}

impl Chords {
    /// Have all chords been returned?
    pub(crate) fn is_done(&self) -> bool {
        self.next > self.count
    }

    fn turn(&mut self) {
        let [i, j] = self.arc.offset;
        if self.corrected >= CHORDS_PER_CORRECTION {
            let (sine, cosine) = (self.next as f32 * self.angle).sin_cos();
            self.towards = [-i * cosine + j * sine, -i * sine - j * cosine].map(f64::from);
            self.corrected = 0;
            return;
        }
        self.corrected += 1;
        let [cosine, sine] = self.rotation;
        self.towards = match self.precision {
            ArcPrecision::Single => {
                let [x, y] = self.towards.map(|component| component as f32);
                [x * cosine - y * sine, x * sine + y * cosine].map(f64::from)
            }
            ArcPrecision::Double => {
                let ([x, y], cosine, sine) = (self.towards, f64::from(cosine), f64::from(sine));
                // The second component passes through a 32 bit variable.
                [x * cosine - y * sine, f64::from((x * sine + y * cosine) as f32)]
            }
        };
    }
}

impl Iterator for Chords {
    type Item = Axes;

    fn next(&mut self) -> Option<Axes> {
        if self.next > self.count {
            return None;
        }
        if self.next == self.count {
            self.next += 1;
            return Some(self.arc.end);
        }
        self.turn();
        self.next += 1;
        self.height += self.rise;
        let (a, b, c) = self.arc.plane.axes();
        let mut point = self.arc.end;
        for (at, axis) in [a, b].into_iter().enumerate() {
            let (start, offset) = (self.arc.start[axis], self.arc.offset[at]);
            point[axis] = match self.precision {
                ArcPrecision::Single => f64::from((start + offset) + self.towards[at] as f32),
                ArcPrecision::Double => {
                    let center = f64::from(start) + f64::from(offset);
                    f64::from((center + self.towards[at]) as f32)
                }
            };
        }
        point[c] = f64::from(self.height);
        // As in grblHAL and FluidNC; grbl has no other axes.
        let share = (self.next - 1) as f32 / self.count as f32;
        for (axis, start) in self.arc.start.into_iter().enumerate().skip(3) {
            point[axis] = f64::from(start + (self.arc.end[axis] as f32 - start) * share);
        }
        Some(point)
    }
}

fn single(position: Axes) -> [f32; AXES] {
    position.map(|coordinate| coordinate as f32)
}

/// As the firmware computes it: squares and a root.
fn hypotenuse(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axes::with_others_at_zero as axes;

    fn middle(radius: f64, clockwise: bool) -> Axes {
        let arc =
            Arc::from_radius(Plane::Xy, [0.0; AXES], axes([10.0, 0.0, 0.0]), radius, clockwise)
                .unwrap();
        let chords: Vec<_> = arc.chords(1e-3, ArcPrecision::Single).collect();
        chords[chords.len() / 2 - 1]
    }

    #[test]
    fn a_radius_word_chooses_the_side_by_its_sign() {
        let close = |point: Axes, y: f64| (point[1] - y).abs() < 0.3;
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
            let arc =
                Arc::from_offsets(plane, [0.0; AXES], [0.0; AXES], axes(offset), true).unwrap();
            let (a, b, _) = plane.axes();
            let mut last = [0.0; AXES];
            for point in arc.chords(0.002, ArcPrecision::Single) {
                let mid: Axes = std::array::from_fn(|i| (last[i] + point[i]) / 2.0);
                let radius = (mid[a] - offset[a]).hypot(mid[b] - offset[b]);
                assert!((5.0 - radius) <= 0.0021, "{plane:?}: chord {} mm inside", 5.0 - radius);
                last = point;
            }
            assert_eq!(last, [0.0; AXES]);
        }
    }

    #[test]
    fn a_full_circle_is_drawn_or_not_as_its_centre_rounds() {
        // In 32 bits 12.7 + 0.1 - 0.1 is not 12.7: start and end differ by a rounding error. Its
        // sign decides whether a full circle is drawn or nothing.
        let chords = |start: f32, offset: f32, precision| {
            let start = axes([f64::from(start), 0.0, 0.0]);
            let offset = axes([f64::from(offset), f64::from(0.3f32), 0.0]);
            let arc = Arc::from_offsets(Plane::Xy, start, start, offset, false).unwrap();
            arc.chords(0.002, precision).count
        };
        let starts = (0..1000u32).map(|index| index as f32 * 0.137);
        let missing =
            |precision| starts.clone().filter(|start| chords(*start, 0.7, precision) <= 2).count();
        assert!(missing(ArcPrecision::Single) > 50, "{}", missing(ArcPrecision::Single));
        assert_eq!(missing(ArcPrecision::Double), 0);
    }

    #[test]
    fn other_axes_turn_evenly_along_an_arc() {
        let (start, mut end) = (axes([10.0, 0.0, 0.0]), axes([-10.0, 0.0, 0.0]));
        end[3] = 180.0;
        let arc = Arc::from_offsets(Plane::Xy, start, end, axes([-10.0, 0.0, 0.0]), false);
        let chords: Vec<Axes> = arc.unwrap().chords(0.01, ArcPrecision::Double).collect();
        for (index, point) in chords.iter().enumerate() {
            let wanted = 180.0 * (index + 1) as f64 / chords.len() as f64;
            assert!((point[3] - wanted).abs() < 1e-3, "{index}: {point:?}");
        }
    }
}
