//! How lengths are written in messages.

/// Decimals of a length in mm: a thousandth, as programs have it.
const DECIMALS: usize = 3;
/// Lengths that are equal to this many decimals count as the same.
const DECIMALS_MAX: usize = 9;

/// Two lengths, mm, with as many decimals as distinguish them.
pub fn with_enough_digits(a_mm: f64, b_mm: f64) -> [String; 2] {
    let written = |decimals: usize| [format!("{a_mm:.decimals$}"), format!("{b_mm:.decimals$}")];
    let differs = |[a, b]: &[String; 2]| a != b;
    (DECIMALS..=DECIMALS_MAX).map(written).find(differs).unwrap_or_else(|| written(DECIMALS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_lengths_have_the_digits_that_distinguish_them() {
        for (a, b, expected) in [
            (5.0, 4.828, ["5.000", "4.828"]),
            (8.6603, 8.660_254, ["8.66030", "8.66025"]),
            (0.597_04, 0.597_01, ["0.59704", "0.59701"]),
            (5.0, 5.0, ["5.000", "5.000"]),
            (5.0, 5.0 + 1e-12, ["5.000", "5.000"]),
            (-3.0, 3.0, ["-3.000", "3.000"]),
        ] {
            assert_eq!(with_enough_digits(a, b), expected);
        }
    }
}
