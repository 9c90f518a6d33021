//! Lines of real firmware, and what they mean: answers, damage, banners, settings.

mod messages;
mod statuses;

use super::*;

fn read(line: &str) -> Report {
    parse(line.as_bytes(), ReportUnits::Millimetres)
}

#[test]
fn answers_are_whole_lines() {
    assert_eq!(read("ok"), Report::Ok);
    assert_eq!(read("ok\r"), Report::Ok);
    assert_eq!(read("error:20"), Report::Error(20));
    assert_eq!(read("error:181"), Report::Error(181));
    assert_eq!(read("ALARM:3"), Report::Alarm(3));
    assert_eq!(read("ALARM:11"), Report::Alarm(11));
    assert_eq!(read(""), Report::Empty);
}

#[test]
fn fragments_and_mixtures_of_answers_are_damage() {
    for line in [
        "o",
        ">",
        "k",
        "o*",
        "okok",
        "ok<Idle",
        "kok",
        "*ok",
        "o\rk",
        "ok\rok",
        "error:",
        "error:2x",
        "error:20ok",
        "error:020",
        "error: 20",
        "rror:20",
        "or:9",
        "err",
        "ALARM:",
        "LARM:1",
        "ALARM:1ok",
        "ALLARM:1",
        "AL?RM:11",
        "eror:20",
        "errorr:20",
        "ALARM:01",
        "<Idle|MPos:0.000,0.0",
        "Idle|MPos:0.000,0.000,0.000>",
        "<Idle|MPos:0.000,0.000,0.000>ok",
        "[MSG:Reset",
        "MSG:Reset to continue]",
        "[MSG:Pgm End]ok",
        "[VER:1.1h.20190830:]ok[OPT:V,15,128]",
        "[MSG:Reset to continue]<Idle|MPos:0.000,0.000,0.000>]",
        "$10=1ok",
        "$130=200.000ok",
        "$10=1error:3",
        "$N0=G54ok",
        "$WIFI/Mode=1ok",
        ">G54ok",
        ">G54:okok",
        ">ok",
        ">:ok",
        "Grbl 1.1h ['$' fo",
        "rbl 1.1h ['$' for help]",
        "Grbl 3.9 [FluidNC v3.9",
        "okGrbl 1.1h ['$' for help]",
        "Idle|MPos:0.000,0.000,0.000|FW:grblHAL>",
        "error:99999999",
    ] {
        assert!(matches!(read(line), Report::Damaged(_)), "{line}: {:?}", read(line));
    }
    assert!(matches!(parse(b"\xf0\x00\x80ok", ReportUnits::Millimetres), Report::Damaged(_)));
}

#[test]
fn text_that_is_no_answer_is_kept_and_harms_nothing() {
    for line in [
        "hello",
        "Booting...",
        "ets Jun  8 2016 00:22:57",
        "rst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)",
        "mode:DIO, clock div:1",
        "NULL",
        "$I - list system information",
        "$70000=1",
    ] {
        assert_eq!(read(line), Report::Unknown(line.to_owned()));
    }
}

#[test]
fn start_up_lines_are_no_answers() {
    for line in [">G20G54:ok", ">G41:error:20", "$N0=G54", "$N1="] {
        assert_eq!(read(line), Report::StartupLine(line.into()));
    }
}

#[test]
fn banners_name_the_firmware() {
    for (line, wanted) in [
        ("Grbl 1.1h ['$' for help]", Firmware::Grbl),
        ("GrblHAL 1.1f ['$' or '$HELP' for help]", Firmware::GrblHal),
        ("grblHAL 1.1f ['$' or '$HELP' for help]", Firmware::GrblHal),
        // Builds that are to look like grbl.
        ("Grbl 1.1f ['$' or '$HELP' for help]", Firmware::Grbl),
        ("Grbl 3.9 [FluidNC v3.9.5 (wifi) '$' for help]", Firmware::FluidNc),
        ("Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]", Firmware::FluidNc),
        // FluidNC with words of its owner.
        ("FluidNC v3.7.16 on the big router", Firmware::FluidNc),
        ("Big router, Grbl 1.1f", Firmware::Grbl),
        ("Grbl", Firmware::Grbl),
    ] {
        assert_eq!(read(line), Report::Banner { firmware: wanted, text: line.into() });
    }
}

#[test]
fn settings_give_number_and_text() {
    for (line, number, value) in [
        ("$110=500.000", 110, "500.000"),
        ("$0=10", 0, "10"),
        // A host name of grblHAL.
        ("$300=bigok", 300, "bigok"),
        ("$75=", 75, ""),
    ] {
        assert_eq!(read(line), Report::Setting { number, value: value.into() });
    }
}

#[test]
fn settings_of_fluidnc_have_names() {
    for (line, name, value) in [
        ("$/axes/x/steps_per_mm=80.000", "/axes/x/steps_per_mm", "80.000"),
        ("$Hostname=bigok", "Hostname", "bigok"),
        (
            "$Start/Message=Grbl \\V [FluidNC \\B (\\R) \\H]",
            "Start/Message",
            "Grbl \\V [FluidNC \\B (\\R) \\H]",
        ),
    ] {
        let wanted = Report::NamedSetting { name: name.into(), value: value.into() };
        assert_eq!(read(line), wanted);
    }
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

#[test]
fn a_start_message_is_known_with_any_byte_damaged_lost_or_doubled() {
    for banner in [
        "Grbl 1.1h ['$' for help]",
        "GrblHAL 1.1f ['$' or '$HELP' for help]",
        "Grbl 4.0 [FluidNC v4.0.5-pre2 (noradio) '$' for help]",
    ] {
        let is_known = |line: &[u8]| match parse(line, ReportUnits::Millimetres) {
            Report::Banner { .. } => true,
            Report::Unknown(text) | Report::Damaged(text) => was_a_banner(&text),
            _ => false,
        };
        assert!(is_known(banner.as_bytes()));
        for at in 0..banner.len() {
            let bytes = banner.as_bytes();
            for bit in 0..8 {
                let mut damaged = bytes.to_vec();
                damaged[at] ^= 1 << bit;
                // A line end in its middle leaves two halves; one of them is known.
                let mut parts = damaged.split(|byte| *byte == b'\n');
                assert!(parts.any(is_known), "{:?}", String::from_utf8_lossy(&damaged));
            }
            let lost = [&bytes[..at], &bytes[at + 1..]].concat();
            let doubled = [&bytes[..=at], &bytes[at..]].concat();
            assert!(is_known(&lost) && is_known(&doubled), "{banner} at {at}");
        }
        // The line end was lost.
        assert!(is_known(format!("{banner}[MSG:'$H'|'$X' to unlock]").as_bytes()));
        assert!(is_known(format!("ok{banner}").as_bytes()));
    }
    for text in ["[HLP:$$ $# $G $I $N]", "[MSG:Check Limits]", "G1X1", "$110=500.000", "error:20"] {
        assert!(!was_a_banner(text), "{text}");
    }
}
