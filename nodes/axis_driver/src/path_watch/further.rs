//! A, B, C, U, V and W: where the lines take them, and whether a report fits.
//!
//! The place of X, Y and Z says how far a line is done, and so where these axes are. Where a line
//! does not move X, Y and Z they may be anywhere between its ends. Degrees and mm, machine frame.
//! An axis whose place or zero is not known is not judged.

use super::tolerances::{LAST_PLACES, PATH_MM, REPORT_MM, ROUNDED_NUMBERS};
use super::words::LineWords;
use cnc_msgs::further::FurtherAxes;

/// A turn: a board may report an angle within one.
const TURN_DEGREES: f64 = 360.0;

/// The offsets of the controller for these axes; those that are not named are not known.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FurtherFrame {
    /// G54 to G59.3, each with the shift of G92.
    pub systems: [FurtherAxes; 9],
    /// The shift of G92.
    pub shift: FurtherAxes,
    /// Machine = work + this.
    pub in_force: FurtherAxes,
}

impl FurtherFrame {
    /// The same with nothing in force.
    pub(super) fn only_stored(self) -> Self {
        Self { in_force: FurtherAxes::NONE, ..self }
    }

    fn system(&mut self, system: Option<u8>) -> Option<&mut FurtherAxes> {
        self.systems.get_mut(usize::from(system?).checked_sub(1)?)
    }

    pub(super) fn select(&mut self, system: Option<u8>) {
        self.in_force = self.system(system).map_or(FurtherAxes::NONE, |zero| *zero);
    }

    /// G10 L2, or L20 at this place; `in_force` is the system in force, where it is known.
    pub(super) fn store(
        &mut self,
        words: &LineWords,
        system: u8,
        in_force: Option<u8>,
        place: FurtherAxes,
    ) {
        for (axis, value) in words.further.iter() {
            let zero = match words.l == Some(20.0) {
                true => place.get(axis).map(|place| place - value),
                false => self.shift.get(axis).map(|shift| value + shift),
            };
            if let Some(stored) = self.system(Some(system)) {
                *stored = zero.map_or(stored.without(axis), |zero| stored.with(axis, zero));
            }
        }
        if in_force.is_none_or(|in_force| in_force == system) {
            self.select(in_force);
        }
    }

    /// Where a line takes the axes from a place.
    pub(super) fn target(
        &self,
        words: &LineWords,
        is_relative: Option<bool>,
        place: FurtherAxes,
    ) -> FurtherAxes {
        if words.has_g(280) || words.has_g(300) {
            // Only the machine knows where that is; without axes all of them go there.
            let are_all = !words.has_axes() && words.further.is_empty();
            let gone = if are_all { place } else { words.further };
            return gone.iter().fold(place, |place, (axis, _)| place.without(axis));
        }
        words.further.iter().fold(place, |place, (axis, value)| {
            let zero = match (words.has_g(530), is_relative) {
                (true, _) => Some(0.0),
                (false, Some(false)) => self.in_force.get(axis),
                _ => None,
            };
            zero.map_or(place.without(axis), |zero| place.with(axis, zero + value))
        })
    }

    /// The axes of a report whose offset in force is the one that reports have shown.
    pub(super) fn as_shown(
        &self,
        seen: FurtherAxes,
        shown: FurtherAxes,
        steps: &[f64; 6],
    ) -> FurtherAxes {
        let is_other = |axis: usize| {
            let both = self.in_force.get(axis).zip(shown.get(axis));
            both.is_none_or(|(is, shown)| !is_same_offset(axis, is, shown, steps[axis]))
        };
        seen.iter().filter(|it| is_other(it.0)).fold(seen, |all, (axis, _)| all.without(axis))
    }

    /// Reports show these offsets, and all lines that change them are answered: those that were
    /// not known and that the report before has shown as well are known.
    pub(super) fn adopt(&mut self, shown: FurtherAxes, before: FurtherAxes) {
        let twice = shown.iter().filter(|&(axis, value)| before.get(axis) == Some(value));
        let twice = twice.collect();
        self.in_force = self.in_force.or(twice);
    }
}

/// How far an axis may be off, where the largest of its places is so large.
fn tolerance(largest: f64, step: f64) -> f64 {
    PATH_MM
        + ROUNDED_NUMBERS * REPORT_MM
        + step
        + LAST_PLACES * largest.abs() * f64::from(f32::EPSILON)
}

/// Whether a report may show the one offset where the other is in force. A turn more or less of an axis that
/// turns is the same: its zero is set where the board says that it stands.
pub(super) fn is_same_offset(axis: usize, one: f64, other: f64, step: f64) -> bool {
    is_same_place(one, other, step, FurtherAxes::is_rotary(axis))
}

/// Whether two places of an axis are the same, with whole turns left out or not.
pub(crate) fn is_same_place(one: f64, other: f64, step: f64, leaves_out_turns: bool) -> bool {
    let apart = match leaves_out_turns {
        true => (one - other) - TURN_DEGREES * ((one - other) / TURN_DEGREES).round(),
        false => one - other,
    };
    apart.abs() <= tolerance(one.abs().max(other.abs()), step)
}

/// What one line does with these axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Turn {
    pub(super) from: FurtherAxes,
    pub(super) to: FurtherAxes,
}

/// An axis that is not where it can be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Off {
    /// 0 for A.
    pub axis: usize,
    pub is: f64,
    /// It should be between these.
    pub ends: [f64; 2],
}

impl Turn {
    /// Nothing is known of them.
    pub(super) const UNKNOWN: Self = Self { from: FurtherAxes::NONE, to: FurtherAxes::NONE };

    pub(super) fn at(place: FurtherAxes) -> Self {
        Self { from: place, to: place }
    }

    /// Whether an axis moves by more than so many of its steps.
    pub(super) fn moves(&self, steps: &[f64; 6], most: f64) -> bool {
        self.to.iter().any(|(axis, to)| {
            self.from.get(axis).is_some_and(|from| (to - from).abs() > most * steps[axis])
        })
    }

    /// The first axis that is not where it is after these shares of the line.
    pub(super) fn off(
        &self,
        seen: FurtherAxes,
        [least, most]: [f64; 2],
        steps: &[f64; 6],
    ) -> Option<Off> {
        seen.iter().find_map(|(axis, is)| {
            let (from, to) = (self.from.get(axis)?, self.to.get(axis)?);
            let [one, other] = [least, most].map(|part| from + (to - from) * part.clamp(0.0, 1.0));
            let ends = [one.min(other), one.max(other)];
            let largest = is.abs().max(from.abs()).max(to.abs());
            let tolerance = tolerance(largest, steps[axis]);
            let [low, high] = [ends[0] - tolerance, ends[1] + tolerance];
            let turned = match FurtherAxes::is_rotary(axis) {
                // The lowest angle of the same direction that is not below.
                true => low + (is - low).rem_euclid(TURN_DEGREES),
                false => is,
            };
            (!(low..=high).contains(&turned)).then_some(Off { axis, is, ends })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: usize = 0;
    const U: usize = 3;

    fn one(axis: usize, value: f64) -> FurtherAxes {
        FurtherAxes::NONE.with(axis, value)
    }

    #[test]
    fn an_axis_is_as_far_as_its_line() {
        let turn = |axis, from, to| Turn { from: one(axis, from), to: one(axis, to) };
        // The line, the shares of it that are done, where the axis is, and whether that fits.
        for (turn, parts, seen, fits) in [
            (turn(A, 0.0, 90.0), [0.5, 0.5], one(A, 45.0), true),
            (turn(A, 0.0, 90.0), [0.5, 0.5], one(A, 45.2), false),
            (turn(A, 0.0, 90.0), [0.0, 1.0], one(A, 89.0), true),
            (turn(A, 90.0, 0.0), [0.25, 0.5], one(A, 60.0), true),
            (turn(A, 90.0, 0.0), [0.25, 0.5], one(A, 70.0), false),
            // Boards that count within one turn.
            (turn(A, 700.0, 760.0), [0.5, 0.5], one(A, 10.0), true),
            (turn(A, -30.0, -30.0), [0.0, 1.0], one(A, 330.0), true),
            (turn(A, -30.0, -30.0), [0.0, 1.0], one(A, 331.0), false),
            (turn(U, 0.0, 10.0), [0.5, 0.5], one(U, 365.0), false),
            (turn(U, 0.0, 10.0), [0.5, 0.5], one(U, 5.0), true),
            // What is not known, and what is not reported.
            (turn(U, 0.0, 10.0), [0.5, 0.5], one(A, 5.0), true),
            (turn(U, 0.0, 10.0), [0.5, 0.5], FurtherAxes::NONE, true),
        ] {
            let off = turn.off(seen, parts, &[0.01; 6]);
            assert_eq!(off.is_none(), fits, "{turn:?} {parts:?} {seen:?}: {off:?}");
        }
    }

    #[test]
    fn an_offset_is_the_same_within_a_step_and_a_turn() {
        for (axis, one, other, is_same) in [
            (A, 10.0, 10.0, true),
            (A, 10.0, 10.03, true),
            (A, 10.0, 10.04, false),
            (A, 10.0, 370.0, true),
            (A, -170.0, 190.0, true),
            (A, 10.0, 190.0, false),
            (A, 0.0, 10.0, false),
            (U, 10.0, 370.0, false),
            (U, 10.0, 10.03, true),
            (U, 10.0, 10.1, false),
        ] {
            assert_eq!(is_same_offset(axis, one, other, 0.01), is_same, "{axis} {one} {other}");
        }
    }

    #[test]
    fn lines_are_followed_in_their_frame() {
        let mut frame = FurtherFrame { shift: one(A, 1.0), ..FurtherFrame::default() };
        frame.systems[0] = one(A, 10.0);
        let mut place = FurtherAxes::NONE;
        for (text, wanted) in [
            ("G0A5", None),
            ("G54", None),
            ("G0A5", Some(15.0)),
            ("G1X3", Some(15.0)),
            ("G53G0A5", Some(5.0)),
            ("G10L2P1A20", Some(5.0)),
            ("A1", Some(22.0)),
            ("G10L20P1A0", Some(22.0)),
            ("A1", Some(23.0)),
            ("G91A1", None),
            ("A0", Some(22.0)),
            ("G28Z0", Some(22.0)),
            ("G28", None),
            ("A0", Some(22.0)),
            ("G55", Some(22.0)),
            ("A0", None),
        ] {
            let words = LineWords::read(text).expect("a line");
            match (words.has_g(100), words.work_system()) {
                (true, _) => frame.store(&words, 1, Some(1), place),
                (false, None) => place = frame.target(&words, Some(words.has_g(910)), place),
                (false, system) => frame.select(system),
            }
            assert_eq!(place.get(A), wanted, "{text}");
        }
    }
}
