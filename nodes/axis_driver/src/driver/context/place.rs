//! Whether a reported position can be true.
//!
//! A damaged digit leaves a report that reads well. What the machine cannot have done since
//! the last report, or has done while it stood and nothing was asked of it, is believed when
//! the next report agrees. Where reports in the machine frame agree on a place near zero to
//! which the axes cannot have gone, the controller has begun to count anew.

use crate::report::StatusReport;
use cnc_msgs::geometry::{AXIS_LETTERS, Position};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Steps and decimals, mm.
const ROUNDING_MM: f64 = 0.02;
/// Reports in a row that may be passed over; the next is taken as it is.
const DOUBTS_MAX: u32 = 3;

/// What was believed last.
#[derive(Debug, Default, Clone, Serialize, Deserialize)]
pub(in crate::driver) struct PlaceWatch {
    believed: Option<Seen>,
    /// Whether a second report agreed with it.
    is_confirmed: bool,
    doubted: Option<Seen>,
    doubts: u32,
}

/// A position in a report.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Seen {
    /// In the machine frame, else in the work frame; mm.
    is_machine: bool,
    position: Position,
    /// The machine was there then at the earliest.
    since: Duration,
    /// The machine stood, and nothing was asked of it.
    is_at_rest: bool,
}

/// What becomes of a report.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::driver) enum Belief {
    Plausible,
    /// It counts when the next one agrees.
    Doubted,
    /// Two agree on what the axes cannot have done: from, to, machine frame.
    Jumped {
        from: Position,
        to: Position,
    },
}

/// What a report is judged by.
#[derive(Debug, Clone, Copy)]
pub(in crate::driver) struct Circumstances {
    /// The machine was looked at between these times.
    pub(in crate::driver) since: Duration,
    pub(in crate::driver) now: Duration,
    /// The most that each axis can do, with a margin; infinite where it is not known.
    pub(in crate::driver) rates_mm_per_min: Position,
    /// The machine stands, and nothing is asked of it.
    pub(in crate::driver) is_at_rest: bool,
}

impl PlaceWatch {
    /// Judges the position of a report as it was printed.
    pub(in crate::driver) fn judge(&mut self, report: &StatusReport, of: Circumstances) -> Belief {
        let machine = report.machine_position.map(|position| (true, position));
        let work = report.work_position.map(|position| (false, position));
        let Some((is_machine, position)) = machine.or(work) else { return Belief::Plausible };
        let Circumstances { since, is_at_rest, .. } = of;
        let seen = Seen { is_machine, position, since, is_at_rest };
        let Some(before) = self.believed.filter(|before| before.is_machine == is_machine) else {
            self.believe(seen, false);
            return Belief::Plausible;
        };
        if can_follow(before, seen, of) {
            self.believe(seen, true);
            return Belief::Plausible;
        }
        let agrees = self.doubted.is_some_and(|doubted| can_follow(doubted, seen, of));
        if !agrees && self.doubts < DOUBTS_MAX {
            (self.doubted, self.doubts) = (Some(seen), self.doubts + 1);
            return Belief::Doubted;
        }
        let was_confirmed = std::mem::replace(&mut self.is_confirmed, agrees);
        self.believe(seen, agrees);
        let zero = Seen { position: [0.0; 3], ..before };
        let is_jump = agrees && was_confirmed && is_machine && is_in_reach(zero, seen, of);
        // A pendant may have moved the axes; to exactly zero only a restart goes.
        let fell_to_zero = before.is_at_rest && is_at_rest && position == [0.0; 3];
        match is_jump && (fell_to_zero || !is_in_reach(before, seen, of)) {
            true => Belief::Jumped { from: before.position, to: position },
            false => Belief::Plausible,
        }
    }

    fn believe(&mut self, seen: Seen, is_confirmed: bool) {
        *self = Self { believed: Some(seen), is_confirmed, doubted: None, doubts: 0 };
    }
}

/// Whether one report may come after the other without a doubt.
fn can_follow(before: Seen, seen: Seen, of: Circumstances) -> bool {
    match before.is_at_rest && seen.is_at_rest {
        true => before.position == seen.position,
        false => is_in_reach(before, seen, of),
    }
}

/// Whether the axes can have gone there in the time.
fn is_in_reach(before: Seen, seen: Seen, of: Circumstances) -> bool {
    let minutes = of.now.saturating_sub(before.since).as_secs_f64() / 60.0;
    (0..3).all(|axis| {
        let way = (seen.position[axis] - before.position[axis]).abs();
        way <= of.rates_mm_per_min[axis] * minutes + ROUNDING_MM
    })
}

/// `X-100.000 Y0.000 Z0.000`
pub(in crate::driver) fn show(place: Position) -> String {
    let words = (0..3).map(|axis| format!("{}{:.3}", AXIS_LETTERS[axis], place[axis]));
    words.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Positions on X with the time of the report, ms; at rest or not; what is made of each.
    fn check(reports: &[(u64, f64, bool, char)]) {
        let mut watch = PlaceWatch::default();
        let mut before = Duration::ZERO;
        for (index, (at_ms, x, is_at_rest, wanted)) in reports.iter().enumerate() {
            let now = Duration::from_millis(*at_ms);
            let machine_position = Some([*x, 0.0, 0.0]);
            let report = StatusReport { machine_position, ..StatusReport::default() };
            let rates_mm_per_min = [6_000.0; 3];
            // It was asked for when the last one came.
            let of =
                Circumstances { since: before, now, rates_mm_per_min, is_at_rest: *is_at_rest };
            let made = match watch.judge(&report, of) {
                Belief::Plausible => '+',
                Belief::Doubted => '?',
                Belief::Jumped { .. } => 'J',
            };
            assert_eq!(made, *wanted, "report {index} of {reports:?}");
            before = now;
        }
    }

    #[test]
    fn motion_up_to_the_fastest_is_never_doubted() {
        check(&[(0, 0.0, false, '+'), (200, 20.0, false, '+'), (400, 0.0, false, '+')]);
        // The line stalled: two come at once that were asked for at their time.
        check(&[(0, 0.0, false, '+'), (700, 40.0, false, '+'), (701, 70.0, false, '+')]);
        // A run begins and ends.
        check(&[(0, 5.0, true, '+'), (200, 24.0, false, '+'), (400, 30.0, true, '+')]);
    }

    #[test]
    fn a_digit_that_is_wrong_once_never_counts() {
        check(&[
            (0, 5.0, true, '+'),
            (200, 5.0, true, '+'),
            (400, 5.4, true, '?'),
            (410, 5.0, true, '+'),
        ]);
        check(&[
            (0, 0.0, false, '+'),
            (200, 10.0, false, '+'),
            (400, 120.0, false, '?'),
            (410, 20.0, false, '+'),
        ]);
    }

    #[test]
    fn what_two_reports_agree_on_counts() {
        // A pendant.
        check(&[
            (0, 5.0, true, '+'),
            (200, 5.0, true, '+'),
            (400, 5.1, true, '?'),
            (410, 5.1, true, '+'),
        ]);
        // Another zero.
        check(&[
            (0, 500.0, true, '+'),
            (200, 500.0, true, '+'),
            (400, 0.0, true, '?'),
            (410, 0.0, true, 'J'),
        ]);
        check(&[
            (0, 1.0, true, '+'),
            (200, 1.0, true, '+'),
            (400, 0.0, true, '?'),
            (410, 0.0, true, 'J'),
        ]);
        check(&[
            (0, 500.0, false, '+'),
            (200, 510.0, false, '+'),
            (400, 0.0, false, '?'),
            (410, 1.0, false, 'J'),
        ]);
    }

    #[test]
    fn a_first_report_that_was_damaged_is_no_jump() {
        check(&[
            (0, 900.0, true, '+'),
            (10, 5.0, true, '?'),
            (20, 5.0, true, '+'),
            (30, 5.0, true, '+'),
        ]);
    }

    #[test]
    fn reports_that_never_agree_are_taken_in_the_end() {
        check(&[
            (0, 0.0, false, '+'),
            (10, 500.0, false, '?'),
            (20, 0.0, false, '+'),
            (30, 500.0, false, '?'),
            (40, 1000.0, false, '?'),
            (50, 1500.0, false, '?'),
            (60, 2000.0, false, '+'),
        ]);
    }
}
