//! What remains of an answer, or several lines run together.
//!
//! A line end that is lost makes one line of two, and the answer in it would be missed;
//! a line that broke off leaves a piece. Neither may be taken for a text without meaning.

use super::number::parse_count;

/// Where one line ends and another begins, with nothing between.
const BORDERS: [&[u8]; 4] = [b"]ok", b"]error:", b"]ALARM:", b"]<"];

/// Whether what stands in square brackets is more than one line.
pub(super) fn holds_a_line_border(inside: &[u8]) -> bool {
    BORDERS.iter().any(|border| inside.windows(border.len()).any(|bytes| bytes == *border))
}

/// Whether an answer directly follows a value: `500.000ok`, `1error:2`. A word that ends in
/// `ok` is a word.
pub(super) fn ends_in_an_answer(value: &str) -> bool {
    let is_number_and_ok = value
        .strip_suffix("ok")
        .is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.'));
    is_number_and_ok || value.contains("error:") || value.contains("ALARM:")
}

/// Whether the text is what remains of an answer, or several lines run together.
pub(super) fn is_fragment(text: &str) -> bool {
    let is_short_remainder = text.len() <= 3 && text.contains(['o', 'k']);
    let ends_like_an_error = text
        .rsplit_once(':')
        .is_some_and(|(head, code)| parse_count(code).is_some() && "error ALARM".contains(head));
    is_short_remainder
        || text.starts_with("ok")
        || text.ends_with("ok")
        || text.starts_with("err")
        || text.starts_with("ALA")
        || text.contains("error:")
        || text.contains("ALARM:")
        || ends_like_an_error
        || is_almost_an_answer(text)
        || text.starts_with(['<', '['])
        || text.ends_with('>')
        || text.matches('[').count() != text.matches(']').count()
}

/// `ALLARM:1`, `erxor:20`: an answer with a number in which a byte is wrong.
fn is_almost_an_answer(text: &str) -> bool {
    let head = text.trim_end_matches(|c: char| c.is_ascii_digit());
    ["error:", "ALARM:"].into_iter().any(|word| {
        let forwards = head.bytes().zip(word.bytes());
        let same_at_start = forwards.take_while(|(a, b)| a == b).count();
        let backwards = head.bytes().rev().zip(word.bytes().rev());
        let same_at_end = backwards.take_while(|(a, b)| a == b).count();
        let longest = head.len().max(word.len());
        head.len().abs_diff(word.len()) <= 1 && same_at_start + same_at_end + 1 >= longest
    })
}
