//! What grblHAL does at switches and asleep: homing, limits, the probe, check mode.

use crate::script::{check, hal};
use expect_test::expect;

// Row "`$H`".
#[test]
fn homing_reports_itself_and_is_silent_then() {
    let script = "
        $H
        ^?
        wait 1
        settle
        ^?
        ^?
    ";
    check(
        hal(&["$22=1"]),
        script,
        expect![[r#"
        $H                       <Home|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        ^?
        wait 1
        settle                   [MSG:] / ok / <Idle|MPos:-1.000,-1.000,-1.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|H:1>
        ^?                       <Idle|MPos:-1.000,-1.000,-1.000|Bf:100,1023|FS:0,0>
        ^?                       <Idle|MPos:-1.000,-1.000,-1.000|Bf:100,1023|FS:0,0>
    "#]],
    );
}

// Row "`$H`": `$10` bit 12.
#[test]
fn homing_reports_on_request_if_the_mask_says_so() {
    let script = "
        $H
        ^?
        settle
    ";
    check(
        hal(&["$22=1", "$10=4607"]),
        script,
        expect![[r#"
        $H                       <Home|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        ^?                       <Home|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        settle                   [MSG:] / ok
    "#]],
    );
}

// Rows "`$H` fails" and "0x18 in homing".
#[test]
fn homing_fails_without_an_answer() {
    let script = "
        cut Z
        $H
        settle
        ^?
        power
        mend Z
        $H
        wait 1
        ^18
    ";
    check(
        hal(&["$22=1"]),
        script,
        expect![[r#"
        cut Z
        $H                       <Home|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        settle                   ALARM:9 / GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
        ^?                       <Alarm|MPos:0.000,0.000,300.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        power                    GrblHAL 1.1f ['$' or '$HELP' for help]
        mend Z
        $H                       <Home|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Pn:Z|Ov:100,100,100|A:|TLR:0>
        wait 1
        ^18                      ALARM:6 / GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
    "#]],
    );
}

// Row "soft limit in stream".
#[test]
fn after_a_soft_limit_lines_are_read_and_rejected() {
    let script = "
        G90G1X-40F3000
        X-45
        wait 0.5
        X900
        X-41
        X-42
        settle
        ^?
        $X
        $H
        G0X1
        $G
        ^18
        $X
    ";
    check(
        {
            let mut build = hal(&["$22=1", "$20=1", "$10=1535"]);
            build.start_in_machine = Some([-10.0, -10.0, -10.0]);
            build
        },
        script,
        expect![[r#"
        G90G1X-40F3000           ok
        X-45                     ok
        wait 0.5
        X900
        X-41
        X-42
        settle                   ALARM:2 / [MSG:Reset to continue]
        ^?                       <Alarm:2|MPos:-35.000,-10.000,-10.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        $X                       error:79
        $H                       error:79
        G0X1                     error:9
        $G                       [GC:G1 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F3000 S0] / ok
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
        $X                       [MSG:Caution: Unlocked] / ok
    "#]],
    );
}

// Row "hard limit".
#[test]
fn a_hard_limit_needs_a_reset() {
    let script = "
        G91G1X20F1200
        wait 5
        ^?
        limit X
        ^?
        ^18
        release X
        $X
    ";
    check(
        {
            let mut build = hal(&["$21=1"]);
            build.start_in_machine = Some([-10.0, -10.0, -10.0]);
            build
        },
        script,
        expect![[r#"
        G91G1X20F1200            ok
        wait 5                   ALARM:1 / [MSG:Reset to continue]
        ^?                       <Alarm|MPos:0.000,-10.000,-10.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        limit X
        ^?                       <Alarm|MPos:0.000,-10.000,-10.000|Bf:100,1023|FS:0,0|Pn:X|WCO:0.000,0.000,0.000>
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
        release X
        $X                       [MSG:Caution: Unlocked] / ok
    "#]],
    );
}

// Alarm 12.
#[test]
fn a_limit_switch_is_checked_after_a_reset_if_set() {
    let script = "
        limit X
        ^18
        release X
        ^18
        $X
    ";
    check(
        hal(&["$21=3"]),
        script,
        expect![[r#"
        limit X                  ALARM:1 / [MSG:Reset to continue]
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help] / ALARM:12 / [MSG:Check Limits]
        release X
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
        $X                       [MSG:Caution: Unlocked] / ok
    "#]],
    );
}

// Row "homing required (`$22` bit 2)".
#[test]
fn nothing_but_homing_unlocks_where_it_is_required() {
    let script = "
        ^18
        ^87
        $X
        G0X1
        $H
        settle
        ^18
    ";
    check(
        hal(&["$22=5"]),
        script,
        expect![[r#"
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help] / ALARM:11 / [MSG:Homing cycle required]
        ^87                      <Alarm:11|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|WCS:G54|Ov:100,100,100|A:|Sc:|MPG:0|H:0|T:0|P:0|TLR:0|FW:grblHAL>
        $X                       error:46
        G0X1                     error:9
        $H                       <Home|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        settle                   [MSG:] / ok
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help]
    "#]],
    );
}

// Row "e-stop".
#[test]
fn an_emergency_stop_is_critical() {
    let script = "
        alarm 10
        ^?
        $X
        ^18
        $X
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        alarm 10                 ALARM:10 / [MSG:Emergency stop - clear, then reset to continue]
        ^?                       <Alarm|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        $X                       error:79
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
        $X                       [MSG:Caution: Unlocked] / ok
    "#]],
    );
}

// Row "probe G38.2".
#[test]
fn a_probe_finds_the_surface_or_says_that_it_did_not() {
    let script = "
        G38.2Z-10F100
        ^?
        settle
        G38.2Z-10F100
        $X
        G0Z0
        wait 3
        G38.3Z-2F100
        settle
        G38.2Z-3F100
        settle
    ";
    check(
        {
            let mut build = hal(&["$10=2559"]);
            build.start_in_machine = Some([5.0, 0.0, 0.0]);
            build.probe_surface_z_mm = Some(-3.988);
            build
        },
        script,
        expect![[r#"
        G38.2Z-10F100
        ^?                       <Run:2|MPos:5.000,0.000,0.000|Bf:99,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        settle                   [PRB:5.000,0.000,-3.988:1] / ok
        G38.2Z-10F100            ALARM:4 / ok
        $X                       [MSG:Caution: Unlocked] / ok
        G0Z0                     ok
        wait 3
        G38.3Z-2F100
        settle                   [PRB:5.000,0.000,-2.000:0] / ok
        G38.2Z-3F100
        settle                   ALARM:5 / [PRB:5.000,0.000,-3.000:0] / ok
    "#]],
    );
}

// Row "check `$C`".
#[test]
fn check_mode_reads_and_moves_nothing() {
    let script = r"
        $C
        ^?
        G1X100F100
        T2M6
        M0
        G41
        G1X5
        bytes \n
        $C
        ^?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        $C                       [MSG:Enabled] / ok
        ^?                       <Check|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        G1X100F100               ok
        T2M6                     ok
        M0                       ok
        G41                      error:20
        G1X5                     error:20
        bytes \n                 ok
        $C                       [MSG:Disabled] / ok / GrblHAL 1.1f ['$' or '$HELP' for help]
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
    "#]],
    );
}

// Row "`$SLP`".
#[test]
fn sleep_has_to_be_enabled_and_locks_gcode_out() {
    let script = "
        $SLP
        $62=1
        $SLP
        ^?
        G0X1
        ^18
        ^?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        $SLP                     error:3
        $62=1                    ok
        $SLP                     ok / [MSG:Sleeping]
        ^?                       <Sleep|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        G0X1                     error:9
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
        ^?                       <Alarm|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
    "#]],
    );
}
