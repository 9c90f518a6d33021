//! Where a path has left the axes A, B, C, U, V and W.

use super::CompensatedPath;
use crate::contour::Action;
use crate::further::{FurtherAxes, FurtherMode, FurtherMove};

/// The further axes at one place of a path. An axis that no event has named yet is in neither set: it
/// stays where it stands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FurtherPlace {
    /// In the work frame in force.
    pub at: FurtherAxes,
    /// Those that are somewhere else, or in another frame, since...
    pub lost: FurtherAxes,
    /// ...this word.
    pub since: String,
}

impl FurtherPlace {
    fn lose(&mut self, axes: FurtherAxes, action: &Action) {
        if !axes.is_empty() {
            self.lost = axes.or(self.lost);
            self.at = self.at.without_all(axes);
            self.since = action.text();
        }
    }

    fn arrive(&mut self, axes: FurtherAxes) {
        self.at = axes.or(self.at);
        self.lost = self.lost.without_all(axes);
    }
}

impl CompensatedPath {
    /// Where the first so many events have left the further axes.
    pub fn further_after(&self, events: usize) -> FurtherPlace {
        let mut place = FurtherPlace::default();
        for (index, event) in self.events[..events].iter().enumerate() {
            match event.action {
                Action::Further(FurtherMove { axes, .. }) => match self.further_owner(index) {
                    // It says them in another frame, or moves the frame.
                    Some(owner) => place.lose(axes, &owner),
                    None => place.arrive(axes),
                },
                action if action.loses_further() => place.lose(place.at, &action),
                _ => {}
            }
        }
        place
    }

    /// The function of the same block that the further axes of an event belong to; `None`: they move.
    pub fn further_owner(&self, index: usize) -> Option<Action> {
        let (event, next) = (self.events.get(index)?, self.events.get(index + 1)?);
        let along =
            matches!(event.action, Action::Further(FurtherMove { mode: FurtherMode::Along, .. }));
        let owns = next.action.takes_further() && next.source == event.source;
        (along && owns).then_some(next.action)
    }

    /// The further axes that events from this one on give in the work frame, up to an element and along
    /// with it.
    pub fn further_given(&self, event: usize, element: usize) -> FurtherAxes {
        let next = self.events.iter().enumerate().skip(event);
        let next = next.take_while(|(_, event)| event.at_element <= element);
        next.fold(FurtherAxes::NONE, |given, (index, event)| match event.action {
            Action::Further(FurtherMove { axes, .. }) if self.further_owner(index).is_none() => {
                axes.or(given)
            }
            _ => given,
        })
    }

    /// The further axes that move, in any frame.
    pub fn further_moved(&self) -> FurtherAxes {
        let all = self.events.iter().enumerate();
        all.fold(FurtherAxes::NONE, |moved, (index, event)| match event.action {
            Action::Further(FurtherMove { axes, .. })
                if !matches!(self.further_owner(index), Some(Action::SetWorkOffset { .. })) =>
            {
                axes.or(moved)
            }
            _ => moved,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contour::Source;
    use crate::geometry::AxisSet;
    use crate::path::PathEvent;

    /// A block a word: `A90` and `G0A90` move, `G53A0`, `G28A0` and `G10A0` are functions with an axis, `G55`
    /// and `$H` have none.
    fn path(words: &[&str]) -> CompensatedPath {
        let mut path = CompensatedPath::default();
        for (word, line) in words.iter().zip(1..) {
            let source = Source { line, ..Source::default() };
            let mut act = |action| path.events.push(PathEvent { at_element: 0, action, source });
            let (function, value) = word.split_once('A').unwrap_or((word, ""));
            let mode = if function == "G0" { FurtherMode::Rapid } else { FurtherMode::Along };
            if let Ok(value) = value.parse() {
                let axes = FurtherAxes::NONE.with(0, value);
                act(Action::Further(FurtherMove { axes, mode }));
            }
            let (axes, target, origin) = (AxisSet::NONE, [0.0; 3], [0.0; 3]);
            match function {
                "G53" => {
                    let (rapid, feed_mm_per_min) = (true, 0.0);
                    act(Action::MachineMove { target, axes, rapid, feed_mm_per_min });
                }
                "G28" => act(Action::Reference { axes, second: false }),
                "G10" => {
                    let (system, by_position) = (1, false);
                    act(Action::SetWorkOffset { system, axes, origin, by_position });
                }
                "G55" => act(Action::WorkOffset { system: 2 }),
                "$H" => act(Action::Home { axes }),
                "$HX" => act(Action::Home { axes: AxisSet::NONE.with(0) }),
                _ => {}
            }
        }
        path
    }

    #[test]
    fn an_axis_is_where_the_last_word_has_taken_it_or_lost_since_a_function() {
        for (words, at, lost, since) in [
            (&[][..], "", "", ""),
            (&["G55"], "", "", ""),
            (&["A90"], " A90", "", ""),
            (&["G0A90", "A-20"], " A-20", "", ""),
            (&["A90", "G55"], "", "A", "G55"),
            (&["A90", "G55", "A5"], " A5", "", "G55"),
            (&["G55", "A5"], " A5", "", ""),
            (&["A90", "G53A0"], "", "A", "G53"),
            (&["A90", "G53"], " A90", "", ""),
            (&["A90", "G28A0"], "", "A", "G28"),
            (&["A90", "G10A0"], "", "A", "G10"),
            (&["A90", "$H"], "", "A", "Home"),
            (&["A90", "$HX"], " A90", "", ""),
            (&["$H"], "", "", ""),
        ] {
            let path = path(words);
            let place = path.further_after(path.events.len());
            let shown = (place.at.words(), place.lost.letters());
            assert_eq!((shown.0.as_str(), shown.1.as_str()), (at, lost), "{words:?}");
            assert!(place.since.starts_with(since), "{words:?}: {}", place.since);
        }
    }

    #[test]
    fn the_axes_that_come_next_are_those_of_the_work_frame() {
        let path = path(&["A1", "G53A2", "A3"]);
        for (event, given) in [(0, " A3"), (1, " A3"), (3, " A3"), (4, "")] {
            assert_eq!(path.further_given(event, 0).words(), given, "{event}");
        }
    }

    #[test]
    fn an_axis_moves_in_the_frame_of_the_machine_too() {
        for (word, moved) in
            [("A1", true), ("G0A1", true), ("G53A1", true), ("G28A1", true), ("G10A1", false)]
        {
            assert_eq!(!path(&[word]).further_moved().is_empty(), moved, "{word}");
        }
    }
}
