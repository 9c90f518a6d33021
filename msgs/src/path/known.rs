//! Where a path has left X, Y and Z.

use super::CompensatedPath;
use crate::contour::Action;
use crate::geometry::AxisSet;

const Z: AxisSet = AxisSet::from_bits(0b100);

/// What the program has said of the place where an element begins.
#[derive(Debug)]
pub struct KnownPlace {
    /// Axes that it has left somewhere else, or in another frame, since...
    pub unknown: AxisSet,
    /// ...this word.
    pub since: String,
    /// Axes that it has never named: they stay where they are.
    pub untouched: AxisSet,
}

impl Default for KnownPlace {
    fn default() -> Self {
        let since = "the beginning of the program".into();
        Self { unknown: AxisSet::NONE, since, untouched: AxisSet::NONE }
    }
}

impl CompensatedPath {
    /// Follows elements and events up to an element and so many events.
    pub fn known_place(&self, index: usize, events: usize) -> KnownPlace {
        let untouched = AxisSet::ALL.without(self.assumed_axes);
        let mut place = KnownPlace { untouched, ..KnownPlace::default() };
        let mut next_event = 0;
        let mut probe = None;
        for (number, element) in self.elements.iter().enumerate().take(index + 1) {
            while let Some(event) = self.events[..events].get(next_event)
                && event.at_element <= number
            {
                next_event += 1;
                place.follow(&event.action);
                if let Action::Probe(it) = event.action {
                    probe = Some(it);
                }
            }
            if number < index {
                let start = self.start_of(number);
                let moved = (0..3).filter(|&axis| element.end[axis] != start[axis]);
                let given = moved.fold(element.axes, AxisSet::with);
                let given = given.without(self.relative_axes(number));
                place.unknown = place.unknown.without(given);
                place.untouched = place.untouched.without(given);
                if let Some(probe) = probe.take() {
                    place.unknown = place.unknown.union(given);
                    place.since = probe.word().to_owned();
                }
            }
        }
        place
    }
}

impl KnownPlace {
    /// The axes whose place the path says.
    pub fn known(&self) -> AxisSet {
        AxisSet::ALL.without(self.unknown.union(self.untouched))
    }

    /// Takes what moves the axes, or their frame, otherwise.
    fn follow(&mut self, action: &Action) {
        let all_if_none = |axes: AxisSet| if axes.is_empty() { AxisSet::ALL } else { axes };
        let moved = match action {
            Action::MachineMove { axes, .. } | Action::SetWorkOffset { axes, .. } => *axes,
            Action::Reference { axes, .. } | Action::Home { axes } => all_if_none(*axes),
            // What was never named is where it is in every frame.
            Action::WorkOffset { .. } => AxisSet::ALL.without(self.untouched),
            Action::ToolLength { .. } => Z.without(self.untouched),
            _ => return,
        };
        if !moved.is_empty() {
            self.unknown = self.unknown.union(moved);
            self.untouched = self.untouched.without(moved);
            self.since = action.text();
        }
    }
}
