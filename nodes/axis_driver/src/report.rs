//! What the firmware says, line by line.
//!
//! Knows the texts of grbl 1.1 and what its relatives add; compares whole lines
//! and never guesses: a fragment of an answer is damage, any other text is kept.
//! Knows nothing of order or time; that is [`crate::link`]. Source: the protocol
//! of grbl 1.1, as its interface documentation and its builds have it.

mod status;

pub use status::{ControllerState, StatusReport};

use cnc_msgs::geometry::Position;
use serde::{Deserialize, Serialize};

/// The unit of lengths in reports, setting `$13`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum ReportUnits {
    #[default]
    Millimetres,
    Inches,
}

impl ReportUnits {
    /// Millimetres in one unit.
    pub const fn millimetres(self) -> f64 {
        match self {
            Self::Millimetres => 1.0,
            Self::Inches => 25.4,
        }
    }
}

/// The family of the firmware, as far as its texts tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Firmware {
    #[default]
    Grbl,
    GrblHal,
    FluidNc,
}

/// One line from the controller.
#[derive(Debug, Clone, PartialEq)]
pub enum Report {
    /// A line was accepted.
    Ok,
    /// A line was refused: `error:20`.
    Error(u16),
    /// Motion is locked: `ALARM:1`.
    Alarm(u16),
    /// The controller has (re)started.
    Banner { firmware: Firmware, text: String },
    /// `<Idle|MPos:0.000,0.000,0.000|FS:0,0>`
    Status(StatusReport),
    /// `[MSG:Caution: Unlocked]` and all else in brackets.
    Message(Message),
    /// `$110=500.000`
    Setting { number: u16, value: String },
    /// A stored start-up line or what it did: `$N0=G54`, `>G54:ok`.
    StartupLine(String),
    /// Nothing between two line ends.
    Empty,
    /// A fragment or a mixture of lines; the count of answers is in doubt.
    Damaged(String),
    /// Anything else; no harm in it.
    Unknown(String),
}

/// A line in brackets.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// `[VER:1.1h.20190830:]`
    Version(String),
    /// `[OPT:V,15,128]`: build letters, planner blocks, receive buffer in bytes.
    Options { letters: String, planner_blocks: Option<u16>, receive_bytes: Option<u16> },
    /// `[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]`: the words in force.
    ParserState(String),
    /// `[PRB:5.000,0.000,-3.988:1]`, machine frame, mm.
    Probe { position: Position, has_touched: bool },
    /// `[G54:0.000,0.000,0.000]`, also G28, G30 and G92; mm.
    Offset { name: String, position: Position },
    /// `[TLO:0.000]`, mm.
    ToolLength(f64),
    /// `[FIRMWARE:grblHAL]`
    Firmware(String),
    /// `[MSG:Reset to continue]`
    Text(String),
    /// Any other bracket, as it stands.
    Other(String),
}

/// Reads one line, without its line end.
pub fn parse(line: &[u8], units: ReportUnits) -> Report {
    let line = line.trim_ascii();
    let text = String::from_utf8_lossy(line).into_owned();
    let printable = line.iter().all(|byte| (0x20..0x7f).contains(byte));
    match line {
        [] => Report::Empty,
        b"ok" => Report::Ok,
        // Messages may hold any text; everything else is plain ASCII.
        [b'[', .., b']'] => Report::Message(parse_message(&text[1..text.len() - 1], units)),
        _ if !printable => Report::Damaged(text),
        [b'<', .., b'>'] => status::parse(&text[1..text.len() - 1], units)
            .map_or(Report::Damaged(text), Report::Status),
        [b'>', ..] => Report::StartupLine(text),
        _ => parse_text(text),
    }
}

fn parse_text(text: String) -> Report {
    if let Some(code) = text.strip_prefix("error:").and_then(parse_code) {
        return Report::Error(code);
    }
    if let Some(code) = text.strip_prefix("ALARM:").and_then(parse_code) {
        return Report::Alarm(code);
    }
    if let Some(firmware) = banner_firmware(&text) {
        return Report::Banner { firmware, text };
    }
    if let Some((number, value)) = text.strip_prefix('$').and_then(|rest| rest.split_once('=')) {
        if let Some(number) = parse_code(number) {
            return Report::Setting { number, value: value.to_owned() };
        }
        if number.strip_prefix('N').and_then(parse_code).is_some() {
            return Report::StartupLine(text);
        }
    }
    if is_fragment(&text) { Report::Damaged(text) } else { Report::Unknown(text) }
}

/// `Grbl 1.1h ['$' for help]`, `GrblHAL 1.1f ['$' or '$HELP' for help]`,
/// `Grbl 3.9 [FluidNC v3.9.5 (wifi) '$' for help]`.
fn banner_firmware(text: &str) -> Option<Firmware> {
    let (rest, is_hal) = match text.get(..7) {
        Some(name) if name.eq_ignore_ascii_case("grblHAL") => (&text[7..], true),
        _ => (text.strip_prefix("Grbl")?, false),
    };
    let version = rest.strip_prefix(' ')?;
    if !version.starts_with(|c: char| c.is_ascii_digit()) || !version.ends_with("for help]") {
        return None;
    }
    Some(match is_hal {
        true => Firmware::GrblHal,
        false if version.contains("FluidNC") => Firmware::FluidNc,
        false => Firmware::Grbl,
    })
}

/// Whether the text is what remains of an answer, or several lines run together.
fn is_fragment(text: &str) -> bool {
    let is_short_remainder = text.len() <= 3 && text.contains(['o', 'k']);
    let ends_like_an_error = text
        .rsplit_once(':')
        .is_some_and(|(head, code)| parse_code(code).is_some() && "error ALARM".contains(head));
    is_short_remainder
        || text.starts_with("ok")
        || text.ends_with("ok")
        || text.starts_with("err")
        || text.starts_with("ALA")
        || text.contains("error:")
        || text.contains("ALARM:")
        || ends_like_an_error
        || text.starts_with(['<', '['])
        || text.ends_with(['>', ']'])
        || text.to_ascii_lowercase().starts_with("grbl")
}

fn parse_message(text: &str, units: ReportUnits) -> Message {
    let other = || Message::Other(text.to_owned());
    let Some((key, value)) = text.split_once(':') else { return other() };
    match key {
        "VER" => Message::Version(value.to_owned()),
        "OPT" => {
            let mut fields = value.split(',');
            Message::Options {
                letters: fields.next().unwrap_or_default().to_owned(),
                planner_blocks: fields.next().and_then(parse_code),
                receive_bytes: fields.next().and_then(parse_code),
            }
        }
        "GC" => Message::ParserState(value.to_owned()),
        "MSG" => Message::Text(value.to_owned()),
        "FIRMWARE" => Message::Firmware(value.to_owned()),
        "TLO" => parse_number(value)
            .map_or_else(other, |length| Message::ToolLength(length * units.millimetres())),
        "PRB" => match value.split_once(':') {
            Some((place, hit @ ("0" | "1"))) => {
                parse_position(place, units).map_or_else(other, |position| Message::Probe {
                    position,
                    has_touched: hit == "1",
                })
            }
            _ => other(),
        },
        _ if key.starts_with('G') => parse_position(value, units)
            .map_or_else(other, |position| Message::Offset { name: key.to_owned(), position }),
        _ => other(),
    }
}

/// A number of digits alone that fits.
fn parse_code(text: &str) -> Option<u16> {
    (text.bytes().all(|byte| byte.is_ascii_digit())).then(|| text.parse().ok())?
}

/// A decimal number as the firmware prints it: no exponent, no plus sign.
fn parse_number(text: &str) -> Option<f64> {
    let digits = text.strip_prefix('-').unwrap_or(text);
    let is_plain = digits.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    (is_plain && (1..=20).contains(&digits.len())).then(|| text.parse().ok())?
}

/// The first three of three to eight axes, in millimetres.
fn parse_position(text: &str, units: ReportUnits) -> Option<Position> {
    let mut position = [0.0; 3];
    let mut count = 0;
    for field in text.split(',') {
        let value = parse_number(field)?;
        if let Some(slot) = position.get_mut(count) {
            *slot = value * units.millimetres();
        }
        count += 1;
    }
    (3..=8).contains(&count).then_some(position)
}

#[cfg(test)]
mod tests;
