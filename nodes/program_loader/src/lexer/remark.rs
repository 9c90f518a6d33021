//! Comments that do something: `(MSG, text)`, `(DEBUG, x is #<_x>)`, `(LOG, #1)`.
//!
//! Knows how they are written, as LinuxCNC does: the word without blanks inside, then a comma. MSG
//! is shown as it is written; the others have the values of parameters put in.

use crate::expression::{self, Lookup, Trouble};

/// What a comment does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RemarkWord {
    Message,
    /// PRINT: a message with values.
    Values,
    /// DEBUG: the same, where `#5599` is not 0.
    Debug,
    /// LOG: a line for a file.
    Log,
    /// LOGOPEN, LOGAPPEND, LOGCLOSE, PROBEOPEN and PROBECLOSE.
    LogFile,
    /// ABORT: the program ends with an error.
    Abort,
}

/// A comment that does something: its bytes with the parentheses, and where its text begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Remark {
    pub(crate) word: RemarkWord,
    pub(crate) start: usize,
    pub(crate) end: usize,
    pub(crate) text: usize,
}

impl Remark {
    const WORDS: [(&'static str, RemarkWord); 10] = [
        ("MSG,", RemarkWord::Message),
        ("DEBUG,", RemarkWord::Debug),
        ("PRINT,", RemarkWord::Values),
        ("LOG,", RemarkWord::Log),
        ("LOGOPEN,", RemarkWord::LogFile),
        ("LOGAPPEND,", RemarkWord::LogFile),
        ("LOGCLOSE", RemarkWord::LogFile),
        ("PROBEOPEN ", RemarkWord::LogFile),
        ("PROBECLOSE", RemarkWord::LogFile),
        ("ABORT,", RemarkWord::Abort),
    ];

    /// The comment from `start` to `end`, if it does anything.
    pub(crate) fn read(line: &[u8], start: usize, end: usize) -> Option<Self> {
        let at = expression::skip_blanks(line, start + 1);
        let rest = &line[at..end];
        let is = |word: &str| {
            rest.get(..word.len()).is_some_and(|it| it.eq_ignore_ascii_case(word.as_bytes()))
        };
        let &(written, word) = Self::WORDS.iter().find(|(word, _)| is(word))?;
        Some(Self { word, start, end, text: at + written.len() })
    }

    /// Its text as it is written, without the closing parenthesis.
    pub(crate) fn text<'t>(&self, line: &'t [u8]) -> &'t [u8] {
        let text = line.get(self.text..self.end).unwrap_or_default();
        text.strip_suffix(b")").unwrap_or(text)
    }
}

/// A parameter of a text that has no value here.
pub(crate) type Unknown = (String, Trouble);

/// A text with the values of its parameters, and the parameters without one, which are shown as
/// `######`.
pub(crate) fn with_values(text: &[u8], lookup: &dyn Lookup) -> (String, Vec<Unknown>) {
    let mut shown = Vec::with_capacity(text.len());
    let (mut decimals, mut at, mut unknown) = (6, 0, Vec::new());
    while let Some(&byte) = text.get(at) {
        if byte == b'%'
            && let Some((number, length)) = format(&text[at..])
        {
            decimals = number;
            at += length;
        } else if byte == b'#'
            && let Some((name, end)) = parameter(text, at)
        {
            match value(name, lookup) {
                Ok(value) => shown.extend_from_slice(format!("{value:.decimals$}").as_bytes()),
                Err(trouble) => {
                    shown.extend_from_slice(b"######");
                    unknown.push((String::from_utf8_lossy(&text[at..end]).into_owned(), trouble));
                }
            }
            at = end;
        } else {
            shown.push(byte);
            at += 1;
        }
    }
    (String::from_utf8_lossy(&shown).into_owned(), unknown)
}

/// `%d`, `%f` and `%.3f`: the decimals of the values after it, and its length.
fn format(text: &[u8]) -> Option<(usize, usize)> {
    match *text {
        [_, b'd', ..] => Some((0, 2)),
        [_, b'f', ..] => Some((4, 2)),
        [_, b'.', digit @ b'0'..=b'9', b'f', ..] => Some((usize::from(digit - b'0'), 4)),
        _ => None,
    }
}

/// The number or `<name>` after a `#`, and the first byte after it.
fn parameter(text: &[u8], start: usize) -> Option<(&[u8], usize)> {
    let rest = &text[start + 1..];
    let length = match rest.first()? {
        b'<' => memchr::memchr(b'>', rest)? + 1,
        _ => rest.iter().take_while(|byte| byte.is_ascii_digit()).count(),
    };
    (length > 0).then_some((&rest[..length], start + 1 + length))
}

fn value(name: &[u8], lookup: &dyn Lookup) -> Result<f64, Trouble> {
    if name[0] == b'<' {
        let Some((name, _)) = expression::name(name, 0) else { return Err(Trouble::NoName) };
        let undefined = || Err(Trouble::Undefined { name: name.clone().into_owned() });
        return lookup.named(&name).unwrap_or_else(undefined);
    }
    let number = std::str::from_utf8(name).ok().and_then(|digits| digits.parse().ok());
    let no_such = || Err(Trouble::NoSuchNumber { number: number.map_or(f64::NAN, f64::from) });
    number.and_then(|number| lookup.numbered(number)).unwrap_or_else(no_such)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Values;

    impl Lookup for Values {
        fn numbered(&self, number: u32) -> Option<Result<f64, Trouble>> {
            match number {
                1 => Some(Ok(5.123_456)),
                5021 => Some(Err(Trouble::NotHere { what: "elsewhere".to_owned() })),
                _ => None,
            }
        }

        fn named(&self, name: &str) -> Option<Result<f64, Trouble>> {
            (name == "abc").then_some(Ok(2.5))
        }
    }

    #[test]
    fn values_are_put_in_as_linuxcnc_does() {
        for (text, wanted, unknown) in [
            ("x #1, #<A b c>", "x 5.123456, 2.500000", 0),
            ("%d#1 %.2f#1 %f#1", "5 5.12 5.1235", 0),
            // The format holds for all values after it; others are not formats.
            ("%.0f #1 #1 %lf %s %% %", " 5 5 %lf %s %% %", 0),
            ("##1 #[1] # 1 #", "#5.123456 #[1] # 1 #", 0),
            ("#1#1", "5.1234565.123456", 0),
            ("#<nope> #2 #5021 #99999999999", "###### ###### ###### ######", 4),
            ("#<", "#<", 0),
        ] {
            let (shown, missing) = with_values(text.as_bytes(), &Values);
            assert_eq!((shown.as_str(), missing.len()), (wanted, unknown), "{text}");
        }
    }

    #[test]
    fn a_word_and_a_comma_begin_a_comment_that_does_something() {
        for (line, wanted) in [
            ("(MSG, hi)", Some((RemarkWord::Message, " hi"))),
            ("( \tmsg,hi)", Some((RemarkWord::Message, "hi"))),
            ("(debug,)", Some((RemarkWord::Debug, ""))),
            ("(LogClose)", Some((RemarkWord::LogFile, ""))),
            ("(M SG,hi)", None),
            ("(msg , hi)", None),
            ("(DEBUG)", None),
            ("()", None),
        ] {
            let read = Remark::read(line.as_bytes(), 0, line.len());
            let read = read.map(|it| (it.word, std::str::from_utf8(it.text(line.as_bytes()))));
            assert_eq!(read, wanted.map(|(word, text)| (word, Ok(text))), "{line}");
        }
    }
}
