//! The pattern of `like`: `%` is any text, `_` any character, and a `\` before one of them that
//! character itself, as in PostgreSQL.

/// A pattern that was read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pattern(Vec<Part>);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    AnyText,
    AnyCharacter,
    Character(char),
}

impl Pattern {
    /// Reads a pattern; `None` if it ends with the `\` of nothing.
    pub(super) fn read(text: &str) -> Option<Self> {
        let mut parts = Vec::new();
        let mut characters = text.chars();
        while let Some(c) = characters.next() {
            parts.push(match c {
                '%' => Part::AnyText,
                '_' => Part::AnyCharacter,
                '\\' => Part::Character(characters.next()?),
                _ => Part::Character(c),
            });
        }
        Some(Self(parts))
    }

    /// Whether a text has this form.
    pub(super) fn fits(&self, text: &str) -> bool {
        let (text, pattern): (Vec<char>, _) = (text.chars().collect(), &self.0);
        let (mut at, mut next) = (0, 0);
        // The last % and how far the text went then: it takes one character more when the rest does not fit.
        let mut any: Option<(usize, usize)> = None;
        while at < text.len() {
            let fits = |part| part == Part::AnyCharacter || part == Part::Character(text[at]);
            match (pattern.get(next), any) {
                (Some(Part::AnyText), _) => {
                    any = Some((next, at));
                    next += 1;
                }
                (Some(&part), _) if fits(part) => (at, next) = (at + 1, next + 1),
                (_, Some((percent, from))) => {
                    any = Some((percent, from + 1));
                    (at, next) = (from + 1, percent + 1);
                }
                _ => return false,
            }
        }
        pattern[next..].iter().all(|&part| part == Part::AnyText)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_fits_as_in_sql() {
        for (text, pattern, wanted) in [
            ("rs274", "rs%", true),
            ("rs274", "%27_", true),
            ("rs274", "r%s%4", true),
            ("rs274", "rs274%", true),
            ("rs274", "RS%", false),
            ("rs274", "s%", false),
            ("rs274", "____", false),
            ("", "", true),
            ("", "%%", true),
            ("", "_", false),
            ("mill_1", r"mill\_1", true),
            ("mill-1", r"mill\_1", false),
            ("100%", r"%\%", true),
            ("100", r"%\%", false),
            (r"C:\x", r"C:\\_", true),
            ("ab", r"a\b", true),
            ("äb", "_b", true),
        ] {
            let read = Pattern::read(pattern).expect("a pattern");
            assert_eq!(read.fits(text), wanted, "{text} like {pattern}");
        }
        assert_eq!(Pattern::read(r"mill\"), None);
    }
}
