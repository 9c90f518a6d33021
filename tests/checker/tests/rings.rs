//! Rings that were left out of the path without a finding, or refused although the tool fits;
//! the drawn programs found them.

use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::tool_table::{Offset, ToolTable};
use kerf_checker::judge::ProductResult;
use kerf_checker::program::Program;
use kerf_checker::{product, profiles};
use settings::Control;

/// A ring in three blocks, half of the first again, and an arc that leaves it next to the tool.
const RETRACED: &str = "G18 G90 F600
G451
G0 Z0.714 X1.236
G1 Y-2
G41 D1 G456 G1 Z3.221 X5.580
G3 Z-6.443 X0.000 K-3.221 I-5.580
G3 Z3.221 X-5.580 K6.443 I0.000
G3 Z3.221 X5.580 K-3.221 I5.580
G3 Z-3.221 X5.580 K-3.221 I-5.580
G3 Z-3.221 X-7.296 K3.717 I-6.438
G40 G456 G1 Z-7.072 X7.075
G0 Y5
M5
M30
";

/// What loader and planner say of a program with one offset.
fn findings(control: Control, axes: [usize; 3], radius_mm: f64, text: &str) -> Vec<Finding> {
    verdict(control, axes, radius_mm, text).findings
}

fn verdict(control: Control, axes: [usize; 3], radius_mm: f64, text: &str) -> ProductResult {
    let mut tools = ToolTable::default();
    tools.offsets.insert(1, Offset { radius_mm, ..Offset::default() });
    let text = text.into();
    let (spans, features) = (Vec::new(), Vec::new());
    let program = Program { seed: 0, control, text, tools, axes, spans, features };
    product(&program, &profiles())
}

#[test]
fn a_ring_is_not_left_out_for_an_arc_after_it_that_cuts_it() {
    let findings = findings(Control::Sinumerik840c, [2, 0, 1], 4.956, RETRACED);
    let refusal = findings.iter().find(|finding| finding.is_error());
    let refusal = refusal.map(|finding| (finding.code, finding.source.line));
    assert_eq!(refusal, Some((Code::Gouge, 10)), "{findings:?}");
}

/// A ring in three blocks that are rounded to three decimals, half of the first again, and an arc
/// that leaves it on the other side.
const ROUNDED: &str = "G17 G90 F600
G0 X173.907 Y14.512
G1 Z-3
G41 D1 G1 X177.718 Y16.924
G2 X179.891 Y21.065 R2.700
G2 X182.391 Y17.113 I0.109 J-2.698
G2 X177.718 Y16.924 I-2.391 J1.254
G2 X177.609 Y19.621 I2.282 J1.443
G3 X169.274 Y32.795 R9.000
G40 G1 X172.325 Y34.725
G0 Z5
M2
";

/// One half was taken for the return along the other, and left out.
#[test]
fn a_ring_of_rounded_blocks_is_followed_all_around() {
    let verdict = verdict(Control::Nct, [0, 1, 2], 3.0, ROUNDED);
    assert!(!verdict.findings.iter().any(Finding::is_error), "{:?}", verdict.findings);
    for line in 5..=9 {
        let is_followed = verdict.path.elements.iter().any(|it| it.source.line == line);
        assert!(is_followed, "line {line} of {:?}", verdict.path);
    }
}

/// A ring in three blocks between an arc that leads to it and a straight: the blocks are one circle
/// to 1e-4 mm.
const CLOSED: &str = "G17 G90 F600
G0 X21.0625 Y15.4119
G1 Z0
G41 D1 G1 X15.2942 Y8.4904
G3 X12.0000 Y20.7846 I-7.7942 J4.5000
G3 X-24.0000 Y0.0000 I-12.0000 J-20.7846
G3 X12.0000 Y-20.7846 R24.0000
G3 X12.0000 Y20.7846 I-12.0000 J20.7846
G40 G1 X10.4800 Y18.1519
G0 Z5
M2
";

/// A ring in three blocks, a part of the first again, and an arc that leaves it: the last block
/// and the part are one circle to 1e-4 mm.
const OVERLAP: &str = "G19 G90 F600
G0 Y-17.732 Z12.170
G1 X-2
G41 D1 G1 Y-24.380 Z15.663
G3 Y-28.577 Z9.131 J10.092 K-11.098
G3 Y6.381 Z-29.314 J28.577 K-9.131
G3 Y22.196 Z20.183 J-6.381 K29.314
G3 Y-28.577 Z9.131 J-22.196 K-20.183
G3 Y-22.196 Z-20.183 J28.577 K-9.131
G3 Y-17.003 Z-22.629 R7.500
G40 G1 Y-7.080 Z-11.367
G0 X5
M2
";

/// A ring in four blocks at two depths; one of them is written with the radius once.
const TWICE: &str = "G17 G90 F600
G0 X-2.921 Y-12.232
G1 Z-2
G42 D1 G1 X-2.572 Y-14.496
G2 X-5.506 Y-14.176 I-0.869 J5.636
G2 X-14.176 Y5.506 I5.506 J14.176
G2 X5.506 Y14.176 I14.176 J-5.506
G2 X14.176 Y-5.506 R15.208
G2 X-5.506 Y-14.176 I-14.176 J5.506
G1 Z-3.5
G2 X-14.176 Y5.506 I5.506 J14.176
G2 X5.506 Y14.176 I14.176 J-5.506
G2 X14.176 Y-5.506 I-5.506 J-14.176
G2 X-5.506 Y-14.176 I-14.176 J5.506
G40 G1 X-4.126 Y-10.623
G0 Z5
M2
";

/// A contour at three depths, so often retraced that its copies are looked at once; one arc is
/// written with the radius at the second depth.
const THREE_DEPTHS: &str = "G17 G90 F600
G0 X38.052 Y-63.268
G1 Z-2
G41 D1 G1 X-6.002 Y-44.183
G3 X-1.179 Y-55.039 I7.840 J-3.016
G3 X42.399 Y-25.478 I11.516 J29.925
G1 X43.833 Y100.980
G3 X-124.552 Y-7.563 I-7.210 J-173.697
G1 X-1.179 Y-55.039
G1 Z-3.5
G3 X42.399 Y-25.478 R32.064
G1 X43.833 Y100.980
G3 X-124.552 Y-7.563 I-7.210 J-173.697
G1 X-1.179 Y-55.039
G1 Z-5
G3 X42.399 Y-25.478 I11.516 J29.925
G1 X43.833 Y100.980
G3 X-124.552 Y-7.563 I-7.210 J-173.697
G1 X-1.179 Y-55.039
G3 X17.184 Y-54.573 I8.620 J22.399
G40 G1 X5.503 Y-57.366
G0 Z5
M2
";

#[test]
fn a_ring_closes_whatever_its_blocks_are_rounded_to() {
    for (axes, radius_mm, text) in [
        ([0, 1, 2], 3.0, CLOSED),
        ([1, 2, 0], 5.0, OVERLAP),
        ([0, 1, 2], 1.901, TWICE),
        ([0, 1, 2], 8.0, THREE_DEPTHS),
    ] {
        let findings = findings(Control::Nct, axes, radius_mm, text);
        assert!(!findings.iter().any(Finding::is_error), "{text}\n{findings:?}");
    }
}

#[test]
fn a_ring_that_is_smaller_than_the_tool_is_refused_all_the_same() {
    for (axes, radius_mm, text) in [([0, 1, 2], 24.1, CLOSED), ([1, 2, 0], 30.1, OVERLAP)] {
        let findings = findings(Control::Nct, axes, radius_mm, text);
        assert!(findings.iter().any(Finding::is_error), "{text}\n{findings:?}");
    }
}
