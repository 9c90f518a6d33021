//! What a path does with axes of which nobody knows where they are: after a probe, or a move to a
//! place of the machine.

use super::CompensatedPath;
use crate::contour::Action;
use crate::geometry::AxisSet;

/// What becomes of such axes, from an element on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnknownAxes {
    /// The elements before this one have named them all; the number of elements where they never do.
    pub until: usize,
    /// Those that are moved from wherever they are before.
    pub relative: AxisSet,
    /// Those whose place becomes the zero of a work system before another probe has moved them, and
    /// the line that does so.
    pub zeroed: Option<(u32, AxisSet)>,
}

impl CompensatedPath {
    /// The axes that the element of this index moves from wherever they are.
    pub fn relative_axes(&self, index: usize) -> AxisSet {
        let first = self.events.partition_point(|event| event.at_element < index);
        let events = self.events[first..].iter().take_while(|event| event.at_element == index);
        let axes = events.filter_map(|event| match event.action {
            Action::Relative { axes } => Some(axes),
            _ => None,
        });
        axes.fold(AxisSet::NONE, AxisSet::union)
    }

    /// Follows axes that are not known before the element of this index.
    pub fn unknown_from(&self, index: usize, axes: AxisSet) -> UnknownAxes {
        let both = |a: AxisSet, b: AxisSet| AxisSet::from_bits(a.bits() & b.bits());
        let until = self.elements.len();
        let mut found = UnknownAxes { until, relative: AxisSet::NONE, zeroed: None };
        // Those that no element has named, and those that no probe has moved either.
        let (mut left, mut unmoved) = (axes, axes);
        let first = self.events.partition_point(|event| event.at_element < index);
        let mut events = self.events[first..].iter().peekable();
        for number in index..=until {
            if left.is_empty() {
                found.until = number;
                break;
            }
            let element = self.elements.get(number).map_or(AxisSet::NONE, |it| it.axes);
            let mut relative = AxisSet::NONE;
            while let Some(event) = events.next_if(|event| event.at_element <= number) {
                match event.action {
                    Action::Relative { axes } => relative = relative.union(axes),
                    Action::Probe(_) => unmoved = unmoved.without(element),
                    Action::SetWorkOffset { by_position: true, axes, .. } => {
                        let zeroed = both(axes, unmoved);
                        if found.zeroed.is_none() && !zeroed.is_empty() {
                            found.zeroed = Some((event.source.line, zeroed));
                        }
                    }
                    _ => {}
                }
            }
            found.relative = found.relative.union(both(relative, left));
            let named = element.without(relative);
            (left, unmoved) = (left.without(named), unmoved.without(named));
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contour::{Probe, Source};
    use crate::geometry::Shape;
    use crate::path::{PathElement, PathEvent, Role};

    fn axes(letters: &str) -> AxisSet {
        AxisSet::from_letters(letters).expect("axes")
    }

    /// Words of a program, a line each: `X` is an element, `by Z`, `probe Z` and `zero XZ`.
    fn path(lines: &[&str]) -> CompensatedPath {
        let mut path = CompensatedPath::default();
        for (text, line) in lines.iter().zip(1..) {
            let source = Source { line, ..Source::default() };
            let (word, letters) = text.rsplit_once(' ').unwrap_or(("", text));
            let at_element = path.elements.len();
            let mut act = |action| path.events.push(PathEvent { at_element, action, source });
            let named = axes(letters);
            if word.contains("by") {
                act(Action::Relative { axes: named });
            }
            if word.contains("probe") {
                act(Action::Probe(Probe { away: false, may_miss: true }));
            }
            if word == "zero" {
                let (system, origin, by_position) = (1, [0.0; 3], true);
                act(Action::SetWorkOffset { system, axes: named, origin, by_position });
                continue;
            }
            path.elements.push(PathElement {
                shape: Shape::Line,
                end: [0.0; 3],
                feed_mm_per_min: Some(100.0),
                role: Role::None,
                side: None,
                axes: named,
                source,
            });
        }
        path
    }

    #[test]
    fn axes_are_followed_until_elements_have_named_them() {
        for (lines, unknown, until, relative, zeroed) in [
            (&["X", "Z", "Y"][..], "Z", 2, "", None),
            (&["X", "Y"], "Z", 2, "", None),
            (&["by Z", "X", "Z"], "Z", 3, "Z", None),
            // Known axes go along with it.
            (&["by XZ", "Z"], "Z", 2, "Z", None),
            (&["X", "zero XZ", "Z"], "Z", 2, "", Some((2, "Z"))),
            (&["Z", "zero Z"], "Z", 1, "", None),
            (&["X", "zero Z"], "Z", 1, "", Some((2, "Z"))),
            // Another probe of the axis has an end of its own; one of another axis has not.
            (&["by Z", "by probe Z", "zero Z", "Z"], "Z", 3, "Z", None),
            (&["by Z", "probe X", "zero XZ", "Z"], "Z", 3, "Z", Some((3, "Z"))),
            (&["probe Z", "zero Z"], "Z", 1, "", None),
            (&["X", "zero XZ", "Z"], "XZ", 2, "", Some((2, "Z"))),
            (&[], "XYZ", 0, "", None),
            (&["X"], "", 0, "", None),
        ] {
            let found = path(lines).unknown_from(0, axes(unknown));
            let zeroed = zeroed.map(|(line, letters)| (line, axes(letters)));
            let wanted = UnknownAxes { until, relative: axes(relative), zeroed };
            assert_eq!(found, wanted, "{lines:?} {unknown}");
        }
    }
}
