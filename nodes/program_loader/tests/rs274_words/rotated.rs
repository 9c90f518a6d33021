//! G10 L2 R: what a program in a rotated work system becomes.

use super::*;

#[test]
fn a_rotated_work_system_turns_what_the_program_writes() {
    let quarter = "G10 L2 P1 R90\n";
    for (text, wanted) in [
        (
            "G0 X10 Y0\nX5\nY2",
            "rapid X0 Y10 Z0 named XY; rapid X0 Y5 Z0 named XY; rapid X-2 Y5 Z0 named XY",
        ),
        (
            "G0 X0 Y0\nG91 X1\nX1 Z2\nZ1",
            "rapid X0 Y0 Z0 named XY; rapid X0 Y1 Z0 named XY; rapid X0 Y2 Z2 named XYZ; rapid X0 Y2 Z3 named Z",
        ),
        // The zero of the program is turned too.
        ("G0 X0 Y0\nG92 X-3\nG0 X0", "rapid X0 Y0 Z0 named XY; rapid X0 Y3 Z0 named XY"),
        ("G52 X3\nG0 X1 Y0", "rapid X0 Y4 Z0 named XY"),
        (
            "F100 G0 X0 Y0\nG2 X10 Y0 I5 J0",
            "rapid X0 Y0 Z0 named XY; arc cw xy X0 Y10 Z0 center X0 Y5 F100 named XY",
        ),
        (
            "F100 G0 X0 Y0 Z5\nG81 X4 Z-1 R5",
            "rapid X0 Y0 Z5 named XYZ; rapid X0 Y4 Z5 named XY; line X0 Y4 Z-1 F100 named Z; rapid X0 Y4 Z5 named Z",
        ),
        // Places of the machine are not turned.
        ("G53 G0 X4 Y1\nG0 X0 Y0", "G53 G0 X4 Y1; rapid X0 Y0 Z0 named XY"),
        (
            "G0 X1 Y2\nG28 X3 Y2\nG0 X0 Y0",
            "rapid X-2 Y1 Z0 named XY; rapid X-2 Y3 Z0 named XY; G28 XY; rapid X0 Y0 Z0 named XY",
        ),
        // The tool stands still where the rotation ends, and its place is another.
        (
            "G0 X4 Y1\nG10 L2 P1 R0\nG91 X1\nG10 L2 P1 R90",
            "rapid X-1 Y4 Z0 named XY; rapid X0 Y4 Z0 named X",
        ),
        (
            "G0 X4 Y1\n(DEBUG, #5420 #5421 #5230 #5250)",
            "rapid X-1 Y4 Z0 named XY; (MSG, 4.000000 1.000000 90.000000 0.000000)",
        ),
        // Another work system has its own.
        (
            "G0 X4 Y1\nG55 G0 X4 Y1\nG54 G0 X4 Y1",
            "rapid X-1 Y4 Z0 named XY; G55; rapid X4 Y1 Z0 named XY; G54; rapid X-1 Y4 Z0 named XY",
        ),
        // The tool stands at X2 Y3 of the program.
        (
            "G0 X4 Y1\nG10 L20 P1 X2 Y3\nG0 X0",
            "rapid X-1 Y4 Z0 named XY; G10 L20 P1 X-3 Y2; rapid X-3 Y2 Z0 named XY; rapid X-3 Y0 Z0 named XY",
        ),
        (
            "G0 X4 Y1\nG10 L20 P1 X2\nG0 X0",
            "rapid X-1 Y4 Z0 named XY; G10 L20 P1 X-1 Y2; rapid X-1 Y2 Z0 named XY; rapid X-1 Y0 Z0 named XY",
        ),
        // The zero itself is a place of the machine.
        ("G10 L2 P1 X3 Y4\nG0 X1 Y0", "G10 L2 P1 X3 Y4; rapid X0 Y1 Z0 named XY"),
        (
            "G0 X1 Y1\nG38.2 X9 F50\nG91 G1 X-1\nG90 X0 Y0",
            "rapid X-1 Y1 Z0 named XY; G38.2; line X-1 Y9 Z0 F50 named XY; G91 XY; line X-1 Y8 Z0 F50 named XY; line X0 Y0 Z0 F50 named XY",
        ),
    ] {
        let forgotten = "work system 1 is rotated by 90 degrees until this program ends, and not in the next one";
        check(&[(&format!("{quarter}{text}\nM2"), &format!("{wanted}; M2"), &[forgotten])]);
        // As often as it is set back, nothing is left.
        check(&[(&format!("{quarter}{text}\nG10 L2 P1 R360\nM2"), &format!("{wanted}; M2"), &[])]);
    }
    check(&[
        ("G10 L2 P1 X3 R0\nG0 X1\nM2", "G10 L2 P1 X3; rapid X1 Y0 Z0 named X; M2", &[]),
        ("G10 L2 P2 R0\nG0 X1\nM2", "rapid X1 Y0 Z0 named X; M2", &[]),
    ]);
}

#[test]
fn a_place_that_is_read_in_a_rotated_system_relies_on_both_axes() {
    for (text, wanted) in [
        ("G0 X10\nG10 L2 P1 R90\n#1=#5420\nG0 X0 Y0\nM2", "Y"),
        ("G10 L2 P1 R90\n#1=#<_x>\nG0 X0 Y0\nM2", "XY"),
        ("G10 L2 P1 R90\nG0 X0 Y0\n#1=#<_x>\nM2", ""),
    ] {
        let loaded = read(text);
        assert_eq!(loaded.contour.assumed_axes.letters(), wanted, "{text}");
    }
}

#[test]
fn what_a_rotated_work_system_cannot_do_is_refused() {
    check_bad(&[
        ("G10 L2 P2 R[1/0]\nG0 X10\nM2", &[("/0", "a division by zero")]),
        ("G10 L20 P1 X1 R5\nM2", &[("R5", "G10 L20 does not take R")]),
        (
            "G10 L2 P1 R30\nG10 L2 P1 X1\nG0 X5\nG0 Y2\nM2",
            &[(
                "G0 X5",
                "this block starts from where X and Y are, which is not known since G10 in line 2",
            )],
        ),
        (
            "G10 L2 P1 R30\nG0 X0 Y0\nG28 X4\nM2",
            &[("G28", "G28 of one of X and Y alone, and the work system is rotated by 30 degrees")],
        ),
        (
            "G10 L2 P1 R30\nG0 X0 Y0\nG18 G2 X5 Z0 R3 F100\nM2",
            &[(
                "G18 G2 X5 Z0 R3 F100",
                "an arc in the plane ZX (G18), and the work system is rotated by 30 degrees",
            )],
        ),
        (
            "G10 L2 P1 R30\nG0 X0 Y0\nG18 G41.1 D2 G1 X5 Z0 F100\nG40 X0\nM2",
            &[(
                "G18 G41.1 D2 G1 X5 Z0 F100",
                "cutter radius compensation in the plane ZX (G18), and the work system is rotated by 30 degrees",
            )],
        ),
        (
            "G10 L2 P2 R30\nG10 L20 P2 X5\nM2",
            &[("G10", "work system 2 is rotated, and where Y is in it is not known here")],
        ),
    ]);
}
