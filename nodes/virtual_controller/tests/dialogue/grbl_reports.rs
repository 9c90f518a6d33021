//! What grbl 1.1h reports: itself, offsets, spindle and coolant, line numbers.

use crate::script::{check, plain};
use expect_test::expect;

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
fn spindle_and_coolant_are_reported_with_the_overrides() {
    let script = "
        ^?
        M3S600
        ^?
        M8
        ^9A
        wait 0.01
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
        wait 0.01
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

// Source: serial.c and protocol_exec_rt_system; each override byte sets a bit.
#[test]
fn equal_override_bytes_between_two_passes_count_once_and_act_in_a_fixed_order() {
    let script = r"
        ^?
        ^?
        bytes \x91\x91\x91\x91\x91\x91\x91\x91\x91
        ^?
        wait 0.01
        ^?
        bytes \x93\x91\x94\x90\x9d\x9a\x95\x97
        wait 0.01
        ^?
        bytes \x91
        wait 0.01
        bytes \x91\x93
        wait 0.01
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,100>
        bytes \x91\x91\x91\x91\x91\x91\x91\x91\x91
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0>
        wait 0.01
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:110,100,100>
        bytes \x93\x91\x94\x90\x9d\x9a\x95\x97
        wait 0.01
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:110,25,109>
        bytes \x91
        wait 0.01
        bytes \x91\x93
        wait 0.01
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:131,25,109>
    "#]],
    );
}

// Eight bits: 10 - 10 - 1 is 255, which is cut to 200.
#[test]
fn two_steps_down_at_the_lower_limit_end_at_the_upper_one() {
    let script = r"
        ^?
        times 9 bytes \x92; wait 0.01
        ^?
        bytes \x92\x94
        wait 0.01
        ^?
    ";
    check(
        plain(&[]),
        script,
        expect![[r#"
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>
        times 9 bytes \x92; wait 0.01
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:10,100,100>
        bytes \x92\x94
        wait 0.01
        ^?                       <Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:200,100,100>
    "#]],
    );
}

#[test]
fn an_echo_is_a_compile_option_and_comes_before_the_line_acts() {
    let mut build = plain(&[]);
    build.echoes_lines = true;
    let script = "
        g1 x10 f600 (slowly)
        G99
        $G
    ";
    check(
        build,
        script,
        expect![[r#"
        g1 x10 f600 (slowly)     [echo: G1X10F600] / ok
        G99                      [echo: G99] / error:20
        $G                       [echo: $G] / [GC:G1 G54 G17 G21 G90 G94 M5 M9 T0 F600 S0] / ok
    "#]],
    );
}
