//! Letters and numbers of a line.

use crate::codes::ErrorCode;

/// Digits of a number that count; more are cut off.
const DIGITS_MAX: usize = 8;

/// Reads a number at the start of `text` and returns it with the rest.
///
/// Sign, digits and one point; no exponent. Eight digits count and the value
/// has the precision of a 32-bit float, as in the firmware; one beyond it is none.
pub(crate) fn read_number(text: &str) -> Option<(f64, &str)> {
    let unsigned = text.strip_prefix(['-', '+']).unwrap_or(text);
    let (mut value, mut exponent, mut digits, mut seen, mut point) = (0.0f64, 0i32, 0, 0, false);
    let mut used = 0;
    for byte in unsigned.bytes() {
        match byte {
            b'0'..=b'9' => {
                seen += 1;
                if digits < DIGITS_MAX {
                    digits += usize::from(digits > 0 || byte != b'0');
                    value = value * 10.0 + f64::from(byte - b'0');
                    exponent -= i32::from(point);
                } else {
                    exponent += i32::from(!point);
                }
            }
            b'.' if !point => point = true,
            _ => break,
        }
        used += 1;
    }
    if seen == 0 {
        return None;
    }
    let value = f64::from((value * 10f64.powi(exponent)) as f32);
    if !value.is_finite() {
        return None;
    }
    Some((if text.starts_with('-') { -value } else { value }, &unsigned[used..]))
}

/// Splits a line without blanks into words; `more_letter` may begin one, too.
pub(super) fn words(
    mut text: &str,
    more_letter: Option<char>,
) -> impl Iterator<Item = Result<(char, f64), ErrorCode>> + '_ {
    std::iter::from_fn(move || {
        let letter = text.chars().next()?;
        if !letter.is_ascii_uppercase() && Some(letter) != more_letter {
            text = "";
            return Some(Err(ErrorCode::ExpectedLetter));
        }
        match read_number(&text[1..]) {
            Some((value, rest)) => {
                text = rest;
                Some(Ok((letter, value)))
            }
            None => {
                text = "";
                Some(Err(ErrorCode::BadNumber))
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_sign_a_point_and_no_exponent() {
        let cases: [(&str, Option<(f64, &str)>); 8] = [
            ("-.5X1", Some((-0.5, "X1"))),
            ("+12.", Some((12.0, ""))),
            ("1E3", Some((1.0, "E3"))),
            ("1.2.3", Some((1.2f32.into(), ".3"))),
            ("1.23456789", Some((1.234_567_8_f32.into(), ""))),
            ("123456789012", Some((123_456_780_000f64 as f32 as f64, ""))),
            ("-", None),
            (".", None),
        ];
        for (text, expected) in cases {
            assert_eq!(read_number(text), expected, "{text}");
        }
    }
}
