//! What grblHAL reports: itself, its state, offsets, spindle and coolant.

use crate::script::{check, hal};
use expect_test::expect;
use virtual_controller::Build;

// Rows "banner", "`$I`", "OPT", "`?` idle, first after reset".
#[test]
fn it_introduces_itself() {
    let script = "
        ^18
        $I
        ^?
        ^?
        ^?
        $G
        $#
        $N
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help]
        $I                       [VER:1.1f.20260817:] / [OPT:VNML+,100,1024,3,0] / [AXS:3:XYZ] / [NEWOPT:ENUMS,RT+,TC,SED] / [FIRMWARE:grblHAL] / [SIGNALS:D] / [NVS STORAGE:*EEPROM] / [DRIVER:Simulator] / [DRIVER VERSION:260324] / ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0>
        $G                       [GC:G0 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F0 S0] / ok
        $#                       [G54:0.000,0.000,0.000] / [G55:0.000,0.000,0.000] / [G56:0.000,0.000,0.000] / [G57:0.000,0.000,0.000] / [G58:0.000,0.000,0.000] / [G59:0.000,0.000,0.000] / [G59.1:0.000,0.000,0.000] / [G59.2:0.000,0.000,0.000] / [G59.3:0.000,0.000,0.000] / [G28:0.000,0.000,0.000] / [G30:0.000,0.000,0.000] / [G92:0.000,0.000,0.000] / [TLO:0.000] / [PRB:0.000,0.000,0.000:0] / ok
        $N                       $N0= / $N1= / ok
    "#]],
    );
}

// Table of flow control: boards with 254 bytes exist; one byte of the ring stays empty.
#[test]
fn a_board_may_have_a_smaller_receive_buffer() {
    let script = "
        $I
        ^?
    ";
    check(
        {
            let mut build = hal(&[]);
            build.receive_buffer_bytes = Some(254);
            build
        },
        script,
        expect![[r#"
        $I                       [VER:1.1f.20260817:] / [OPT:VNML+,100,254,3,0] / [AXS:3:XYZ] / [NEWOPT:ENUMS,RT+,TC,SED] / [FIRMWARE:grblHAL] / [SIGNALS:D] / [NVS STORAGE:*EEPROM] / [DRIVER:Simulator] / [DRIVER VERSION:260324] / ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,253|FS:0,0|Ov:100,100,100|A:|TLR:0>
    "#]],
    );
}

// Row "Run": `Ln` stays on the last number in Idle.
#[test]
fn a_report_keeps_naming_the_line() {
    let script = "
        ^?
        ^?
        N10G1X10F600
        wait 0.5
        ^?
        wait 3
        ^?
        ^18
        ^?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        N10G1X10F600             ok
        wait 0.5
        ^?                       <Run|MPos:4.500,0.000,0.000|Bf:99,1023|Ln:10|FS:600,0>
        wait 3
        ^?                       <Idle|MPos:10.000,0.000,0.000|Bf:100,1023|Ln:10|FS:0,0>
        ^18                      GrblHAL 1.1f ['$' or '$HELP' for help]
        ^?                       <Idle|MPos:10.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
    "#]],
    );
}

// Row "0x87".
#[test]
fn every_field_comes_on_demand() {
    let script = "
        ^87
        $X
        ^87
        ^8C
        ^87
        alarm 10
        ^87
    ";
    check(
        hal(&["$22=1", "$64=1", "$481=200"]),
        script,
        expect![[r#"
        ^87                      <Alarm|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|WCS:G54|Ov:100,100,100|A:|Sc:|MPG:0|H:0|T:0|P:0|TLR:0|FW:grblHAL|AR:200>
        $X                       [MSG:Caution: Unlocked] / ok
        ^87                      <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|WCS:G54|Ov:100,100,100|A:|Sc:|MPG:0|H:0|T:0|P:0|TLR:0|FW:grblHAL|AR:200>
        ^8C
        ^87                      <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|WCS:G54|Ov:100,100,100|A:|Sc:|MPG:0|H:0|T:0|P:0|TLR:0|FW:grblHAL|AR>
        alarm 10                 ALARM:10 / [MSG:Emergency stop - clear, then reset to continue]
        ^87                      <Alarm:10|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|WCS:G54|Ov:100,100,100|A:|Sc:|MPG:0|H:0|T:0|P:0|TLR:0|FW:grblHAL|$C:1|AR>
    "#]],
    );
}

// Row "`???` in one write".
#[test]
fn three_requests_in_one_write_get_three_reports() {
    let script = "
        ^???
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        ^???                     <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0> / <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000> / <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0>
    "#]],
    );
}

// Table of real-time bytes: 0x05 and 0x80, 0x81, 0x82, 0x83.
#[test]
fn other_bytes_ask_for_the_same() {
    let script = "
        ^05
        ^80
        G1X100F600
        wait 1
        ^82
        wait 1
        ^80
        ^81
        wait 0.1
        ^80
        ^83
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        ^05                      <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        ^80                      <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        G1X100F600               ok
        wait 1
        ^82
        wait 1
        ^80                      <Hold:0|MPos:10.000,0.000,0.000|Bf:99,1023|FS:600,0>
        ^81                      [MSG:]
        wait 0.1
        ^80                      <Run|MPos:10.500,0.000,0.000|Bf:99,1023|FS:600,0>
        ^83                      [GC:G1 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F600 S0]
    "#]],
    );
}

// Row "offsets".
#[test]
fn offsets_show_in_the_next_report_with_the_system() {
    let script = "
        ^?
        ^?
        ^?
        G10L2P2X1Y2Z3
        G55
        ^?
        G92X10
        ^?
        G43.1Z-1.5
        ^?
        G59.3
        ^?
        $G
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0>
        G10L2P2X1Y2Z3            ok
        G55                      ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:1.000,2.000,3.000|WCS:G55>
        G92X10                   ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:-10.000,2.000,3.000>
        G43.1Z-1.5               ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:-10.000,2.000,1.500>
        G59.3                    ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:-11.000,0.000,-1.500|WCS:G59.3>
        $G                       [GC:G0 G59.3 G17 G21 G90 G94 G43.1 G98 G50 M5 M9 T0 F0 S0] / ok
    "#]],
    );
}

// Rows "spindle/coolant" and "overrides": `A:` is empty when all is off.
#[test]
fn accessories_show_once_when_they_change() {
    let script = "
        ^?
        ^?
        M3S600
        ^?
        M8
        M7
        ^?
        ^?
        ^9A
        ^?
        ^A0
        ^?
        M5
        M9
        ^?
        ^?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
            M3S600                   ok
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,600|A:S>
            M8                       ok
            M7                       ok
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,600|A:SFM>
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,600>
            ^9A
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,660|Ov:100,100,110>
            ^A0
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,660|A:SM>
            M5                       ok
            M9                       ok
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|A:>
            ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0>
        "#]],
    );
}

// Row "overrides": clamp 10..200.
#[test]
fn overrides_are_clamped() {
    let script = r"
        ^?
        ^?
        bytes \x91\x91\x91\x91\x91\x91\x91\x91\x91\x91\x91\x91
        ^?
        bytes \x90\x92\x92\x92\x92\x92\x92\x92\x92\x92\x92\x92\x97
        ^?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        bytes \x91\x91\x91\x91\x91\x91\x91\x91\x91\x91\x91\x91
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:200,100,100>
        bytes \x90\x92\x92\x92\x92\x92\x92\x92\x92\x92\x92\x92\x97
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:10,25,100>
    "#]],
    );
}

// Row "`$10` masks".
#[test]
fn the_mask_chooses_the_fields() {
    let script = "
        $10=0
        ^?
        $10=1
        ^?
        $10=2
        ^?
        $10=8
        ^?
        $10=1023
        ^?
        ^?
        G1F100
        ^?
        ^?
        $10=8193
        G1X10F600
        wait 0.5
        ^?
    ";
    check(
        hal(&[]),
        script,
        expect![[r#"
        $10=0                    ok
        ^?                       <Idle|WPos:0.000,0.000,0.000|A:|TLR:0>
        $10=1                    ok
        ^?                       <Idle|MPos:0.000,0.000,0.000>
        $10=2                    ok
        ^?                       <Idle|WPos:0.000,0.000,0.000|Bf:100,1023>
        $10=8                    ok
        ^?                       <Idle|WPos:0.000,0.000,0.000|FS:0,0>
        $10=1023                 ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|Ov:100,100,100> / [GC:G0 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F0 S0]
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000>
        G1F100                   ok
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0> / [GC:G1 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F100 S0]
        ^?                       <Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0>
        $10=8193                 ok
        G1X10F600                ok
        wait 0.5
        ^?                       <Run|MPos:4.500,0.000,0.000|DTG:5.500,0.000,0.000>
    "#]],
    );
}

// Row "`$10` masks": `$481` needs a reboot, then 0x8C toggles.
#[test]
fn reports_come_by_themselves_after_a_reboot() {
    let script = "
        $481=200
        wait 1
        power
        wait 0.5
        ^?
        ^8C
        wait 0.5
        ^?
        ^8C
        wait 0.3
    ";
    check(
        hal(&["$10=1"]),
        script,
        expect![[r#"
        $481=200                 ok
        wait 1
        power                    GrblHAL 1.1f ['$' or '$HELP' for help]
        wait 0.5                 <Idle|MPos:0.000,0.000,0.000|A:|TLR:0> / <Idle|MPos:0.000,0.000,0.000>
        ^?
        ^8C
        wait 0.5
        ^?                       <Idle|MPos:0.000,0.000,0.000>
        ^8C
        wait 0.3                 <Idle|MPos:0.000,0.000,0.000>
    "#]],
    );
}

// Row "`$13=1`".
#[test]
fn inches_show_in_reports_and_listings() {
    let script = "
        G92X25.4
        G43.1Z2.54
        G1F254
        ^?
        ^?
        $#
        $G
    ";
    check(
        hal(&["$13=1"]),
        script,
        expect![[r#"
        G92X25.4                 ok
        G43.1Z2.54               ok
        G1F254                   ok
        ^?                       <Idle|MPos:0.0000,0.0000,0.0000|Bf:100,1023|FS:0.0,0|WCO:-1.0000,0.0000,0.1000|A:|TLR:0>
        ^?                       <Idle|MPos:0.0000,0.0000,0.0000|Bf:100,1023|FS:0.0,0|Ov:100,100,100>
        $#                       [G54:0.0000,0.0000,0.0000] / [G55:0.0000,0.0000,0.0000] / [G56:0.0000,0.0000,0.0000] / [G57:0.0000,0.0000,0.0000] / [G58:0.0000,0.0000,0.0000] / [G59:0.0000,0.0000,0.0000] / [G59.1:0.0000,0.0000,0.0000] / [G59.2:0.0000,0.0000,0.0000] / [G59.3:0.0000,0.0000,0.0000] / [G28:0.0000,0.0000,0.0000] / [G30:0.0000,0.0000,0.0000] / [G92:-1.0000,0.0000,0.0000] / [TLO:0.1000] / [PRB:0.0000,0.0000,0.0000:0] / ok
        $G                       [GC:G1 G54 G17 G21 G90 G94 G43.1 G98 G50 M5 M9 T0 F10.0 S0] / ok
    "#]],
    );
}

#[test]
fn a_board_may_have_more_axes_and_those_that_turn_have_no_inches() {
    let script = "
        $I
        G20G0X1A90
        wait 10
        ^?
        G10L20P1A0
        ^?
        $13=1
        ^87
        G0B1
    ";
    let three = hal(&[]);
    let settings = three.settings.clone().with_axes("XYZA".parse().unwrap());
    check(
        Build { settings, ..three },
        script,
        expect![[r#"
        $I                       [VER:1.1f.20260817:] / [OPT:VNML+,100,1024,4,0] / [AXS:4:XYZA] / [NEWOPT:ENUMS,RT+,TC,SED] / [FIRMWARE:grblHAL] / [SIGNALS:D] / [NVS STORAGE:*EEPROM] / [DRIVER:Simulator] / [DRIVER VERSION:260324] / ok
        G20G0X1A90               ok
        wait 10
        ^?                       <Idle|MPos:25.400,0.000,0.000,90.000|Bf:100,1023|FS:0,0|Ov:100,100,100|A:|TLR:0>
        G10L20P1A0               ok
        ^?                       <Idle|MPos:25.400,0.000,0.000,90.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000,90.000>
        $13=1                    ok
        ^87                      <Idle|MPos:1.0000,0.0000,0.0000,90.0000|Bf:100,1023|FS:0.0,0|WCO:0.0000,0.0000,0.0000,90.0000|WCS:G54|Ov:100,100,100|A:|Sc:|MPG:0|H:0|T:0|P:0|TLR:0|FW:grblHAL>
        G0B1                     error:20
    "#]],
    );
}
