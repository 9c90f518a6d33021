//! Leaves out what a contour repeats again and again: roughing in steps of Z cuts it a hundred
//! times in one selection.
//!
//! What bounds a radius on the third of a hundred equal passes bounds it on the second too. The
//! first two and the last one are kept, with what leads to them and away.

use crate::span::{Run, Span};
use std::borrow::Cow;

/// Equal passes in a row that are kept.
const KEPT: usize = 3;

/// The runs of a span, without most of their repetitions.
pub(crate) fn without_repetitions<'a>(span: &Span<'_>, runs: &'a [Run]) -> Cow<'a, [Run]> {
    let next = next_copies(span, runs);
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

/// For each run the next one that is the same, bit for bit.
fn next_copies(span: &Span<'_>, runs: &[Run]) -> Vec<Option<usize>> {
    let start = |run: usize| runs[run].element.start().map(f64::to_bits);
    let mut order: Vec<([u64; 2], usize)> =
        (0..runs.len()).map(|run| (start(run).into(), run)).collect();
    order.sort_unstable();
    let corner = |run: &Run| span.legs[run.legs.start].corner;
    let is_same = |a: &Run, b: &Run| {
        (a.element, a.d_in_mm, a.d_out_mm, corner(a))
            == (b.element, b.d_in_mm, b.d_out_mm, corner(b))
    };
    let mut next = vec![None; runs.len()];
    for pair in order.windows(2) {
        let [(_, run), (_, later)] = [pair[0], pair[1]];
        next[run] = (pair[0].0 == pair[1].0 && is_same(&runs[run], &runs[later])).then_some(later);
    }
    next
}
