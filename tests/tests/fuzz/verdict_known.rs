//! Programs that got two verdicts. `kerf plan` and the planner's node: the tool is 1e-6 mm larger than a
//! fillet, and the conversion to a message moved a centre by less than 1e-9 mm. Planner and audit: a contour
//! that misses its own start by 1e-3 mm was taken for one that retraces itself there.

use crate::verdict::{Program, ProgramOutcome, verdict};

/// The radius of the tool, mm, and the program; all of NCT.
const PROGRAMS: [(f64, &str); 4] = [
    (
        4.000001,
        "N1 G0 X-7 Y0
        N2 F100
        G41 D1 G1 X0 Y0
        G1 X1.8 Y5.7236
        G3 X-0.8158 Y10.7394 R4
        G1 X-6.5395 Y12.5393
        G1 X-0.8158 Y10.7394
        G2 X1.8 Y5.7236 R4
        G1 X-2.9999 Y-9.5394
        G1 X0 Y0
        G40 G1 X-7 Y0
        M2",
    ),
    (
        4.000001,
        "N1 G0 X0 Y3
        N2 F100
        G42 D1 G1 X0 Y0
        G1 X-10.0045 Y-10.0045
        G2 X-16.7135 Y-8.1462 R4
        G1 X-20 Y5
        G40 G1 X-17.8787 Y7.1213
        M2",
    ),
    (
        5.000001,
        "N1 G0 X0 Y-3.5
        N2 F100
        G42 D1 G1 X0 Y0
        G1 X-8.206 Y16.413
        G3 X-13.891 Y19.027 I-4.472 J-2.236
        G1 X-23.787 Y16.553
        G2 X-30 Y21.404 R5
        G1 X-30 Y30
        G1 X-30 Y46.396
        G2 X-26.581 Y51.14 I5 J0
        G1 X-15.337 Y54.888
        G3 X-14.682 Y55.159 I-1.581 J4.743
        G1 X-11.205 Y56.898
        G3 X-9.905 Y64.905 I-2.236 J4.472
        G1 X-20 Y75
        G1 X-20 Y60
        G40 G1 X-17.525 Y62.475
        M2",
    ),
    (
        5.0,
        "N1 G0 X15 Y60
        N2 F100
        G41 D1 G1 X30.001 Y60
        X40 Y80
        G2 X65 Y55 I0 J-25
        G1 X95
        X90 Y35
        X65 Y15
        X40 Y40
        X30 Y60
        G40 X15 Y60
        M2",
    ),
];

#[test]
fn programs_that_got_two_verdicts_get_one() {
    for (radius_mm, text) in PROGRAMS {
        let outcome = verdict(&Program::of("nct", text, radius_mm));
        assert!(!matches!(outcome, ProgramOutcome::Disagreed(_)), "{outcome:?}");
    }
}
