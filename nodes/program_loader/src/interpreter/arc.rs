//! The centre of an arc from I, J, K or from R.
//!
//! Plane geometry in millimetres, without words and axes. The checks and their tolerances are
//! LinuxCNC's, with grbl's upper limit.

use cnc_msgs::geometry::{Arc, Position};

use crate::limits::{
    ARC_MISMATCH_MM_MAX, ARC_MISMATCH_RELATIVE, COORDINATE_MM_MAX, FULL_CIRCLE_RELATIVE,
};

/// A point or vector in the plane: first axis, second axis, mm.
pub(super) type InPlane = [f64; 2];

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Resolved {
    pub(super) center: InPlane,
    /// Start and end are the same point.
    pub(super) is_full_circle: bool,
}

/// Why an arc is impossible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ArcTrouble {
    /// The centre is the start or the end.
    ZeroRadius,
    /// The radii at start and end differ by more than is allowed.
    Mismatch { start_mm: f64, end_mm: f64, allowed_mm: f64 },
    /// R does not reach from start to end.
    TooShort { radius_mm: f64, half_chord_mm: f64 },
    /// R form with start = end: the circle is not determined.
    NoChord,
    /// The radius is larger than the limit of coordinates.
    TooLarge { radius_mm: f64 },
}

/// The length of an arc or helix, mm.
pub(super) fn length(start: Position, end: Position, arc: &Arc) -> f64 {
    let [first, second, across] = arc.plane.axes();
    let from = [start[first] - arc.center[first], start[second] - arc.center[second]];
    let to = [end[first] - arc.center[first], end[second] - arc.center[second]];
    let (from, to) = if arc.clockwise { (to, from) } else { (from, to) };
    let sine = from[0] * to[1] - from[1] * to[0];
    let cosine = from[0] * to[0] + from[1] * to[1];
    let angle = sine.atan2(cosine).rem_euclid(std::f64::consts::TAU);
    // A full circle ends where it starts, and has a turn more.
    let is_closed = start[first] == end[first] && start[second] == end[second];
    let part = if is_closed { 0.0 } else { angle };
    let sweep = part + f64::from(arc.turns) * std::f64::consts::TAU;
    (sweep * from[0].hypot(from[1])).hypot(end[across] - start[across])
}

/// Checks an arc about a given centre. `mismatch_mm` is the allowed difference of its radii.
pub(super) fn about_center(
    start: InPlane,
    end: InPlane,
    center: InPlane,
    mismatch_mm: f64,
) -> Result<Resolved, ArcTrouble> {
    let start_mm = distance(start, center);
    let end_mm = distance(end, center);
    let larger_mm = start_mm.max(end_mm);
    // Below this the direction from the centre is undefined.
    if start_mm.min(end_mm) < mismatch_mm * 1e-3 && (start_mm - end_mm).abs() <= mismatch_mm {
        return Err(ArcTrouble::ZeroRadius);
    }
    if larger_mm > COORDINATE_MM_MAX {
        return Err(ArcTrouble::TooLarge { radius_mm: larger_mm });
    }
    let allowed_mm = mismatch_mm.max((ARC_MISMATCH_RELATIVE * larger_mm).min(ARC_MISMATCH_MM_MAX));
    if (start_mm - end_mm).abs() > allowed_mm {
        return Err(ArcTrouble::Mismatch { start_mm, end_mm, allowed_mm });
    }
    let is_full_circle = distance(start, end) < FULL_CIRCLE_RELATIVE * start_mm;
    Ok(Resolved { center, is_full_circle })
}

/// Finds the centre of an arc of a given radius; a negative one means more than half a circle.
///
/// `short_mm` is by how much R may be too short for a half circle.
pub(super) fn with_radius(
    start: InPlane,
    end: InPlane,
    radius_mm: f64,
    clockwise: bool,
    short_mm: f64,
) -> Result<Resolved, ArcTrouble> {
    let chord_mm = distance(start, end);
    let half_chord_mm = chord_mm / 2.0;
    if radius_mm == 0.0 {
        return Err(ArcTrouble::ZeroRadius);
    }
    if chord_mm < FULL_CIRCLE_RELATIVE * radius_mm.abs() || chord_mm == 0.0 {
        return Err(ArcTrouble::NoChord);
    }
    if half_chord_mm - radius_mm.abs() > short_mm {
        return Err(ArcTrouble::TooShort { radius_mm: radius_mm.abs(), half_chord_mm });
    }
    let apothem_mm =
        ((radius_mm.abs() - half_chord_mm) * (radius_mm.abs() + half_chord_mm)).max(0.0).sqrt();
    // A counter-clockwise arc of less than half a circle has its centre to the left of the chord.
    let is_left = clockwise == (radius_mm < 0.0);
    let along = if is_left { apothem_mm } else { -apothem_mm } / chord_mm;
    let chord = [end[0] - start[0], end[1] - start[1]];
    let center = [
        f64::midpoint(start[0], end[0]) - chord[1] * along,
        f64::midpoint(start[1], end[1]) + chord[0] * along,
    ];
    Ok(Resolved { center, is_full_circle: false })
}

fn distance(a: InPlane, b: InPlane) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check_center(end: InPlane, radius_mm: f64, clockwise: bool, expected: InPlane) {
        let arc = with_radius([0.0, 0.0], end, radius_mm, clockwise, 0.001).expect("an arc");
        assert!(distance(arc.center, expected) < 1e-9, "{:?}", arc.center);
    }

    #[test]
    fn r_is_an_arc_below_half_a_circle_and_negative_r_above() {
        check_center([10.0, 10.0], 10.0, false, [0.0, 10.0]);
        check_center([10.0, 10.0], 10.0, true, [10.0, 0.0]);
        check_center([10.0, 10.0], -10.0, false, [10.0, 0.0]);
        check_center([10.0, 10.0], -10.0, true, [0.0, 10.0]);
        check_center([20.0, 0.0], 9.9995, true, [10.0, 0.0]);
    }

    #[test]
    fn r_that_does_not_reach_is_refused_with_its_numbers() {
        let refused = with_radius([0.0, 0.0], [20.0, 0.0], 9.998, true, 0.001);
        assert_eq!(refused, Err(ArcTrouble::TooShort { radius_mm: 9.998, half_chord_mm: 10.0 }));
        let closed = with_radius([1.0, 1.0], [1.0, 1.0], 5.0, true, 0.001);
        assert_eq!(closed, Err(ArcTrouble::NoChord));
    }

    #[test]
    fn radii_may_differ_by_the_absolute_or_the_relative_tolerance() {
        let about = |end: InPlane, center: InPlane| about_center([0.0, 0.0], end, center, 0.028);
        assert!(about([10.0, 0.0], [5.01, 0.0]).is_ok());
        assert!(matches!(
            about([10.0, 0.0], [5.02, 0.0]),
            Err(ArcTrouble::Mismatch { allowed_mm: 0.028, .. })
        ));
        assert!(about([600.0, 0.0], [300.14, 0.0]).is_ok());
        assert!(matches!(
            about([4000.0, 0.0], [2000.3, 0.0]),
            Err(ArcTrouble::Mismatch { allowed_mm: 0.5, .. })
        ));
    }

    #[test]
    fn an_arc_about_its_own_start_is_refused() {
        assert_eq!(
            about_center([3.0, 3.0], [3.0, 3.0], [3.0, 3.0], 0.028),
            Err(ArcTrouble::ZeroRadius)
        );
    }

    #[test]
    fn start_and_end_within_rounding_are_a_full_circle() {
        let circle = about_center([5.0, 0.0], [5.0, 1e-12], [0.0, 0.0], 0.028).expect("a circle");
        assert!(circle.is_full_circle);
        let arc = about_center([5.0, 0.0], [5.0, 1e-3], [0.0, 0.0], 0.028).expect("an arc");
        assert!(!arc.is_full_circle);
    }
}
