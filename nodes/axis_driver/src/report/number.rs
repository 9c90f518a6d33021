//! Numbers as firmware prints them; anything else is rejected.

use super::ReportUnits;
use cnc_msgs::geometry::Position;

/// A number of digits alone that fits.
pub(super) fn parse_count(text: &str) -> Option<u16> {
    (text.bytes().all(|byte| byte.is_ascii_digit())).then(|| text.parse().ok())?
}

/// The number of an answer: no zero stands before it, so that a byte that came twice
/// is not read over.
pub(super) fn parse_code(text: &str) -> Option<u16> {
    parse_count(text).filter(|_| text == "0" || !text.starts_with('0'))
}

/// A decimal number: no exponent, no plus sign.
pub(super) fn parse_number(text: &str) -> Option<f64> {
    let digits = text.strip_prefix('-').unwrap_or(text);
    let is_plain = digits.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    (is_plain && (1..=20).contains(&digits.len())).then(|| text.parse().ok())?
}

/// The first three of three to eight axes, in millimetres.
pub(super) fn parse_position(text: &str, units: ReportUnits) -> Option<Position> {
    let mut position = [0.0; 3];
    let mut count = 0;
    for field in text.split(',') {
        let value = parse_number(field)?;
        if let Some(slot) = position.get_mut(count) {
            *slot = value * units.millimetres();
        }
        count += 1;
    }
    (3..=8).contains(&count).then_some(position)
}

/// The values after the first three, as they are printed; a sound position is parsed before.
pub(super) fn parse_further(text: &str) -> Vec<f64> {
    text.split(',').skip(3).filter_map(parse_number).collect()
}

/// 1 to 6 for G54 to G59, 7 to 9 for G59.1 to G59.3.
pub(super) fn parse_work_system(word: &str) -> Option<u8> {
    const SYSTEMS: [&str; 9] =
        ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
    (1..).zip(SYSTEMS).find_map(|(number, name)| (name == word).then_some(number))
}
