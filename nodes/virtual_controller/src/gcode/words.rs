//! Letters and numbers of a line.

use crate::codes::ErrorCode;

/// Digits of a number that count; further digits are dropped.
const DIGITS_MAX: usize = 8;

/// Which digits are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Digits {
    /// All of them, leading zeros included: grbl and FluidNC.
    All,
    /// From the first digit that is not zero: grblHAL.
    Significant,
}

/// Reads a number at the start of `text` and returns it with the rest.
///
/// Sign, digits and one point; no exponent. Eight digits count, and the point is moved by
/// multiplications in 32 bits, as the firmware does. Returns `None` when there is no number.
pub(crate) fn read_number(text: &str, which: Digits) -> Option<(f64, &str)> {
    let unsigned = text.strip_prefix(['-', '+']).unwrap_or(text);
    let (mut whole, mut exponent, mut digits, mut seen, mut point) = (0u32, 0i32, 0, 0, false);
    let mut used = 0;
    for byte in unsigned.bytes() {
        match byte {
            b'0'..=b'9' => {
                seen += 1;
                let counts = which == Digits::All || byte != b'0' || whole != 0;
                digits += usize::from(counts);
                if digits <= DIGITS_MAX {
                    whole = whole * 10 + u32::from(byte - b'0');
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
    let value = f64::from(move_point(whole as f32, exponent));
    if !value.is_finite() {
        return None;
    }
    Some((if text.starts_with('-') { -value } else { value }, &unsigned[used..]))
}

/// Moves the decimal point, two places at a time to the left.
fn move_point(mut value: f32, mut exponent: i32) -> f32 {
    if value == 0.0 {
        return value;
    }
    while exponent <= -2 && value > 0.0 {
        value *= 0.01;
        exponent += 2;
    }
    if exponent == -1 {
        value *= 0.1;
    }
    while exponent > 0 && value.is_finite() {
        value *= 10.0;
        exponent -= 1;
    }
    value
}

/// Splits a line without blanks into words; `more_letter` is a letter of this family, too.
pub(super) fn words(
    mut text: &str,
    more_letter: Option<char>,
    digits: Digits,
) -> impl Iterator<Item = Result<(char, f64), ErrorCode>> + '_ {
    std::iter::from_fn(move || {
        let letter = text.chars().next()?;
        if !letter.is_ascii_uppercase() && Some(letter) != more_letter {
            text = "";
            return Some(Err(ErrorCode::ExpectedLetter));
        }
        match read_number(&text[1..], digits) {
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
            ("1.23456789", Some(((12_345_678f32 * 0.01 * 0.01 * 0.01 * 0.1).into(), ""))),
            ("123456789012", Some((123_456_780_000f32.into(), ""))),
            ("-", None),
            (".", None),
        ];
        for (text, expected) in cases {
            assert_eq!(read_number(text, Digits::All), expected, "{text}");
        }
    }

    #[test]
    fn the_point_is_moved_in_32_bits_and_zeros_in_front_may_cost_digits() {
        // The result is not the nearest 32 bit number.
        assert_eq!(read_number("12.7", Digits::All), Some(((127f32 * 0.1).into(), "")));
        assert_eq!(read_number("0000001.25", Digits::All), Some(((12f32 * 0.1).into(), "")));
        assert_eq!(read_number("0000001.25", Digits::Significant), Some((1.25, "")));
    }
}
