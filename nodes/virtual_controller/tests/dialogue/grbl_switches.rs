//! What grbl 1.1h does at switches: homing, limits, the probe.

use crate::script::{check, plain};
use expect_test::expect;

#[test]
fn homing_takes_its_time_in_silence() {
    let script = "
        ^18
        G0X1
        $H
        ^?
        wait 1
        settle
        ^?
        $J=X1F100
        $J=X-5F1000
        settle
        wait 5
        ^?
    ";
    check(
        plain(&["$22=1", "$20=1"]),
        script,
        expect![[r#"
            ^18                      Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
            G0X1                     error:9
            $H
            ^?
            wait 1
            settle                   ok / <Idle|MPos:-1.000,-1.000,-1.000|FS:0,0|WCO:0.000,0.000,0.000>
            ^?                       <Idle|MPos:-1.000,-1.000,-1.000|FS:0,0|Ov:100,100,100>
            $J=X1F100                error:15
            $J=X-5F1000              ok
            settle
            wait 5
            ^?                       <Idle|MPos:-5.000,-1.000,-1.000|FS:0,0>
        "#]],
    );
}

#[test]
fn homing_towards_the_other_end_leaves_the_other_coordinate() {
    let script = "
        $H
        settle
        ^?
    ";
    check(
        plain(&["$22=1", "$23=3"]),
        script,
        expect![[r#"
        $H
        settle                   ok
        ^?                       <Idle|MPos:-199.000,-199.000,-1.000|FS:0,0|WCO:0.000,0.000,0.000>
    "#]],
    );
}

#[test]
fn homing_fails_when_a_switch_is_cut_or_stuck_or_when_it_is_reset() {
    let script = "
        cut Z
        $H
        settle
        ^?
        power
        mend Z
        limit X
        $H
        settle
        release X
        $H
        wait 1
        ^18
        $H
        wait 1
        door
        shut
    ";
    check(
        plain(&["$22=1"]),
        script,
        expect![[r#"
            cut Z
            $H
            settle                   ALARM:9 / ok / Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
            ^?                       <Alarm|MPos:0.000,0.000,300.000|FS:0,0|WCO:0.000,0.000,0.000>
            power                    Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
            mend Z
            limit X
            $H
            settle                   ALARM:8 / ok / Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
            release X
            $H
            wait 1
            ^18                      ALARM:6 / ok / Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
            $H
            wait 1
            door                     ALARM:7 / ok / Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
            shut
        "#]],
    );
}

#[test]
fn after_a_soft_limit_nothing_but_a_reset_is_accepted() {
    let mut build = plain(&["$22=1", "$20=1"]);
    build.start_in_machine = Some([-10.0, -10.0, -10.0]);
    let script = "
        $X
        G90G1X-40F3000
        X-45
        wait 0.5
        X900
        X-41
        ^?
        settle
        ^?
        $X
        ^18
        ^?
        $X
    ";
    check(
        build,
        script,
        expect![[r#"
            $X                       [MSG:Caution: Unlocked] / ok
            G90G1X-40F3000           ok
            X-45                     ok
            wait 0.5
            X900
            X-41
            ^?                       <Hold:1|MPos:-22.500,-10.000,-10.000|FS:3000,0|WCO:0.000,0.000,0.000>
            settle                   ALARM:2 / [MSG:Reset to continue]
            ^?
            $X
            ^18                      ok / Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
            ^?                       <Alarm|MPos:-35.000,-10.000,-10.000|FS:0,0|WCO:0.000,0.000,0.000>
            $X                       [MSG:Caution: Unlocked] / ok
        "#]],
    );
}

#[test]
fn a_hard_limit_stops_dead_where_the_switch_is() {
    let mut build = plain(&["$21=1"]);
    build.start_in_machine = Some([-10.0, -10.0, -10.0]);
    let script = "
        G91G1X20F1200
        wait 5
        ^?
        ^18
        $X
        ^?
        G91G1X-5F1200
        wait 2
        ^?
        limit Y
        ^18
        release Y
        ^18
    ";
    check(
        build,
        script,
        expect![[r#"
        G91G1X20F1200            ok
        wait 5                   ALARM:1 / [MSG:Reset to continue]
        ^?
        ^18                      Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
        $X                       [MSG:Caution: Unlocked] / ok
        ^?                       <Idle|MPos:0.000,-10.000,-10.000|FS:0,0|WCO:0.000,0.000,0.000>
        G91G1X-5F1200            ok
        wait 2
        ^?                       <Idle|MPos:-5.000,-10.000,-10.000|FS:0,0|Ov:100,100,100>
        limit Y                  ALARM:1 / [MSG:Reset to continue]
        ^18                      Grbl 1.1h ['$' for help] / [MSG:Check Limits] / [MSG:'$H'|'$X' to unlock]
        release Y
        ^18                      Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
    "#]],
    );
}

#[test]
fn a_probe_finds_the_surface_or_says_that_it_did_not() {
    let mut build = plain(&[]);
    build.start_in_machine = Some([5.0, 0.0, 0.0]);
    build.probe_surface_z_mm = Some(-3.988);
    let script = "
        G38.2Z-10F100
        settle
        $#
        ^?
        G38.2Z-10F100
        G0Z0
        $X
        G0Z0
        wait 3
        G38.3Z-2F100
        settle
        G38.2Z-3F100
        settle
        $X
        G38.4Z-1F100
    ";
    check(
        build,
        script,
        expect![[r#"
        G38.2Z-10F100
        settle                   [PRB:5.000,0.000,-3.988:1] / ok
        $#                       [G54:0.000,0.000,0.000] / [G55:0.000,0.000,0.000] / [G56:0.000,0.000,0.000] / [G57:0.000,0.000,0.000] / [G58:0.000,0.000,0.000] / [G59:0.000,0.000,0.000] / [G28:0.000,0.000,0.000] / [G30:0.000,0.000,0.000] / [G92:0.000,0.000,0.000] / [TLO:0.000] / [PRB:5.000,0.000,-3.988:1] / ok
        ^?                       <Idle|MPos:5.000,0.000,-4.004|FS:0,0|Pn:P|WCO:0.000,0.000,0.000>
        G38.2Z-10F100            ALARM:4 / ok
        G0Z0                     error:9
        $X                       [MSG:Caution: Unlocked] / ok
        G0Z0                     ok
        wait 3
        G38.3Z-2F100
        settle                   [PRB:5.000,0.000,-2.000:0] / ok
        G38.2Z-3F100
        settle                   ALARM:5 / [PRB:5.000,0.000,-3.000:0] / ok
        $X                       [MSG:Caution: Unlocked] / ok
        G38.4Z-1F100             ALARM:4 / ok
    "#]],
    );
}
