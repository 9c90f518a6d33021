//! Numbers as the controller reads them.
//!
//! All lengths and feeds are whole steps of a grid of 0.0001, so that two numbers
//! that read the same are the same.

/// Steps of the grid in one millimetre: four decimals, finer than any stepper and as
/// much as the firmware's 32 bit floats hold within a metre.
pub(super) const GRID_PER_MM: f64 = 10_000.0;
/// The same as decimals.
pub(super) const GRID_DECIMALS: u32 = 4;

/// The nearest step of the grid. The value has been checked to be within range.
pub(crate) fn to_grid(value: f64) -> i64 {
    // A cast saturates; range checks come before it.
    (value * GRID_PER_MM).round() as i64
}

/// Writes a word in the fewest characters: `X10`, `Y-.5`, `Z0`.
pub(crate) fn write_word(text: &mut String, letter: char, steps: i64) {
    const DECIMALS: u64 = GRID_PER_MM as u64;
    text.push(letter);
    if steps < 0 {
        text.push('-');
    }
    let (whole, fraction) = (steps.unsigned_abs() / DECIMALS, steps.unsigned_abs() % DECIMALS);
    if whole != 0 || fraction == 0 {
        text.push_str(&whole.to_string());
    }
    if fraction != 0 {
        let digits = format!(".{fraction:04}");
        text.push_str(digits.trim_end_matches('0'));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn word(value: f64) -> String {
        let mut text = String::new();
        write_word(&mut text, 'X', to_grid(value));
        text
    }

    #[test]
    fn numbers_are_as_short_as_they_can_be() {
        for (value, wanted) in [
            (0.0, "X0"),
            (-0.0, "X0"),
            (-0.00004, "X0"),
            (0.00005, "X.0001"),
            (10.0, "X10"),
            (0.5, "X.5"),
            (-0.5, "X-.5"),
            (-12.3456, "X-12.3456"),
            (1.25, "X1.25"),
            (100.01, "X100.01"),
            (9999.9999, "X9999.9999"),
            (1e-9, "X0"),
        ] {
            assert_eq!(word(value), wanted);
        }
    }
}
