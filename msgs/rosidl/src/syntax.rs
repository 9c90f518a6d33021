//! The lines of an interface definition.
//!
//! Accepts what any writer of bags may have written: names of any case, indented lines, tabs.
//! A reader of its own files can check stricter rules with the fields of [`SourceLine`].

/// One line of a definition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceLine<'a> {
    /// From 1.
    pub number: usize,
    /// The line without the space around it.
    pub text: &'a str,
    /// The part before the comment, with the space around it.
    pub code: &'a str,
    /// The part after the number signs, if there are any. ROS ends a line at the first one,
    /// even inside quotes.
    pub comment: Option<&'a str>,
    /// The field or the constant, if the line is not empty and not only a comment.
    pub item: Option<Result<LineItem<'a>, LineError>>,
}

/// A field or a constant, not yet interpreted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineItem<'a> {
    Field {
        type_text: &'a str,
        name: &'a str,
        /// Empty without a default value.
        default: &'a str,
    },
    /// Not on the wire.
    Constant { type_text: &'a str, name: &'a str, value: &'a str },
}

/// Why a line is neither a field nor a constant.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    #[error("a line is a type, a space and a name")]
    NoName,
    #[error("{0:?} is not a name")]
    Name(String),
}

/// Reads a definition line by line.
pub fn lines(text: &str) -> impl Iterator<Item = SourceLine<'_>> {
    text.lines().enumerate().map(|(index, line)| {
        let (code, comment) = match line.split_once('#') {
            Some((code, comment)) => (code, Some(comment.trim_start_matches('#').trim_end())),
            None => (line, None),
        };
        let item = match code.trim() {
            "" => None,
            code => Some(item(code)),
        };
        SourceLine { number: index + 1, text: line.trim(), code, comment, item }
    })
}

fn item(code: &str) -> Result<LineItem<'_>, LineError> {
    let (type_text, rest) = code.split_once(char::is_whitespace).ok_or(LineError::NoName)?;
    let rest = rest.trim_start();
    let name_end = rest.find(|c: char| c == '=' || c.is_whitespace()).unwrap_or(rest.len());
    let (name, after) = rest.split_at(name_end);
    if !is_name(name) {
        return Err(LineError::Name(name.to_owned()));
    }
    let after = after.trim_start();
    Ok(match after.strip_prefix('=') {
        Some(value) => LineItem::Constant { type_text, name, value: value.trim_start() },
        None => LineItem::Field { type_text, name, default: after },
    })
}

fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
}
