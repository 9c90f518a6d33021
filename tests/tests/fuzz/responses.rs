//! Lines of controllers, damaged in transit, through framing and parser.
//!
//! Whatever comes in: no panic; an answer is read from a whole line and nothing else; a
//! line after the damage is read as if nothing had happened; and one byte that is wrong
//! never takes an answer away without a fault.

use crate::mutate::Random;
use axis_driver::link::{LineKind, Link, LinkConfig, LinkEvent, LinkFault};
use axis_driver::report::{Report, ReportUnits, parse};
use std::time::Duration;

/// Lines of grbl 1.1, grblHAL and FluidNC. The first eight are answers.
const LINES: [&str; 56] = [
    "ok",
    "ok",
    "ok",
    "error:2",
    "error:20",
    "error:181",
    "ALARM:1",
    "ALARM:11",
    "",
    "Grbl 1.1h ['$' for help]",
    "GrblHAL 1.1f ['$' or '$HELP' for help]",
    "Grbl 3.9 [FluidNC v3.9.5 (wifi) '$' for help]",
    "[VER:1.1h.20190830:]",
    "[OPT:V,15,128]",
    "[OPT:VNML+,100,1024,3,0]",
    "[OPT:PHSW]",
    "[AXS:3:XYZ]",
    "[NEWOPT:ENUMS,RT+,TC,SED]",
    "[FIRMWARE:grblHAL]",
    "[SIGNALS:D]",
    "[NVS STORAGE:*EEPROM]",
    "[DRIVER:Simulator]",
    "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]",
    "[G54:0.000,0.000,0.000]",
    "[G59.3:1.000,-2.000,3.500,90.000]",
    "[TLO:0.000,0.000,-12.500]",
    "[PRB:5.000,0.000,-3.988:1]",
    "[PRB:0.000,0.000,0.000:0]",
    "[MSG:]",
    "[MSG:Reset to continue]",
    "[MSG:'$H'|'$X' to unlock]",
    "[MSG:INFO: Caution: Unlocked]",
    "[MSG:ERR: no config]",
    "[echo: G1X1]",
    "[JSON:{\"cmd\":\"420\",\"status\":\"ok\"}]",
    "[SETTING:110|10|X-axis maximum rate|mm/min|6|#####0.000|||0|0]",
    "[HOME:0.000,0.000,0.000:7]",
    "$110=500.000",
    "$13=0",
    "$300=bigok",
    "$/axes/x/steps_per_mm=80.000",
    "$N0=G54",
    ">G54:ok",
    ">G41:error:20",
    "rst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)",
    "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>",
    "<Idle|MPos:0.000,0.000,0.000|FS:0,0|Ov:100,100,100>",
    "<Run|MPos:4.108,2.056,0.000|Bf:98,1023|Ln:10|FS:1500,0>",
    "<Hold:1|WPos:1.000,2.000,3.000|Bf:15,128|F:500|Pn:XP|Ov:100,50,110|A:SF>",
    "<Hold:0|MPos:-45.952,0.000,0.000|FS:0,0>",
    "<Alarm:11|MPos:0.000,0.000,0.000|Bf:100,1023|FS:0,0,0|Pn:E|H:0|T:0|TLR:0|FW:grblHAL|$C:1>",
    "<Door:4|MPos:0.000,0.000,0.000|FS:0,0|Pn:D>",
    "<Jog|MPos:0.000,0.000,0.000,1.000,2.000|FS:0,0|WCS:G55|A:|Sc:|MPG:0|H:1,7|T:3|AR:200|In:-1>",
    "<Run:2|MPos:0.000,0.000,0.000|FS:600,12000|SP1:0,,,100|DTG:0.1,0.0,0.0>",
    "<Idle|MPos:0.000,0.000,0.000|FS:0,0|SD:12.50,größe.nc>",
    "<Starting|MPos:0.000,0.000,0.000|FS:0,0>",
];
/// Of these lines nothing is known but that they do no harm.
const UNKNOWN: [&str; 1] = ["rst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)"];

const CONFIG: LinkConfig = LinkConfig {
    baud: 115_200,
    hold_latency_ms_max: 20,
    receive_buffer_bytes: None,
    poll_interval_ms: 200,
    busy_poll_interval_ms: 0,
    line_check_interval_ms: 0,
    watches_path: false,
};

/// What a stream of bytes comes to.
#[derive(Debug, Default, PartialEq)]
struct Received {
    /// `ok` and `error:N`, with the number of the latter, in order.
    answers: Vec<Option<u16>>,
    alarms: Vec<u16>,
    texts: Vec<String>,
    faults: usize,
    banners: usize,
}

/// Every line that a controller says is known as what it is.
pub(crate) fn check_clean() {
    for line in LINES {
        let report = parse(line.as_bytes(), ReportUnits::Millimetres);
        let is_unknown = matches!(report, Report::Unknown(_));
        assert_eq!(is_unknown, UNKNOWN.contains(&line), "{line} was read as {report:?}");
        assert!(!matches!(report, Report::Damaged(_)), "{line} was read as {report:?}");
    }
}

/// One stream with damage here and there.
pub(crate) fn check(random: &mut Random) {
    // All of them end lines with CR LF; a device in between may drop one of them.
    let mut bytes = stream(random, 12);
    for _ in 0..random.below(8) {
        spoil(&mut bytes, random);
    }
    if random.once_in(4) {
        let noise = (0..random.below(1500)).map(|_| random.next() as u8).collect::<Vec<u8>>();
        let at = random.below(bytes.len() + 1);
        bytes.splice(at..at, noise);
    }
    // Whatever came before ends here.
    bytes.extend_from_slice(b"\r\n[MSG:in step]\r\nerror:77\r\nok\r\n");
    let received = receive(&bytes, random);
    let shown = || String::from_utf8_lossy(&bytes).into_owned();
    let (answers, alarms) = answers_of(&bytes);
    assert_eq!((&received.answers, &received.alarms), (&answers, &alarms), "{}", shown());
    assert_eq!(received.texts.last().map(String::as_str), Some("in step"), "{}", shown());
    assert_eq!(received.answers[received.answers.len() - 2..], [Some(77), None], "{}", shown());
}

/// One stream with one wrong byte, or a line end that is lost: no answer goes missing
/// unnoticed.
pub(crate) fn check_one_byte(random: &mut Random) {
    const IN_STEP: &[u8] = b"[MSG:in step]\r\n";
    let mut clean = stream(random, usize::MAX);
    let mut bytes = clean.clone();
    if random.once_in(4) {
        lose_line_end(&mut bytes, random);
    } else {
        spoil_byte(&mut bytes, random);
    }
    bytes.extend_from_slice(IN_STEP);
    clean.extend_from_slice(IN_STEP);
    let (before, after) = (receive(&clean, random), receive(&bytes, random));
    let lost = (before.answers.len() + before.alarms.len())
        .saturating_sub(after.answers.len() + after.alarms.len());
    assert_eq!(before.faults, 0, "{}", String::from_utf8_lossy(&clean));
    assert!(
        lost == 0 || after.faults > 0,
        "{lost} answers were lost without a fault:\n{}\n{}",
        String::from_utf8_lossy(&clean),
        bytes.escape_ascii()
    );
}

/// Lines, one in so many without a carriage return.
fn stream(random: &mut Random, bare: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for _ in 0..=random.below(25) {
        let line = if random.once_in(2) { random.of(&LINES[..8]) } else { random.of(&LINES) };
        bytes.extend_from_slice(line.as_bytes());
        bytes.extend_from_slice(if random.once_in(bare) { b"\n" } else { b"\r\n" });
    }
    bytes
}

/// Changes, loses, doubles or adds a byte.
fn spoil_byte(bytes: &mut Vec<u8>, random: &mut Random) {
    let at = random.below(bytes.len());
    match random.below(5) {
        0 => bytes[at] ^= 1 << random.below(8),
        1 => bytes[at] = random.next() as u8,
        2 => {
            bytes.remove(at);
        }
        3 => bytes.insert(at, bytes[at]),
        _ => bytes.insert(at, random.next() as u8),
    }
}

/// Makes one line of two.
fn lose_line_end(bytes: &mut Vec<u8>, random: &mut Random) {
    let ends: Vec<usize> = (1..bytes.len())
        .filter(|&at| bytes[at - 1..].starts_with(b"\r\n"))
        // A name may end in the letters of an answer.
        .filter(|&at| !bytes[..at - 1].ends_with(b"bigok"))
        .collect();
    if !ends.is_empty() {
        let at = *random.of(&ends);
        bytes.drain(at - 1..=at);
    }
}

fn spoil(bytes: &mut Vec<u8>, random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    let from = random.below(bytes.len());
    let to = (from + random.below(20)).min(bytes.len());
    match random.below(4) {
        0 if bytes.len() > 40 => drop(bytes.drain(from..to)),
        1 => {
            let again = bytes[from..to].to_vec();
            bytes.splice(to..to, again);
        }
        _ => spoil_byte(bytes, random),
    }
}

/// Gives the bytes to a link, in pieces as a port would.
fn receive(bytes: &[u8], random: &mut Random) -> Received {
    let now = Duration::ZERO;
    let mut link: Link<()> = Link::new(CONFIG, now);
    link.receive(now, b"Grbl 1.1h ['$' for help]\r\n");
    let mut received = Received::default();
    let mut rest = bytes;
    while !rest.is_empty() {
        // As many lines as could be answered are in transit, also after a start message.
        while link.unanswered() < 100 {
            link.send_line("G1X1", LineKind::Silent, ());
        }
        let line = rest.iter().position(|byte| *byte == b'\n').map_or(rest.len(), |at| at + 1);
        let (piece, after) = rest.split_at(line.min(1 + random.below(64)));
        rest = after;
        link.receive(now, piece);
        while let Some(event) = link.poll_event() {
            match event {
                LinkEvent::Answer { error, .. } => received.answers.push(error),
                LinkEvent::Alarm(code) => received.alarms.push(code),
                LinkEvent::Message(axis_driver::report::Message::Text(text)) => {
                    received.texts.push(text);
                }
                LinkEvent::Fault(LinkFault::Damaged { .. } | LinkFault::ReadOtherwise { .. }) => {
                    received.faults += 1;
                }
                LinkEvent::Fault(fault) => panic!("{fault} in {}", bytes.escape_ascii()),
                LinkEvent::Banner { .. } => received.banners += 1,
                _ => {}
            }
        }
    }
    received
}

/// The answers by another method: a line is one if a firmware would print it.
fn answers_of(bytes: &[u8]) -> (Vec<Option<u16>>, Vec<u16>) {
    let printed = |word: &str, text: &str| {
        let number: u16 = text.rsplit(':').next()?.parse().ok()?;
        (format!("{word}:{number}") == text).then_some(number)
    };
    let (mut answers, mut alarms) = (Vec::new(), Vec::new());
    let mut line = Vec::new();
    // Flow control is no part of a line, and no line is longer than this.
    for &byte in bytes.iter().filter(|byte| !matches!(byte, 0x11 | 0x13)) {
        if byte != b'\n' {
            line.push(byte);
            if line.len() < 1024 {
                continue;
            }
        }
        let whole = std::mem::take(&mut line);
        let Ok(text) = std::str::from_utf8(&whole) else { continue };
        let text = text.trim_matches([' ', '\t', '\r', '\x0c']);
        if text == "ok" {
            answers.push(None);
        } else if let Some(code) = printed("error", text) {
            answers.push(Some(code));
        } else if let Some(code) = printed("ALARM", text) {
            alarms.push(code);
        }
    }
    (answers, alarms)
}
