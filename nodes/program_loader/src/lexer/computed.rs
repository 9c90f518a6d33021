//! Words whose value is an expression, parameters that a block sets, and program numbers.
//!
//! Only of languages with parameters; the others refuse them by name.

use super::Lexer;
use crate::block::Assignment;
use crate::expression::{self, Parameter};
use cnc_msgs::finding::{Code, Finding};

impl Lexer<'_> {
    /// A program number at the beginning; `flow` has read it already.
    #[cold]
    pub(super) fn o_word(&mut self, digits: usize) {
        let has_numbers = self.rules.programs.is_some_and(|it| it.begins.contains(&"O"));
        if !self.rules.parameters && !has_numbers {
            return self.rest(
                Code::Unsupported,
                "O words are not supported",
                "delete program numbers; write subroutines and loops out, or post without them",
            );
        }
        let length = self.line.text[digits..].iter().take_while(|it| it.is_ascii_digit()).count();
        // After N it is no number of a program, which the flow would know.
        let is_late = has_numbers && self.has_begun;
        let is_alone = self.block.words.is_empty() && self.block.assignments.is_empty();
        if length == 0 || is_late || !is_alone {
            return self.rest(
                Code::Syntax,
                "an O word is not at the beginning of its line",
                "write it into a line of its own",
            );
        }
        self.block.has_remark |= self.has_begun;
        self.at = digits + length;
    }

    /// A word whose value is an expression: `X[#1+2]`, `Z-#<depth>`, `YSIN[30]`.
    #[cold]
    pub(super) fn computed_word(&mut self, letter: u8, start: usize, value: usize) {
        match expression::value(self.line.text, value, self.values) {
            Ok((value, end)) => {
                self.at = end;
                self.add(letter, value, start);
                if value.is_nan() {
                    self.block.is_damaged = true;
                }
            }
            Err(error) => {
                self.at = error.end.max(start + 1);
                self.skip_expression();
                let finding = error.finding(self.line, self.block.number);
                self.add(letter, f64::NAN, start);
                self.damage(finding);
            }
        }
    }

    /// `#1=5`, `#<depth>=[#<depth>-1]`: the value is set once the block has been read.
    #[cold]
    pub(super) fn assignment(&mut self, start: usize) {
        let text = self.line.text;
        let target = expression::target(text, start, self.values);
        let (parameter, end) = match target {
            Ok(target) => target,
            Err(error) => {
                self.at = error.end.max(start + 1);
                self.damage(error.finding(self.line, self.block.number));
                return self.skip_expression();
            }
        };
        self.at = end;
        let equals = expression::skip_blanks(text, end);
        let parameter = match parameter {
            Parameter::Numbered(number) => Parameter::Numbered(number),
            Parameter::Named(name) => Parameter::Named(name.into_owned().into()),
        };
        if text.get(equals) != Some(&b'=') {
            let message = format!("`{}` has no letter", self.line.quote(start, end));
            let help = "write the letter of a word before it, or = and a value after it";
            self.covers(start);
            return self.report(Code::Syntax, start, message, help);
        }
        let (value, error) = match expression::value(text, equals + 1, self.values) {
            Ok((value, end)) => {
                self.at = end;
                (value, None)
            }
            Err(error) => {
                self.at = error.end.max(equals + 1);
                (f64::NAN, Some(error))
            }
        };
        self.covers(start);
        let end = self.at;
        self.block.assignments.push(Assignment { parameter, value, start, end });
        if let Some(error) = error {
            self.damage(error.finding(self.line, self.block.number));
            self.skip_expression();
        }
    }

    /// After an error in an expression: what follows it up to the next word cannot be read.
    fn skip_expression(&mut self) {
        let text = self.line.text;
        let mut depth = 0_i32;
        while let Some(&byte) = text.get(self.at) {
            match byte {
                b'(' | b';' => break,
                b'[' => depth += 1,
                b']' => depth -= 1,
                _ if depth <= 0 && byte.is_ascii_alphabetic() && !follows_letter(text, self.at) => {
                    let next = text.get(expression::skip_blanks(text, self.at + 1));
                    if matches!(next, Some(b'0'..=b'9' | b'-' | b'+' | b'.' | b'#' | b'[')) {
                        break;
                    }
                }
                _ => {}
            }
            self.at += 1;
        }
    }

    fn damage(&mut self, finding: Finding) {
        self.block.is_damaged = true;
        self.block.has_remark = true;
        self.findings.push(finding);
    }
}

/// Whether the value of a word is an expression.
pub(super) fn is_computed(text: &[u8], at: usize) -> bool {
    let byte = |at: usize| text.get(at).copied().unwrap_or(0);
    match byte(at) {
        b'[' | b'#' => true,
        b'+' | b'-' => {
            let next = byte(expression::skip_blanks(text, at + 1));
            matches!(next, b'[' | b'#') || next.is_ascii_alphabetic()
        }
        first if first.is_ascii_alphabetic() => {
            let letters = text[at..].iter().take_while(|it| it.is_ascii_alphabetic()).count();
            letters > 1 && byte(expression::skip_blanks(text, at + letters)) == b'['
        }
        _ => false,
    }
}

fn follows_letter(text: &[u8], at: usize) -> bool {
    at > 0 && text[at - 1].is_ascii_alphabetic()
}
