//! The words of a condition.

/// A word, with the place of its first character.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Word {
    pub(super) at: usize,
    pub(super) what: What,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum What {
    /// A column, or `and`, `or`, `not`, `is`, `null`, `in`, `between`, `like`; in small letters.
    Name(String),
    Text(String),
    Number(f64),
    /// `=`, `!=`, `<`, `<=`, `>`, `>=`.
    Sign(&'static str),
    Open,
    Close,
    Comma,
}

/// Longer signs first.
const SIGNS: [(&str, &str); 8] = [
    ("!=", "!="),
    ("<>", "!="),
    ("<=", "<="),
    (">=", ">="),
    ("==", "="),
    ("=", "="),
    ("<", "<"),
    (">", ">"),
];

/// Splits a condition; an error has the place, counted in characters from 1.
pub(super) fn words(text: &str) -> Result<Vec<Word>, (usize, String)> {
    let mut words = Vec::new();
    let mut rest = text;
    loop {
        rest = rest.trim_start();
        let Some(first) = rest.chars().next() else { return Ok(words) };
        let at = text.len() - rest.len();
        let place = text[..at].chars().count() + 1;
        let sign = SIGNS.iter().find(|(sign, _)| rest.starts_with(sign));
        let (length, what) = if let Some((sign, meaning)) = sign {
            (sign.len(), What::Sign(meaning))
        } else if first == '(' {
            (1, What::Open)
        } else if first == ')' {
            (1, What::Close)
        } else if first == ',' {
            (1, What::Comma)
        } else if first == '\'' || first == '"' {
            let (length, content) = quoted(rest, first).ok_or_else(|| {
                (place, format!("the text that begins here has no closing {first}"))
            })?;
            (length, What::Text(content))
        } else if first.is_ascii_digit() || "+-.".contains(first) {
            let is_inside = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
            let length = rest.find(|c| !is_inside(c)).unwrap_or(rest.len());
            let number = rest[..length].parse::<f64>().ok().filter(|it| it.is_finite());
            let number = number.ok_or_else(|| {
                (
                    place,
                    format!("`{}` is not a number; a text stands between quotes", &rest[..length]),
                )
            })?;
            (length, What::Number(number))
        } else if first.is_alphabetic() || first == '_' {
            let length =
                rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            (length, What::Name(rest[..length].to_lowercase()))
        } else {
            return Err((place, format!("`{first}` has no meaning in a condition")));
        };
        words.push(Word { at: place, what });
        rest = &rest[length..];
    }
}

/// The length of a quoted text, and its content; a quote inside is doubled.
fn quoted(text: &str, quote: char) -> Option<(usize, String)> {
    let mut content = String::new();
    let mut characters = text.char_indices().skip(1).peekable();
    while let Some((at, c)) = characters.next() {
        if c != quote {
            content.push(c);
        } else if characters.next_if(|(_, next)| *next == quote).is_some() {
            content.push(quote);
        } else {
            return Some((at + 1, content));
        }
    }
    None
}
