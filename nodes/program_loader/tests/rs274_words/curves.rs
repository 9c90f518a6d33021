//! G5 to G5.3: what curves become, and what is wrong with them.

use super::*;

#[test]
fn curves_become_lines_and_arcs_that_touch() {
    for (text, end) in [
        ("G5 I0 J3 P0 Q-3 X1 Y1", [1.0, 1.0]),
        ("G5 I0 J3 P0 Q-3 X1 Y1\nG5 P1 Q1 X3 Y3", [3.0, 3.0]),
        ("G91 G5.1 X4 Y4 I2 J1\nG90", [4.0, 4.0]),
        ("G20 G5.1 X1 Y1 I0.5 J0.1 F20\nG21", [25.4, 25.4]),
        ("G5.2 P1 L3 X0 Y1\nX2 Y2 P1\nX2 Y0 P1\n(MSG, here)\nX0 Y5 P2\nG5.3", [0.0, 5.0]),
        ("G5.2 P0.5\nX1 Y1\nX2 Y0\nG5.3", [2.0, 0.0]),
        ("G52 X1 Y1\nG5.1 X4 Y4 I2 J1", [5.0, 5.0]),
    ] {
        let loaded = read(&format!("F100 G0 X0 Y0 Z-1\n{text}\nG1 Z0\nM2"));
        assert!(loaded.is_accepted(), "{text}: {:?}", loaded.findings);
        let events: Vec<String> = loaded.contour.events.iter().map(canonical::event_text).collect();
        let arcs = events.iter().filter(|it| it.starts_with("arc")).count();
        assert!((2..60).contains(&arcs), "{text}: {events:#?}");
        let moves = events.iter().filter(|it| it.starts_with("arc") || it.starts_with("line"));
        let last = moves.rev().nth(1).expect("the end of the curve");
        let wanted = format!(" X{} Y{} Z-1 ", end[0], end[1]);
        assert!(last.contains(&wanted), "{text}: {last}, not {wanted}");
    }
    // The time of a curve under G93 is that of its whole length: half a minute.
    let loaded = read("G0 X0 Y0\nG93 G5.1 X30 Y0 I15 J0 F2\nM2");
    let text = canonical::text(&loaded.contour);
    assert!(text.contains("line X30 Y0 Z0 F60 named XY"), "{text}");
}

#[test]
fn wrong_curves_are_errors_at_their_places() {
    let begin = "F100 G0 X0 Y0\n";
    for (text, wanted) in [
        ("G5 X1 Y1 P1 Q1", "G5 has not all of I, J, P and Q"),
        ("G5 X1 Y1 I1 P1 Q1", "one of I and J without the other"),
        ("G5 I0 J3 X1 Y1", "G5 has not all of I, J, P and Q"),
        ("G5 I0 J3 P1 X1 Y1", "one of P and Q without the other"),
        ("G18 G5 I0 J3 P0 Q-3 X1 Y1", "a curve outside the plane XY"),
        ("G5 I0 J3 P0 Q-3 X1 Y1 Z1", "a curve has no Z"),
        ("G5.1 X1 Y1", "G5.1 without I and J"),
        ("G5.1 X1 Y1 I1", "one of I and J without the other"),
        ("G5.1 X1 Y1 I[0/0] J1", "a division by zero"),
        ("G5.1 X1 Y1 I999999999 J1", "I999999999 is beyond 1000000 mm"),
        ("G5.3", "G5.3 without G5.2"),
        ("G5.2 X1 Y1 L3\nG5.3", "a curve of order 3 needs 3 control points, and has 2"),
        ("G5.2 X1 Y1 P0\nG5.3", "P0 is not the weight of a control point"),
        ("G5.2 X1 Y1 P-1\nG5.3", "P-1 is not the weight of a control point"),
        ("G5.2 X1 Y1 L99\nG5.3", "the order of a curve is from 3 to 10"),
        ("G5.2 X1\nX1 Y1\nX2 Y2\nG5.3", "a control point has X and Y"),
        ("G5.2 X1 Y1\nG5.2 P2\nX2 Y2\nG5.3", "a control point without X and Y"),
        ("G5.2 X1 Y1 P-1\nX1 Y1\nX2 Y2\nX3 Y3\nG5.3", "P-1 is not the weight of a control point"),
        ("G5.2 X1 Y1\nX1 Y1 P-1\nX2 Y2\nX3 Y3\nG5.3", "P-1 is not the weight of a control point"),
        (
            "G5.2 L4 X100 Y0 P900000\nX100 Y20 P1\nX200 Y0 P.000002\nG5.3",
            "the weights of the curve differ by more than 1000 times",
        ),
        ("G5.2 X1 Y1\nG1 X5", "the curve that G5.2 begins in line 2 has no G5.3"),
        ("G5.2 X1 Y1\nM30", "the curve that G5.2 begins in line 2 has no G5.3"),
        ("G5.2 X1 Y1\nG92 X0", "the curve that G5.2 begins in line 2 has no G5.3"),
        (
            "T1 M6\nG0 Y20\nG41 G1 Y0\nG5.1 X5 Y5 I1 J1\nG40 G1 Y9",
            "a curve under cutter radius compensation, which is on since line 4",
        ),
    ] {
        let loaded = read(&format!("{begin}{text}\nM2"));
        let errors: Vec<&str> = loaded
            .findings
            .iter()
            .filter(|it| it.is_error())
            .map(|it| it.message.as_str())
            .collect();
        assert_eq!(errors, [wanted], "{text}");
    }
    // Nothing has ended it at the end of the text.
    assert!(!read("F100 G0 X0 Y0\nG5.2 X1 Y1\n").is_accepted());
}
