//! How near a tool comes to a box in one move.
//!
//! The tool is a cylinder of its diameter from the tip upwards, without end; a box has sides
//! parallel to the axes. So they touch where the tip is no higher than the top of the box, and
//! the axis of the tool no farther from its outline in XY than the radius. Lines and the arcs and
//! helices of the XY plane are exact; arcs of other planes are chords of them.

use crate::vectors::sweep;
use cnc_msgs::geometry::{Arc, Plane, Position};
use std::f64::consts::TAU;

/// Chords of arcs in ZX and YZ are off them by at most this, mm.
const SAGITTA_MM: f64 = 0.001;
/// The most chords of one arc.
const CHORDS_MAX: f64 = 20_000.0;
/// Rounding, mm.
const ROUNDING_MM: f64 = 1e-6;

/// A box in the frame of the tip, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub(super) min: Position,
    pub(super) max: Position,
}

/// Where the axis of the tool is nearest to a box, of all places where the tip is low enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Nearest {
    pub(super) tip: Position,
    /// From the axis to the outline in XY; 0 within it.
    pub(super) distance_mm: f64,
}

/// The nearest place of a straight move. `None`: the tip stays above the box.
pub(super) fn of_line(from: Position, to: Position, bounds: &Bounds) -> Option<Nearest> {
    let [first, last] = low_part(from[2], to[2], bounds.max[2])?;
    let at = |part: f64| -> Position {
        std::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * part)
    };
    let (a, b) = (at(first), at(last));
    if let Some(inside) = first_within(a, b, bounds) {
        return Some(Nearest { tip: inside, distance_mm: 0.0 });
    }
    let length = (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2);
    let feet = corners(bounds).map(|[x, y]| {
        let along = (x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1]);
        let part = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
        std::array::from_fn(|axis| a[axis] + (b[axis] - a[axis]) * part)
    });
    nearest([a, b].into_iter().chain(feet), bounds)
}

/// The nearest place of an arc or helix; `None` as for a line.
pub(super) fn of_arc(from: Position, to: Position, arc: &Arc, bounds: &Bounds) -> Option<Nearest> {
    match arc.plane {
        Plane::Xy => of_flat_arc(from, to, arc, bounds),
        Plane::Zx | Plane::Yz => of_chords(from, to, arc, bounds),
    }
}

fn of_flat_arc(from: Position, to: Position, arc: &Arc, bounds: &Bounds) -> Option<Nearest> {
    let [first, last] = low_part(from[2], to[2], bounds.max[2])?;
    let (whole, center) = (sweep(arc, from, to), arc.center);
    let radius = (from[0] - center[0]).hypot(from[1] - center[1]);
    let start = (from[1] - center[1]).atan2(from[0] - center[0]);
    let sign = if arc.clockwise { -1.0 } else { 1.0 };
    let at = |part: f64| -> Position {
        let angle = start + sign * whole * part;
        let z = from[2] + (to[2] - from[2]) * part;
        [center[0] + radius * angle.cos(), center[1] + radius * angle.sin(), z]
    };
    // The first time in the low part that the arc passes this direction from its centre.
    let passes = |x: f64, y: f64| -> Option<Position> {
        let turned = (sign * ((y - center[1]).atan2(x - center[0]) - start)).rem_euclid(TAU);
        let turns = ((first * whole - turned) / TAU - 1e-12).ceil().max(0.0);
        let angle = turned + TAU * turns;
        (whole > 0.0 && angle <= last * whole + 1e-12).then(|| at(angle / whole))
    };
    let ends = [at(first), at(last)];
    let crossings = crossings(center, radius, bounds);
    let inside = crossings.into_iter().flatten().find_map(|[x, y]| passes(x, y));
    if let Some(tip) = inside {
        return Some(Nearest { tip, distance_mm: 0.0 });
    }
    let toward_corners = corners(bounds).map(|[x, y]| passes(x, y));
    let quadrants = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
    let quadrants = quadrants.map(|[x, y]| passes(center[0] + x, center[1] + y));
    let passed = toward_corners.into_iter().chain(quadrants).flatten();
    nearest(ends.into_iter().chain(passed), bounds)
}

/// Where a circle crosses the outline of a box.
fn crossings(center: Position, radius: f64, bounds: &Bounds) -> [Option<[f64; 2]>; 8] {
    let mut found = [None; 8];
    let mut count = 0;
    for (along, across) in [(0, 1), (1, 0)] {
        for side in [bounds.min[across], bounds.max[across]] {
            let off = side - center[across];
            let Some(half) = Some(radius * radius - off * off).filter(|it| *it >= 0.0) else {
                continue;
            };
            for value in [center[along] - half.sqrt(), center[along] + half.sqrt()] {
                if (bounds.min[along]..=bounds.max[along]).contains(&value) {
                    let mut point = [side; 2];
                    point[along] = value;
                    found[count] = Some(point);
                    count += 1;
                }
            }
        }
    }
    found
}

fn of_chords(from: Position, to: Position, arc: &Arc, bounds: &Bounds) -> Option<Nearest> {
    let [a, b, normal] = arc.plane.axes();
    let whole = sweep(arc, from, to);
    let radius = (from[a] - arc.center[a]).hypot(from[b] - arc.center[b]);
    let start = (from[b] - arc.center[b]).atan2(from[a] - arc.center[a]);
    let sign = if arc.clockwise { -1.0 } else { 1.0 };
    let step = 2.0 * (1.0 - SAGITTA_MM / radius.max(SAGITTA_MM)).acos();
    let count = (whole / step.max(1e-9)).ceil().clamp(1.0, CHORDS_MAX);
    let at = |part: f64| -> Position {
        let angle = start + sign * whole * part;
        let mut point = from;
        point[a] = arc.center[a] + radius * angle.cos();
        point[b] = arc.center[b] + radius * angle.sin();
        point[normal] = from[normal] + (to[normal] - from[normal]) * part;
        point
    };
    let mut last = from;
    let mut best: Option<Nearest> = None;
    for number in 1..=count as u32 {
        let next = if f64::from(number) >= count { to } else { at(f64::from(number) / count) };
        let found = of_line(last, next, bounds);
        last = next;
        let is_nearer = |it: &Nearest| best.is_none_or(|best| it.distance_mm < best.distance_mm);
        best = found.filter(is_nearer).or(best);
        if best.is_some_and(|best| best.distance_mm <= 0.0) {
            break;
        }
    }
    best
}

/// The part of a move in which the tip is no higher than this; Z changes evenly along it.
fn low_part(from: f64, to: f64, top: f64) -> Option<[f64; 2]> {
    let top = top + ROUNDING_MM;
    match (from <= top, to <= top) {
        (true, true) => Some([0.0, 1.0]),
        (false, false) => None,
        (true, false) => Some([0.0, (top - from) / (to - from)]),
        (false, true) => Some([(from - top) / (from - to), 1.0]),
    }
}

/// The first place of a segment within the outline of a box.
fn first_within(a: Position, b: Position, bounds: &Bounds) -> Option<Position> {
    let (mut enter, mut leave) = (0f64, 1f64);
    for axis in 0..2 {
        let way = b[axis] - a[axis];
        if way == 0.0 {
            if a[axis] < bounds.min[axis] || a[axis] > bounds.max[axis] {
                return None;
            }
            continue;
        }
        let ends = [(bounds.min[axis] - a[axis]) / way, (bounds.max[axis] - a[axis]) / way];
        enter = enter.max(ends[0].min(ends[1]));
        leave = leave.min(ends[0].max(ends[1]));
    }
    (enter <= leave).then(|| std::array::from_fn(|axis| a[axis] + (b[axis] - a[axis]) * enter))
}

fn corners(bounds: &Bounds) -> [[f64; 2]; 4] {
    let ([x0, y0, _], [x1, y1, _]) = (bounds.min, bounds.max);
    [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
}

fn nearest(places: impl Iterator<Item = Position>, bounds: &Bounds) -> Option<Nearest> {
    let to_outline = |at: &Position| {
        let off = |axis: usize| (bounds.min[axis] - at[axis]).max(at[axis] - bounds.max[axis]);
        off(0).max(0.0).hypot(off(1).max(0.0))
    };
    places
        .map(|tip| Nearest { tip, distance_mm: to_outline(&tip) })
        .min_by(|a, b| a.distance_mm.total_cmp(&b.distance_mm))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 to 20 in X and Y, up to Z5.
    const BLOCK: Bounds = Bounds { min: [10.0, 10.0, 0.0], max: [20.0, 20.0, 5.0] };

    fn arc(center: [f64; 2], clockwise: bool, turns: u16) -> Arc {
        Arc { center: [center[0], center[1], 0.0], plane: Plane::Xy, clockwise, turns }
    }

    #[test]
    fn a_line_is_as_near_as_its_nearest_point_below_the_top() {
        for (from, to, expected) in [
            // Along a side, past a corner, through, over, beside.
            ([0.0, 7.0, 0.0], [30.0, 7.0, 0.0], Some(3.0)),
            ([0.0, 13.0, 0.0], [7.0, 6.0, 0.0], Some(7.0 / 2f64.sqrt())),
            ([0.0, 12.0, 0.0], [6.0, 6.0, 0.0], Some(32f64.sqrt())),
            ([0.0, 15.0, 0.0], [30.0, 15.0, 0.0], Some(0.0)),
            ([0.0, 15.0, 6.0], [30.0, 15.0, 6.0], None),
            ([0.0, 15.0, 5.0], [30.0, 15.0, 5.0], Some(0.0)),
            ([0.0, 15.0, -50.0], [30.0, 15.0, -50.0], Some(0.0)),
            ([15.0, 15.0, 30.0], [15.0, 15.0, 4.0], Some(0.0)),
            ([15.0, 15.0, 30.0], [15.0, 15.0, 6.0], None),
            ([7.0, 15.0, 30.0], [7.0, 15.0, 0.0], Some(3.0)),
            // Down while it goes away: below the top from X23 on.
            ([20.0, 15.0, 8.0], [30.0, 15.0, -2.0], Some(3.0)),
            // Beside, with the top crossed on the way.
            ([0.0, 0.0, 5.0], [0.0, 0.0, 5.0], Some(200f64.sqrt())),
        ] {
            let found = of_line(from, to, &BLOCK).map(|it| it.distance_mm);
            match (found, expected) {
                (Some(found), Some(expected)) => {
                    assert!((found - expected).abs() < 1e-5, "{from:?} {to:?}: {found}");
                }
                _ => assert_eq!(found, expected, "{from:?} {to:?}"),
            }
            // The other way round it is the same.
            let back = of_line(to, from, &BLOCK).map(|it| it.distance_mm);
            assert!(back.zip(found).is_none_or(|(a, b)| (a - b).abs() < 1e-9), "{from:?} {to:?}");
        }
    }

    #[test]
    fn an_arc_is_as_near_as_many_short_lines_of_it() {
        let at = |center: [f64; 2], radius: f64, angle: f64, z: f64| {
            [center[0] + radius * angle.cos(), center[1] + radius * angle.sin(), z]
        };
        let mut seen = [0; 3];
        for number in 0..1_000u32 {
            // Numbers that are spread evenly and never repeat.
            let spread = |share: f64| (f64::from(number) * share).fract();
            let center = [30.0 * spread(0.618_034), 30.0 * spread(0.754_878)];
            let radius = 0.5 + 20.0 * spread(0.569_840);
            let start = TAU * spread(0.819_173);
            let turned = TAU * (0.02 + 0.97 * spread(0.671_044));
            let clockwise = number.is_multiple_of(2);
            let heights = [12.0 * spread(0.438_579) - 2.0, 12.0 * spread(0.880_272) - 2.0];
            let signed = if clockwise { -turned } else { turned };
            let (from, to) = (
                at(center, radius, start, heights[0]),
                at(center, radius, start + signed, heights[1]),
            );
            let found = of_arc(from, to, &arc(center, clockwise, 0), &BLOCK);
            let parts = 3_000;
            let place = |part: u32| {
                let share = f64::from(part) / f64::from(parts);
                let z = heights[0] + (heights[1] - heights[0]) * share;
                at(center, radius, start + signed * share, z)
            };
            let lines = (0..parts).filter_map(|part| of_line(place(part), place(part + 1), &BLOCK));
            let expected = lines.map(|it| it.distance_mm).min_by(f64::total_cmp);
            match (found.map(|it| it.distance_mm), expected) {
                (Some(found), Some(expected)) => {
                    assert!((found - expected).abs() < 0.01, "{number}: {found}, not {expected}");
                    seen[usize::from(found > 0.0)] += 1;
                }
                (None, None) => seen[2] += 1,
                (found, expected) => panic!("{number}: {found:?}, not {expected:?}"),
            }
        }
        assert!(seen.iter().all(|count| *count > 50), "{seen:?}");
    }

    #[test]
    fn a_helix_counts_in_the_turn_in_which_it_is_low_enough() {
        // Five turns down beside the block: only the last is below its top.
        let (from, to) = ([30.0, 15.0, 50.0], [30.0, 15.0, 0.0]);
        let found = of_arc(from, to, &arc([27.0, 15.0], false, 5), &BLOCK).expect("low enough");
        assert!((found.distance_mm - 4.0).abs() < 1e-6, "{found:?}");
        assert!(found.tip[2] < 5.0 + 1e-5, "{found:?}");
        assert_eq!(of_arc(from, [30.0, 15.0, 6.0], &arc([27.0, 15.0], false, 5), &BLOCK), None);
    }

    #[test]
    fn an_arc_in_another_plane_dips_to_its_lowest_point() {
        // Radius 10 about X15 Z12: the lower half reaches Z2, the upper one stays above.
        let arc = Arc { center: [15.0, 15.0, 12.0], plane: Plane::Zx, clockwise: true, turns: 0 };
        let low = of_arc([25.0, 15.0, 12.0], [5.0, 15.0, 12.0], &arc, &BLOCK);
        let other = Arc { clockwise: false, ..arc };
        let high = of_arc([25.0, 15.0, 12.0], [5.0, 15.0, 12.0], &other, &BLOCK);
        // One of the two ways is the lower half circle.
        assert_eq!(low.is_some(), high.is_none(), "{low:?} {high:?}");
        assert_eq!(low.or(high).map(|it| it.distance_mm), Some(0.0));
    }
}
