//! How grbl 1.1h restarts: resets, power, sleep, check mode, startup lines.

use crate::script::{check, plain};
use expect_test::expect;

#[test]
fn a_reset_in_motion_locks_and_one_in_a_hold_does_not() {
    let script = "
        G1X50F600
        wait 1
        ^18
        ^?
        G0X1
        $X
        ^?
        G0X50
        wait 0.5
        ^!
        ^?
        wait 2
        ^?
        ^18
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
            G1X50F600                ok
            wait 1
            ^18                      ALARM:3 / Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
            ^?                       <Alarm|MPos:9.500,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
            G0X1                     error:9
            $X                       [MSG:Caution: Unlocked] / ok
            ^?                       <Idle|MPos:9.500,0.000,0.000|FS:0,0|Ov:100,100,100>
            G0X50                    ok
            wait 0.5
            ^!
            ^?                       <Hold:1|MPos:22.000,0.000,0.000|FS:3000,0>
            wait 2
            ^?                       <Hold:0|MPos:34.500,0.000,0.000|FS:0,0>
            ^18                      Grbl 1.1h ['$' for help]
            ^?                       <Idle|MPos:34.500,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        "#]],
    );
}

#[test]
fn a_line_in_work_is_answered_between_alarm_and_banner() {
    let script = "
        G1X50F600
        G4P5
        wait 1
        ^18
        $X
        G4P5
        ^?
        ^18
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        G1X50F600                ok
        G4P5
        wait 1
        ^18                      ALARM:3 / ok / Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
        $X                       [MSG:Caution: Unlocked] / ok
        G4P5
        ^?                       <Idle|MPos:9.500,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        ^18                      ok / Grbl 1.1h ['$' for help]
    "#]],
    );
}

#[test]
fn check_mode_reads_and_moves_nothing() {
    let script = "
        $C
        ^?
        G1X100F100
        G2X0I-50
        G4P100
        G41
        M0
        M30
        ^?
        $C
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        $C                       [MSG:Enabled] / ok
        ^?                       <Check|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        G1X100F100               ok
        G2X0I-50                 ok
        G4P100                   ok
        G41                      error:20
        M0                       ok
        M30                      [MSG:Pgm End] / ok
        ^?                       <Check|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,100>
        $C                       [MSG:Disabled] / ok / Grbl 1.1h ['$' for help]
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
    "#]],
    );
}

#[test]
fn in_sleep_only_a_reset_is_accepted() {
    let script = "
        $SLP
        ^?
        G0X1
        ^18
        $X
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        $SLP                     ok / [MSG:Sleeping]
        ^?                       <Sleep|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        G0X1
        ^18                      Grbl 1.1h ['$' for help] / [MSG:'$H'|'$X' to unlock]
        $X                       [MSG:Caution: Unlocked] / ok
    "#]],
    );
}

#[test]
fn startup_lines_run_after_a_reset_and_defaults_come_back() {
    let script = "
        $N0=G20 G55
        $N1=g91
        ^18
        $G
        $N
        $110=777
        $RST=*
        $N
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        $N0=G20 G55              ok
        $N1=g91                  ok
        ^18                      Grbl 1.1h ['$' for help] / >G20G55:ok / >G91:ok
        $G                       [GC:G0 G55 G17 G20 G91 G94 M5 M9 T0 F0 S0] / ok
        $N                       $N0=G20G55 / $N1=G91 / ok
        $110=777                 ok
        $RST=*                   [MSG:Restoring defaults] / ok / Grbl 1.1h ['$' for help]
        $N                       $N0= / $N1= / ok
    "#]],
    );
}

#[test]
fn a_power_cycle_forgets_where_it_is() {
    let script = "
        G0X5
        wait 2
        G1X50F100
        wait 1
        power
        ^?
        settle
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        G0X5                     ok
        wait 2
        G1X50F100                ok
        wait 1
        power                    Grbl 1.1h ['$' for help]
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        settle
    "#]],
    );
}
