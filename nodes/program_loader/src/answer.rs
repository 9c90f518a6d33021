//! What a load is answered with: why a program is refused, its corners, its first findings.

use crate::Loaded;
use cnc_msgs::calls::chain_after;
use cnc_msgs::cdr;
use cnc_msgs::units::point_from_position;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use cnc_msgs::wire::geometry_msgs::msg::Point;

/// Size of the findings in one response, bytes.
const FINDINGS_BYTES_MAX: usize = 40_000;

/// The response for a rejected program; `None` for an accepted one.
pub fn refusal(name: &str, loaded: &Loaded) -> Option<String> {
    let mut errors = loaded.findings.iter().filter(|finding| finding.is_error());
    let first = errors.next()?;
    let (line, message) = (first.source.line, &first.message);
    let calls = chain_after(&first.calls);
    let place = format!("line {line}{calls}: {message}");
    Some(match errors.count() {
        0 => format!("{name} is refused: {place}"),
        more => format!("{name} is refused: {} errors, the first: {place}", 1 + more),
    })
}

/// The corners of the box around the programmed motion, m; without motion, the start.
///
/// NaN for an axis that the program does not name: where that axis stands is not known.
pub fn corners(loaded: &Loaded) -> (Point, Point) {
    let Some(bounds) = &loaded.bounds else {
        let start = point_from_position(loaded.contour.start);
        return (start.clone(), start);
    };
    let corner = |position| {
        let Point { x, y, z } = point_from_position(position);
        let named = |axis, value| if bounds.axes.contains(axis) { value } else { f64::NAN };
        Point { x: named(0, x), y: named(1, y), z: named(2, z) }
    };
    (corner(bounds.min), corner(bounds.max))
}

/// As many findings as fit a response, and how many there are.
pub fn first_findings(loaded: &Loaded) -> (Vec<wire::Finding>, u32) {
    let mut bytes = 0;
    let findings = loaded.findings.iter().map(Into::into).take_while(|finding| {
        bytes += cdr::body(finding).len();
        bytes <= FINDINGS_BYTES_MAX
    });
    (findings.collect(), loaded.findings.len() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LoadOptions, load};

    #[test]
    fn one_error_is_not_counted() {
        // Blocks, and why they are refused.
        let table = [
            ("G0 X1\n", None),
            ("G0 X\n", Some("a.ngc is refused: line 1: `X` has no number")),
            ("G0 X\nY\n", Some("a.ngc is refused: 2 errors, the first: line 1: `X` has no number")),
        ];
        let profile = settings::load_profile("rs274").expect("a profile of ours");
        for (text, expected) in table {
            let loaded = load(format!("{text}M2\n").as_bytes(), &profile, &LoadOptions::default());
            assert_eq!(refusal("a.ngc", &loaded).as_deref(), expected, "{text:?}");
        }
    }

    #[test]
    fn an_axis_that_the_program_does_not_name_has_no_bounds() {
        const NONE: f64 = f64::NAN;
        // The program, and both corners, m.
        let table = [
            ("G21 G90\nG0 X5 Y-2\nG1 X40 F600\nM30\n", [0.005, -0.002, NONE], [0.04, -0.002, NONE]),
            ("G21 G90\nG0 Z5\nM30\n", [NONE, NONE, 0.005], [NONE, NONE, 0.005]),
            ("G21 G90\nG0 X1 Y2 Z3\nM30\n", [0.001, 0.002, 0.003], [0.001, 0.002, 0.003]),
            // The plane of an arc is named by it.
            ("G21 G90\nG0 X0\nG2 X10 Y0 I5 J0 F600\nM30\n", [0.0, 0.0, NONE], [0.01, 0.005, NONE]),
            ("M30\n", [0.0; 3], [0.0; 3]),
        ];
        for (text, min, max) in table {
            let profile = settings::load_profile("rs274").expect("a profile of ours");
            let loaded = load(text.as_bytes(), &profile, &LoadOptions::default());
            let (found_min, found_max) = corners(&loaded);
            let found = [found_min, found_max].map(|it| [it.x, it.y, it.z]);
            for (found, expected) in found.iter().flatten().zip([min, max].iter().flatten()) {
                let is_same = (found - expected).abs() < 1e-12;
                assert!(is_same || (found.is_nan() && expected.is_nan()), "{text:?}: {found:?}");
            }
        }
    }
}
