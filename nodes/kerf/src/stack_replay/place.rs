//! Where the stack was when a command came, and when it is there again.
//!
//! Never by the clock: a moving machine is at a place on its path, after a number of answered
//! lines; a standing machine is in a state. Pure.

use super::track::Track;
use std::sync::Arc;

/// A machine position, mm.
pub(super) type Position = [f64; 3];

/// Within this distance a machine is at a place, mm: some steps of a motor.
const THERE_MM: f64 = 0.02;
/// A machine that comes within this distance and moves away again was at the place, mm: the
/// recording has three decimals, and another controller brakes a little differently.
pub(super) const NEAR_MM: f64 = 0.5;
/// Answers may be in transit when a command is given: this many fewer are enough.
pub(super) const SLACK_ANSWERS: u64 = 2;

/// A place of a moving machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum WatchPlace {
    /// The machine stops here when it is held now.
    StopsAt(Position),
    /// The machine passes here.
    Passes(Position),
}

/// The place at which the gate waits for a moving machine.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Watch {
    pub(super) place: WatchPlace,
    /// The path that it is on.
    pub(super) track: Arc<Track>,
    /// Distance of the place along the path, mm; `None`: the place is, or the machine was, off the
    /// path.
    pub(super) along_mm: Option<f64>,
    /// Lines that were answered since the goal.
    pub(super) answers: u64,
    /// The driver's state, as in `MachineState`.
    pub(super) state: u8,
}

impl Watch {
    /// Whether a machine at this distance along the path has come far enough.
    pub(super) fn is_far_enough(&self, along_mm: Option<f64>) -> Option<bool> {
        Some(along_mm? >= self.along_mm? - THERE_MM)
    }

    /// Whether enough lines were answered, for a machine off its path.
    pub(super) fn is_answered(&self, answers: u64) -> bool {
        answers + SLACK_ANSWERS >= self.answers
    }
}

/// A machine that stands and waits for a command.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stand {
    /// As in `MachineState`.
    pub(super) state: u8,
    pub(super) tool_wanted: u32,
    /// Lines that were answered since the goal.
    pub(super) answers: u64,
    /// Paths that were run since the goal; each change while it stood adds one.
    pub(super) paths: usize,
}

impl Stand {
    /// Whether the stack has reached the same state again.
    pub(super) fn is_reached(&self, seen: &Self, speed_mm_per_min: f64) -> bool {
        // Older bags have no tool.
        let is_tool = self.tool_wanted == 0 || seen.tool_wanted == self.tool_wanted;
        seen.state == self.state
            && seen.paths >= self.paths
            && is_tool
            && seen.answers >= self.answers
            && speed_mm_per_min <= 0.0
    }
}

/// Detects the nearest approach to a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Approach {
    nearest_mm: f64,
}

impl Default for Approach {
    fn default() -> Self {
        Self { nearest_mm: f64::INFINITY }
    }
}

impl Approach {
    /// Takes the next distance; returns whether this is the place.
    pub(super) fn is_there(&mut self, apart_mm: f64) -> bool {
        let goes_away = apart_mm > self.nearest_mm && self.nearest_mm <= NEAR_MM;
        self.nearest_mm = self.nearest_mm.min(apart_mm);
        apart_mm <= THERE_MM || goes_away
    }
}

pub(super) fn distance_mm(a: Position, b: Position) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_reached_at_the_nearest_approach() {
        for (name, distances, there_at) in [
            ("it gets exactly there", &[3.0, 1.0, 0.01, 1.0][..], Some(2)),
            ("it passes", &[3.0, 0.3, 0.1, 0.2], Some(3)),
            ("it starts there and moves away", &[0.4, 0.5], Some(1)),
            ("it never comes near", &[3.0, 0.6, 0.7, 3.0], None),
            ("it stands near by", &[0.3, 0.3, 0.3], None),
            ("NaN is never a place", &[f64::NAN, f64::NAN], None),
        ] {
            let mut approach = Approach::default();
            let found = distances.iter().position(|&apart| approach.is_there(apart));
            assert_eq!(found, there_at, "{name}");
        }
    }

    #[test]
    fn a_machine_is_far_enough_by_its_distance_or_else_by_its_answers() {
        let watch = |along_mm| Watch {
            place: WatchPlace::Passes([0.0; 3]),
            track: Arc::default(),
            along_mm,
            answers: 9,
            state: 3,
        };
        for (name, wanted, along, is_far_enough) in [
            ("as far", Some(30.0), Some(30.0), Some(true)),
            ("less the steps of a motor", Some(30.0), Some(29.99), Some(true)),
            ("on its way", Some(30.0), Some(29.0), Some(false)),
            ("not on its path", Some(30.0), None, None),
            ("it was not on its path then", None, Some(30.0), None),
        ] {
            assert_eq!(watch(wanted).is_far_enough(along), is_far_enough, "{name}");
        }
        for (answers, is_answered) in [(6, false), (7, true), (9, true), (12, true)] {
            assert_eq!(watch(None).is_answered(answers), is_answered, "{answers}");
        }
    }

    #[test]
    fn a_standing_machine_is_recognised_by_state_lines_and_rest() {
        let wanted = Stand { state: 11, tool_wanted: 2, answers: 9, paths: 1 };
        let seen = |change: fn(&mut Stand)| {
            let mut seen = wanted.clone();
            change(&mut seen);
            seen
        };
        for (name, seen, speed, is_reached) in [
            ("as it was", seen(|_| ()), 0.0, true),
            ("more answers have come", seen(|it| it.answers = 12), 0.0, true),
            ("too early", seen(|it| it.answers = 8), 0.0, false),
            ("another state", seen(|it| it.state = 4), 0.0, false),
            ("another tool", seen(|it| it.tool_wanted = 1), 0.0, false),
            ("the rest is not planned yet", seen(|it| it.paths = 0), 0.0, false),
            ("it brakes", seen(|_| ()), 10.0, false),
        ] {
            assert_eq!(wanted.is_reached(&seen, speed), is_reached, "{name}");
        }
        let any_tool = Stand { tool_wanted: 0, ..wanted.clone() };
        assert!(any_tool.is_reached(&wanted, 0.0), "a bag without the tool");
    }
}
