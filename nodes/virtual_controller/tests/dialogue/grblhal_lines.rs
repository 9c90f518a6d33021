//! Which lines grblHAL accepts, and which errors persist.

use crate::script::{check, hal};
use expect_test::expect;
use virtual_controller::Build;

// Row "error handling".
#[test]
fn an_error_sticks_until_an_empty_line() {
    let script = r"
        bytes G1X2F600\nG41\nG1X3\nG1X4\n
        wait 3
        ^?
        bytes \n
        G1X4
        G41
        (a comment)
        G1X5
        $G
        G1X5
        G41
        G1X6
        ^18
        G1X6F600
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        bytes G1X2F600\nG41\nG1X3\nG1X4\n ok / error:20 / error:20 / error:20
        wait 3
        ^?                       <Idle|MPos:2.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        bytes \n                 ok
        G1X4                     ok
        G41                      error:20
        (a comment)              error:20
        G1X5                     error:20
        $G                       [GC:G1 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F600 S0] / ok
        G1X5                     ok
        G41                      error:20
        G1X6                     error:20
        ^18                      ALARM:3 / GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
        G1X6F600                 error:9
    "#]],
    );
}

// Row "error handling": `$H`, `$J=`, `$foo`, `$I` while running.
#[test]
fn any_error_sticks() {
    let script = r"
        G1X20F600
        $I
        G1X6
        bytes \n
        wait 3
        $H
        G1X6
        bytes \n
        $J=X1
        G1X6
        bytes \n
        $foo
        G1X6
        ^85
        G1X6
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        G1X20F600                ok
        $I                       error:8
        G1X6                     error:8
        bytes \n                 ok
        wait 3
        $H                       error:5
        G1X6                     error:5
        bytes \n                 ok
        $J=X1                    error:22
        G1X6                     error:22
        bytes \n                 ok
        $foo                     error:3
        G1X6                     error:3
        ^85
        G1X6                     ok
    "#]],
    );
}

// Row "line end".
#[test]
fn a_pair_of_line_ends_is_one_unless_the_line_was_wrong() {
    let script = r"
        bytes G0X1\r\n
        bytes G0X1\r
        bytes \nG0X1\n
        bytes G41\r\n
        bytes G0X1\r\n
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        bytes G0X1\r\n           ok
        bytes G0X1\r             ok
        bytes \nG0X1\n           ok
        bytes G41\r\n            error:20 / ok
        bytes G0X1\r\n           ok
    "#]],
    );
}

// Row "arc / G-code errors".
#[test]
fn codes_that_grbl_refuses_in_another_way() {
    let script = r"
        G40
        G41
        bytes \n
        G42
        bytes \n
        G64
        bytes \n
        G95
        bytes \n
        G1X1
        bytes \n
        G1X1X2F1
        bytes \n
        G92
        bytes \n
        G53G2X1I1F1
        bytes \n
        G0I1
        bytes \n
        *71
        bytes \n
        N1G1X1*12
        bytes \n
        O100
        bytes \n
        G1X1e1F100
        bytes \n
        G2I5F600
        wait 10
        M7
        T300
        G59.1
        M1
        ^~
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
            G40                      ok
            G41                      error:20
            bytes \n                 ok
            G42                      error:20
            bytes \n                 ok
            G64                      error:20
            bytes \n                 ok
            G95                      error:20
            bytes \n                 ok
            G1X1                     error:22
            bytes \n                 ok
            G1X1X2F1                 error:25
            bytes \n                 ok
            G92                      error:26
            bytes \n                 ok
            G53G2X1I1F1              error:30
            bytes \n                 ok
            G0I1                     error:36
            bytes \n                 ok
            *71                      error:1
            bytes \n                 ok
            N1G1X1*12                error:1
            bytes \n                 ok
            O100                     error:36
            bytes \n                 ok
            G1X1e1F100               error:36
            bytes \n                 ok
            G2I5F600
            wait 10                  ok
            M7                       ok
            T300                     ok
            G59.1                    ok
            M1
            ^~                       [MSG:] / ok
        "#]],
    );
}

// Row "arc tolerance".
#[test]
fn arcs_have_grbl_s_tolerance() {
    let script = r"
        G2X10.004I5F6000
        wait 10
        G0X0
        wait 3
        G2X10I5.006F6000
        bytes \n
        G2X10R4.9
        bytes \n
        G2X1
        bytes \n
        G2I5F6000
    ";
    check(
        hal(&["$12=1"]),
        script,
        expect![[r#"
        G2X10.004I5F6000         ok
        wait 10
        G0X0                     ok
        wait 3
        G2X10I5.006F6000         error:33
        bytes \n                 ok
        G2X10R4.9                error:34
        bytes \n                 ok
        G2X1                     error:35
        bytes \n                 ok
        G2I5F6000                ok
    "#]],
    );
}

// Row "`!?~` inside comments".
#[test]
fn bytes_of_real_time_act_within_comments_only_as_legacy() {
    let script = "
        (what?)
        $39=0
        (what?)
        ; what?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        (what?)                  <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0> / ok
        $39=0                    ok
        (what?)                  ok
        ; what?                  <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000> / ok
    "#]],
    );
}

// Row "half line left by a previous session".
#[test]
fn half_a_line_spoils_the_next_one_and_sticks() {
    let script = "
        bytes G1X5
        $I
        $I
        G1X6
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
            bytes G1X5
            $I                       error:2
            $I                       [VER:1.1f.20260817:] / [OPT:VNML+,100,1024,3,0] / [AXS:3:XYZ] / [NEWOPT:ENUMS,RT+,TC,SED] / [FIRMWARE:grblHAL] / [SIGNALS:D] / [NVS STORAGE:*EEPROM] / [DRIVER:Simulator] / [DRIVER VERSION:260324] / ok
            G1X6                     error:22
        "#]],
    );
}

// Row "byte >= 0x80".
#[test]
fn bytes_from_0x80_on_are_dropped() {
    let script = r"
        bytes G0X\xb50.5\n
        wait 2
        ^?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        bytes G0X\xb50.5\n       ok
        wait 2
        ^?                       <Idle|MPos:0.500,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
    "#]],
    );
}

// `gcode.c`, `state_machine.c`: G33 waits for two turns of its spindle, and no hold stops it.
#[test]
fn a_thread_needs_an_encoder_and_a_spindle_that_turns() {
    let encoder = Build { has_spindle_encoder: true, ..hal(&[]) };
    let script = "
        $I
        G33Z-1K1
        bytes \\n
        S60M3
        G33Z-1
        bytes \\n
        G33Z-9K100
        bytes \\n
        G33Z-2K1
        $G
        ^?
        wait 1
        ^!
        settle
        ^?
        ^~
        wait 1
        ^!
        ^?
        settle
        ^?
        ^~
        ^?
        S20M3
        G33Z-3K1
        ^?
        wait 6
        ^?
    ";
    check(
        encoder,
        script,
        expect![[r#"
            $I                       [VER:1.1f.20260817:] / [OPT:VNML+,100,1024,3,0] / [AXS:3:XYZ] / [NEWOPT:ENUMS,RT+,TC,SS,SED] / [FIRMWARE:grblHAL] / [SIGNALS:D] / [NVS STORAGE:*EEPROM] / [DRIVER:Simulator] / [DRIVER VERSION:260324] / ok
            G33Z-1K1                 error:41
            bytes \n                 ok
            S60M3                    ok
            G33Z-1                   error:39
            bytes \n                 ok
            G33Z-9K100               error:43
            bytes \n                 ok
            G33Z-2K1                 ok
            $G
            ^?
            wait 1
            ^!
            settle                   <Hold:0|MPos:0.000,0.000,0.000|Bf:99,1020|FS:0,60|Ov:100,100,100|A:S|TLR:0>
            ^?                       <Hold:0|MPos:0.000,0.000,0.000|Bf:99,1020|FS:0,60|WCO:0.000,0.000,0.000>
            ^~                       [MSG:]
            wait 1
            ^!
            ^?
            settle                   <Run:1|MPos:0.000,0.000,0.000|Bf:99,1020|FS:0,60>
            ^?                       <Hold:0|MPos:0.000,0.000,-2.000|Bf:100,1020|FS:0,60>
            ^~                       [MSG:] / [GC:G33 G54 G17 G21 G90 G94 G49 G98 G50 M3 M9 T0 F0 S60] / ok
            ^?                       <Idle|MPos:0.000,0.000,-2.000|Bf:100,1023|FS:0,60>
            S20M3                    ok
            G33Z-3K1                 ok
            ^?
            wait 6                   ALARM:14 / <Idle|MPos:0.000,0.000,-2.000|Bf:100,1023|FS:0,20|A:S>
            ^?                       <Idle|MPos:0.000,0.000,-2.000|Bf:100,1023|FS:0,20>
        "#]],
    );
    check(
        hal(&[]),
        "G33Z-1K1",
        expect![[r#"
        G33Z-1K1                 error:20
    "#]],
    );
}

// With a motion before it, its answer comes at its end.
#[test]
fn a_thread_after_a_motion_is_answered_at_its_end() {
    let encoder = Build { has_spindle_encoder: true, ..hal(&[]) };
    let script = "
        S300M3
        G0X1
        G33Z-2K1
        G0X2
        ^?
        settle
        ^?
    ";
    check(
        encoder,
        script,
        expect![[r#"
        S300M3                   ok
        G0X1                     ok
        G33Z-2K1
        G0X2
        ^?                       <Run|MPos:0.000,0.000,0.000|Bf:99,1018|FS:0,300|Ov:100,100,100|A:S|TLR:0>
        settle                   ok / ok
        ^?                       <Run|MPos:1.000,0.000,-2.000|Bf:99,1023|FS:0,300|WCO:0.000,0.000,0.000>
    "#]],
    );
}

// `gcode.c`: M64 switches as soon as it is read, M62 with the next motion, M66 waits and is reported once.
#[test]
fn outputs_are_switched_and_inputs_read_on_a_board_that_has_them() {
    let board = Build { ports: [2, 2, 1, 1], ..hal(&[]) };
    let script = "
        $I
        M64P2
        bytes \\n
        M64
        bytes \\n
        M66P0
        bytes \\n
        M66P0L3
        bytes \\n
        M66E0L3Q1
        bytes \\n
        M62P1G0X1
        M68E0Q2.5
        settle
        M66P1L3Q1
        ^?
        wait 2
        ^?
        ^?
        M66E0L0
        ^?
    ";
    check(
        board,
        script,
        expect![[r#"
            $I                       [VER:1.1f.20260817:] / [OPT:VNML+,100,1024,3,0] / [AXS:3:XYZ] / [NEWOPT:ENUMS,RT+,TC,SED] / [FIRMWARE:grblHAL] / [SIGNALS:D] / [NVS STORAGE:*EEPROM] / [DRIVER:Simulator] / [DRIVER VERSION:260324] / [AUX IO:2,2,1,1] / ok
            M64P2                    error:39
            bytes \n                 ok
            M64                      error:28
            bytes \n                 ok
            M66P0                    error:28
            bytes \n                 ok
            M66P0L3                  error:39
            bytes \n                 ok
            M66E0L3Q1                error:39
            bytes \n                 ok
            M62P1G0X1                ok
            M68E0Q2.5                ok
            settle
            M66P1L3Q1
            ^?                       <Run|MPos:0.000,0.000,0.000|Bf:99,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
            wait 2                   ok
            ^?                       <Idle|MPos:1.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|In:-1>
            ^?                       <Idle|MPos:1.000,0.000,0.000|Bf:100,1023|FS:0,0>
            M66E0L0                  ok
            ^?                       <Idle|MPos:1.000,0.000,0.000|Bf:100,1023|FS:0,0|In:0>
        "#]],
    );
    check(
        hal(&[]),
        "M64P0",
        expect![[r#"
        M64P0                    error:20
    "#]],
    );
}
