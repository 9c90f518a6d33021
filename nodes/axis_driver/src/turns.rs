//! Which line that turns A to W alone is under way, between two elements.
//!
//! X, Y and Z stand meanwhile, so the tracker of elements does not see it. Which of the lines that were
//! sent is under way is decided by the reported place of the axes; progress never goes back.

use cnc_msgs::contour::{Action, Source};
use cnc_msgs::further::{FurtherAxes, FurtherMode};
use cnc_msgs::path::CompensatedPath;

/// A place counts as on the way of a line within this, degrees or mm: steps, and three decimals.
const ON_WAY: f64 = 0.02;

/// Follows such lines.
#[derive(Debug, Clone)]
pub struct Turns {
    /// The element that they come before.
    gap: usize,
    /// The event that is followed next, and where the path has the axes before it.
    next: usize,
    at: FurtherAxes,
    turn: Option<Turn>,
    /// Events before this one have been sent and answered, or are being read.
    answered: usize,
}

/// The line that is under way.
#[derive(Debug, Clone, Copy)]
struct Turn {
    event: usize,
    from: FurtherAxes,
    to: FurtherAxes,
    /// 0 to 1.
    part: f64,
}

impl Turns {
    /// The run begins with this event; the axes stand where the path has them before it.
    pub fn new(first_event: usize, at: FurtherAxes) -> Self {
        Self { gap: 0, next: first_event, at, turn: None, answered: first_event }
    }

    /// The event of the line that is under way, and the part of it that is done.
    pub fn under_way(&self) -> Option<(usize, f64)> {
        self.turn.map(|turn| (turn.event, turn.part))
    }

    /// The block of that line.
    pub fn source(&self, path: &CompensatedPath) -> Option<Source> {
        Some(path.events.get(self.turn?.event)?.source)
    }

    /// A line of the program was answered: so many events are before it, its own included.
    pub fn on_answer(&mut self, events: usize) {
        self.answered = self.answered.max(events);
    }

    /// Takes the reported places. All elements before `gap` have been cut and that one has not begun;
    /// `None`: an element is being cut. `oldest`: the events before the oldest unanswered line.
    pub fn on_places(
        &mut self,
        path: &CompensatedPath,
        gap: Option<usize>,
        places: FurtherAxes,
        oldest: Option<usize>,
    ) {
        let Some(gap) = gap else {
            self.turn = None;
            return;
        };
        if gap != self.gap {
            (self.gap, self.turn) = (gap, None);
        }
        let sent = self.answered.max(oldest.unwrap_or(0));
        if self.turn.is_none() {
            self.turn = self.take_next(path, gap, sent);
        }
        let before = self.clone();
        while let Some(turn) = &mut self.turn
            && !turn.is_on_its_way(places)
        {
            match self.take_next(path, gap, sent) {
                Some(turn) => self.turn = Some(turn),
                None => {
                    // On the way of none that was sent: what comes later may not have been cut.
                    *self = before;
                    return;
                }
            }
        }
    }

    /// All that was answered is done.
    pub fn on_all_done(&mut self, path: &CompensatedPath, gap: usize) {
        let sent = self.answered;
        self.turn = self.turn.filter(|_| self.gap == gap);
        self.gap = gap;
        while let Some(turn) = self.take_next(path, gap, sent) {
            self.turn = Some(turn);
        }
        if let Some(turn) = &mut self.turn {
            turn.part = 1.0;
        }
    }

    /// The next line of this gap that was sent.
    fn take_next(&mut self, path: &CompensatedPath, gap: usize, sent: usize) -> Option<Turn> {
        while let Some(event) = path.events[..sent.min(path.events.len())].get(self.next)
            && event.at_element <= gap
        {
            let (index, from) = (self.next, self.at);
            self.next += 1;
            match event.action {
                Action::Further(further) if path.further_owner(index).is_some() => {
                    self.at = from.without_all(further.axes);
                }
                Action::Further(further) => {
                    self.at = further.axes.or(from);
                    if further.mode != FurtherMode::Along && event.at_element == gap {
                        return Some(Turn { event: index, from, to: further.axes, part: 0.0 });
                    }
                }
                action if action.loses_further() => self.at = FurtherAxes::NONE,
                _ => {}
            }
        }
        None
    }
}

impl Turn {
    /// Whether the axes are on the way of this line, and not back before its part that is done. Where
    /// they come from, or where they are, may not be known: then it is as long as it is not at its end.
    fn is_on_its_way(&mut self, places: FurtherAxes) -> bool {
        let (mut done, mut whole, mut off) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut is_known = false;
        for (axis, to) in self.to.iter() {
            let Some(at) = places.get(axis) else { continue };
            is_known = true;
            // The first report says where an axis begins that the path has not named.
            let from = self.from.get(axis).unwrap_or(at);
            self.from = self.from.with(axis, from);
            let way = to - from;
            (done, whole) = (done + (at - from) * way, whole + way * way);
        }
        if !is_known {
            return true;
        }
        let part = if whole > 0.0 { (done / whole).clamp(0.0, 1.0) } else { 1.0 };
        for (axis, to) in self.to.iter() {
            let (Some(at), Some(from)) = (places.get(axis), self.from.get(axis)) else { continue };
            off = off.hypot(at - from - (to - from) * part);
        }
        let fell_back = (self.part - part) * whole.sqrt() > ON_WAY;
        let is_on_it = off <= ON_WAY && !fell_back;
        if is_on_it {
            self.part = self.part.max(part);
        }
        is_on_it
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::further::FurtherMove;
    use cnc_msgs::path::PathEvent;

    /// A line a target of A, all of them before the first element, from A0.
    fn path(targets: &[f64]) -> CompensatedPath {
        let event = |(a, line): (&f64, u32)| PathEvent {
            at_element: 0,
            action: Action::Further(FurtherMove {
                axes: FurtherAxes::NONE.with(0, *a),
                mode: FurtherMode::Feed(3600.0),
            }),
            source: Source { line, ..Source::default() },
        };
        let events = targets.iter().zip(1..).map(event).collect();
        CompensatedPath { events, ..CompensatedPath::default() }
    }

    #[test]
    fn the_places_of_the_axes_decide_which_line_turns_them() {
        let a = |place: f64| FurtherAxes::NONE.with(0, place);
        for (targets, reports) in [
            // Forth, on, and back over both.
            (
                &[360.0, 720.0, 0.0][..],
                &[(0.0, 1), (226.0, 1), (360.0, 1), (457.0, 2), (720.0, 2), (500.0, 3)][..],
            ),
            // There and back between two reports.
            (&[90.0, 0.0, 90.0], &[(10.0, 1), (80.0, 1), (60.0, 2), (30.0, 2), (40.0, 3)]),
            // A line that turns nothing, and reports that come late.
            (&[0.0, 90.0, 180.0], &[(0.0, 1), (100.0, 3), (180.0, 3)]),
            // A board that counts within one turn: the later lines are not known to be cut.
            (&[400.0, 500.0], &[(350.0, 1), (20.0, 1), (90.0, 1)]),
        ] {
            let path = path(targets);
            let mut turns = Turns::new(0, a(0.0));
            turns.on_answer(path.events.len());
            for (place, line) in reports {
                turns.on_places(&path, Some(0), a(*place), None);
                let source = turns.source(&path).map(|source| source.line);
                assert_eq!(source, Some(*line), "{targets:?} at A{place}");
            }
        }
    }

    #[test]
    fn no_line_is_under_way_that_was_not_sent() {
        let a = |place: f64| FurtherAxes::NONE.with(0, place);
        let path = path(&[90.0, 180.0]);
        let mut turns = Turns::new(0, a(0.0));
        let line = |turns: &Turns| turns.source(&path).map(|source| source.line);
        turns.on_places(&path, Some(0), a(0.0), None);
        assert_eq!(line(&turns), None);
        turns.on_places(&path, Some(0), a(45.0), Some(1));
        assert_eq!((line(&turns), turns.under_way()), (Some(1), Some((0, 0.5))));
        // It waits at the end of the last one.
        turns.on_places(&path, Some(0), a(100.0), Some(1));
        assert_eq!(line(&turns), Some(1));
        // Without a place it is the first that was sent.
        let mut turns = Turns::new(0, FurtherAxes::NONE);
        turns.on_answer(2);
        turns.on_places(&path, Some(0), FurtherAxes::NONE, None);
        assert_eq!(line(&turns), Some(1));
        turns.on_all_done(&path, 0);
        assert_eq!((line(&turns), turns.under_way()), (Some(2), Some((1, 1.0))));
        // An element is being cut.
        turns.on_places(&path, None, a(180.0), None);
        assert_eq!(line(&turns), None);
    }
}
