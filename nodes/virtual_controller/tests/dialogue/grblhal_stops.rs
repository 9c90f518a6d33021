//! What makes grblHAL wait or stop: holds, resets, dwells, tool changes, doors, jogs.

use crate::script::{check, hal};
use expect_test::expect;

// Row "`!` `~`".
#[test]
fn a_hold_shows_the_feed_from_before_and_ends_with_an_empty_message() {
    let script = "
        G1X50F600
        wait 1
        ^!
        ^?
        wait 1
        ^?
        ^~
        wait 0.1
        ^?
        wait 10
        ^!
        G1X60
        ^?
        ^~
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        G1X50F600                ok
        wait 1
        ^!
        ^?                       <Hold:1|MPos:9.500,0.000,0.000|Bf:99,1023|FS:600,0|Ov:100,100,100|A:|TLR:0>
        wait 1
        ^?                       <Hold:0|MPos:10.000,0.000,0.000|Bf:99,1023|FS:600,0|WCO:0.000,0.000,0.000>
        ^~                       [MSG:]
        wait 0.1
        ^?                       <Run|MPos:10.500,0.000,0.000|Bf:99,1023|FS:600,0>
        wait 10
        ^!
        G1X60
        ^?                       <Hold:0|MPos:50.000,0.000,0.000|Bf:100,1017|FS:0,0>
        ^~                       [MSG:] / ok
    "#]],
    );
}

// Rows "0x18 moving", "0x18 in Hold:0", "0x18 generally": nothing pending is answered.
#[test]
fn a_reset_in_motion_locks_and_one_in_a_hold_does_not() {
    let script = "
        G1X50F600
        G4P1
        wait 1
        ^18
        ^?
        $X
        G1X50F600
        G4P1
        wait 1
        ^!
        wait 1
        ^18
        ^?
        G4P5
        ^18
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        G1X50F600                ok
        G4P1
        wait 1
        ^18                      ALARM:3 / GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
        ^?                       <Alarm|MPos:9.500,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        $X                       [MSG:Caution: Unlocked] / ok
        G1X50F600                ok
        G4P1
        wait 1
        ^!
        wait 1
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help]
        ^?                       <Idle|MPos:19.500,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        G4P5
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help]
    "#]],
    );
}

// Row "0x19".
#[test]
fn a_stop_keeps_the_position_and_forgets_the_rest() {
    let script = "
        M3S500
        G1X50F600
        G4P1
        G1X60
        wait 1
        ^19
        wait 0.5
        ^?
        $G
        G1X9
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        M3S500                   ok
        G1X50F600                ok
        G4P1
        G1X60
        wait 1
        ^19
        wait 0.5                 [MSG:Stop]
        ^?                       <Idle|MPos:10.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        $G                       [GC:G0 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F0 S500] / ok
        G1X9                     error:22
    "#]],
    );
}

// Row "dwell G4".
#[test]
fn a_dwell_withholds_its_ok_and_looks_idle() {
    let script = "
        G4P1.5
        ^?
        wait 2
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        G4P1.5
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        wait 2                   ok
    "#]],
    );
}

// Row "M6" with `$341=0`.
#[test]
fn a_tool_change_answers_first_and_then_nothing_until_a_start() {
    let script = "
        ^?
        ^?
        M3S500
        G1X5F600
        T2M6
        settle
        ^?
        $I
        G1X6F600
        wait 5
        ^~
        ^?
        wait 3
        M6
        ^18
        M6
        ^19
        ^?
        $341=4
        M6
        G1X7F600
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
            M3S500                   ok
            G1X5F600                 ok
            T2M6
            settle                   ok
            ^?                       <Tool|MPos:5.000,0.000,0.000|Bf:100,1023|FS:0,0|A:T>
            $I
            G1X6F600
            wait 5
            ^~                       <Idle|MPos:5.000,0.000,0.000|Bf:100,1011|FS:0,0|A:|T:2> / [VER:1.1f.20260817:] / [OPT:VNML+,100,1024,3,0] / [AXS:3:XYZ] / [NEWOPT:ENUMS,RT+,TC,SED] / [FIRMWARE:grblHAL] / [SIGNALS:D] / [NVS STORAGE:*EEPROM] / [DRIVER:Simulator] / [DRIVER VERSION:260324] / ok / ok
            ^?                       <Run|MPos:5.000,0.000,0.000|Bf:99,1023|FS:0,0>
            wait 3
            M6                       ok
            ^18                      GrblHAL 1.1f ['$' or '$HELP' for help]
            M6                       ok
            ^19                      [MSG:Stop]
            ^?                       <Idle|MPos:6.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
            $341=4                   ok
            M6                       ok
            G1X7F600                 ok
        "#]],
    );
}

// Row "M0/M1".
#[test]
fn programs_pause_and_end() {
    let script = "
        M0
        ^?
        G0X1
        ^~
        wait 2
        M1
        ^?
        ^~
        ^88
        M1
        M30
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        M0
        ^?                       <Hold:0|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        G0X1
        ^~                       [MSG:] / ok / ok
        wait 2
        M1
        ^?                       <Hold:0|MPos:1.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        ^~                       [MSG:] / ok
        ^88
        M1                       ok
        M30                      [MSG:Pgm End] / ok
    "#]],
    );
}

// Row "door pin / 0x84": 2 retracting, 1 ajar, 0 closed, 4 resuming.
#[test]
fn a_door_opens_stops_closes_and_resumes() {
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
        wait 3.9
        ^?
        wait 0.2
        ^?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        M3S100                   ok
        G1X20F600                ok
        wait 1
        door                     [MSG:Check Door]
        ^?                       <Door:2|MPos:9.500,0.000,0.000|Bf:99,1023|FS:600,100|Pn:D|Ov:100,100,100|A:S|TLR:0>
        wait 1
        ^?                       <Door:1|MPos:10.000,0.000,0.000|Bf:99,1023|FS:0,0|Pn:D|WCO:0.000,0.000,0.000>
        ^~
        ^?                       <Door:1|MPos:10.000,0.000,0.000|Bf:99,1023|FS:0,0|Pn:D>
        shut
        ^?                       <Door:0|MPos:10.000,0.000,0.000|Bf:99,1023|FS:0,0>
        ^~
        ^?                       <Door:4|MPos:10.000,0.000,0.000|Bf:99,1023|FS:0,100>
        wait 3.9
        ^?                       <Door:4|MPos:10.000,0.000,0.000|Bf:99,1023|FS:0,100>
        wait 0.2
        ^?                       <Run|MPos:10.500,0.000,0.000|Bf:99,1023|FS:600,100>
    "#]],
    );
}

// Table of states: Door:3 cancels.
#[test]
fn a_door_ends_a_jog_for_good() {
    let script = "
        $J=G91X50F600
        wait 1
        ^84
        ^?
        wait 1
        ^?
        ^~
        ^?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        $J=G91X50F600            ok
        wait 1
        ^84                      [MSG:Check Door]
        ^?                       <Door:3|MPos:9.500,0.000,0.000|Bf:99,1023|FS:600,0|Ov:100,100,100|A:|TLR:0>
        wait 1
        ^?                       <Door:0|MPos:10.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        ^~
        ^?                       <Idle|MPos:10.000,0.000,0.000|Bf:100,1023|FS:0,0>
    "#]],
    );
}

// Row "`$J=`".
#[test]
fn a_jog_locks_gcode_out() {
    let script = r"
        $J=X1
        bytes \n
        $J=X10F1000
        bytes \n
        $J=X-10F1000M3
        bytes \n
        $J=X-10F1000
        G0X1
        wait 5
        $40=1
        $J=X500F6000
        wait 5
        ^?
        $G
    ";
    check(
        hal(&["$22=1", "$20=1"]),
        script,
        expect![[r#"
        $J=X1                    error:22
        bytes \n                 ok
        $J=X10F1000              error:15
        bytes \n                 ok
        $J=X-10F1000M3           error:16
        bytes \n                 ok
        $J=X-10F1000             ok
        G0X1                     error:9
        wait 5
        $40=1                    ok
        $J=X500F6000             ok
        wait 5
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        $G                       [GC:G0 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F0 S0] / ok
    "#]],
    );
}

// Row "0x85".
#[test]
fn a_jog_cancel_throws_away_what_is_not_read() {
    let script = r"
        power
        bytes $J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n
        bytes $J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n
        bytes $J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n
        bytes $J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n
        wait 0.5
        ^85
        wait 5
        ^?
    ";
    check(
        hal(&["$398=30"]),
        script,
        expect![[r#"
        power                    GrblHAL 1.1f ['$' or '$HELP' for help]
        bytes $J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n ok / ok / ok / ok / ok / ok / ok / ok / ok / ok
        bytes $J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n ok / ok / ok / ok / ok / ok / ok / ok / ok / ok
        bytes $J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n ok / ok / ok / ok / ok / ok / ok / ok / ok / ok
        bytes $J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n$J=G91X1F600\n
        wait 0.5                 ok / ok / ok / ok
        ^85
        wait 5
        ^?                       <Idle|MPos:5.000,0.000,0.000|Bf:30,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
    "#]],
    );
}
