//! How far along its path a machine is.
//!
//! A position alone is not enough: a slot passes the same point again and again, and a controller
//! has many lines in its planner. So positions are followed along the path, never backwards. Pure.

use super::place::{Position, distance_mm};
use cnc_msgs::path::CompensatedPath;
use compensation_planner::tessellate;

/// Chord error of arcs, mm.
const CHORD_ERROR_MM: f64 = 0.01;
/// A machine within this distance is on its path, mm: chords, steps, three decimals.
const ON_IT_MM: f64 = 0.05;
/// No machine moves farther between two reports, mm.
pub(super) const REPORT_MM: f64 = 2_000.0;
/// Nor along more chords than this; it limits the search on a path of a million elements.
const SEARCH_CHORDS: usize = 20_000;

/// The path as chords in the machine frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Track {
    points: Vec<Position>,
    /// Length of the path up to each of them, mm.
    lengths: Vec<f64>,
    /// The source line of the chord that starts there.
    lines: Vec<u32>,
}

impl Track {
    /// The track from `start` (machine frame) along a path; machine position = work position +
    /// `offset`.
    pub(super) fn new(start: Position, path: &CompensatedPath, offset: Position) -> Self {
        let mut points = vec![start];
        let mut lines = Vec::new();
        let mut from = path.start;
        for element in &path.elements {
            tessellate::points(from, element, CHORD_ERROR_MM, |work| {
                points.push([0, 1, 2].map(|axis| work[axis] + offset[axis]));
                lines.push(element.source.line);
            });
            from = element.end;
        }
        Self::through(points, lines)
    }

    /// The track along these points, with the source line of each chord.
    pub(super) fn through(points: Vec<Position>, lines: Vec<u32>) -> Self {
        let mut lengths = Vec::with_capacity(points.len());
        let mut length = 0.0;
        lengths.push(length);
        for pair in points.windows(2) {
            length += distance_mm(pair[0], pair[1]);
            lengths.push(length);
        }
        Self { points, lengths, lines }
    }

    /// The first place from `from_mm` on that is at `position`, mm from the start; at most
    /// `within_mm` farther. A place on `line` is preferred to an earlier one: a machine may pass
    /// twice between two reports, and the driver knows the line.
    pub(super) fn follow(
        &self,
        from_mm: f64,
        position: Position,
        within_mm: f64,
        line: Option<u32>,
    ) -> Option<f64> {
        let first = self.lengths.partition_point(|length| *length <= from_mm).saturating_sub(1);
        let chords = self.points.windows(2).zip(&self.lengths).zip(&self.lines);
        let mut found = None;
        for ((chord, &length), &of) in chords.skip(first).take(SEARCH_CHORDS) {
            if length > from_mm + within_mm {
                break;
            }
            let least = (from_mm - length).max(0.0);
            if let Some(along) = nearest_from(chord[0], chord[1], position, least) {
                if line.is_none_or(|line| line == of) {
                    return Some(length + along);
                }
                found = found.or(Some(length + along));
            }
        }
        found
    }
}

/// The distance of a position along a chord, at least `least`; `None`: it is off the chord.
fn nearest_from(from: Position, to: Position, position: Position, least: f64) -> Option<f64> {
    let length = distance_mm(from, to);
    let along = match length {
        length if length > 0.0 => {
            let dot: f64 =
                (0..3).map(|axis| (to[axis] - from[axis]) * (position[axis] - from[axis])).sum();
            (dot / length).clamp(0.0, length).max(least.min(length))
        }
        _ => 0.0,
    };
    let share = if length > 0.0 { along / length } else { 0.0 };
    let there = [0, 1, 2].map(|axis| from[axis] + (to[axis] - from[axis]) * share);
    (distance_mm(there, position) <= ON_IT_MM).then_some(along)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Back and forth between X0 and X100, twice.
    fn slot() -> Track {
        let points = [0.0, 100.0, 0.0, 100.0, 0.0].map(|x| [x, 0.0, 5.0]).to_vec();
        Track::through(points, vec![4, 5, 6, 7])
    }

    #[test]
    fn a_machine_that_passes_again_is_farther_along() {
        let track = slot();
        let mut at_mm = 0.0;
        for (x, along_mm) in [
            (30.0, Some(30.0)),
            (99.0, Some(99.0)),
            (99.5, Some(99.5)),
            (70.0, Some(130.0)),
            (70.0, Some(130.0)),
            (1.0, Some(199.0)),
            (70.0, Some(270.0)),
            (70.5, Some(270.5)),
            (70.0, Some(330.0)),
            (0.0, Some(400.0)),
            (10.0, None),
        ] {
            let found = track.follow(at_mm, [x, 0.0, 5.0], REPORT_MM, None);
            assert_eq!(found.map(f64::round), along_mm.map(f64::round), "X{x} from {at_mm}");
            at_mm = found.unwrap_or(at_mm);
        }
        assert_eq!(track.follow(0.0, [30.0, 0.5, 5.0], REPORT_MM, None), None, "off the path");
        assert_eq!(track.follow(130.0, [30.0, 0.0, 5.0], 2.0, None), Some(170.0), "the same chord");
        assert_eq!(track.follow(180.0, [30.0, 0.0, 5.0], 2.0, None), None, "too far");
        assert_eq!(track.follow(f64::NAN, [f64::NAN; 3], f64::NAN, None), None);
    }

    #[test]
    fn the_line_decides_which_passage_it_is() {
        let track = slot();
        for (from_mm, line, along_mm) in [
            (20.0, Some(4), Some(90.0)),
            (20.0, Some(5), Some(110.0)),
            (20.0, Some(7), Some(310.0)),
            // A line that does not pass there does not help.
            (20.0, Some(99), Some(90.0)),
            (105.0, Some(4), Some(110.0)),
        ] {
            let found = track.follow(from_mm, [90.0, 0.0, 5.0], REPORT_MM, line);
            assert_eq!(found.map(f64::round), along_mm, "line {line:?} from {from_mm}");
        }
    }

    #[test]
    fn a_path_without_elements_has_no_places() {
        let track = Track::new([1.0; 3], &CompensatedPath::default(), [0.0; 3]);
        assert_eq!(track.follow(0.0, [1.0; 3], 1.0, None), None);
        assert_eq!(Track::default().follow(0.0, [0.0; 3], 1.0, None), None);
    }
}
