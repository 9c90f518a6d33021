//! What the serial interrupt and the line reader do with received bytes.
//!
//! Knows the receive buffer of 128 bytes, the real-time bytes that never enter
//! it, and the line buffer of 79 characters. Knows nothing of what a line means.

use std::collections::VecDeque;

/// Bytes the receive buffer holds; more are lost without a word.
pub const RECEIVE_BUFFER_BYTES: usize = 128;

/// Bytes the transmit buffer holds; the firmware waits when it is full.
pub const TRANSMIT_BUFFER_BYTES: usize = 104;

/// Characters of a line, spaces and comments not counted.
pub const LINE_CHARACTERS_MAX: usize = 79;

/// A command that is a single byte and acts at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Realtime {
    /// 0x18.
    SoftReset,
    /// `?`.
    StatusReport,
    /// `~`.
    CycleStart,
    /// `!`.
    FeedHold,
    /// 0x84.
    SafetyDoor,
    /// 0x85.
    JogCancel,
    /// 0x90 to 0x9D: a change of an override.
    Override(OverrideChange),
    /// 0x9E.
    SpindleStop,
    /// 0xA0.
    FloodToggle,
    /// 0xA1.
    MistToggle,
    /// Any other byte from 0x80 on: taken away, nothing happens.
    Unknown,
}

/// One step of an override, in percent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OverrideChange {
    /// Back to 100.
    FeedReset,
    /// By this many percent.
    FeedBy(i16),
    /// To 100, 50 or 25.
    Rapid(u8),
    /// Back to 100.
    SpindleReset,
    /// By this many percent.
    SpindleBy(i16),
}

/// Returns what a byte means out of turn, `None` for a byte that belongs to a line.
pub(crate) fn realtime(byte: u8) -> Option<Realtime> {
    use OverrideChange::{FeedBy, FeedReset, Rapid, SpindleBy, SpindleReset};
    Some(match byte {
        0x18 => Realtime::SoftReset,
        b'?' => Realtime::StatusReport,
        b'~' => Realtime::CycleStart,
        b'!' => Realtime::FeedHold,
        0x84 => Realtime::SafetyDoor,
        0x85 => Realtime::JogCancel,
        0x90 => Realtime::Override(FeedReset),
        0x91 => Realtime::Override(FeedBy(10)),
        0x92 => Realtime::Override(FeedBy(-10)),
        0x93 => Realtime::Override(FeedBy(1)),
        0x94 => Realtime::Override(FeedBy(-1)),
        0x95 => Realtime::Override(Rapid(100)),
        0x96 => Realtime::Override(Rapid(50)),
        0x97 => Realtime::Override(Rapid(25)),
        0x99 => Realtime::Override(SpindleReset),
        0x9A => Realtime::Override(SpindleBy(10)),
        0x9B => Realtime::Override(SpindleBy(-10)),
        0x9C => Realtime::Override(SpindleBy(1)),
        0x9D => Realtime::Override(SpindleBy(-1)),
        0x9E => Realtime::SpindleStop,
        0xA0 => Realtime::FloodToggle,
        0xA1 => Realtime::MistToggle,
        0x80..=0xFF => Realtime::Unknown,
        _ => return None,
    })
}

/// The receive buffer.
#[derive(Debug, Clone, Default)]
pub(crate) struct ReceiveBuffer {
    bytes: VecDeque<u8>,
    /// Bytes lost to a full buffer since power-up.
    pub(crate) overrun_bytes: u64,
}

impl ReceiveBuffer {
    pub(crate) fn push(&mut self, byte: u8) {
        if self.bytes.len() < RECEIVE_BUFFER_BYTES {
            self.bytes.push_back(byte);
        } else {
            self.overrun_bytes += 1;
        }
    }

    pub(crate) fn pop(&mut self) -> Option<u8> {
        self.bytes.pop_front()
    }

    pub(crate) fn free(&self) -> usize {
        RECEIVE_BUFFER_BYTES - self.bytes.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
    }
}

/// A line as the reader hands it on: upper case, without blanks and comments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Line {
    Text(String),
    /// It had more than [`LINE_CHARACTERS_MAX`] characters.
    TooLong,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Skip {
    #[default]
    Nothing,
    Parentheses,
    RestOfLine,
    TooLong,
}

/// Collects characters until a line end.
#[derive(Debug, Clone, Default)]
pub(crate) struct LineReader {
    text: String,
    skip: Skip,
}

impl LineReader {
    /// Takes one byte; returns the line it ends. Both CR and LF end one.
    pub(crate) fn take(&mut self, byte: u8) -> Option<Line> {
        if matches!(byte, b'\n' | b'\r') {
            let reader = std::mem::take(self);
            return Some(match reader.skip {
                Skip::TooLong => Line::TooLong,
                _ => Line::Text(reader.text),
            });
        }
        match (self.skip, byte) {
            (Skip::Parentheses, b')') => self.skip = Skip::Nothing,
            (Skip::Parentheses | Skip::RestOfLine | Skip::TooLong, _) => {}
            (Skip::Nothing, b'(') => self.skip = Skip::Parentheses,
            (Skip::Nothing, b';') => self.skip = Skip::RestOfLine,
            (Skip::Nothing, 0..=b' ' | b'/' | 0x80..) => {}
            (Skip::Nothing, _) if self.text.len() == LINE_CHARACTERS_MAX => {
                self.skip = Skip::TooLong;
            }
            (Skip::Nothing, _) => self.text.push(char::from(byte.to_ascii_uppercase())),
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Vec<Line> {
        let mut reader = LineReader::default();
        bytes.iter().filter_map(|&byte| reader.take(byte)).collect()
    }

    #[test]
    fn a_line_of_79_characters_passes_and_one_of_80_does_not() {
        for (characters, fits) in [(79, true), (80, false)] {
            let line = format!("(a comment) {}\n", "X ".repeat(characters));
            let expected = if fits { Line::Text("X".repeat(79)) } else { Line::TooLong };
            assert_eq!(read(line.as_bytes()), [expected], "{characters} characters");
        }
    }

    #[test]
    fn blanks_comments_and_slashes_vanish_and_letters_grow() {
        let lines = read(b"/g1 x1 (to (x) y2 ;rest\r\n");
        assert_eq!(lines, [Line::Text("G1X1Y2".into()), Line::Text(String::new())]);
    }

    #[test]
    fn a_full_buffer_drops_bytes_silently() {
        let mut buffer = ReceiveBuffer::default();
        (0..200).for_each(|byte| buffer.push(byte));
        assert_eq!((buffer.free(), buffer.overrun_bytes), (0, 72));
        assert_eq!(buffer.pop(), Some(0));
    }
}
