//! The numbers of RS-274: a sign, digits, a point; no exponent.
//!
//! Knows where a number ends and how it rounds, not what it is for. Results equal those of
//! `str::parse::<f64>`, bit for bit.

/// A number that was read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Number {
    /// Always finite.
    pub(crate) value: f64,
    /// The first byte after the last digit.
    pub(crate) end: usize,
    /// Whether there were blanks between its digits.
    pub(crate) is_split: bool,
}

/// Why there is no number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NotANumber {
    pub(crate) what: NumberError,
    /// The first byte after the text that was meant as a number.
    pub(crate) end: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NumberError {
    /// Nothing that could be a number begins here.
    Missing,
    /// A sign or a point without digits, or too many of them.
    Malformed,
    /// `1e5`.
    Exponent,
    /// More than a double can hold.
    TooLarge,
}

const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Reads digits with at most one point: the value, the byte after them, and what follows (0 at the
/// end). `None` if there are none, or too many to be exact.
///
/// Eighteen digits fit u64. A mantissa below 2^53 and a power of ten up to 10^22 are exact
/// doubles, so that one division rounds correctly.
#[inline(always)]
fn read_digits(text: &[u8], first: usize) -> Option<(f64, usize, u8)> {
    let mut mantissa: u64 = 0;
    let mut digits = 0;
    let mut places = 0;
    let mut following = 0;
    for &next in &text[first..] {
        let digit = next.wrapping_sub(b'0');
        if digit >= 10 {
            following = next;
            break;
        }
        mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
        digits += 1;
    }
    let mut at = first + digits;
    if following == b'.' {
        at += 1;
        following = 0;
        for &next in &text[at..] {
            let digit = next.wrapping_sub(b'0');
            if digit >= 10 {
                following = next;
                break;
            }
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            places += 1;
        }
        at += places;
        digits += places;
    }
    if digits == 0 || digits > 18 || mantissa >= 1 << 53 {
        return None;
    }
    Some((mantissa as f64 / POWERS[places], at, following))
}

/// Reads a number of few digits without anything unusual after it; `None` for all others.
#[inline]
pub(crate) fn read_simple(text: &[u8], start: usize) -> Option<(f64, usize)> {
    let sign = *text.get(start)?;
    let is_negative = sign == b'-';
    let first = start + usize::from(is_negative || sign == b'+');
    let (magnitude, at, following) = read_digits(text, first)?;
    match following {
        b'.' | b'+' | b'-' | b'e' | b'E' | b'[' | b'=' | b'#' => return None,
        b' ' | b'\t' => {
            let (_, visible) = next_visible(text, at);
            if matches!(visible, Some(b'0'..=b'9' | b'.' | b'+' | b'-')) {
                return None;
            }
        }
        _ => {}
    }
    Some((if is_negative { -magnitude } else { magnitude }, at))
}

/// Reads digits and a point, as they stand in expressions: a sign is an operator there. Blanks
/// between them are skipped.
pub(crate) fn read_unsigned(text: &[u8], start: usize) -> Result<(f64, usize), NotANumber> {
    if matches!(text.get(start), Some(b'0'..=b'9' | b'.'))
        && let Some((value, end, following)) = read_digits(text, start)
    {
        let is_whole = match following {
            b'.' => false,
            b'e' | b'E' => digit_at(text, end + 1).is_none(),
            b' ' | b'\t' => !matches!(next_visible(text, end).1, Some(b'0'..=b'9' | b'.')),
            _ => true,
        };
        if is_whole {
            return Ok((value, end));
        }
    }
    let (mut plain, mut end, mut at) = (String::new(), start, start);
    while let Some(&byte) = text.get(at) {
        match byte {
            b'0'..=b'9' | b'.' => {
                plain.push(char::from(byte));
                end = at + 1;
            }
            b' ' | b'\t' => {}
            b'e' | b'E' if digit_at(text, at + 1).is_some() => {
                let digits = text[at + 1..].iter().take_while(|byte| byte.is_ascii_digit()).count();
                return Err(NotANumber { what: NumberError::Exponent, end: at + 1 + digits });
            }
            _ => break,
        }
        at += 1;
    }
    match plain.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok((value, end)),
        Ok(_) => Err(NotANumber { what: NumberError::TooLarge, end }),
        Err(_) => Err(NotANumber { what: NumberError::Malformed, end }),
    }
}

/// Reads the number that begins at `start`.
///
/// With `joins_blanks`, blanks between its characters are skipped, as in RS-274 (`1 234.5` is
/// 1234.5).
pub(crate) fn read(text: &[u8], start: usize, joins_blanks: bool) -> Result<Number, NotANumber> {
    if let Some((value, end)) = read_simple(text, start) {
        return Ok(Number { value, end, is_split: false });
    }
    read_slowly(text, start, joins_blanks)
}

fn read_slowly(text: &[u8], start: usize, joins_blanks: bool) -> Result<Number, NotANumber> {
    let mut plain = String::new();
    let (mut at, mut end, mut is_split) = (start, start, false);
    loop {
        match text.get(at) {
            Some(&byte) if is_numeric(Some(&byte)) => {
                is_split |= end != at && plain.bytes().any(|earlier| earlier.is_ascii_digit());
                plain.push(char::from(byte));
                at += 1;
                end = at;
            }
            Some(b' ' | b'\t') if joins_blanks && is_numeric(next_visible(text, at).1) => {
                at = next_visible(text, at).0;
            }
            _ => break,
        }
    }
    let has_digits = plain.bytes().any(|byte| byte.is_ascii_digit());
    if plain.is_empty() {
        return Err(NotANumber { what: NumberError::Missing, end });
    }
    if has_digits && matches!(text.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(text.get(end + 1), Some(b'+' | b'-')));
        if digit_at(text, end + 1 + sign).is_some() {
            let mut next = end + 1 + sign;
            while is_numeric(text.get(next)) {
                next += 1;
            }
            return Err(NotANumber { what: NumberError::Exponent, end: next });
        }
    }
    match plain.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(Number { value, end, is_split }),
        Ok(_) => Err(NotANumber { what: NumberError::TooLarge, end }),
        Err(_) => Err(NotANumber { what: NumberError::Malformed, end }),
    }
}

#[inline]
fn digit_at(text: &[u8], at: usize) -> Option<u64> {
    let digit = text.get(at)?.wrapping_sub(b'0');
    (digit < 10).then_some(u64::from(digit))
}

fn is_numeric(byte: Option<&u8>) -> bool {
    matches!(byte, Some(b'0'..=b'9' | b'.' | b'+' | b'-'))
}

/// The next byte from `at` on that is not a blank, and its index.
#[inline]
fn next_visible(text: &[u8], mut at: usize) -> (usize, Option<&u8>) {
    while matches!(text.get(at), Some(b' ' | b'\t')) {
        at += 1;
    }
    (at, text.get(at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[track_caller]
    fn check(text: &str, expected: Result<(f64, usize), (NumberError, usize)>) {
        let read = read(text.as_bytes(), 0, true);
        let seen = read.map(|number| (number.value, number.end)).map_err(|no| (no.what, no.end));
        assert_eq!(seen, expected, "{text:?}");
    }

    #[test]
    fn a_number_may_have_signs_points_blanks_and_leading_zeros() {
        for (text, value, end) in [
            ("1", 1.0, 1),
            ("-.5Y", -0.5, 3),
            ("+007.", 7.0, 5),
            ("0.1X2", 0.1, 3),
            ("+ 0. 12 34 y7", 0.1234, 10),
            ("9007199254740993", 9_007_199_254_740_993_f64, 16),
            ("123456789012345678901", 123_456_789_012_345_678_901_f64, 21),
            ("1 Y", 1.0, 1),
        ] {
            check(text, Ok((value, end)));
        }
    }

    #[test]
    fn text_that_is_not_a_number_has_a_reason_and_an_end() {
        for (text, what, end) in [
            ("", NumberError::Missing, 0),
            ("nan", NumberError::Missing, 0),
            ("--5", NumberError::Malformed, 3),
            (".", NumberError::Malformed, 1),
            ("-", NumberError::Malformed, 1),
            ("1.2.3", NumberError::Malformed, 5),
            ("5-3", NumberError::Malformed, 3),
            ("1e5", NumberError::Exponent, 3),
            ("1E+400Y", NumberError::Exponent, 6),
        ] {
            check(text, Err((what, end)));
        }
        check(&"9".repeat(400), Err((NumberError::TooLarge, 400)));
    }

    #[test]
    fn only_separated_digits_count_as_split() {
        assert!(read(b"10 20", 0, true).is_ok_and(|number| number.is_split));
        assert!(read(b"- 20", 0, true).is_ok_and(|number| !number.is_split));
        assert!(read(b"10 20", 0, false).is_ok_and(|number| number.end == 2));
    }

    proptest! {
        #[test]
        fn numbers_round_as_the_standard_library_rounds(text in "[+-]?([0-9]{1,25}(\\.[0-9]{0,25})?|\\.[0-9]{1,25})") {
            let expected: f64 = text.parse().expect("a decimal number");
            let number = read(text.as_bytes(), 0, false).expect("a decimal number");
            prop_assert_eq!(number.value.to_bits(), expected.to_bits());
            prop_assert_eq!(number.end, text.len());
        }

        #[test]
        fn anything_at_all_is_read_or_refused_within_the_text(text in "[-+.0-9eE \t]{0,40}") {
            let end = match read(text.as_bytes(), 0, true) {
                Ok(number) => number.end,
                Err(no) => no.end,
            };
            prop_assert!(end <= text.len());
        }
    }
}
