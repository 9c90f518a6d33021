//! What FluidNC does differently.

use crate::script::{check, fluid};
use expect_test::expect;

// Boot messages; state Starting; the line as of section 2, banner with FluidNC in it.
#[test]
fn it_prints_boot_messages_before_its_banner() {
    let script = "
        power
        ^?
        $I
        wait 0.3
        ^?
        settle
        ^?
        ^18
        $I
        ^?
    ";
    check(
        fluid(&[]),
        script,
        expect![[r#"
        power                    rst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT) / [MSG:INFO: FluidNC v4.0.5-pre2] / [MSG:INFO: Local filesystem type is littlefs] / [MSG:INFO: Machine Virtual] / [MSG:INFO: Axis count 3]
        ^?                       <Starting|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        $I
        wait 0.3
        ^?                       <Starting|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,100>
        settle                   Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        ^18                      Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]
        $I                       [VER:4.0 FluidNC v4.0.5-pre2:] / [OPT:MPHS] / [MSG: Machine: Virtual] / ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
    "#]],
    );
}

// Table of real-time bytes: 0x87 runs Macro0.
#[test]
fn a_byte_that_grblhal_takes_for_a_report_runs_a_macro() {
    let script = "
        settle
        ^87
        ^8A
        G1X50F600
        ^87
    ";
    check(
        fluid(&[]),
        script,
        expect![[r#"
        settle                   Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]
        ^87                      [MSG:INFO: Macro0]
        ^8A                      [MSG:INFO: Macro3]
        G1X50F600                ok
        ^87                      [MSG:ERR: Macro can only be used in idle state]
    "#]],
    );
}

// Table of real-time bytes: 0x0C, and any other control character.
#[test]
fn a_control_character_switches_echo_on() {
    let script = "
        settle
        ^19
        G0X1
        wait 1
        ^?
        ^0C
        G0X2
    ";
    check(
        fluid(&[]),
        script,
        expect![[r#"
        settle                   Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]
        ^19
        G0X1                     G0X1 / ok
        wait 1
        ^?                       <Idle|MPos:1.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        ^0C
        G0X2                     ok
    "#]],
    );
}

// Table of flow control: 254 characters.
#[test]
fn a_long_line_is_cut_off_and_executed() {
    // 248 characters of comment leave room for six.
    let line = format!("({})G0X1.5Y7", "a".repeat(246));
    let script = format!("settle\n{line}\nwait 3\n^?\nG0X2");
    check(
        fluid(&[]),
        &script,
        expect![[r#"
        settle                   Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]
        (aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa)G0X1.5Y7 ok
        wait 3
        ^?                       <Idle|MPos:1.500,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        G0X2                     ok
    "#]],
    );
}

// Rows "error handling" and "line end".
#[test]
fn errors_do_not_stick_and_pairs_of_line_ends_are_one() {
    let script = r"
        settle
        bytes G0X1\r\nG41\r\nG0X2\r\n
    ";
    check(
        fluid(&[]),
        script,
        expect![[r#"
        settle                   Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]
        bytes G0X1\r\nG41\r\nG0X2\r\n ok / error:20 / ok
    "#]],
    );
}

// Framing: `[MSG:INFO: ...]`.
#[test]
fn messages_are_worded_and_wrapped_in_its_way() {
    let script = "
        settle
        G0X1
        $X
        $C
        $C
        M30
        door
        shut
        ^~
    ";
    check(
        fluid(&["$22=1"]),
        script,
        expect![[r#"
        settle                   Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help] / [MSG:INFO: '$H'|'$X' to unlock]
        G0X1                     error:9
        $X                       [MSG:INFO: Caution: Unlocked] / ok
        $C                       [MSG:INFO: Enabled] / ok
        $C                       [MSG:INFO: Disabled] / ok / Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]
        M30                      [MSG:INFO: Program End] / ok
        door                     [MSG:INFO: Check door]
        shut
        ^~
    "#]],
    );
}

// States: Home.
#[test]
fn homing_reports_all_the_time() {
    let script = "
        settle
        $H
        ^?
        wait 1
        ^?
        settle
    ";
    check(
        fluid(&["$22=1"]),
        script,
        expect![[r#"
        settle                   Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help] / [MSG:INFO: '$H'|'$X' to unlock]
        $H
        ^?                       <Home|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        wait 1
        ^?                       <Home|MPos:0.000,0.000,7.986|FS:0,0|Ov:100,100,100>
        settle                   ok
    "#]],
    );
}

// Critical alarms 1, 2, 13 and 16.
#[test]
fn a_critical_alarm_swallows_lines_and_reports() {
    let script = "
        settle
        G1X50F600
        wait 1
        alarm 13
        ^?
        $X
        G0X1
        ^18
        $X
    ";
    check(
        fluid(&[]),
        script,
        expect![[r#"
        settle                   Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]
        G1X50F600                ok
        wait 1
        alarm 13                 ALARM:13 / [MSG:INFO: Reset to continue]
        ^?                       <Alarm|MPos:9.500,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        $X
        G0X1
        ^18                      Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help] / [MSG:INFO: '$H'|'$X' to unlock]
        $X                       [MSG:INFO: Caution: Unlocked] / ok
    "#]],
    );
}

// Row "0x18 generally".
#[test]
fn a_reset_in_motion_answers_nothing_that_is_pending() {
    let script = "
        settle
        G1X50F600
        G4P1
        wait 1
        ^18
        $X
    ";
    check(
        fluid(&[]),
        script,
        expect![[r#"
        settle                   Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]
        G1X50F600                ok
        G4P1
        wait 1
        ^18                      ALARM:3 / Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help] / [MSG:INFO: '$H'|'$X' to unlock]
        $X                       [MSG:INFO: Caution: Unlocked] / ok
    "#]],
    );
}
