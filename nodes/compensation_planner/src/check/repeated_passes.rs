//! Leaves out what a contour repeats again and again: roughing in steps of Z cuts it a hundred
//! times in one selection.
//!
//! What bounds a radius on the third of a hundred equal passes bounds it on the second too. The
//! first two and the last one are kept, with what leads to them and away.

use crate::geometry::element::{Element, Vec2};
use crate::span::{Run, Span};
use std::borrow::Cow;

/// Equal passes in a row that are kept.
const KEPT: usize = 3;

/// The runs of a span, without most of their repetitions.
pub(crate) fn without_repetitions<'a>(span: &Span<'_>, runs: &'a [Run]) -> Cow<'a, [Run]> {
    let joint = |run: &Run| (run.d_in_mm, run.d_out_mm, span.legs[run.legs.start].corner);
    without_repetitions_of(runs, |a, b| a.element == b.element && joint(a) == joint(b))
}

fn without_repetitions_of(runs: &[Run], is_same: impl Fn(&Run, &Run) -> bool) -> Cow<'_, [Run]> {
    let next = next_copies(runs, is_same);
    let mut kept: Vec<Run> = Vec::new();
    // What is kept so far ends before this run.
    let mut from = 0;
    let mut index = 0;
    while index < runs.len() {
        let Some(period) = next[index].map(|next| next - index) else {
            index += 1;
            continue;
        };
        let equal = (index..).take_while(|run| next.get(*run) == Some(&Some(run + period))).count();
        let end = index + equal + period;
        let left_out = ((end - index) / period).saturating_sub(KEPT) * period;
        if left_out > 0 {
            let gap = index + (KEPT - 1) * period;
            kept.extend_from_slice(&runs[from..gap]);
            from = gap + left_out;
        }
        index += equal;
    }
    if from == 0 {
        return Cow::Borrowed(runs);
    }
    kept.extend_from_slice(&runs[from..]);
    Cow::Owned(kept)
}

/// For each run the next one on the same line or arc, if it is the same.
fn next_copies(runs: &[Run], is_same: impl Fn(&Run, &Run) -> bool) -> Vec<Option<usize>> {
    let mut order: Vec<([u64; 7], usize)> =
        runs.iter().map(|run| key(&run.element)).zip(0..).collect();
    order.sort_unstable();
    let mut next = vec![None; runs.len()];
    for pair in order.windows(2) {
        let [(key, run), (later_key, later)] = [pair[0], pair[1]];
        next[run] = (key == later_key && is_same(&runs[run], &runs[later])).then_some(later);
    }
    next
}

/// Equal for equal elements.
fn key(element: &Element) -> [u64; 7] {
    let (center, sweep) = match element {
        Element::Line(_) => (Vec2::zeros(), 0.0),
        Element::Arc(arc) => (arc.center, arc.sweep * arc.turn),
    };
    let [start, end] = [element.start(), element.end()];
    // Zero has two signs.
    [start.x, start.y, end.x, end.y, center.x, center.y, sweep].map(|value| (value + 0.0).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs between the points of these letters, with a radius each, mm.
    fn runs(letters: &str) -> Vec<Run> {
        let point = |letter: u8| {
            let number = f64::from(letter);
            Vec2::new(number.sin(), number.cos()) * 40.0
        };
        (letters.as_bytes().windows(2).enumerate())
            .map(|(index, ends)| Run {
                element: Element::line(point(ends[0]), point(ends[1])).expect("two points"),
                legs: index..index + 1,
                d_in_mm: 5.0,
                d_out_mm: 5.0,
            })
            .collect()
    }

    /// What is kept, as the letters at the starts of the runs and the last end.
    fn kept(letters: &str, is_same: impl Fn(&Run, &Run) -> bool) -> String {
        let runs = runs(letters);
        let kept = without_repetitions_of(&runs, is_same);
        let starts = kept.iter().map(|run| letters.as_bytes()[run.legs.start] as char);
        starts.chain(letters.chars().last()).collect()
    }

    #[test]
    fn of_a_pass_that_repeats_the_first_two_and_the_last_are_kept() {
        let geometry = |a: &Run, b: &Run| a.element == b.element;
        for (letters, expected) in [
            ("xabcabcabcabcabcay", "xabcabcabcay"),
            ("abcabcabca", "abcabcabca"),
            ("xabababababcdcdcdcdcdcy", "xababababcdcdcdcy"),
            ("abcdefgh", "abcdefgh"),
            // Two loops from one point.
            ("pabpcdpabpcdpabpcdpabpcdpabpcdp", "pabpcdpabpcdpabpcdp"),
            // A pass that is left out of the row ends the row.
            ("abcabcabcaqabcabcabcabca", "abcabcabcaqabcabcabca"),
        ] {
            assert_eq!(kept(letters, geometry), expected, "{letters}");
        }
        assert_eq!(kept("abababababab", |_, _| false), "abababababab");
    }
}
