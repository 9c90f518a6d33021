//! What the firmware says, line by line.
//!
//! Knows the texts of grbl 1.1, grblHAL and FluidNC; compares whole lines and never
//! guesses: a fragment of an answer is damage, any other text is kept. `status` reads
//! what stands in angle brackets, `message` what stands in square ones. Knows nothing of
//! order or time; that is [`crate::link`]. Source: the protocol of grbl 1.1, as its
//! interface documentation, its builds and its relatives have it.

mod damage;
mod message;
mod modal;
mod number;
mod status;

pub use message::{Message, Severity};
pub use modal::ModalWords;
pub use status::{Accessories, ControllerState, StatusReport};

use crate::firmware::Firmware;
use number::{parse_code, parse_count};
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
    Status(Box<StatusReport>),
    /// `[MSG:Caution: Unlocked]` and all else in brackets.
    Message(Message),
    /// `$110=500.000`
    Setting { number: u16, value: String },
    /// A setting with a name, as FluidNC has them: `$/axes/x/max_rate_mm_per_min=5000.000`.
    NamedSetting { name: String, value: String },
    /// A stored start-up line or what it did: `$N0=G54`, `>G54:ok`.
    StartupLine(String),
    /// Nothing between two line ends.
    Empty,
    /// A fragment or a mixture of lines; the count of answers is in doubt.
    Damaged(String),
    /// Anything else; no harm in it.
    Unknown(String),
}

/// Reads one line, without its line end.
pub fn parse(line: &[u8], units: ReportUnits) -> Report {
    let line = line.trim_ascii();
    let text = String::from_utf8_lossy(line).into_owned();
    match line {
        [] => Report::Empty,
        b"ok" => Report::Ok,
        // A message may hold any text, but no answer next to it.
        [b'[', inside @ .., b']'] if !damage::holds_a_line_border(inside) => {
            Report::Message(Message::read(&text[1..text.len() - 1], units))
        }
        [b'<', .., b'>'] => StatusReport::read(&text[1..text.len() - 1], units)
            .map_or(Report::Damaged(text), |report| Report::Status(Box::new(report))),
        // Everything else is plain ASCII.
        _ if !line.iter().all(|byte| (0x20..0x7f).contains(byte)) => Report::Damaged(text),
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
    if is_startup_line(&text) {
        return Report::StartupLine(text);
    }
    if let Some((name, value)) = text.strip_prefix('$').and_then(|rest| rest.split_once('='))
        && !damage::ends_in_an_answer(value)
        && let Some(setting) = setting(name, value)
    {
        return setting;
    }
    if damage::is_fragment(&text) {
        return Report::Damaged(text);
    }
    match banner_firmware(&text) {
        Some(firmware) => Report::Banner { firmware, text },
        // The end of one, or of a message.
        None if text.ends_with(']') => Report::Damaged(text),
        None => Report::Unknown(text),
    }
}

/// `>G54:ok`, `>G54:error:20`, `$N0=G54`.
fn is_startup_line(text: &str) -> bool {
    let is_answered = |rest: &str| {
        let head = rest.strip_suffix(":ok").or_else(|| {
            let (head, code) = rest.rsplit_once(":error:")?;
            parse_code(code).map(|_| head)
        });
        head.is_some_and(|head| !head.is_empty() && !damage::ends_in_an_answer(head))
    };
    let is_stored = |rest: &str| {
        let Some((number, line)) = rest.split_once('=') else { return false };
        parse_count(number).is_some() && !line.ends_with("ok") && !damage::ends_in_an_answer(line)
    };
    text.strip_prefix('>').is_some_and(is_answered)
        || text.strip_prefix("$N").is_some_and(is_stored)
}

fn setting(name: &str, value: &str) -> Option<Report> {
    let (name, value) = (name.to_owned(), value.to_owned());
    if name.bytes().all(|byte| byte.is_ascii_digit()) {
        let number = parse_count(&name)?;
        return Some(Report::Setting { number, value });
    }
    let is_name = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"/_-.".contains(&byte));
    let is_stored_line = name.strip_prefix('N').and_then(parse_count).is_some();
    (is_name && !is_stored_line).then_some(Report::NamedSetting { name, value })
}

/// Of a start message; one that broke off has a bracket that is not closed.
fn banner_firmware(text: &str) -> Option<Firmware> {
    let is_whole = text.matches('[').count() == text.matches(']').count();
    if !is_whole || text.contains('|') {
        return None;
    }
    Firmware::of_banner(text)
}

/// Whether a line that is no start message was one before a byte of it was damaged or a line
/// end was lost: one of its two halves is still there.
pub fn was_a_banner(text: &str) -> bool {
    const SECOND_HALVES: [&str; 2] = ["'$' for help", "'$help' for help"];
    let text = text.to_ascii_lowercase();
    let first_halves = Firmware::ALL.map(|firmware| firmware.traits().banner_beginning);
    first_halves.iter().chain(&SECOND_HALVES).any(|half| text.contains(half))
}

/// What a controller says last when it has started and is locked; never otherwise.
pub fn is_lock_notice(text: &str) -> bool {
    text.contains("'$H'|'$X' to unlock")
}

#[cfg(test)]
mod tests;
