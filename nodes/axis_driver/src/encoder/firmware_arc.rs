//! What grbl draws of a G2 or G3 line, in the 32 bit numbers it computes with.
//!
//! Follows `read_float`, the check of the radii in `gc.c` and `mc_arc` of grbl 1.1h.
//! FluidNC computes the same; grblHAL keeps the centre in 64 bits and is nowhere worse.
//! Knows the words of one line and the arc that was planned; writes nothing.

use super::words::GRID_DECIMALS;
use cnc_msgs::geometry::{Plane, Position};
use std::f32::consts::TAU;

/// Angles below this are a full circle to the firmware, rad (`ARC_ANGULAR_TRAVEL_EPSILON`).
const FULL_CIRCLE_RAD: f32 = 5e-7;
/// Chords between two that are computed anew (`N_ARC_CORRECTION`).
const CHORDS_PER_CORRECTION: u32 = 12;
/// Digits of a number that the firmware reads.
const DIGITS_MAX: u32 = 8;
/// The firmware refuses an arc whose radii at both ends differ by more, mm (`error:33`).
const RADIUS_MISMATCH_MM_MAX: f32 = 0.005;
/// How many of the last places of a machine coordinate a result may be off by: offsets are
/// reported with three decimals and kept with more.
const PLACES_UNKNOWN: f32 = 4.0;

/// An arc as it is written: whole steps of the grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct ArcWords {
    pub(super) plane: Plane,
    pub(super) clockwise: bool,
    pub(super) start: [i64; 3],
    pub(super) end: [i64; 3],
    /// Of the centre from the start, in the two axes of the plane.
    pub(super) offset: [i64; 2],
}

/// The arc that it stands for, in the work frame, mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlannedArc {
    pub(super) start: Position,
    pub(super) end: Position,
    /// The whole of it, rad, never negative.
    pub(super) sweep: f64,
    /// In the two axes of the plane.
    pub(super) center: [f64; 2],
}

/// The frame and the tolerance that the firmware draws with.
#[derive(Debug, Clone, Copy)]
pub(super) struct DrawingFrame {
    /// Machine = work + this, mm.
    pub(super) offset_mm: Position,
    /// `$12`, mm.
    pub(super) tolerance_mm: f64,
}

/// How far what is drawn is off what was planned, mm; `None` when the firmware refuses the
/// arc, or when it hangs on the last place of a number which way round it goes.
pub(super) fn deviation(
    words: &ArcWords,
    planned: &PlannedArc,
    frame: &DrawingFrame,
) -> Option<f64> {
    let [a, b, normal] = words.plane.axes();
    let machine = |steps: [i64; 3], axis: usize| read(steps[axis]) + frame.offset_mm[axis] as f32;
    let from = [machine(words.start, a), machine(words.start, b)];
    let to = [machine(words.end, a), machine(words.end, b)];
    let offset = words.offset.map(read);
    let center = [from[0] + offset[0], from[1] + offset[1]];
    let largest = [from, to, center].as_flattened().iter().fold(0f32, |m, v| m.max(v.abs()));
    let unknown = PLACES_UNKNOWN * last_place(largest);

    // gc.c: both ends are on one circle.
    let radius = hypotenuse(offset[0], offset[1]);
    let end_radius = hypotenuse(to[0] - from[0] - offset[0], to[1] - from[1] - offset[1]);
    let is_accepted = (end_radius - radius).abs() + unknown <= RADIUS_MISMATCH_MM_MAX;
    if !is_accepted || radius <= 0.0 {
        return None;
    }

    // mc_arc: the angle...
    let mut towards = [-offset[0], -offset[1]];
    let last = [to[0] - center[0], to[1] - center[1]];
    let cross = towards[0] * last[1] - towards[1] * last[0];
    let turned = cross.atan2(towards[0] * last[0] + towards[1] * last[1]);
    if turned.abs() <= FULL_CIRCLE_RAD + 2.0 * unknown / radius {
        return None;
    }
    let sweep = match (words.clockwise, turned > 0.0) {
        (true, true) => turned - TAU,
        (false, false) => turned + TAU,
        _ => turned,
    };
    // ...and the chords.
    let tolerance = frame.tolerance_mm as f32;
    let count = (0.5 * sweep * radius).abs() / (tolerance * (2.0 * radius - tolerance)).sqrt();
    // No number where the circle is no larger than the tolerance.
    let count = if count.is_nan() { 0 } else { (count as u32).min(u32::from(u16::MAX)) };
    let parts = count.max(1);
    let angle = sweep / parts as f32;
    let rise = (machine(words.end, normal) - machine(words.start, normal)) / parts as f32;
    let doubled_cosine = 2.0 - angle * angle;
    let sine = angle * 0.166_666_67 * (doubled_cosine + 4.0);
    let cosine = doubled_cosine * 0.5;
    let mut height = machine(words.start, normal);
    let mut expected = Expected::new(words, planned, parts);
    let mut farthest = 0f64;
    let mut see = |at: [f32; 2], height: f32, wanted: [f64; 3]| {
        let off = [
            f64::from(at[0]) - frame.offset_mm[a] - wanted[0],
            f64::from(at[1]) - frame.offset_mm[b] - wanted[1],
            f64::from(height) - frame.offset_mm[normal] - wanted[2],
        ];
        farthest = farthest.max(off.iter().map(|part| part * part).sum::<f64>().sqrt());
    };
    let mut uncorrected = 0;
    for part in 1..parts {
        if uncorrected < CHORDS_PER_CORRECTION {
            let [x, y] = towards;
            towards = [x * cosine - y * sine, x * sine + y * cosine];
            uncorrected += 1;
        } else {
            let (sine, cosine) = (part as f32 * angle).sin_cos();
            let [i, j] = offset;
            towards = [-i * cosine + j * sine, -i * sine - j * cosine];
            uncorrected = 0;
        }
        height += rise;
        see([center[0] + towards[0], center[1] + towards[1]], height, expected.next());
    }
    see(to, machine(words.end, normal), expected.next());
    Some(farthest + expected.sagitta() + f64::from(unknown))
}

/// The points of the planned arc after equal parts of it, in the work frame.
struct Expected {
    center: [f64; 2],
    /// From the centre, of the length of the start radius.
    towards: [f64; 2],
    /// Cosine and sine of a part.
    rotation: [f64; 2],
    part: u32,
    parts: u32,
    /// How much longer the end radius is.
    stretch: f64,
    heights: [f64; 2],
    radius: f64,
    angle: f64,
}

impl Expected {
    fn new(words: &ArcWords, planned: &PlannedArc, parts: u32) -> Self {
        let PlannedArc { start, end, sweep, center } = *planned;
        let [a, b, normal] = words.plane.axes();
        let towards = [start[a] - center[0], start[b] - center[1]];
        let radius = towards[0].hypot(towards[1]);
        let end_radius = (end[a] - center[0]).hypot(end[b] - center[1]);
        let angle = sweep / f64::from(parts);
        let (sine, cosine) = if words.clockwise { -angle } else { angle }.sin_cos();
        Self {
            center,
            towards,
            rotation: [cosine, sine],
            part: 0,
            parts,
            stretch: end_radius / radius - 1.0,
            heights: [start[normal], end[normal]],
            radius: radius.max(end_radius),
            angle,
        }
    }

    fn next(&mut self) -> [f64; 3] {
        let ([x, y], [cosine, sine]) = (self.towards, self.rotation);
        self.towards = [x * cosine - y * sine, x * sine + y * cosine];
        self.part += 1;
        let share = f64::from(self.part) / f64::from(self.parts);
        let longer = 1.0 + self.stretch * share;
        let [low, high] = self.heights;
        [
            self.center[0] + self.towards[0] * longer,
            self.center[1] + self.towards[1] * longer,
            low + (high - low) * share,
        ]
    }

    /// How far the arc rises over a chord, mm.
    fn sagitta(&self) -> f64 {
        self.radius * (1.0 - (self.angle.min(std::f64::consts::TAU) / 2.0).cos())
    }
}

/// The number that the firmware reads where so many steps of the grid are written.
pub(super) fn read(steps: i64) -> f32 {
    let (mut digits, mut decimals) = (steps.unsigned_abs(), GRID_DECIMALS);
    while decimals > 0 && digits % 10 == 0 {
        (digits, decimals) = (digits / 10, decimals - 1);
    }
    // What does not fit is cut off at the end, which is after the point.
    while decimals > 0 && digits >= 10u64.pow(DIGITS_MAX) {
        (digits, decimals) = (digits / 10, decimals - 1);
    }
    let mut value = digits as f32;
    while decimals >= 2 {
        value *= 0.01;
        decimals -= 2;
    }
    if decimals == 1 {
        value *= 0.1;
    }
    if steps < 0 { -value } else { value }
}

/// What the last place of a 32 bit number of this size is worth.
pub(super) fn last_place(value: f32) -> f32 {
    let value = value.abs().max(1.0);
    f32::from_bits(value.to_bits() + 1) - value
}

fn hypotenuse(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    /// An arc about (0, 0) from an angle on, at a place of the machine.
    fn off(radius: f64, angle: f64, sweep: f64, offset: f64) -> Option<f64> {
        let point = |angle: f64| [radius * angle.cos(), radius * angle.sin(), 0.0];
        let planned =
            PlannedArc { start: point(angle), end: point(angle + sweep), sweep, center: [0.0; 2] };
        let steps = |place: Position| place.map(super::super::words::to_grid);
        let start = steps(planned.start);
        let words = ArcWords {
            plane: Plane::Xy,
            clockwise: false,
            start,
            end: steps(planned.end),
            offset: [-start[0], -start[1]],
        };
        let frame = DrawingFrame { offset_mm: [offset, -offset, 0.0], tolerance_mm: 0.002 };
        deviation(&words, &planned, &frame)
    }

    #[test]
    fn halves_and_quarters_are_drawn_to_their_chords() {
        for (radius, offset) in [(0.5, 0.0), (12.1, -317.3), (2_000.0, 0.0), (40.0, 1_500.7)] {
            for sweep in [PI / 2.0, PI, 1.4 * PI] {
                let off = off(radius, 0.3, sweep, offset).expect("an arc that is drawn");
                assert!((0.0005..0.006).contains(&off), "r{radius} at {offset}: {off} mm");
            }
        }
    }

    #[test]
    fn what_hangs_on_the_last_place_is_no_arc() {
        for radius in [0.5, 12.1, 400.0] {
            assert_eq!(off(radius, 0.3, TAU, -317.3), None, "a full circle, r{radius}");
            assert_eq!(off(radius, 0.3, 1e-7, -317.3), None, "next to nothing, r{radius}");
        }
        // Forty metres from the origin the numbers are 4 µm apart.
        assert_eq!(off(10.0, 0.3, PI, 40_000.0), None);
    }

    #[test]
    fn numbers_are_read_digit_by_digit_and_moved_in_32_bits() {
        for (steps, expected) in [
            (0, 0.0),
            (127_000, 127f32 * 0.1),
            (-5, -(5f32 * 0.01 * 0.01)),
            (99_999_999, 99_999_999f32 * 0.01 * 0.01),
            // Nine digits are one too many.
            (123_456_789, 12_345_678f32 * 0.01 * 0.1),
            (200_000_000, 20_000.0),
        ] {
            assert_eq!(read(steps), expected, "{steps}");
        }
    }
}
