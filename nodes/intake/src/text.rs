//! Text from outside, safe to show on a terminal and in a log.
//!
//! The name of a program may hold an escape sequence that clears the screen, or a line feed
//! that forges a log line. All text is escaped here before it is shown.

use std::borrow::Cow;
use std::fmt::Write as _;

/// Whether a character controls a terminal or hides text instead of being shown: control
/// characters, line separators, and the marks that change the writing direction.
pub const fn is_steering(letter: char) -> bool {
    matches!(
        letter,
        '\0'..='\x1f'
            | '\x7f'..='\u{9f}'
            | '\u{200e}' | '\u{200f}'
            | '\u{2028}'..='\u{202e}'
            | '\u{2066}'..='\u{2069}'
            | '\u{feff}'
    )
}

/// One line of text: every control character as `\n` or `\u001b`, as JSON writes it.
pub fn one_line(text: &str) -> Cow<'_, str> {
    escape(text, |_| false)
}

/// Several lines of text: as [`one_line`], but line feeds and tabs stay.
pub fn lines(text: &str) -> Cow<'_, str> {
    escape(text, |letter| matches!(letter, '\n' | '\t'))
}

fn escape(text: &str, stays: impl Fn(char) -> bool) -> Cow<'_, str> {
    let is_bad = |letter: char| is_steering(letter) && !stays(letter);
    let Some(first) = text.find(is_bad) else { return Cow::Borrowed(text) };
    let mut shown = String::with_capacity(text.len() + 16);
    shown.push_str(&text[..first]);
    for letter in text[first..].chars() {
        match letter {
            letter if !is_bad(letter) => shown.push(letter),
            '\n' => shown.push_str("\\n"),
            '\r' => shown.push_str("\\r"),
            '\t' => shown.push_str("\\t"),
            // Writing to a string cannot fail.
            other => drop(write!(shown, "\\u{:04x}", u32::from(other))),
        }
    }
    Cow::Owned(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_steers_a_terminal_is_left() {
        let table = [
            ("part.ngc", "part.ngc"),
            ("Größe 5 µm, 部品", "Größe 5 µm, 部品"),
            ("\x1b[2J\x1b]0;pwned\x07", "\\u001b[2J\\u001b]0;pwned\\u0007"),
            ("a\nb\r\tc", "a\\nb\\r\\tc"),
            ("\u{9b}2J\x7f", "\\u009b2J\\u007f"),
            ("cgn.\u{202e}trap", "cgn.\\u202etrap"),
        ];
        for (text, shown) in table {
            assert_eq!(one_line(text), shown);
        }
        assert_eq!(lines("a\n\tb\x1b"), "a\n\tb\\u001b");
        assert!(matches!(one_line("plain"), Cow::Borrowed(_)));
    }

    #[test]
    fn json_stays_json() {
        let json = "{\n  \"name\": \"a\u{9b}\u{7f}b\"\n}";
        let shown = lines(json);
        // YAML 1.2 is a superset of JSON.
        let read: std::collections::BTreeMap<String, String> =
            serde_yaml::from_str(&shown).expect("JSON");
        assert_eq!(read["name"], "a\u{9b}\u{7f}b");
    }
}
