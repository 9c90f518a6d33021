//! Which time a program with calls and loops runs a line.

use crate::calls::Calls;
use crate::contour::Source;

/// One of the times that a line is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunOfLine {
    line: u32,
    row: u32,
    /// The line is that of the row: what is meant is everything in this call or pass.
    is_whole_row: bool,
}

impl RunOfLine {
    /// Whether what is of this place belongs to it.
    pub fn has(&self, source: Source, calls: &Calls) -> bool {
        match self.is_whole_row {
            true => calls.around(source.call).any(|(row, _)| row == self.row),
            false => source.line == self.line && source.call == self.row,
        }
    }

    /// The row of the table of calls that distinguishes it from the other times; 0 in the main program.
    pub fn row(&self) -> u32 {
        self.row
    }
}

/// The first element and the first event that are not before a place of a path. In the order of the path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    pub(super) element: u32,
    pub(super) event: u32,
}

/// What is never run begins after everything.
const NEVER: Place = Place { element: u32::MAX, event: u32::MAX };

/// The line that a start at `line` begins with, which is that line or the next one that does
/// something, and all times that it is run, in order, each with its beginning. `sources` is everything in the
/// path, in order.
///
/// One pass over the path and one over the table: the thread that feeds the controller does this.
pub(super) fn runs_from(
    line: u32,
    sources: impl Iterator<Item = (Place, Source)>,
    calls: &Calls,
) -> Option<(u32, Vec<(RunOfLine, Place)>)> {
    let rows = calls.rows();
    // Where each row begins, and the line whose run in it is noted.
    let mut begins = vec![NEVER; rows.len() + 1];
    let mut noted = vec![u32::MAX; rows.len() + 1];
    let (mut first, mut own) = (u32::MAX, Vec::new());
    for (place, Source { line: of, call: row, .. }) in sources {
        let index = row as usize;
        if begins.get(index).is_some_and(|begin| *begin == NEVER) {
            begins[index] = place;
        }
        if of < line || of > first {
            continue;
        }
        if of < first {
            first = of;
            own.clear();
        }
        // A loop comes through the same places again and again.
        if noted.get(index).is_some_and(|noted| *noted != of) {
            noted[index] = of;
            own.push((RunOfLine { line: of, row, is_whole_row: false }, place));
        }
    }
    // A row begins where the first one in it does; those around it have smaller numbers.
    for (index, call) in rows.iter().enumerate().rev() {
        let around = call.parent as usize;
        begins[around] = begins[around].min(begins[index + 1]);
    }
    let used = || (1_u32..).zip(rows).zip(&begins[1..]).filter(|(_, begin)| **begin != NEVER);
    let of_rows = used().map(|((_, call), _)| call.line).filter(|of| *of >= line).min();
    match of_rows {
        Some(of) if of < first || own.is_empty() => {
            let of_line = used().filter(|((_, call), _)| call.line == of);
            let run = |row| RunOfLine { line: of, row, is_whole_row: true };
            let mut runs: Vec<_> = of_line.map(|((row, _), begin)| (run(row), *begin)).collect();
            // Of those that begin together, the ones around come first.
            runs.sort_by_key(|(run, begin)| (*begin, run.row));
            Some((of, runs))
        }
        _ => (!own.is_empty()).then_some((first, own)),
    }
}

/// `1: pass 1 of the loop in line 3; 2: pass 2 of the loop in line 3`, and how many more.
pub(super) fn text(runs: &[(RunOfLine, Place)], calls: &Calls) -> String {
    const SHOWN: usize = 3;
    let name = |index: usize| {
        let text = match calls.text(runs[index].0.row).as_str() {
            "" => "in the main program".to_owned(),
            text => text.to_owned(),
        };
        format!("{}: {text}", index + 1)
    };
    let mut times: Vec<String> = (0..runs.len().min(SHOWN)).map(name).collect();
    if runs.len() > SHOWN {
        match runs.len() - SHOWN - 1 {
            0 => {}
            more => times.push(format!("{more} more")),
        }
        times.push(name(runs.len() - 1));
    }
    times.join("; ")
}

#[cfg(test)]
mod tests {
    use crate::calls::Calls;
    use crate::contour::Source;
    use crate::geometry::{AxisSet, Shape};
    use crate::path::{CompensatedPath, NoEntry, PathElement, Role};

    fn path(calls: Calls, places: impl Iterator<Item = (u32, u32)>) -> CompensatedPath {
        let element = |(line, call)| PathElement {
            shape: Shape::Line,
            end: [0.0; 3],
            feed_mm_per_min: None,
            role: Role::None,
            side: None,
            axes: AxisSet::ALL,
            source: Source { line, call, ..Source::default() },
        };
        CompensatedPath { elements: places.map(element).collect(), calls, ..Default::default() }
    }

    #[test]
    fn each_time_of_a_line_has_its_place_and_each_place_its_time() {
        // Lines 3 and 4 in a loop that begins in line 2, in a call from line 9, and from line 8 before.
        let mut calls = Calls::default();
        let mut places = vec![(7, 0)];
        for line in [9, 8] {
            let call = calls.push(0, Some("o1".into()), line, 1);
            for pass in 1..=2 {
                let row = calls.push(call, None, 2, pass);
                places.extend([(3, row), (4, row), (4, row)]);
            }
        }
        places.push((10, 0));
        let path = path(calls, places.into_iter());
        for (line, elements) in [
            (4, &[2, 5, 8, 11][..]),
            (3, &[1, 4, 7, 10]),
            // The line of the loop, then the lines of the calls.
            (2, &[1, 4, 7, 10]),
            (1, &[1, 4, 7, 10]),
            (5, &[0]),
            (8, &[7]),
            (9, &[1]),
            (10, &[13]),
        ] {
            for (occurrence, element) in (1..).zip(elements) {
                let entry = path.entry(line, occurrence).expect("it is run so often");
                assert_eq!(entry.element, *element, "line {line}, {occurrence}");
                let last = path.last_occurrence(line, Some(&entry));
                assert_eq!(last, if elements.len() > 1 { occurrence } else { 0 });
                let source = path.elements[*element].source;
                if source.line == line && elements.len() > 1 {
                    assert_eq!(path.occurrence(source), occurrence, "line {line}");
                }
            }
            let count = elements.len() as u32;
            let beyond = path.entry(line, count + 1);
            assert!(matches!(beyond, Err(NoEntry::TooFew { .. })), "line {line}: {beyond:?}");
            assert_eq!(path.last_occurrence(line, None), if count > 1 { count } else { 0 });
            assert_eq!(path.entry(line, 0).is_ok(), count == 1, "line {line}");
        }
        assert_eq!(path.occurrence(path.elements[0].source), 0, "it is run once");
        assert!(matches!(path.entry(11, 0), Err(NoEntry::PastEnd { last: 10, .. })));
        assert!(matches!(path.entry(0, 2), Err(NoEntry::NoLine { occurrence: 2 })));
    }

    #[test]
    fn the_last_of_a_million_passes_is_found_with_those_around_it() {
        let mut calls = Calls::default();
        let call = calls.push(0, Some("o1".into()), 9, 1);
        let passes = 1_000_000;
        let first = calls.push(call, None, 2, 1);
        for pass in 2..=passes {
            calls.push(call, None, 2, pass);
        }
        let path = path(calls, (first..first + passes).flat_map(|row| [(3, row), (4, row)]));
        let entry = path.entry(4, passes).expect("the last one");
        assert_eq!(entry.element, path.elements.len() - 1);
        assert_eq!(path.occurrence(path.elements[entry.element].source), passes);
        assert_eq!(path.entry(2, passes).expect("a pass").element, path.elements.len() - 2);
        let several = path.entry(4, 0).expect_err("which one").to_string();
        assert!(several.contains("999996 more; 1000000: pass 1000000 of the loop"), "{several}");
    }
}
