//! Conversations with the controller, as a terminal would show them.
//!
//! A script has one step a line: text is said as a line; `^` begins raw bytes
//! (`?`, `!`, `~` or hexadecimal); `wait S` lets seconds pass; `settle` goes
//! on until nothing is awaited. `limit X`, `release X`, `cut X`, `mend X`,
//! `door`, `shut` and `power` act on the machine.

mod common;
use common::{Bench, settings};
use expect_test::{Expect, expect};
use virtual_controller::Build;

fn axis(letter: &str) -> usize {
    ["X", "Y", "Z"].iter().position(|l| *l == letter).unwrap()
}

fn check(build: Build, script: &str, expected: Expect) {
    let mut bench = Bench::with(build);
    let mut transcript = String::new();
    for step in script.lines().map(str::trim).filter(|step| !step.is_empty()) {
        let (verb, argument) = step.split_once(' ').unwrap_or((step, ""));
        let heard = match verb {
            "wait" => bench.wait(argument.parse().unwrap()),
            "settle" => bench.settle(),
            "limit" => {
                bench.controller.hold_limit(axis(argument), true);
                bench.heard()
            }
            "release" => {
                bench.controller.hold_limit(axis(argument), false);
                bench.heard()
            }
            "mend" => {
                bench.controller.cut_limit(axis(argument), false);
                bench.heard()
            }
            "cut" => {
                bench.controller.cut_limit(axis(argument), true);
                bench.heard()
            }
            "door" => {
                bench.controller.set_door(true);
                bench.heard()
            }
            "shut" => {
                bench.controller.set_door(false);
                bench.heard()
            }
            "power" => {
                bench.controller.power_cycle();
                bench.heard()
            }
            _ => match step.strip_prefix('^') {
                Some(raw) if raw.len() == 2 => bench.send(&[u8::from_str_radix(raw, 16).unwrap()]),
                Some(raw) => bench.send(raw.as_bytes()),
                None => bench.say(step),
            },
        };
        transcript += format!("{step:<24} {heard}").trim_end();
        transcript += "\n";
    }
    expected.assert_eq(&transcript);
}

fn plain(lines: &[&str]) -> Build {
    Build::new(settings(lines))
}

#[test]
fn it_introduces_itself() {
    let script = "
        ^18
        $I
        $
        $N
        $G
        $#
        $$
        ^?
        ^?
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        ^18                      Grbl 1.1h ['$' for help]
        $I                       [VER:1.1h.20190830:] / [OPT:V,15,128] / ok
        $                        [HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x] / ok
        $N                       $N0= / $N1= / ok
        $G                       [GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0] / ok
        $#                       [G54:0.000,0.000,0.000] / [G55:0.000,0.000,0.000] / [G56:0.000,0.000,0.000] / [G57:0.000,0.000,0.000] / [G58:0.000,0.000,0.000] / [G59:0.000,0.000,0.000] / [G28:0.000,0.000,0.000] / [G30:0.000,0.000,0.000] / [G92:0.000,0.000,0.000] / [TLO:0.000] / [PRB:0.000,0.000,0.000:0] / ok
        $$                       $0=10 / $1=25 / $2=0 / $3=0 / $4=0 / $5=0 / $6=0 / $10=1 / $11=0.010 / $12=0.002 / $13=0 / $20=0 / $21=0 / $22=0 / $23=0 / $24=25.000 / $25=500.000 / $26=250 / $27=1.000 / $30=1000 / $31=0 / $32=0 / $100=250.000 / $101=250.000 / $102=250.000 / $110=6000.000 / $111=6000.000 / $112=6000.000 / $120=100.000 / $121=100.000 / $122=100.000 / $130=200.000 / $131=200.000 / $132=200.000 / ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,100>
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0>
    "#]],
    );
}

#[test]
fn offsets_show_in_the_next_report() {
    let script = "
        ^?
        ^?
        G10L2P2X1Y2Z3
        G55
        ^?
        G92X10
        ^?
        G43.1Z-1.5
        ^?
        $#
        G0X0Y0Z0
        wait 5
        ^?
        G92.1
        $10=0
        ^?
        $13=1
        ^?
        $G
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,100>
        G10L2P2X1Y2Z3            ok
        G55                      ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:1.000,2.000,3.000>
        G92X10                   ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:-10.000,2.000,3.000>
        G43.1Z-1.5               ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:-10.000,2.000,1.500>
        $#                       [G54:0.000,0.000,0.000] / [G55:1.000,2.000,3.000] / [G56:0.000,0.000,0.000] / [G57:0.000,0.000,0.000] / [G58:0.000,0.000,0.000] / [G59:0.000,0.000,0.000] / [G28:0.000,0.000,0.000] / [G30:0.000,0.000,0.000] / [G92:-11.000,0.000,0.000] / [TLO:-1.500] / [PRB:0.000,0.000,0.000:0] / ok
        G0X0Y0Z0                 ok
        wait 5
        ^?                       <Idle|MPos:-10.000,2.000,1.500|FS:0,0>
        G92.1                    ok
        $10=0                    ok
        ^?                       <Idle|WPos:-11.000,0.000,0.000|FS:0,0|WCO:1.000,2.000,1.500>
        $13=1                    ok
        ^?                       <Idle|WPos:-0.4331,0.0000,0.0000|FS:0.0,0>
        $G                       [GC:G0 G55 G17 G21 G90 G94 M5 M9 T0 F0.0 S0] / ok
    "#]],
    );
}

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
fn spindle_and_coolant_show_beside_the_overrides() {
    let script = "
        ^?
        M3S600
        ^?
        M8
        ^9A
        ^?
        ^A0
        ^?
        S9000
        ^?
        ^!
        ^9E
        ^?
        ^~
        M5
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        M3S600                   ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,600|Ov:100,100,100|A:S>
        M8                       ok
        ^9A
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,660|Ov:100,100,110|A:SF>
        ^A0
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,660|Ov:100,100,110|A:S>
        S9000                    ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,1000|Ov:100,100,110|A:S>
        ^!
        ^9E
        ^?                       <Hold:0|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,110>
        ^~
        M5                       ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,110>
    "#]],
    );
}

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
fn a_soft_limit_stops_the_stream_and_leaves_it_deaf() {
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
fn sleep_answers_and_then_listens_to_a_reset_alone() {
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

#[test]
fn a_jog_locks_gcode_out_and_lines_behind_a_cancel_still_run() {
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

#[test]
fn line_numbers_are_a_compile_option() {
    let mut build = plain(&["$10=3"]);
    build.has_line_numbers = true;
    let script = "
        $I
        N120G1X10F600
        wait 0.5
        ^?
        wait 3
        ^?
    ";
    check(
        build,
        script,
        expect![[r#"
        $I                       [VER:1.1h.20190830:] / [OPT:VN,15,128] / ok
        N120G1X10F600            ok
        wait 0.5
        ^?                       <Run|MPos:4.500,0.000,0.000|Bf:14,128|Ln:120|FS:600,0|WCO:0.000,0.000,0.000>
        wait 3
        ^?                       <Idle|MPos:10.000,0.000,0.000|Bf:15,128|FS:0,0|Ov:100,100,100>
    "#]],
    );
}
