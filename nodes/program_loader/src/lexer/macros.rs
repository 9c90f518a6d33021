//! The macro language of Fanuc controls: `IF [#1 GT 5] GOTO 10`, `WHILE [#1 LT 3] DO1`, `END1`.
//!
//! RS-274 has O words in its place. Nothing after such a line can be read: what it does is not known.

use super::Lexer;
use cnc_msgs::finding::Code;

/// The words, and whether an expression follows at once. The others are followed by a number, too.
const WORDS: [(&str, bool); 4] = [("IF", true), ("WHILE", true), ("GOTO", false), ("END", false)];

/// Whether a word of the macro language stands here. No word of RS-274 begins so.
pub(super) fn begins(text: &[u8]) -> bool {
    WORDS.iter().any(|(word, has_value)| {
        let is_word =
            text.get(..word.len()).is_some_and(|it| it.eq_ignore_ascii_case(word.as_bytes()));
        let next = || text[word.len()..].trim_ascii_start().first().copied().unwrap_or_default();
        is_word && (next() == b'[' || !has_value && (next() == b'#' || next().is_ascii_digit()))
    })
}

impl Lexer<'_> {
    /// Reports that a program is written in the macro language.
    #[cold]
    pub(super) fn macro_language(&mut self, start: usize) {
        self.at = start;
        let rest = &self.line.text[start..];
        let length = memchr::memchr2(b'(', b';', rest).unwrap_or(rest.len());
        self.at = start + rest[..length].trim_ascii_end().len();
        let quote = self.line.quote(start, self.at);
        let message = format!(
            "`{quote}` is of the macro language of Fanuc controls, which this control does not have"
        );
        let help = "write o1 if [...] and o1 endif around what IF and GOTO skip, o1 while [...] and o1 endwhile for \
                    WHILE, DO and END, and o1 call for G65: there is no jump";
        self.report(Code::Unsupported, start, message, help);
        self.block.ends_reading = true;
    }
}

#[cfg(test)]
mod tests {
    use super::begins;

    #[test]
    fn words_of_the_macro_language_are_known_by_what_follows_them() {
        let table = [
            ("IF[#1 GT 5]GOTO10", true),
            ("if [#1 eq 0] then #2=1", true),
            ("WHILE [#1 LT 3] DO1", true),
            ("GOTO 10", true),
            ("GOTO#5", true),
            ("GOTO [#1+5]", true),
            ("END1", true),
            ("END 2", true),
            // Words of RS-274, and what is wrong in another way.
            ("IFIX[#1]", false),
            ("I[#1]", false),
            ("E1", false),
            ("END", false),
            ("WHILE", false),
            ("G0", false),
            ("IF", false),
            ("IF#1", false),
        ];
        for (text, expected) in table {
            assert_eq!(begins(text.as_bytes()), expected, "{text}");
        }
    }
}
