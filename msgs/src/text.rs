//! A short text that is copied like a number.
//!
//! The text of a message to the operator is in an event of a path; events are copied.

use std::fmt;

/// At most `MAX` bytes of UTF-8, which are fewer than 256. An event with the longest text is no
/// larger than one with an arc.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Text<const MAX: usize = 62> {
    length: u8,
    bytes: [u8; MAX],
}

/// The words of a machine function: `P1 L3`.
pub type Words = Text<44>;

impl<const MAX: usize> Text<MAX> {
    /// The text; `None` if it is too long.
    pub fn new(text: &str) -> Option<Self> {
        let mut bytes = [0; MAX];
        bytes.get_mut(..text.len())?.copy_from_slice(text.as_bytes());
        Some(Self { length: text.len() as u8, bytes })
    }

    pub const EMPTY: Self = Self { length: 0, bytes: [0; MAX] };

    pub fn as_str(&self) -> &str {
        // Made of a text, and never changed.
        std::str::from_utf8(&self.bytes[..usize::from(self.length)]).unwrap_or_default()
    }

    /// A text of any length in parts, divided at blanks where it has any; none of it is lost but
    /// the blanks at the joints.
    pub fn parts(text: &str) -> Vec<Self> {
        let mut parts = Vec::new();
        let mut rest = text.trim();
        while let Some(part) = Self::first_part(rest) {
            parts.extend(Self::new(part.trim_end()));
            rest = rest[part.len()..].trim_start();
        }
        parts
    }

    /// As much of the beginning as fits.
    fn first_part(text: &str) -> Option<&str> {
        if text.len() <= MAX {
            return (!text.is_empty()).then_some(text);
        }
        let fits = (1..=MAX).rev().find(|&at| text.is_char_boundary(at))?;
        if text[fits..].starts_with(' ') {
            return Some(&text[..fits]);
        }
        Some(&text[..text[..fits].rfind(' ').unwrap_or(fits)])
    }
}

impl Words {
    /// The number after a letter, if it is among the words.
    pub fn value(&self, letter: char) -> Option<f64> {
        self.as_str().split(' ').find_map(|word| word.strip_prefix(letter)?.parse().ok())
    }
}

impl<const MAX: usize> Default for Text<MAX> {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl<const MAX: usize> fmt::Display for Text<MAX> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl<const MAX: usize> fmt::Debug for Text<MAX> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contour::{ContourEventKind, Motion};

    #[test]
    fn a_long_text_is_divided_at_blanks_and_none_of_it_is_lost() {
        let (long, wide) = ("x".repeat(60), "\u{fc}".repeat(40));
        for (text, wanted) in [
            (String::new(), vec![]),
            (" put in T3 ".to_owned(), vec!["put in T3"]),
            (format!("{long} yy zz"), vec![&*long, "yy zz"]),
            (format!("{long} y zz"), vec![&*format!("{long} y"), "zz"]),
            (long.repeat(2), vec![&long.repeat(2)[..62], &long.repeat(2)[62..]]),
            (wide.clone(), vec![&wide[..62], &wide[62..]]),
        ] {
            let parts: Vec<Text> = Text::parts(&text);
            let parts: Vec<&str> = parts.iter().map(Text::as_str).collect();
            assert_eq!(parts, wanted, "{text:?}");
        }
    }

    #[test]
    fn a_text_makes_an_event_no_larger_than_a_motion_does() {
        assert!(size_of::<ContourEventKind>() <= size_of::<Motion>() + 8);
        assert_eq!(Text::<62>::new(&"x".repeat(63)), None);
    }
}
