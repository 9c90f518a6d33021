//! How grblHAL parks the tool while the door is open.

use crate::script::{check, hal};
use expect_test::expect;

/// Z is the parking axis: 5 mm out at 300 mm/min, then to -5 at 3000 mm/min.
const SETTINGS: [&str; 5] = ["$22=1", "$41=1", "$57=300", "$59=3000", "$10=13"];

// Rows "door pin / 0x84" and the settings $41, $42, $56 to $59.
#[test]
fn the_tool_goes_away_without_its_spindle_and_comes_back_with_it() {
    let script = "
        $H
        settle
        G0X-50Y-50Z-50
        M3S500
        G1X-100F600
        wait 4
        door
        ^?
        wait 0.6
        ^?
        wait 1.2
        ^?
        wait 5
        ^?
        ^~
        ^?
        shut
        ^?
        ^~
        wait 1
        ^?
        wait 4
        ^?
        wait 1
        ^?
        wait 3
        ^?
        wait 5
        ^?
    ";
    check(
        hal(&SETTINGS),
        script,
        expect![[r#"
            $H                       <Home|MPos:0.000,0.000,0.000|FS:0,0|A:|TLR:0>
            settle                   [MSG:] / ok
            G0X-50Y-50Z-50           ok
            M3S500
            G1X-100F600
            wait 4                   ok / ok
            door                     [MSG:Check Door]
            ^?                       <Door:2|MPos:-75.500,-50.000,-50.000|FS:600,500|A:S|H:1>
            wait 0.6
            ^?                       <Door:2|MPos:-76.000,-50.000,-47.624|FS:300,500>
            wait 1.2
            ^?                       <Door:2|MPos:-76.000,-50.000,-25.000|FS:3000,0|A:>
            wait 5
            ^?                       <Door:1|MPos:-76.000,-50.000,-5.000|FS:0,0>
            ^~
            ^?                       <Door:1|MPos:-76.000,-50.000,-5.000|FS:0,0>
            shut
            ^?                       <Door:0|MPos:-76.000,-50.000,-5.000|FS:0,0>
            ^~
            wait 1
            ^?                       <Door:4|MPos:-76.000,-50.000,-40.500|FS:1800,0>
            wait 4
            ^?                       <Door:4|MPos:-76.000,-50.000,-45.000|FS:0,500|A:S>
            wait 1
            ^?                       <Door:4|MPos:-76.000,-50.000,-48.376|FS:300,500>
            wait 3
            ^?                       <Idle|MPos:-100.000,-50.000,-50.000|FS:0,500>
            wait 5
            ^?                       <Idle|MPos:-100.000,-50.000,-50.000|FS:0,500>
        "#]],
    );
}

#[test]
fn a_door_that_opens_on_the_way_back_sends_the_tool_away_again() {
    let script = "
        $H
        settle
        G0Z-50
        G4P0
        settle
        ^84
        wait 5
        ^?
        ^~
        wait 0.3
        ^84
        ^?
        wait 5
        ^?
        ^~
        wait 5
        ^?
    ";
    check(
        hal(&SETTINGS),
        script,
        expect![[r#"
        $H                       <Home|MPos:0.000,0.000,0.000|FS:0,0|A:|TLR:0>
        settle                   [MSG:] / ok
        G0Z-50                   ok
        G4P0
        settle                   ok
        ^84                      [MSG:Check Door]
        wait 5
        ^?                       <Door:0|MPos:-1.000,-1.000,-5.000|FS:0,0|A:|H:1>
        ^~
        wait 0.3
        ^84                      [MSG:Check Door]
        ^?                       <Door:2|MPos:-1.000,-1.000,-9.500|FS:1800,0>
        wait 5
        ^?                       <Door:0|MPos:-1.000,-1.000,-5.000|FS:0,0|A:>
        ^~
        wait 5
        ^?                       <Idle|MPos:-1.000,-1.000,-50.000|FS:0,0|A:>
    "#]],
    );
}

#[test]
fn a_reset_in_parking_locks_and_keeps_the_place() {
    let script = "
        $H
        settle
        G0Z-50
        G4P0
        settle
        ^84
        wait 0.5
        ^18
        ^?
    ";
    check(
        hal(&SETTINGS),
        script,
        expect![[r#"
        $H                       <Home|MPos:0.000,0.000,0.000|FS:0,0|A:|TLR:0>
        settle                   [MSG:] / ok
        G0Z-50                   ok
        G4P0
        settle                   ok
        ^84                      [MSG:Check Door]
        wait 0.5
        ^18                      ALARM:3 / GrblHAL 1.1f ['$' or '$HELP' for help] / [MSG:'$H'|'$X' to unlock]
        ^?                       <Alarm|MPos:-1.000,-1.000,-47.624|FS:0,0|A:|TLR:0>
    "#]],
    );
}

#[test]
fn an_axis_that_is_not_homed_or_above_the_parking_position_stays() {
    let script = "
        G0Z-50
        wait 9
        ^84
        ^?
        ^~
        $H
        settle
        ^84
        ^?
    ";
    check(
        hal(&SETTINGS),
        script,
        expect![[r#"
        G0Z-50                   ok
        wait 9
        ^84                      [MSG:Check Door]
        ^?                       <Door:0|MPos:0.000,0.000,-50.000|FS:0,0|A:|TLR:0>
        ^~
        $H                       <Home|MPos:0.000,0.000,-50.000|FS:0,0>
        settle                   [MSG:] / ok
        ^84                      [MSG:Check Door]
        ^?                       <Door:0|MPos:-1.000,-1.000,-1.000|FS:0,0|H:1>
    "#]],
    );
}
