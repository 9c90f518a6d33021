//! Values of RS-274: numbers, parameters, expressions in brackets, functions.
//!
//! ```text
//! value      = number | '#' value | '#<' name '>' | '[' expression ']' | function | sign value
//! expression = value { operator value }
//! function   = SIN '[' expression ']' | ATAN '[' expression ']/[' expression ']' | EXISTS '[' parameter ']' | ...
//! ```
//!
//! Blanks may stand anywhere. Angles are in degrees. Knows how a value is computed, not what a
//! parameter means: [`Lookup`] has their values. A value that is NaN because of an error that has
//! been reported stays NaN, without another error.

mod arithmetic;
mod trouble;

use crate::limits::NUMBER_MAX;
use crate::number::{self, NumberError};
pub(crate) use arithmetic::spelled_of;
use arithmetic::{Function, Operator};
use std::borrow::Cow;
pub(crate) use trouble::{ExpressionError, Trouble};

/// Brackets, signs and `#` inside each other: more than any program needs, and no stack overflow.
const DEPTH_MAX: u32 = 100;
/// How near to a whole number a value must be where a number is meant: of a tool, a parameter, passes (LinuxCNC).
const WHOLE_TOLERANCE: f64 = 1e-4;

/// The whole number that a value stands for, with at most eight digits: `[0.7/0.1]` is 7.
#[inline]
pub(crate) fn whole(value: f64) -> Option<u32> {
    let number = value as u32;
    if f64::from(number) == value && value <= NUMBER_MAX {
        return Some(number);
    }
    let number = value.round();
    let is_near = (value - number).abs() <= WHOLE_TOLERANCE;
    (is_near && (0.0..=NUMBER_MAX).contains(&number)).then_some(number as u32)
}

/// The values of parameters.
pub(crate) trait Lookup {
    /// The value of a numbered parameter, `#100`; `None` if there is no such number.
    fn numbered(&self, number: u32) -> Option<Result<f64, Trouble>>;

    /// The value of a named parameter, in small letters; `None` if nothing has set it.
    fn named(&self, name: &str) -> Option<Result<f64, Trouble>>;
}

/// A parameter that is named or numbered.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Parameter<'t> {
    Numbered(u32),
    /// Small letters without blanks.
    Named(Cow<'t, str>),
}

/// Reads the value at `start`; returns it, and the first byte after it.
pub(crate) fn value(
    text: &[u8],
    start: usize,
    lookup: &dyn Lookup,
) -> Result<(f64, usize), ExpressionError> {
    let mut reader = Reader { text, at: start, lookup, depth: 0 };
    let value = reader.value()?;
    Ok((value, reader.at))
}

/// Reads `#100` or `#<name>` as the target of an assignment; `start` is the `#`.
pub(crate) fn target<'t>(
    text: &'t [u8],
    start: usize,
    lookup: &dyn Lookup,
) -> Result<(Parameter<'t>, usize), ExpressionError> {
    let mut reader = Reader { text, at: start + 1, lookup, depth: 0 };
    let parameter = reader.parameter(start)?;
    Ok((parameter.unwrap_or(Parameter::Numbered(0)), reader.at))
}

/// Reads `<name>`, the `<` at `start`: small letters without blanks, and the first byte after `>`.
pub(crate) fn name(text: &[u8], start: usize) -> Option<(Cow<'_, str>, usize)> {
    let is_plain = |byte: &&u8| matches!(**byte, b'!'..=b'=' | b'?'..=b'@' | b'['..=b'~');
    let length = 1 + text[start + 1..].iter().take_while(is_plain).count();
    if length > 1 && text.get(start + length) == Some(&b'>') {
        let name = std::str::from_utf8(&text[start + 1..start + length]).ok()?;
        return Some((Cow::Borrowed(name), start + length + 1));
    }
    let length = memchr::memchr(b'>', &text[start..])?;
    let inner = std::str::from_utf8(&text[start + 1..start + length]).ok()?;
    let letters = inner.chars().filter(|letter| !matches!(letter, ' ' | '\t' | '\r'));
    let name: String = letters.map(|letter| letter.to_ascii_lowercase()).collect();
    (!name.is_empty()).then_some((Cow::Owned(name), start + length + 1))
}

/// The index of the first byte from `at` on that is no blank.
pub(crate) fn skip_blanks(text: &[u8], mut at: usize) -> usize {
    while matches!(text.get(at), Some(b' ' | b'\t')) {
        at += 1;
    }
    at
}

struct Reader<'t, 'l> {
    text: &'t [u8],
    at: usize,
    lookup: &'l dyn Lookup,
    depth: u32,
}

impl<'t> Reader<'t, '_> {
    fn peek(&mut self) -> Option<u8> {
        self.at = skip_blanks(self.text, self.at);
        self.text.get(self.at).copied()
    }

    fn fail<T>(&self, trouble: Trouble, start: usize) -> Result<T, ExpressionError> {
        // What is missing at the end of the line is shown at its last character.
        let start = start.min(self.text.len().saturating_sub(1));
        let end = self.at.clamp(start + 1, self.text.len().max(start + 1));
        Err(ExpressionError { trouble, start, end })
    }

    fn value(&mut self) -> Result<f64, ExpressionError> {
        self.depth += 1;
        let first = self.peek();
        let start = self.at;
        if self.depth > DEPTH_MAX {
            return self.fail(Trouble::TooDeep { most: DEPTH_MAX }, start);
        }
        let value = match first {
            Some(b'[') => {
                self.at += 1;
                self.bracket(start)?
            }
            Some(b'#') => {
                self.at += 1;
                self.read(start)?
            }
            Some(sign @ (b'+' | b'-')) => {
                self.at += 1;
                let value = self.value()?;
                if sign == b'-' { -value } else { value }
            }
            Some(b'0'..=b'9' | b'.') => self.number(start)?,
            Some(byte) if byte.is_ascii_alphabetic() => self.function(start)?,
            _ => return self.fail(Trouble::NoValue, start),
        };
        self.depth -= 1;
        Ok(value)
    }

    fn number(&mut self, start: usize) -> Result<f64, ExpressionError> {
        match number::read_unsigned(self.text, start) {
            Ok((value, end)) => {
                self.at = end;
                Ok(value)
            }
            Err(not) => {
                self.at = not.end;
                self.fail(Trouble::Number { is_exponent: not.what == NumberError::Exponent }, start)
            }
        }
    }

    /// The expression after a `[` at `start`, and its `]`.
    fn bracket(&mut self, start: usize) -> Result<f64, ExpressionError> {
        let value = self.operations(0)?;
        match self.peek() {
            Some(b']') => {
                self.at += 1;
                Ok(value)
            }
            None => self.fail(Trouble::NotClosed, start),
            Some(_) => {
                let start = self.at;
                self.at = end_of_word(self.text, start);
                self.fail(Trouble::NoOperator, start)
            }
        }
    }

    /// A value and all operations of at least this precedence after it, from left to right.
    fn operations(&mut self, least: u8) -> Result<f64, ExpressionError> {
        let mut left = self.value()?;
        loop {
            self.peek();
            let start = self.at;
            let Some((operator, length)) = Operator::read(&self.text[start..]) else { break };
            if operator.precedence() < least {
                break;
            }
            self.at += length;
            let right = self.operations(operator.precedence() + 1)?;
            left = match operator.apply(left, right) {
                Ok(value) => value,
                Err(trouble) => return self.fail(trouble, start),
            };
        }
        Ok(left)
    }

    fn function(&mut self, start: usize) -> Result<f64, ExpressionError> {
        let Some((function, length)) = Function::read(&self.text[start..]) else {
            self.at = end_of_word(self.text, start);
            return self.fail(Trouble::UnknownFunction, start);
        };
        self.at += length;
        if self.peek() != Some(b'[') {
            return self.fail(Trouble::NoArgument { function: function.name() }, start);
        }
        let bracket = self.at;
        self.at += 1;
        if function == Function::Exists {
            return self.exists(bracket);
        }
        let argument = self.bracket(bracket)?;
        let second = if function == Function::Atan { Some(self.second(start)?) } else { None };
        match function.apply(argument, second) {
            Ok(value) => Ok(value),
            Err(trouble) => self.fail(trouble, start),
        }
    }

    /// `/[x]` of `ATAN[y]/[x]`.
    fn second(&mut self, start: usize) -> Result<f64, ExpressionError> {
        if self.peek() == Some(b'/') {
            self.at += 1;
            if self.peek() == Some(b'[') {
                let bracket = self.at;
                self.at += 1;
                return self.bracket(bracket);
            }
        }
        self.fail(Trouble::NoSecondArgument, start)
    }

    /// `#<name>]` of `EXISTS[#<name>]`.
    fn exists(&mut self, bracket: usize) -> Result<f64, ExpressionError> {
        if self.peek() != Some(b'#') {
            return self.fail(Trouble::NoParameterInExists, bracket);
        }
        let start = self.at;
        self.at += 1;
        let exists = match self.parameter(start)? {
            Some(Parameter::Numbered(number)) => self.lookup.numbered(number).is_some(),
            Some(Parameter::Named(name)) => self.lookup.named(&name).is_some(),
            None => false,
        };
        if self.peek() != Some(b']') {
            return self.fail(Trouble::NotClosed, bracket);
        }
        self.at += 1;
        Ok(f64::from(u8::from(exists)))
    }

    /// The value of the parameter whose `#` is at `start`.
    fn read(&mut self, start: usize) -> Result<f64, ExpressionError> {
        let read = match self.parameter(start)? {
            None => return Ok(f64::NAN),
            Some(Parameter::Numbered(number)) => self
                .lookup
                .numbered(number)
                .unwrap_or(Err(Trouble::NoSuchNumber { number: f64::from(number) })),
            Some(Parameter::Named(name)) => self
                .lookup
                .named(&name)
                .unwrap_or_else(|| Err(Trouble::Undefined { name: name.into_owned() })),
        };
        read.or_else(|trouble| self.fail(trouble, start))
    }

    /// What follows the `#` at `start`; `None` for a number that an error has made unknown.
    fn parameter(&mut self, start: usize) -> Result<Option<Parameter<'t>>, ExpressionError> {
        if self.peek() == Some(b'<') {
            return match name(self.text, self.at) {
                Some((name, end)) => {
                    self.at = end;
                    Ok(Some(Parameter::Named(name)))
                }
                None => self.fail(Trouble::NoName, start),
            };
        }
        let value = self.value()?;
        if value.is_nan() {
            return Ok(None);
        }
        let number = value.round();
        if (value - number).abs() > WHOLE_TOLERANCE {
            return self.fail(Trouble::NotWhole { value }, start);
        }
        if !(1.0..=f64::from(u32::MAX)).contains(&number) {
            return self.fail(Trouble::NoSuchNumber { number }, start);
        }
        Ok(Some(Parameter::Numbered(number as u32)))
    }
}

/// Where what stands at `start` ends, as an error shows it: letters, or one character.
fn end_of_word(text: &[u8], start: usize) -> usize {
    let letters = text[start..].iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
    start + letters.max(1)
}

#[cfg(test)]
mod tests;
