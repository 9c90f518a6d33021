//! One line of a program, and places in it.
//!
//! Knows bytes, characters and columns; the lexer knows words.

use cnc_msgs::contour::Source;

/// A line without the carriage returns at its end: of CR LF, or of CR CR LF where CR LF was converted twice.
pub(crate) fn without_carriage_returns(mut line: &[u8]) -> &[u8] {
    while let [before @ .., b'\r'] = line {
        line = before;
    }
    line
}

/// One line, without its line ending.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line<'t> {
    /// Line number, from 1.
    pub(crate) number: u32,
    pub(crate) text: &'t [u8],
    /// The row of the table of calls that it is run in.
    pub(crate) call: u32,
}

impl Line<'_> {
    /// The place of some bytes of the line, in characters.
    ///
    /// Bytes that are not UTF-8 count as the replacement characters of a lossy conversion. Values
    /// that exceed the fields are limited.
    pub(crate) fn source(&self, block: Option<u32>, start: usize, end: usize) -> Source {
        let end = end.min(self.text.len());
        let start = start.min(end);
        let before = characters(&self.text[..start]);
        let within = characters(&self.text[start..end]);
        Source {
            line: self.number,
            block,
            column: u16::try_from(before + 1).unwrap_or(u16::MAX),
            length: u16::try_from(within).unwrap_or(u16::MAX),
            call: self.call,
        }
    }

    /// Some bytes of the line as a message quotes them: capitals, but for names in `< >`; no blanks,
    /// shortened.
    pub(crate) fn quote(&self, start: usize, end: usize) -> String {
        const LONG: usize = 24;
        let end = end.min(self.text.len());
        let text = String::from_utf8_lossy(&self.text[start.min(end)..end]);
        if let Some(name) = name_of_call(&text) {
            return name.to_owned();
        }
        let mut is_name = false;
        let mut quote: String = text
            .chars()
            .filter(|letter| !letter.is_whitespace())
            .map(|letter| {
                is_name = letter == '<' || is_name && letter != '>';
                if is_name { letter } else { letter.to_ascii_uppercase() }
            })
            .take(LONG + 1)
            .collect();
        if quote.chars().count() > LONG {
            quote = quote.chars().take(LONG).chain("...".chars()).collect();
        }
        quote
    }
}

/// The name of a call, whole and as written: `CutterCompensationSetRadius`. A word has one letter.
fn name_of_call(text: &str) -> Option<&str> {
    let is_name = text.len() > 1 && text.bytes().all(|byte| byte.is_ascii_alphabetic());
    // No call has a longer name.
    const LONGEST: usize = 40;
    (is_name && text.len() <= LONGEST).then_some(text)
}

fn characters(bytes: &[u8]) -> usize {
    if bytes.is_ascii() { bytes.len() } else { String::from_utf8_lossy(bytes).chars().count() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters_whatever_the_encoding() {
        for text in ["(\u{fc}) G1".as_bytes(), b"(\xfc) G1"] {
            let line = Line { number: 3, text, call: 0 };
            let source = line.source(None, text.len() - 2, text.len());
            assert_eq!((source.line, source.column, source.length), (3, 5, 2));
        }
    }

    #[test]
    fn names_are_quoted_as_they_are_written() {
        let line = Line { number: 1, text: b"x[#<_Depth> + sin[#<a b>]]", call: 0 };
        assert_eq!(line.quote(0, 99), "X[#<_Depth>+SIN[#<ab>]]");
    }

    #[test]
    fn long_words_are_quoted_short() {
        let line = Line { number: 1, text: &[b'x'; 100], call: 0 };
        assert_eq!(line.quote(0, 100), "X".repeat(24) + "...");
    }
}
