//! R parameters of the 840C: `R1=R2+5` sets one, `X=R1` and `X=-R1` read one.
//!
//! What the manuals leave open is refused: a chain whose value depends on which operator comes first,
//! a parameter that nothing has set, and one that is set and read in the same block.

use super::Lexer;
use crate::block::Assignment;
use crate::expression::{Parameter, skip_blanks};
use crate::number;
use cnc_msgs::finding::{Code, Finding};

/// Digits of the number of a parameter.
const DIGITS_MAX: usize = 4;

/// A value that cannot be read: what is wrong, from which byte to which, and what to do.
struct Wrong {
    code: Code,
    message: String,
    start: usize,
    end: usize,
    help: String,
}

impl Lexer<'_> {
    /// Whether a word goes on with `=` here.
    pub(super) fn is_r_value(&self, letter: u8, at: usize) -> bool {
        // N, G, L and M take plain numbers.
        self.rules.r_parameters
            && letter.is_ascii_alphabetic()
            && !matches!(letter, b'N' | b'G' | b'L' | b'M' | b'R')
            && self.line.text.get(at) == Some(&b'=')
    }

    /// `X=R1`: a word whose value begins after the `=` at this byte.
    #[cold]
    pub(super) fn r_word(&mut self, letter: u8, start: usize, equals: usize) {
        match self.r_chain(equals + 1) {
            Ok(value) => self.add(letter, value, start),
            Err(wrong) => {
                self.at = self.end_of_r_value(equals + 1);
                self.add(letter, f64::NAN, start);
                self.r_error(wrong);
            }
        }
    }

    /// The `=` of `R1=...`; `digits` is the first byte after R and blanks.
    pub(super) fn r_equals(&self, digits: usize) -> Option<usize> {
        let text = self.line.text;
        let length = text[digits..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let equals = skip_blanks(text, digits + length);
        (length > 0 && text.get(equals) == Some(&b'=')).then_some(equals)
    }

    /// `R1=...`
    #[cold]
    pub(super) fn r_assignment(&mut self, start: usize, digits: usize, equals: usize) {
        let text = self.line.text;
        let length = text[digits..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        if length > DIGITS_MAX {
            self.at = digits + length;
            let quote = self.line.quote(start, self.at);
            let message = format!("`{quote}` is not the number of a parameter");
            let help = "R parameters have at most four digits";
            self.report(Code::BadNumber, start, message, help);
            self.at = self.end_of_r_value(equals);
            return;
        }
        let parameter = Parameter::Named(name(&text[digits..digits + length]).into());
        let (value, wrong) = match self.r_chain(equals + 1) {
            Ok(value) => (value, None),
            Err(wrong) => {
                self.at = self.end_of_r_value(equals + 1);
                (f64::NAN, Some(wrong))
            }
        };
        self.covers(start);
        let end = self.at;
        self.block.assignments.push(Assignment { parameter, value, start, end });
        if let Some(wrong) = wrong {
            self.r_error(wrong);
        }
    }

    fn r_error(&mut self, wrong: Wrong) {
        let Wrong { code, message, start, end, help } = wrong;
        let source = self.line.source(self.block.number, start, end);
        self.block.is_damaged = true;
        self.block.has_remark = true;
        self.findings.push(Finding::error(code, source, message).help(help));
    }

    /// Where a value that cannot be read ends: before the next blank or comment.
    fn end_of_r_value(&self, at: usize) -> usize {
        let text = self.line.text;
        let at = skip_blanks(text, at);
        let is_end = |byte: &u8| matches!(byte, b' ' | b'\t' | b'(' | b';');
        text[at..].iter().position(is_end).map_or(text.len(), |length| at + length)
    }

    /// Numbers and parameters with operators between them; `at` is then after the last one.
    fn r_chain(&mut self, start: usize) -> Result<f64, Wrong> {
        let text = self.line.text;
        let mut value = self.r_term(start)?;
        let mut first = None;
        loop {
            let at = skip_blanks(text, self.at);
            let Some(&operator @ (b'+' | b'-' | b'*' | b'/')) = text.get(at) else { break };
            let is_product = matches!(operator, b'*' | b'/');
            if first.is_some_and(|first| first != is_product) {
                return Err(Wrong {
                    code: Code::Unsupported,
                    message: "+ or - and * or / in one calculation".to_owned(),
                    start: at,
                    end: at + 1,
                    help: "write two blocks: which of them comes first is not the same on all \
                           controls"
                        .to_owned(),
                });
            }
            first = Some(is_product);
            let right = self.r_term(at + 1)?;
            value = match operator {
                b'+' => value + right,
                b'-' => value - right,
                b'*' => value * right,
                _ => value / right,
            };
            if value.is_infinite() || right == 0.0 && operator == b'/' {
                let message = match operator {
                    b'/' => "a division by zero",
                    _ => "the result is too large for a number",
                };
                return Err(Wrong {
                    code: Code::BadNumber,
                    message: message.to_owned(),
                    start: at,
                    end: self.at,
                    help: "look for a parameter with a wrong value before this block".to_owned(),
                });
            }
        }
        Ok(value)
    }

    /// A number or a parameter, with a sign.
    fn r_term(&mut self, start: usize) -> Result<f64, Wrong> {
        let text = self.line.text;
        let mut at = skip_blanks(text, start);
        let sign = match text.get(at) {
            Some(b'-') => -1.0,
            _ => 1.0,
        };
        if matches!(text.get(at), Some(b'+' | b'-')) {
            at = skip_blanks(text, at + 1);
        }
        if matches!(text.get(at), Some(b'R' | b'r')) {
            let length = text[at + 1..].iter().take_while(|byte| byte.is_ascii_digit()).count();
            if (1..=DIGITS_MAX).contains(&length) {
                self.at = at + 1 + length;
                return Ok(sign * self.r_value(at, &name(&text[at + 1..self.at]))?);
            }
        } else if let Ok((value, end)) = number::read_unsigned(text, at) {
            self.at = end;
            return Ok(sign * value);
        }
        Err(Wrong {
            code: Code::BadNumber,
            message: "a number or a parameter is missing here".to_owned(),
            start: at.min(text.len().saturating_sub(1)),
            end: at + 1,
            help: "write a value like 5, R2 or R2+5; there are no functions".to_owned(),
        })
    }

    /// The value of the parameter that is named at this byte.
    fn r_value(&self, start: usize, name: &str) -> Result<f64, Wrong> {
        let shown = name.to_ascii_uppercase();
        let wrong = |code, message: String, help: String| {
            Err(Wrong { code, message, start, end: self.at, help })
        };
        let is_set_here = self.block.assignments.iter().any(
            |assignment| matches!(&assignment.parameter, Parameter::Named(named) if named == name),
        );
        if is_set_here {
            return wrong(
                Code::Unsupported,
                format!("{shown} is set in this block, and read in it"),
                format!("read {shown} in a block after it"),
            );
        }
        match self.values.named(name) {
            Some(Ok(value)) => Ok(value),
            Some(Err(trouble)) => wrong(Code::Unsupported, trouble.message(&shown), trouble.help()),
            None => wrong(
                Code::BadNumber,
                format!("{shown} has no value: nothing before this block has set it"),
                format!("set {shown} before this block; what the machine has in it is not known"),
            ),
        }
    }
}

/// The parameter of a number, as it is kept: `r5` of `R05`.
fn name(digits: &[u8]) -> String {
    let number = digits.iter().fold(0_u32, |number, digit| number * 10 + u32::from(digit - b'0'));
    format!("r{number}")
}
