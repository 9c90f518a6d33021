//! Status reports of grbl, grblHAL and FluidNC.

use super::super::*;
use super::read;
use cnc_msgs::contour::SpindleMode;

fn status(line: &str) -> StatusReport {
    match read(line) {
        Report::Status(report) => *report,
        other => panic!("{line} was read as {other:?}"),
    }
}

fn other(key: &str, value: &str) -> (String, String) {
    (key.to_owned(), value.to_owned())
}

#[test]
fn reports_that_miss_something_or_hold_two_are_damage() {
    for line in [
        "<Idle|MPos:0.0,x,0.0>",
        "<Idle|MPos:1,2>",
        "<Idle|MPos:1,2,3,4,5,6,7,8,9>",
        "<Run|MPos:nan,0,0>",
        "<Run|MPos:1e1,0,0>",
        "<Idle>",
        "<Idle|FS:0,0>",
        "<Idle|MPos:0,0,0|FS:0>",
        "<Idle|MPos:0,0,0|Ov:100,100>",
        "<Idle|MPos:0,0,0|Ov:100,100,1000>",
        "<Idle|MPos:0,0,0|Bf:15>",
        "<Idle|MPos:0,0,0|Ln:x>",
        "<Idle|MP<Idle|MPos:0.000,0.000,0.000>",
        "<Idle|MPos:0,0,0|FS:0,0|MPos:0,0,0|FS:0,0>",
        "<Id le|MPos:0,0,0>",
        "<Hold:|MPos:0,0,0>",
        "<Hold:x|MPos:0,0,0>",
        "<Hold:0:1|MPos:0,0,0>",
    ] {
        assert!(matches!(read(line), Report::Damaged(_)), "{line}: {:?}", read(line));
    }
    for line in [&b"<Idle|MPos:0,0,0|Pn:\xd8>"[..], b"<Idle|MPos:0,0,0|SD:1.0,\xff.nc>"] {
        assert!(matches!(parse(line, ReportUnits::Millimetres), Report::Damaged(_)));
    }
}

#[test]
fn a_status_report_of_grbl_gives_its_fields() {
    let report = status("<Idle|MPos:0.000,-1.250,3.000|FS:0,0|WCO:1.000,2.000,-3.500>");
    assert_eq!(report.state, ControllerState::Idle);
    assert_eq!(report.machine_position, Some([0.0, -1.25, 3.0]));
    assert_eq!(report.work_offset, Some([1.0, 2.0, -3.5]));
    assert_eq!((report.feed_mm_per_min, report.spindle_rpm), (Some(0.0), Some(0.0)));
    let report = status("<Hold:1|WPos:1.0,2.0,3.0|Bf:15,128|F:500|Pn:XP|Ov:100,50,110|A:SF>");
    assert_eq!((report.state.clone(), report.substate), (ControllerState::Hold, Some(1)));
    assert!(report.is_moving() && !report.is_held());
    assert_eq!(report.work_position, Some([1.0, 2.0, 3.0]));
    assert_eq!(report.free, Some((15, 128)));
    assert_eq!(report.feed_mm_per_min, Some(500.0));
    assert_eq!(report.pins.as_deref(), Some("XP"));
    assert_eq!(report.overrides_percent, Some([100, 50, 110]));
    assert_eq!(report.accessories.as_deref(), Some("SF"));
}

#[test]
fn states_and_what_they_say_of_motion() {
    use ControllerState as S;
    for (text, state, substate, is_moving, is_held) in [
        ("Idle", S::Idle, None, false, false),
        ("Run", S::Run, None, true, false),
        ("Run:1", S::Run, Some(1), true, false),
        ("Run:2", S::Run, Some(2), true, false),
        ("Hold:0", S::Hold, Some(0), false, true),
        ("Hold:1", S::Hold, Some(1), true, false),
        // One less than nothing, for a moment, on grblHAL.
        ("Hold:4294967295", S::Hold, Some(255), true, false),
        ("Jog", S::Jog, None, true, false),
        ("Alarm", S::Alarm, None, false, false),
        ("Alarm:11", S::Alarm, Some(11), false, false),
        ("Door:0", S::Door, Some(0), false, true),
        ("Door:1", S::Door, Some(1), false, true),
        ("Door:2", S::Door, Some(2), true, false),
        ("Door:3", S::Door, Some(3), true, false),
        ("Door:4", S::Door, Some(4), true, false),
        ("Check", S::Check, None, false, false),
        ("Home", S::Home, None, true, false),
        ("Sleep", S::Sleep, None, false, false),
        ("Tool", S::Tool, None, false, false),
        ("Starting", S::Other("Starting".into()), None, false, false),
        ("", S::Unnamed, None, false, false),
    ] {
        let report = status(&format!("<{text}|MPos:0.000,0.000,0.000|FS:0,0>"));
        assert_eq!((&report.state, report.substate), (&state, substate), "{text}");
        assert_eq!((report.is_moving(), report.is_held()), (is_moving, is_held), "{text}");
    }
}

#[test]
fn the_fields_that_grblhal_adds_are_read() {
    let report = status(
        "<Idle|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0|WCO:0.000,0.000,0.000|WCS:G54\
         |Ov:100,100,100|A:|Sc:|MPG:0|H:0|T:0|P:0|TLR:0|FW:grblHAL>",
    );
    assert_eq!(report.free, Some((100, 1023)));
    assert_eq!(report.work_system, Some(1));
    assert_eq!((report.is_homed, report.tool), (Some(false), Some(0)));
    let wanted = [("Sc", ""), ("MPG", "0"), ("P", "0"), ("TLR", "0"), ("FW", "grblHAL")];
    assert_eq!(report.others, wanted.map(|(key, value)| other(key, value)));

    let report =
        status("<Run:2|MPos:1.000,2.000,0.000|WCS:G59.3|H:1,7|T:12|TLR:1|D:1|In:-1|AR:200>");
    assert_eq!(report.work_system, Some(9));
    assert_eq!((report.is_homed, report.tool), (Some(true), Some(12)));
    assert_eq!(report.input, Some(-1));
    // A reference for tool lengths says nothing of a tool length.
    assert_eq!(report.others[0], other("TLR", "1"));

    let report =
        status("<Alarm:10|MPos:0.000,0.000,0.000|Pn:ES|AR|SP1:12000,,S,100|DTG:0.1,0,0|$C:1>");
    assert_eq!(report.pins.as_deref(), Some("ES"));
    // A name without a value stands where a value without a name would.
    assert_eq!(report.others[0], other("", "AR"));
    assert_eq!(report.others[1], other("SP1", "12000,,S,100"));
    assert_eq!(report.others[3], other("$C", "1"));
}

#[test]
fn numbers_beyond_those_that_are_known_are_passed_over() {
    let report = status("<Run|MPos:4.108,2.056,0.000,1.000|Bf:98,1023|Ln:10|FS:1500,0>");
    assert_eq!(report.machine_position, Some([4.108, 2.056, 0.0]));
    assert_eq!((report.line, report.free), (Some(10), Some((98, 1023))));
    let report = status("<Run|MPos:1,2,3,4,5,6,7,8|FS:600,12000,11987|Ov:100,100,100,100>");
    assert_eq!(report.machine_position, Some([1.0, 2.0, 3.0]));
    assert_eq!((report.feed_mm_per_min, report.spindle_rpm), (Some(600.0), Some(12000.0)));
    assert_eq!(report.overrides_percent, Some([100; 3]));
}

#[test]
fn fields_that_nobody_knows_or_that_say_something_else_are_kept() {
    for (field, key, value) in [
        ("SD:12.5,job.nc", "SD", "12.5,job.nc"),
        ("SD:12.5,größe.nc", "SD", "12.5,größe.nc"),
        ("job 12 %", "", "job 12 %"),
        ("WCS:G60", "WCS", "G60"),
        ("H:x", "H", "x"),
        ("T:-1", "T", "-1"),
        ("ISRs:17", "ISRs", "17"),
        ("", "", ""),
    ] {
        let report = status(&format!("<Idle|MPos:0,0,0|{field}>"));
        assert_eq!(report.others, [other(key, value)], "{field}");
        assert_eq!((report.work_system, report.is_homed, report.tool), (None, None, None));
    }
}

#[test]
fn spindle_and_coolant_are_off_when_left_out_next_to_the_overrides_but_not_on_grblhal() {
    use Firmware::{FluidNc, Grbl, GrblHal};
    use SpindleMode::{Clockwise, CounterClockwise, Off};
    let on = |spindle, flood, mist| Some(Accessories { spindle, flood, mist });
    for (fields, firmware, wanted) in [
        ("A:S", Grbl, on(Clockwise, false, false)),
        ("A:CFM", FluidNc, on(CounterClockwise, true, true)),
        ("A:SETF", GrblHal, on(Clockwise, true, false)),
        ("A:", GrblHal, on(Off, false, false)),
        ("Ov:100,100,100|A:M", Grbl, on(Off, false, true)),
        ("Ov:100,100,100", Grbl, on(Off, false, false)),
        ("Ov:100,100,100", FluidNc, on(Off, false, false)),
        ("Ov:100,100,100", GrblHal, None),
        ("FS:0,0", Grbl, None),
        ("FS:0,0", GrblHal, None),
    ] {
        let report = status(&format!("<Idle|MPos:0,0,0|{fields}>"));
        assert_eq!(report.accessories_on(firmware), wanted, "{fields} of {firmware:?}");
    }
}

#[test]
fn inch_reports_become_millimetres() {
    let line = b"<Run|MPos:1.0000,-0.5000,0.0000|FS:10.0,5000|WCO:0.1000,0.0000,0.0000>";
    let Report::Status(report) = parse(line, ReportUnits::Inches) else { panic!() };
    assert_eq!(report.machine_position, Some([25.4, -12.7, 0.0]));
    assert_eq!(report.feed_mm_per_min, Some(254.0));
    assert_eq!(report.spindle_rpm, Some(5000.0));
    assert!((report.work_offset.unwrap()[0] - 2.54).abs() < 1e-12);
}

#[test]
fn a_report_written_down_before_a_field_was_known_is_still_read() {
    let text = r#"{"state":"Idle","substate":null,"machine_position":[1.0,2.0,3.0]}"#;
    let report: StatusReport = serde_json::from_str(text).unwrap();
    assert_eq!(report.machine_position, Some([1.0, 2.0, 3.0]));
    assert_eq!((report.work_system, report.others.len()), (None, 0));
}
