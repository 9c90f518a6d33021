//! One O word: `o100 while [#1 LT 5]`, `o<pocket> call [10] [20]`, `O1001`.
//!
//! Knows how a statement is written, not what it does.

use crate::expression::{self, Lookup, Trouble};
use std::borrow::Cow;

/// What a statement does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Keyword {
    Sub,
    EndSub,
    Call,
    Return,
    Do,
    While,
    EndWhile,
    /// `while` that closes a `do`.
    DoWhile,
    Repeat,
    EndRepeat,
    If,
    ElseIf,
    Else,
    EndIf,
    Break,
    Continue,
    /// A program number: `O1001`.
    Number,
}

impl Keyword {
    /// As they are written; a name that begins with another one stands before it.
    const WRITTEN: [(&'static str, Self); 15] = [
        ("ENDSUB", Self::EndSub),
        ("ENDWHILE", Self::EndWhile),
        ("ENDREPEAT", Self::EndRepeat),
        ("ENDIF", Self::EndIf),
        ("ELSEIF", Self::ElseIf),
        ("ELSE", Self::Else),
        ("SUB", Self::Sub),
        ("CALL", Self::Call),
        ("RETURN", Self::Return),
        ("DO", Self::Do),
        ("WHILE", Self::While),
        ("REPEAT", Self::Repeat),
        ("IF", Self::If),
        ("BREAK", Self::Break),
        ("CONTINUE", Self::Continue),
    ];

    /// The word in small letters.
    pub(crate) fn word(self) -> String {
        match self {
            Self::Number => "a program number".to_owned(),
            Self::DoWhile => "while".to_owned(),
            _ => {
                let written = Self::WRITTEN.iter().find(|(_, keyword)| *keyword == self);
                written.map_or_else(String::new, |(word, _)| word.to_ascii_lowercase())
            }
        }
    }
}

/// The name of a statement.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Name<'t> {
    /// Small letters, or digits without leading zeros.
    Known(Cow<'t, str>),
    /// A value that begins at this byte.
    Computed(usize),
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Statement<'t> {
    pub(crate) name: Name<'t>,
    pub(crate) keyword: Keyword,
    /// The N number.
    pub(crate) block: Option<u32>,
    /// Whether the line begins with `/`.
    pub(crate) is_optional: bool,
    /// The O, the first byte after the keyword, and the end of the line or the `;` of a comment.
    pub(crate) start: usize,
    pub(crate) arguments: usize,
    pub(crate) end: usize,
}

/// A statement that cannot be read: what is wrong, its place and what to do.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BadStatement {
    pub(crate) start: usize,
    pub(crate) end: usize,
    pub(crate) message: String,
    pub(crate) help: &'static str,
}

/// Where the O word of a line is: after blanks, `/` and N. `None` if the line has none.
pub(crate) fn o_word(text: &[u8]) -> Option<(usize, Option<u32>, bool)> {
    let mut at = expression::skip_blanks(text, 0);
    let is_optional = text.get(at) == Some(&b'/');
    if is_optional {
        at = expression::skip_blanks(text, at + 1);
    }
    let mut block = None;
    if matches!(text.get(at), Some(b'N' | b'n')) {
        let digits = expression::skip_blanks(text, at + 1);
        let length = text[digits..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        block = std::str::from_utf8(&text[digits..digits + length]).ok()?.parse().ok();
        at = expression::skip_blanks(text, digits + length);
    }
    let is_word = matches!(text.get(at), Some(b'O' | b'o'))
        && matches!(
            text.get(expression::skip_blanks(text, at + 1)),
            Some(b'0'..=b'9' | b'<' | b'[' | b'#')
        );
    is_word.then_some((at, block, is_optional))
}

/// Reads the statement of a line; `None` if the line has no O word.
pub(crate) fn read(text: &[u8]) -> Option<Result<Statement<'_>, BadStatement>> {
    let (start, block, is_optional) = o_word(text)?;
    let mut at = expression::skip_blanks(text, start + 1);
    let name = match text[at] {
        b'<' => match expression::name(text, at) {
            Some((name, end)) => {
                at = end;
                Name::Known(name)
            }
            None => return Some(bad(text, start, "the name has no >", "write o<name>")),
        },
        b'0'..=b'9' => {
            let length = text[at..].iter().take_while(|byte| byte.is_ascii_digit()).count();
            let digits = std::str::from_utf8(&text[at..at + length]).unwrap_or_default();
            at += length;
            let number = digits.trim_start_matches('0');
            Name::Known(Cow::Borrowed(if number.is_empty() { "0" } else { number }))
        }
        _ => {
            let value = at;
            match expression::value(text, at, &Unknown) {
                Ok((_, end)) => at = end,
                Err(error) => {
                    let quote = String::from_utf8_lossy(&text[error.start..error.end]);
                    return Some(Err(BadStatement {
                        start: error.start,
                        end: error.end,
                        message: error.trouble.message(&quote),
                        help: "write the number of the subroutine, or its value in [ ]",
                    }));
                }
            }
            Name::Computed(value)
        }
    };
    let at = expression::skip_blanks(text, at);
    let end = end_of_line(text, at);
    let words = &text[at..end];
    let (keyword, arguments) = match expression::spelled_of(&Keyword::WRITTEN, words) {
        Some((keyword, length)) => (keyword, at + length),
        // A program number; a block may follow it.
        None if matches!(name, Name::Known(_)) && text[start..].get(1) != Some(&b'<') => {
            (Keyword::Number, at)
        }
        None => return Some(bad(text, start, "the O word has no keyword", KEYWORDS)),
    };
    Some(Ok(Statement { name, keyword, block, is_optional, start, arguments, end }))
}

const KEYWORDS: &str = "write sub, endsub, call, return, if, elseif, else, endif, while, \
                        endwhile, do, repeat, endrepeat, break or continue after the name";

#[allow(clippy::unnecessary_wraps, reason = "it is the result of `read`")]
fn bad<'t>(
    text: &[u8],
    start: usize,
    message: &str,
    help: &'static str,
) -> Result<Statement<'t>, BadStatement> {
    let end = end_of_line(text, start).max(start + 1);
    Err(BadStatement { start, end, message: message.to_owned(), help })
}

/// Where a statement ends: at the `;` of a comment, or at the end of the line.
fn end_of_line(text: &[u8], start: usize) -> usize {
    let mut at = start;
    while let Some(length) = memchr::memchr2(b'(', b';', &text[at..]) {
        at += length;
        if text[at] == b';' {
            return start + text[start..at].trim_ascii_end().len();
        }
        match memchr::memchr(b')', &text[at..]) {
            Some(length) => at += length,
            None => break,
        }
    }
    start + text[start..].trim_ascii_end().len()
}

/// The index of the first byte from `at` on that is neither blank nor in a comment.
pub(crate) fn skip_remarks(text: &[u8], mut at: usize) -> usize {
    loop {
        at = expression::skip_blanks(text, at);
        match text.get(at) {
            Some(b'(') => match memchr::memchr(b')', &text[at..]) {
                Some(length) => at += length + 1,
                None => return at,
            },
            _ => return at,
        }
    }
}

/// Values before the program runs.
struct Unknown;

impl Lookup for Unknown {
    fn numbered(&self, _: u32) -> Option<Result<f64, Trouble>> {
        Some(Ok(f64::NAN))
    }

    fn named(&self, _: &str) -> Option<Result<f64, Trouble>> {
        Some(Ok(f64::NAN))
    }
}

#[cfg(test)]
mod tests {
    use super::Keyword;

    #[test]
    fn the_page_of_rs274_names_each_o_word() {
        let page = include_str!("../../../../docs/rs274.md");
        for (word, _) in Keyword::WRITTEN {
            let word = word.to_ascii_lowercase();
            assert!(page.contains(&format!("`{word}`")), "{word}");
        }
    }
}
