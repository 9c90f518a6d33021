//! Lines of real firmware, and what they mean.

use super::*;

fn read(line: &str) -> Report {
    parse(line.as_bytes(), ReportUnits::Millimetres)
}

fn status(line: &str) -> StatusReport {
    match read(line) {
        Report::Status(report) => report,
        other => panic!("{line} was read as {other:?}"),
    }
}

#[test]
fn answers_are_whole_lines() {
    assert_eq!(read("ok"), Report::Ok);
    assert_eq!(read("ok\r"), Report::Ok);
    assert_eq!(read("error:20"), Report::Error(20));
    assert_eq!(read("ALARM:3"), Report::Alarm(3));
    assert_eq!(read(""), Report::Empty);
}

#[test]
fn fragments_and_mixtures_of_answers_are_damage() {
    for line in [
        "o",
        "k",
        "o*",
        "okok",
        "ok<Idle",
        "kok",
        "*ok",
        "error:",
        "error:2x",
        "error:20ok",
        "rror:20",
        "or:9",
        "err",
        "ALARM:",
        "LARM:1",
        "ALARM:1ok",
        "<Idle|MPos:0.000,0.0",
        "Idle|MPos:0.000,0.000,0.000>",
        "<Idle|MPos:0.000,0.000,0.000>ok",
        "[MSG:Reset",
        "<Idle|MP<Idle|MPos:0.000,0.000,0.000>",
        "<Idle|MPos:0.0,x,0.0>",
        "<Idle|MPos:1,2>",
        "<Run|MPos:nan,0,0>",
        "<Idle|Ov:100,100>",
        "<Id le|MPos:0,0,0>",
        "Grbl 1.1h ['$' fo",
        "rbl 1.1h ['$' for help]",
        "error:99999999",
    ] {
        assert!(matches!(read(line), Report::Damaged(_)), "{line}: {:?}", read(line));
    }
    assert!(matches!(parse(b"\xf0\x00\x80ok", ReportUnits::Millimetres), Report::Damaged(_)));
}

#[test]
fn text_that_is_no_answer_is_kept_and_harms_nothing() {
    for line in ["hello", "$foo=1", "Booting...", "ets Jun  8 2016 00:22:57", "NULL"] {
        assert_eq!(read(line), Report::Unknown(line.to_owned()));
    }
    assert_eq!(read(">G20G54:ok"), Report::StartupLine(">G20G54:ok".into()));
    assert_eq!(read("$N0=G54"), Report::StartupLine("$N0=G54".into()));
}

#[test]
fn banners_name_the_firmware() {
    for (line, wanted) in [
        ("Grbl 1.1h ['$' for help]", Firmware::Grbl),
        ("GrblHAL 1.1f ['$' or '$HELP' for help]", Firmware::GrblHal),
        ("grblHAL 1.1f ['$' or '$HELP' for help]", Firmware::GrblHal),
        ("Grbl 3.9 [FluidNC v3.9.5 (wifi) '$' for help]", Firmware::FluidNc),
    ] {
        assert_eq!(read(line), Report::Banner { firmware: wanted, text: line.into() });
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
    assert_eq!(report.pins.as_deref(), Some("XP"));
    assert_eq!(report.overrides_percent, Some([100, 50, 110]));
    assert_eq!(report.accessories.as_deref(), Some("SF"));
}

#[test]
fn a_status_report_of_grblhal_keeps_what_is_not_known() {
    let report = status(
        "<Run|MPos:4.108,2.056,0.000,1.000|Bf:98,1023|Ln:10|FS:1500,0|A:|TLR:0|FW:grblHAL|$C:1>",
    );
    assert_eq!(report.machine_position, Some([4.108, 2.056, 0.0]));
    assert_eq!((report.line, report.free), (Some(10), Some((98, 1023))));
    assert_eq!(report.accessories.as_deref(), Some(""));
    assert_eq!(report.others[0], ("TLR".into(), "0".into()));
    assert_eq!(report.others.len(), 3);
    assert_eq!(status("<Alarm:11|MPos:0.000,0.000,0.000>").substate, Some(11));
    assert_eq!(status("<Idle|MPos:0,0,0|SD:12.5,job.nc>").others[0].1, "12.5,job.nc");
    assert_eq!(status("<Idle|MPos:0,0,0|job 12 %>").others[0].1, "job 12 %");
    assert_eq!(status("<Starting|MPos:0,0,0>").state, ControllerState::Other("Starting".into()));
    assert_eq!(status("<|MPos:0,0,0>").state, ControllerState::Unnamed);
}

#[test]
fn inch_reports_become_millimetres() {
    let line = b"<Run|MPos:1.0000,-0.5000,0.0000|FS:10.0,5000|WCO:0.1000,0.0000,0.0000>";
    let Report::Status(report) = parse(line, ReportUnits::Inches) else { panic!() };
    assert_eq!(report.machine_position, Some([25.4, -12.7, 0.0]));
    assert_eq!(report.feed_mm_per_min, Some(254.0));
    assert_eq!(report.spindle_rpm, Some(5000.0));
    assert!((report.work_offset.unwrap()[0] - 2.54).abs() < 1e-12);
    let touched = parse(b"[PRB:1.0000,0.0000,-0.1000:1]", ReportUnits::Inches);
    let Report::Message(Message::Probe { position, .. }) = touched else { panic!() };
    assert_eq!(position[0], 25.4);
}

#[test]
fn brackets_are_read_by_their_key() {
    let message = |line: &str| match read(line) {
        Report::Message(message) => message,
        other => panic!("{line} was read as {other:?}"),
    };
    assert_eq!(
        message("[OPT:V,15,128]"),
        Message::Options {
            letters: "V".into(),
            planner_blocks: Some(15),
            receive_bytes: Some(128)
        }
    );
    assert_eq!(
        message("[OPT:VNML+,100,1024,3,0]"),
        Message::Options {
            letters: "VNML+".into(),
            planner_blocks: Some(100),
            receive_bytes: Some(1024)
        }
    );
    assert_eq!(
        message("[OPT:PHSW]"),
        Message::Options { letters: "PHSW".into(), planner_blocks: None, receive_bytes: None }
    );
    assert_eq!(message("[VER:1.1h.20190830:]"), Message::Version("1.1h.20190830:".into()));
    assert_eq!(message("[GC:G0 G54 G17]"), Message::ParserState("G0 G54 G17".into()));
    assert_eq!(
        message("[G54:1.000,2.000,3.000]"),
        Message::Offset { name: "G54".into(), position: [1.0, 2.0, 3.0] }
    );
    assert_eq!(
        message("[PRB:5.000,0.000,-3.988:0]"),
        Message::Probe { position: [5.0, 0.0, -3.988], has_touched: false }
    );
    assert_eq!(message("[TLO:1.5]"), Message::ToolLength(1.5));
    assert_eq!(message("[MSG:]"), Message::Text(String::new()));
    assert_eq!(message("[FIRMWARE:grblHAL]"), Message::Firmware("grblHAL".into()));
    assert_eq!(message("[echo: G1X1]"), Message::Other("echo: G1X1".into()));
    assert_eq!(message("[G54:x]"), Message::Other("G54:x".into()));
}

#[test]
fn settings_give_number_and_text() {
    let wanted = Report::Setting { number: 110, value: "500.000".into() };
    assert_eq!(read("$110=500.000"), wanted);
    assert_eq!(read("$0=10"), Report::Setting { number: 0, value: "10".into() });
}

proptest::proptest! {
    #[test]
    fn no_line_whatever_is_a_panic(line in proptest::collection::vec(proptest::num::u8::ANY, 0..80)) {
        parse(&line, ReportUnits::Millimetres);
    }

    #[test]
    fn no_text_in_any_brackets_is_a_panic(line in "[<\\[][a-zA-Z:|,0-9.$-]{0,40}[>\\]]") {
        parse(line.as_bytes(), ReportUnits::Inches);
    }
}
