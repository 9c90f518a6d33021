//! A ring that was left out of the path without a finding; the drawn programs found it.

use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::tool_table::{Offset, ToolTable};
use kerf_checker::program::Program;
use kerf_checker::{product, profiles};

/// A ring in three blocks, half of the first again, and an arc that leaves it beside the tool.
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
fn findings(control: &'static str, axes: [usize; 3], radius_mm: f64, text: &str) -> Vec<Finding> {
    let mut tools = ToolTable::default();
    tools.offsets.insert(1, Offset { radius_mm, ..Offset::default() });
    let text = text.into();
    let (spans, features) = (Vec::new(), Vec::new());
    let program = Program { seed: 0, control, text, tools, axes, spans, features };
    product(&program, &profiles()).findings
}

#[test]
fn a_ring_is_not_left_out_for_an_arc_that_the_tool_does_not_reach() {
    let findings = findings("sinumerik_840c", [2, 0, 1], 4.956, RETRACED);
    let unreachable = findings.iter().find(|finding| finding.code == Code::Unreachable);
    let lines = unreachable.map(|finding| (finding.is_error(), finding.source.line));
    assert_eq!(lines, Some((true, 10)), "{findings:?}");
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

#[test]
fn half_a_ring_is_not_taken_for_the_way_back_along_the_other_half() {
    let findings = findings("nct", [0, 1, 2], 3.0, ROUNDED);
    assert!(findings.iter().any(Finding::is_error), "{findings:?}");
}
