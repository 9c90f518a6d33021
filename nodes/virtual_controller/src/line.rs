//! The line reader: from bytes to lines.
//!
//! Knows comments, blanks, line ends and the longest line, but not what a line means.

/// What a family accepts as a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LineRules {
    pub(crate) characters_max: usize,
    /// Blanks and comments count towards the length.
    pub(crate) counts_everything: bool,
    pub(crate) beyond: OverlongLine,
    pub(crate) ends: LineEnds,
    /// A control character switches echo on; 0x0C switches it off.
    pub(crate) edits: bool,
}

/// What happens to a line with too many characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OverlongLine {
    Refused,
    /// The rest is cut off and the line executed.
    CutOff,
}

/// What CR and LF together are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LineEnds {
    /// Two line ends.
    Each,
    /// One line end, CR first.
    Pairs,
    /// One line end in either order, but two after a line that was answered with an error.
    PairsUnlessWrong,
}

/// A line as the reader returns it: upper case, without blanks and comments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Line {
    Text(String),
    /// It had characters, but no words.
    Remark,
    /// It had more characters than a line may have.
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
#[derive(Debug, Clone)]
pub(crate) struct LineReader {
    rules: LineRules,
    text: String,
    /// Characters so far, dropped ones included.
    seen: usize,
    first: Option<u8>,
    skip: Skip,
    /// The previous line end, as long as its partner may follow.
    last_end: Option<u8>,
    echoes: bool,
}

impl LineReader {
    pub(crate) fn new(rules: LineRules) -> Self {
        let text = String::new();
        let (skip, first, last_end) = (Skip::Nothing, None, None);
        Self { rules, text, seen: 0, first, skip, last_end, echoes: false }
    }

    /// Drops the line so far; echo stays on.
    pub(crate) fn clear(&mut self) {
        *self = Self { echoes: self.echoes, ..Self::new(self.rules) };
    }

    /// The last line was answered with an error.
    pub(crate) fn line_was_wrong(&mut self) {
        if self.rules.ends == LineEnds::PairsUnlessWrong {
            self.last_end = None;
        }
    }

    /// Are `!`, `?` and `~` part of what is being read (a command or a comment)?
    pub(crate) fn is_literal(&self) -> bool {
        self.skip == Skip::Parentheses || matches!(self.first, Some(b'$' | b'['))
    }

    /// Takes one byte; returns the line that it ends. Appends the echo.
    pub(crate) fn take(&mut self, byte: u8, echo: &mut Vec<u8>) -> Option<Line> {
        if matches!(byte, b'\n' | b'\r') {
            return self.end(byte, echo);
        }
        if self.rules.edits && self.edit(byte, echo) {
            return None;
        }
        let is_blank = matches!(byte, 0..=b' ' | 0x80..);
        let is_leading = byte == b' ' && self.seen == 0;
        if byte >= b' ' && !is_leading {
            self.first = self.first.or(Some(byte));
            self.seen += 1;
        }
        if self.rules.counts_everything && self.seen > self.rules.characters_max {
            if self.rules.beyond == OverlongLine::Refused {
                self.skip = Skip::TooLong;
            }
            return None;
        }
        match (self.skip, byte) {
            (Skip::Parentheses, b')') => self.skip = Skip::Nothing,
            (Skip::Parentheses | Skip::RestOfLine | Skip::TooLong, _) => {}
            (Skip::Nothing, b'(') => self.skip = Skip::Parentheses,
            (Skip::Nothing, b';') => self.skip = Skip::RestOfLine,
            (Skip::Nothing, b'/') => {}
            (Skip::Nothing, _) if is_blank => {}
            (Skip::Nothing, _) if self.text.len() == self.rules.characters_max => {
                self.skip = Skip::TooLong;
            }
            (Skip::Nothing, _) => self.text.push(char::from(byte.to_ascii_uppercase())),
        }
        None
    }

    fn end(&mut self, byte: u8, echo: &mut Vec<u8>) -> Option<Line> {
        let is_second = match self.rules.ends {
            LineEnds::Each => false,
            LineEnds::Pairs => self.last_end == Some(b'\r') && byte == b'\n',
            LineEnds::PairsUnlessWrong => self.last_end.is_some_and(|end| end != byte),
        };
        if is_second && self.seen == 0 {
            self.last_end = None;
            return None;
        }
        if self.echoes {
            echo.extend(b"\r\n");
        }
        let before = std::mem::replace(self, Self { echoes: self.echoes, ..Self::new(self.rules) });
        self.last_end = Some(byte);
        Some(match before.skip {
            Skip::TooLong => Line::TooLong,
            _ if before.text.is_empty() && before.seen > 0 => Line::Remark,
            _ => Line::Text(before.text),
        })
    }

    /// Does what a terminal does; returns whether the byte is done with.
    fn edit(&mut self, byte: u8, echo: &mut Vec<u8>) -> bool {
        match byte {
            0x0C => self.echoes = false,
            0x08 | 0x7F => {
                if self.text.pop().is_some() {
                    self.seen = self.seen.saturating_sub(1);
                    echo.extend(b"\x08 \x08");
                }
                self.echoes = true;
            }
            0..b' ' => {
                if !self.echoes {
                    echo.extend(self.text.bytes());
                }
                self.echoes = true;
            }
            _ => {
                if self.echoes && self.seen < self.rules.characters_max {
                    echo.push(byte);
                }
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::Firmware;

    fn read(firmware: Firmware, bytes: &[u8]) -> (Vec<Line>, String) {
        let mut reader = LineReader::new(firmware.traits().line);
        let mut echo = Vec::new();
        let lines = bytes.iter().filter_map(|&byte| reader.take(byte, &mut echo)).collect();
        (lines, String::from_utf8(echo).unwrap())
    }

    #[test]
    fn lines_have_a_longest_length_and_firmware_differs_in_what_counts_and_what_follows() {
        let x = |count: usize| Line::Text("X".repeat(count));
        let commented = |total: usize| format!("(c) {}", "X".repeat(total - 4));
        let cases = [
            // Row "line limit": 79 ok, 80 is error:11; blanks and comments do not count.
            (Firmware::Grbl, format!("(a comment) {}", "X ".repeat(79)), x(79)),
            (Firmware::Grbl, format!("(a comment) {}", "X ".repeat(80)), Line::TooLong),
            // 256 ok, 257 is error:11; comments count.
            (Firmware::GrblHal, commented(256), x(252)),
            (Firmware::GrblHal, commented(257), Line::TooLong),
            (Firmware::GrblHal, format!("X{}", " ".repeat(256)), Line::TooLong),
            // 254; what is more is cut off and the rest executed.
            (Firmware::FluidNc, commented(254), x(250)),
            (Firmware::FluidNc, commented(300), x(250)),
        ];
        for (firmware, line, expected) in cases {
            let length = line.len();
            let (lines, _) = read(firmware, format!("{line}\n").as_bytes());
            assert_eq!(lines, [expected], "{firmware}, {length} characters");
        }
    }

    #[test]
    fn blanks_comments_and_slashes_vanish_and_letters_grow() {
        let (lines, _) = read(Firmware::Grbl, b"/g1 x1 (to (x) y2 ;rest\r\n");
        assert_eq!(lines, [Line::Text("G1X1Y2".into()), Line::Text(String::new())]);
    }

    #[test]
    fn a_pair_of_line_ends_is_two_one_or_one_unless_the_line_was_wrong() {
        // Row "line end".
        let count = |firmware, bytes| read(firmware, bytes).0.len();
        assert_eq!(count(Firmware::Grbl, b"X\r\nY\r\n"), 4);
        assert_eq!(count(Firmware::FluidNc, b"X\r\nY\r\n"), 2);
        assert_eq!(count(Firmware::FluidNc, b"X\n\rY\r\n"), 3);
        assert_eq!(count(Firmware::GrblHal, b"X\r\nY\n\rZ\n\n"), 4);
        let mut reader = LineReader::new(Firmware::GrblHal.traits().line);
        let mut echo = Vec::new();
        assert!(reader.take(b'X', &mut echo).is_none());
        assert!(reader.take(b'\r', &mut echo).is_some());
        reader.line_was_wrong();
        assert_eq!(reader.take(b'\n', &mut echo), Some(Line::Text(String::new())));
    }

    #[test]
    fn a_control_character_switches_echo_on_until_a_form_feed() {
        let (lines, echo) = read(Firmware::FluidNc, b"G0X1\nG\x19X2\n\x0cX3\n");
        assert_eq!(lines.len(), 3);
        assert_eq!(echo, "GX2\r\n");
        assert_eq!(read(Firmware::Grbl, b"G\x19X2\n").1, "");
    }
}
