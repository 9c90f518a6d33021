//! Turns one line of word-address text into a block of words.
//!
//! Knows letters, numbers, comments, N and block delete, but not what a word means. A word that
//! cannot be read is reported once and stays in the block as present, so that it is not reported
//! as missing, too.

pub(crate) mod call;
mod computed;
mod macros;
mod r_words;
pub(crate) mod remark;

use crate::block::{Block, LexerRules, Word};
use crate::expression::Lookup;
use crate::findings::Findings;
use crate::limits::{BLOCK_WORDS_MAX, NUMBER_MAX};
use crate::line::Line;
use crate::number::{self, NotANumber, NumberError};
use cnc_msgs::finding::{Code, Finding};
use remark::Remark;

/// Splits a line that is not longer than a [`Word`]'s places can express.
///
/// `values` are those of parameters before the block.
pub(crate) fn read(
    line: Line<'_>,
    rules: &LexerRules,
    block: &mut Block,
    findings: &mut Findings,
    values: &dyn Lookup,
) {
    block.words.clear();
    block.assignments.clear();
    block.remark = None;
    block.number = None;
    (block.start, block.end) = (0, 0);
    (block.is_optional, block.is_damaged) = (false, false);
    (block.is_cut, block.ends_reading) = (false, false);
    block.has_remark = false;
    Lexer { line, rules, block, findings, values, at: 0, has_begun: false }.run();
}

struct Lexer<'a> {
    line: Line<'a>,
    rules: &'a LexerRules,
    block: &'a mut Block,
    findings: &'a mut Findings,
    values: &'a dyn Lookup,
    at: usize,
    /// Whether anything except comments has been read.
    has_begun: bool,
}

impl Lexer<'_> {
    fn run(&mut self) {
        while let Some(&byte) = self.line.text.get(self.at) {
            match byte {
                b' ' | b'\t' => self.at += 1,
                b'A'..=b'Z' | b'a'..=b'z' => self.word(byte & 0xDF),
                b'/' if self.rules.calls => self.slashes(),
                b'(' if !self.rules.calls => self.comment(),
                b';' => return,
                b'/' => self.slash(),
                b'@' if self.rules.at_words => self.word(b'@'),
                b'@' | b'^' if self.rules.parameters => self.word(byte),
                _ => self.stray(byte),
            }
        }
    }

    /// The bytes from `start` on belong to the block.
    #[inline]
    fn covers(&mut self, start: usize) {
        if !self.has_begun {
            self.has_begun = true;
            self.block.start = start;
        }
        self.block.end = self.at;
    }

    #[inline]
    fn word(&mut self, letter: u8) {
        let text = self.line.text;
        let start = self.at;
        let mut digits = start + 1;
        while matches!(text.get(digits), Some(b' ' | b'\t')) {
            digits += 1;
        }
        if self.rules.calls && text.get(start + 1).is_some_and(u8::is_ascii_alphabetic) {
            return self.name(start);
        }
        if letter == b'O' {
            if self.rules.names && !self.has_begun {
                self.at = end_of_alphanumeric(text, start);
                return;
            }
            return self.o_word(digits);
        }
        if letter == b'R'
            && self.rules.r_parameters
            && let Some(equals) = self.r_equals(digits)
        {
            return self.r_assignment(start, digits, equals);
        }
        if let Some((value, end)) = number::read_simple(text, digits) {
            self.at = end;
            return self.add(letter, value, start);
        }
        self.uncommon_word(letter, start, digits);
    }

    #[cold]
    fn uncommon_word(&mut self, letter: u8, start: usize, digits: usize) {
        let text = self.line.text;
        if self.rules.parameters && macros::begins(&text[start..]) {
            return self.macro_language(start);
        }
        if self.rules.parameters && letter != b'N' && computed::is_computed(text, digits) {
            return self.computed_word(letter, start, digits);
        }
        if self.is_r_value(letter, digits) {
            return self.r_word(letter, start, digits);
        }
        match number::read(text, digits, self.rules.blanks_in_numbers) {
            Ok(number) => {
                self.at = number.end;
                if number.is_split {
                    self.warn_of_split(start);
                }
                if !self.rules.parameters && matches!(text.get(self.at), Some(b'=' | b'[' | b'#')) {
                    return self.expression(letter, start);
                }
                self.add(letter, number.value, start);
            }
            Err(trouble) => self.word_without_number(letter, start, digits, trouble),
        }
    }

    #[cold]
    fn word_without_number(
        &mut self,
        letter: u8,
        start: usize,
        digits: usize,
        trouble: NotANumber,
    ) {
        let text = self.line.text;
        let sign = usize::from(matches!(text.get(digits), Some(b'+' | b'-')));
        if matches!(text.get(digits + sign), Some(b'[' | b'#')) {
            self.at = digits + sign;
            return self.expression(letter, start);
        }
        if trouble.what == NumberError::Missing {
            if self.rules.written_line_feed
                && letter == b'L'
                && text.get(start + 1).is_some_and(|next| next.eq_ignore_ascii_case(&b'f'))
                && !text.get(start + 2).is_some_and(u8::is_ascii_alphanumeric)
            {
                self.at = text.len();
                return;
            }
            if self.rules.names && letter == b'N' && !self.has_begun {
                self.at = end_of_alphanumeric(text, start);
                return self.covers(start);
            }
            if matches!(text.get(digits), Some(b'=' | b'"' | b'<')) {
                self.at = digits;
                return self.expression(letter, start);
            }
        }
        let names_axes = self.rules.axis_names_after.is_some_and(|number| {
            self.block.words.iter().any(|word| word.letter == b'G' && word.value == number)
        });
        if names_axes
            && matches!(letter, b'X' | b'Y' | b'Z')
            && trouble.what == NumberError::Missing
        {
            // G44 X Y names axes.
            self.at = start + 1;
            return self.add(letter, 0.0, start);
        }
        self.at = match trouble.what {
            NumberError::Missing => end_of_name(text, start),
            _ => trouble.end,
        };
        let quote = self.line.quote(start, self.at);
        let (message, help) = match trouble.what {
            NumberError::Missing => (
                format!("`{quote}` has no number"),
                "every word is a letter and a number, like X12.5; comments go in ( )",
            ),
            NumberError::Malformed => (
                format!("`{quote}` is not a number"),
                "write it with at most one sign and one decimal point",
            ),
            NumberError::Exponent => (
                format!("`{quote}` has an exponent"),
                "write the number out: 100000 instead of 1e5, 0.00001 instead of 1e-5",
            ),
            NumberError::TooLarge => {
                (format!("`{quote}` is too large"), "look for a missing decimal point")
            }
        };
        let is_parameter = matches!(
            self.line.text[self.at.min(self.line.text.len())..].trim_ascii_start().first(),
            Some(b'R' | b'r')
        );
        let help = match trouble.what {
            NumberError::Missing | NumberError::Malformed
                if self.rules.r_parameters && is_parameter =>
            {
                "write a parameter after an equals sign: X=R1, X=-R1"
            }
            _ => help,
        };
        self.add(letter, f64::NAN, start);
        self.report(Code::BadNumber, start, message, help);
    }

    #[inline]
    fn add(&mut self, letter: u8, value: f64, start: usize) {
        let is_first = !self.has_begun || self.block.is_optional && self.block.words.is_empty();
        self.covers(start);
        if letter == b'N' {
            return self.block_number(value, start, is_first);
        }
        if self.block.words.len() == BLOCK_WORDS_MAX {
            // Certainly a broken file: one finding is enough.
            self.block.words.clear();
            self.at = start;
            return self.rest(
                Code::Limit,
                &format!("the block has more than {BLOCK_WORDS_MAX} words"),
                "write one block a line",
            );
        }
        let end = self.at as u16;
        self.block.words.push(Word { value, start: start as u16, end, letter });
    }

    #[inline]
    fn block_number(&mut self, value: f64, start: usize, is_first: bool) {
        // RS-274 has lines between two lines: N20.1.
        let value = if self.rules.parameters { value.trunc() } else { value };
        if is_first && self.block.number.is_none() && (0.0..=NUMBER_MAX).contains(&value) {
            let number = value as u32;
            if f64::from(number) == value {
                self.block.number = Some(number);
                return;
            }
        }
        if !value.is_nan() {
            self.bad_block_number(start, is_first);
        }
    }

    #[cold]
    fn bad_block_number(&mut self, start: usize, is_first: bool) {
        let quote = self.line.quote(start, self.at);
        if is_first {
            let message = format!("`{quote}` is not a block number");
            self.report(
                Code::BadNumber,
                start,
                message,
                "write N with a whole number of at most eight digits",
            );
        } else {
            let message = format!("block number {quote} is not at the beginning of its block");
            let help = "begin a new line with it; the words before it make a block of their own";
            self.report(Code::Syntax, start, message, help);
        }
    }

    /// Skips a comment in `( )`, from the opening parenthesis on.
    fn comment(&mut self) {
        self.block.has_remark = true;
        let start = self.at;
        let rest = &self.line.text[start + 1..];
        let Some(length) = memchr::memchr2(b')', b'(', rest) else {
            self.at = self.line.text.len();
            let message = "the comment has no closing parenthesis".to_owned();
            return self.report(Code::Syntax, start, message, "close it with ) on the same line");
        };
        self.at = start + length + 2;
        if self.rules.parameters {
            // Of several comments only the last does something, and nothing if it is plain.
            self.block.remark = Remark::read(self.line.text, start, self.at);
        }
        if rest[length] == b'(' {
            let inner = self.at - 1;
            let close = memchr::memrchr(b')', self.line.text);
            self.at = close.map_or(self.line.text.len(), |close| close + 1).max(self.at);
            let end = self.at;
            self.at = inner + 1;
            let message = "a comment inside a comment".to_owned();
            let help = "controls end the comment at the first ); use [ ] inside it";
            self.report(Code::Syntax, inner, message, help);
            self.at = end;
        }
    }

    /// Skips a comment: `//` to the end of the line, `/* */` within it.
    fn slashes(&mut self) {
        let (start, text) = (self.at, self.line.text);
        match text.get(start + 1) {
            Some(b'/') => self.at = text.len(),
            Some(b'*') => {
                self.block.has_remark = true;
                let close = text[start + 2..].windows(2).position(|pair| pair == b"*/");
                self.at = close.map_or(text.len(), |length| start + length + 4);
                if close.is_none() {
                    let message = "the comment is not closed in its line".to_owned();
                    self.report(Code::Syntax, start, message, "close it with */ on the same line");
                }
            }
            _ => self.slash(),
        }
    }

    fn slash(&mut self) {
        let start = self.at;
        self.at += 1;
        if self.has_begun {
            let help = "write block delete at the beginning of the line";
            return self.report(Code::Syntax, start, "`/` inside a block".to_owned(), help);
        }
        if self.rules.delete_levels && self.line.text.get(self.at).is_some_and(u8::is_ascii_digit) {
            self.at += 1;
        }
        self.covers(start);
        self.block.is_optional = true;
    }

    #[cold]
    fn stray(&mut self, byte: u8) {
        self.block.has_remark = true;
        let start = self.at;
        match byte {
            b'#' if self.rules.parameters => self.assignment(start),
            b'#' | b'[' | b'=' | b'"' | b'<' if !self.rules.parameters => {
                self.expression(b' ', start);
            }
            b'$' if self.rules.calls => self.variable(),
            b'$' if self.rules.parameters && self.has_begun => self.spindle(start),
            b'$' => self.rest(
                Code::Unsupported,
                "controller settings and commands are not part of a program",
                "delete the line; send it from a terminal when no run is active",
            ),
            b')' => {
                self.at += 1;
                let message = "`)` without a comment before it".to_owned();
                self.report(Code::Syntax, start, message, "delete it, or open the comment with (");
            }
            b'\r' => {
                self.at += 1;
                let message = "a carriage return inside a line".to_owned();
                self.report(Code::Syntax, start, message, "save the file with LF or CR LF lines");
                self.block.is_cut = true;
                self.at = self.line.text.len();
            }
            0..0x20 | 0x7F => {
                self.at += 1;
                self.block.ends_reading = true;
                let message = format!("byte 0x{byte:02X}: this is not the text of a part program");
                let help = "save the program as plain text (ASCII or UTF-8)";
                self.report(Code::Syntax, start, message, help);
                self.at = self.line.text.len();
            }
            b'0'..=b'9' | b'+' | b'-' | b'.' => {
                self.at = match number::read(self.line.text, start, self.rules.blanks_in_numbers) {
                    Ok(number) => number.end,
                    Err(no) => no.end.max(start + 1),
                };
                let message = format!("`{}` has no letter", self.line.quote(start, self.at));
                let help = "every word is a letter and a number, like X12.5";
                self.report(Code::Syntax, start, message, help);
            }
            _ => {
                self.at += 1;
                while self.line.text.get(self.at).is_some_and(|next| *next >= 0x80) {
                    self.at += 1;
                }
                let message =
                    format!("`{}` is not part of any word", self.line.quote(start, self.at));
                let help = "delete it, or put it into a comment ( )";
                self.report(Code::Syntax, start, message, help);
            }
        }
    }

    /// The word of a spindle, as LinuxCNC has it: `M3 S500 $0`. There is one.
    #[cold]
    fn spindle(&mut self, start: usize) {
        let number = number::read(self.line.text, start + 1, self.rules.blanks_in_numbers);
        self.at = number.as_ref().map_or_else(|no| no.end.max(start + 1), |number| number.end);
        if number.is_ok_and(|number| number.value == 0.0) {
            return self.covers(start);
        }
        let message = format!("`{}` is not $0, the only spindle", self.line.quote(start, self.at));
        self.report(Code::Unsupported, start, message, "write $0, or delete it");
    }

    /// Reports `X[#1+2]`, `#1=5`, `R1=3`, from `start` on; `at` is before the expression.
    #[cold]
    fn expression(&mut self, letter: u8, start: usize) {
        let text = self.line.text;
        let is_assignment = memchr::memchr(b'=', &text[start..]).is_some();
        if is_assignment || text[self.at] != b'[' && text[self.at] != b'#' {
            self.at = start;
            return self.rest(
                Code::Unsupported,
                "parameters and assignments are not supported",
                "post the program with plain numbers",
            );
        }
        self.at = end_of_expression(text, self.at);
        if letter == b' ' {
            self.covers(start);
        } else {
            self.add(letter, f64::NAN, start);
        }
        let message = format!("`{}` is an expression", self.line.quote(start, self.at));
        self.report(Code::Unsupported, start, message, "post the program with plain numbers");
    }

    /// Reports the rest of the block and skips it.
    #[cold]
    fn rest(&mut self, code: Code, message: &str, help: &str) {
        let start = self.at.min(self.line.text.len() - 1);
        let text = &self.line.text[start..];
        let length = memchr::memchr2(b'(', b';', text).unwrap_or(text.len());
        self.at = start + text[..length].trim_ascii_end().len().max(1);
        self.report(code, start, message.to_owned(), help);
        self.block.is_cut = true;
        self.at = self.line.text.len();
    }

    #[cold]
    fn warn_of_split(&mut self, start: usize) {
        let quote = self.line.quote(start, self.at);
        let source = self.line.source(self.block.number, start, self.at);
        let message = format!("the blanks between these digits are skipped: {quote}");
        let help = "write it in one piece, or with the letter that is missing";
        self.findings.push(Finding::warning(Code::SuspiciousValue, source, message).help(help));
    }

    /// Reports an error at the bytes from `start` to `at`.
    #[cold]
    fn report(&mut self, code: Code, start: usize, message: String, help: &str) {
        self.covers(start);
        self.block.is_damaged = true;
        self.block.has_remark = true;
        let source = self.line.source(self.block.number, start, self.at);
        self.findings.push(Finding::error(code, source, message).help(help));
    }
}

/// Where `[#1+2]`, `#12`, `#<name>`, `##1` or `#[1+2]` ends.
fn end_of_expression(text: &[u8], start: usize) -> usize {
    let mut at = start;
    while text.get(at) == Some(&b'#') {
        at += 1;
    }
    match text.get(at) {
        Some(b'[') => {
            let mut depth = 0_usize;
            let closes = |byte: &u8| {
                depth = match byte {
                    b'[' => depth + 1,
                    b']' => depth - 1,
                    _ => depth,
                };
                depth == 0
            };
            text[at..].iter().position(closes).map_or(text.len(), |length| at + length + 1)
        }
        Some(b'<') => memchr::memchr(b'>', &text[at..]).map_or(text.len(), |end| at + end + 1),
        _ => at + text[at..].iter().take_while(|byte| byte.is_ascii_digit()).count(),
    }
}

/// Where the name of a program or block ends.
fn end_of_alphanumeric(text: &[u8], start: usize) -> usize {
    let length = text[start..].iter().take_while(|byte| byte.is_ascii_alphanumeric()).count();
    start + length
}

/// Where a word without a number ends: `X` in `XY5`, `Xnan` in `Xnan Y5`.
fn end_of_name(text: &[u8], start: usize) -> usize {
    let letters = text[start..].iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
    let after = start + letters;
    let has_number = matches!(text.get(after), Some(b'0'..=b'9' | b'.' | b'+' | b'-'));
    // `@` and `^` are no letters.
    (if has_number { after - 1 } else { after }).max(start + 1)
}

#[cfg(test)]
mod tests;
