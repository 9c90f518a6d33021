//! Lines in square brackets.

use super::super::*;
use super::read;
use cnc_msgs::contour::SpindleMode;

fn message(line: &str) -> Message {
    match read(line) {
        Report::Message(message) => message,
        other => panic!("{line} was read as {other:?}"),
    }
}

#[test]
fn the_build_options_say_what_the_firmware_reports() {
    for (line, letters, numbers) in [
        ("[OPT:V,15,128]", "V", [Some(15), Some(128), None, None]),
        ("[OPT:VNML+,100,1024,3,0]", "VNML+", [Some(100), Some(1024), Some(3), Some(0)]),
        ("[OPT:PHSW]", "PHSW", [None; 4]),
        ("[OPT:V,x,128]", "V", [None, Some(128), None, None]),
    ] {
        let [planner_blocks, receive_bytes, axes, tools] = numbers;
        let letters = letters.to_owned();
        let wanted = Message::Options { letters, planner_blocks, receive_bytes, axes, tools };
        assert_eq!(message(line), wanted);
    }
}

#[test]
fn a_grblhal_build_describes_itself() {
    assert_eq!(message("[VER:1.1f.20260817:]"), Message::Version("1.1f.20260817:".into()));
    assert_eq!(message("[AXS:3:XYZ]"), Message::Axes("XYZ".into()));
    let options = ["ENUMS", "RT+", "TC", "SED"].map(str::to_owned).to_vec();
    assert_eq!(message("[NEWOPT:ENUMS,RT+,TC,SED]"), Message::NewOptions(options));
    assert_eq!(message("[FIRMWARE:grblHAL]"), Message::Firmware("grblHAL".into()));
    assert_eq!(message("[SIGNALS:D]"), Message::Signals("D".into()));
    for (line, key, value) in [
        ("[NVS STORAGE:*EEPROM]", "NVS STORAGE", "*EEPROM"),
        ("[DRIVER:Simulator]", "DRIVER", "Simulator"),
        ("[DRIVER VERSION:260324]", "DRIVER VERSION", "260324"),
        ("[BOARD:BTT SKR 2]", "BOARD", "BTT SKR 2"),
        ("[MAX STEP RATE:200000 Hz]", "MAX STEP RATE", "200000 Hz"),
    ] {
        let (key, value) = (key.to_owned(), value.to_owned());
        assert_eq!(message(line), Message::Build { key, value });
    }
    assert_eq!(message("[AUX IO:4,3,0,12]"), Message::AuxIo([4, 3, 0, 12]));
    for damaged in ["AUX IO:4,3,0", "AUX IO:4,3,0,1,2", "AUX IO:4,3,x,1", "AUX IO:4,300,0,1"] {
        assert_eq!(message(&format!("[{damaged}]")), Message::Other(damaged.into()));
    }
}

#[test]
fn places_and_lengths_are_in_millimetres() {
    for name in ["G54", "G59", "G59.3", "G28", "G30", "G92"] {
        for (values, further) in [("", vec![]), (",4.000", vec![4.0])] {
            let position = [1.0, 2.0, 3.0];
            let wanted = Message::Offset { name: name.into(), position, further };
            assert_eq!(message(&format!("[{name}:1.000,2.000,3.000{values}]")), wanted);
        }
    }
    let scaling = Message::Other("G51:1.000,1.000,1.000".into());
    assert_eq!(message("[G51:1.000,1.000,1.000]"), scaling);
    assert_eq!(message("[TLO:1.5]"), Message::ToolLength(1.5));
    assert_eq!(message("[TLO:0.000,0.000,-12.500]"), Message::ToolLength(-12.5));
    assert_eq!(message("[TLO:]"), Message::Other("TLO:".into()));
    let touched = parse(b"[PRB:1.0000,0.0000,-0.1000:1]", ReportUnits::Inches);
    let Report::Message(Message::Probe { position, .. }) = touched else { panic!() };
    assert_eq!(position[0], 25.4);
}

#[test]
fn a_probe_reports_where_and_whether_it_touched() {
    for (line, further, has_touched) in [
        ("[PRB:5.000,0.000,-3.988:1]", vec![], true),
        ("[PRB:5.000,0.000,-3.988:0]", vec![], false),
        ("[PRB:5.000,0.000,-3.988,90.000,0.000:1]", vec![90.0, 0.0], true),
    ] {
        let position = [5.0, 0.0, -3.988];
        assert_eq!(message(line), Message::Probe { position, further, has_touched });
    }
    for line in ["PRB:5.000,0.000,-3.988", "PRB:5.000,0.000:1", "PRB:5.000,0.000,-3.9 8:1"] {
        assert_eq!(message(&format!("[{line}]")), Message::Other(line.into()));
    }
}

#[test]
fn texts_are_kept_with_their_severity() {
    for (line, text, severity, rest) in [
        ("[MSG:Reset to continue]", "Reset to continue", Severity::Info, "Reset to continue"),
        ("[MSG:'$H'|'$X' to unlock]", "'$H'|'$X' to unlock", Severity::Info, "'$H'|'$X' to unlock"),
        ("[MSG:]", "", Severity::Info, ""),
        (
            "[MSG:INFO: Caution: Unlocked]",
            "INFO: Caution: Unlocked",
            Severity::Info,
            "Caution: Unlocked",
        ),
        ("[MSG: WARN: Low memory]", "WARN: Low memory", Severity::Warning, "Low memory"),
        ("[MSG:ERR: no config]", "ERR: no config", Severity::Error, "no config"),
        ("[MSG:DBG: x=[1]]", "DBG: x=[1]", Severity::Debug, "x=[1]"),
    ] {
        assert_eq!(message(line), Message::Text(text.into()));
        assert_eq!(Severity::of(text), (severity, rest), "{line}");
    }
    assert_eq!(message("[echo: G1X1]"), Message::Echo("G1X1".into()));
    assert_eq!(message("[JSON:{\"cmd\":\"420\"}]"), Message::Json("{\"cmd\":\"420\"}".into()));
}

#[test]
fn a_setting_is_called_what_the_controller_calls_it() {
    for (line, number, name, unit) in [
        (
            "[SETTING:110|10|X-axis maximum rate|mm/min|6|#####0.000|||0|0]",
            110,
            "X-axis maximum rate",
            "mm/min",
        ),
        ("[SETTING:13|2|Report in inches||0||||0|0]", 13, "Report in inches", ""),
    ] {
        let (name, unit) = (name.to_owned(), unit.to_owned());
        assert_eq!(message(line), Message::SettingDetail { number, name, unit });
    }
    let broken = Message::Other("SETTING:x|1|y|z".into());
    assert_eq!(message("[SETTING:x|1|y|z]"), broken);
}

#[test]
fn brackets_that_nobody_knows_are_kept() {
    for line in ["G54:x", "HLP:$$ $#", "AXS:4:XYZ", "HOME:0,0,0:7", "TLR:1.5", "", "plain", ":"] {
        assert_eq!(message(&format!("[{line}]")), Message::Other(line.into()));
    }
    let bytes = parse(b"[MSG:f\xfcr]", ReportUnits::Millimetres);
    assert!(matches!(bytes, Report::Message(Message::Text(_))));
}

#[test]
fn the_words_in_force_are_read_word_by_word() {
    let Message::ParserState(words) = message("[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]") else {
        panic!()
    };
    let grbl = ModalWords {
        work_system: Some(1),
        spindle: Some(SpindleMode::Off),
        tool: Some(0),
        feed_per_min: Some(0.0),
        spindle_rpm: Some(0.0),
        is_rapid: true,
        ..ModalWords::default()
    };
    assert_eq!(ModalWords::read(&words), grbl);
    let words = "G1 G59.2 G17 G21 G90 G94 G43.1 G98 G50 M4 M7 M8 T3 F600.0 S12000.0";
    let grbl_hal = ModalWords {
        work_system: Some(8),
        has_tool_length: Some(true),
        spindle: Some(SpindleMode::CounterClockwise),
        flood: true,
        mist: true,
        tool: Some(3),
        feed_per_min: Some(600.0),
        spindle_rpm: Some(12000.0),
        ..ModalWords::default()
    };
    assert_eq!(ModalWords::read(words), grbl_hal);
    assert_eq!(
        ModalWords::read("G49 G60 X ü TT"),
        ModalWords { has_tool_length: Some(false), ..ModalWords::default() }
    );
}
