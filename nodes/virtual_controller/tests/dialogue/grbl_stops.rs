//! What makes grbl 1.1h wait: dwells, pauses, doors, jogs.

use crate::script::{check, plain};
use expect_test::expect;

#[test]
fn a_dwell_withholds_its_ok_and_looks_idle() {
    let script = "
        G4P1.5
        ^?
        wait 1.4
        wait 0.2
        G1X1F600
        G4P0.5
        wait 0.1
        ^?
        settle
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        G4P1.5
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        wait 1.4
        wait 0.2                 ok
        G1X1F600                 ok
        G4P0.5
        wait 0.1
        ^?                       <Run|MPos:0.500,0.000,0.000|FS:600,0|Ov:100,100,100>
        settle                   ok
        ^?                       <Idle|MPos:1.000,0.000,0.000|FS:0,0>
    "#]],
    );
}

#[test]
fn m0_waits_for_the_operator_and_m30_ends_the_program() {
    let script = "
        G1X1F600
        M0
        settle
        G1X2
        ^?
        wait 60
        ^~
        wait 1
        G20G91G55M3S500
        $G
        M30
        settle
        $G
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        G1X1F600                 ok
        M0
        settle
        G1X2
        ^?                       <Hold:0|MPos:1.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        wait 60
        ^~                       ok / ok
        wait 1
        G20G91G55M3S500          ok
        $G                       [GC:G1 G55 G17 G20 G91 G94 M3 M9 T0 F600 S500] / ok
        M30                      [MSG:Pgm End] / ok
        settle
        $G                       [GC:G1 G54 G17 G20 G90 G94 M5 M9 T0 F600 S500] / ok
    "#]],
    );
}

#[test]
fn a_door_stops_and_needs_closing_and_a_start() {
    let script = "
        M3S100
        G1X20F600
        wait 1
        door
        ^?
        wait 1
        ^?
        ^~
        ^?
        shut
        ^?
        ^~
        ^?
        wait 4.5
        ^?
        wait 5
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        M3S100                   ok
        G1X20F600                ok
        wait 1
        door                     [MSG:Check Door]
        ^?                       <Door:2|MPos:9.500,0.000,0.000|FS:600,100|Pn:D|WCO:0.000,0.000,0.000>
        wait 1
        ^?                       <Door:1|MPos:10.000,0.000,0.000|FS:0,0|Pn:D|Ov:100,100,100>
        ^~
        ^?                       <Door:1|MPos:10.000,0.000,0.000|FS:0,0|Pn:D>
        shut
        ^?                       <Door:0|MPos:10.000,0.000,0.000|FS:0,0>
        ^~
        ^?                       <Door:3|MPos:10.000,0.000,0.000|FS:0,100>
        wait 4.5
        ^?                       <Run|MPos:14.500,0.000,0.000|FS:600,100>
        wait 5
        ^?                       <Idle|MPos:20.000,0.000,0.000|FS:0,100>
    "#]],
    );
}

#[test]
fn a_door_ends_a_jog_for_good() {
    let script = "
        $J=G91X50F600
        wait 1
        ^84
        wait 1
        ^?
        ^~
        ^?
        G91G0X1
        wait 2
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        $J=G91X50F600            ok
        wait 1
        ^84                      [MSG:Check Door]
        wait 1
        ^?                       <Door:0|MPos:10.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        ^~
        ^?                       <Idle|MPos:10.000,0.000,0.000|FS:0,0|Ov:100,100,100>
        G91G0X1                  ok
        wait 2
        ^?                       <Idle|MPos:11.000,0.000,0.000|FS:0,0>
    "#]],
    );
}

#[test]
fn a_jog_locks_gcode_out_and_lines_after_a_cancel_still_run() {
    let script = "
        $J=G91X5F600
        G0X1
        ^?
        wait 2
        $J=G91X5F600
        $J=G91X5F600
        wait 0.5
        ^85
        $J=G91X5F600
        settle
        ^?
        wait 3
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
            $J=G91X5F600             ok
            G0X1                     error:9
            ^?                       <Jog|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
            wait 2
            $J=G91X5F600             ok
            $J=G91X5F600             ok
            wait 0.5
            ^85
            $J=G91X5F600
            settle                   ok
            ^?                       <Jog|MPos:10.000,0.000,0.000|FS:0,0|Ov:100,100,100>
            wait 3
            ^?                       <Idle|MPos:15.000,0.000,0.000|FS:0,0>
        "#]],
    );
}
