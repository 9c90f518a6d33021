//! What a run is called.

use runtime::RosTime;

/// `run_20261121_004500_1a2b3c4d`: UTC and the beginning of the goal's id.
pub(super) fn run_id(now: RosTime, goal: [u8; 16]) -> String {
    let (sec, _) = now.parts();
    let (days, second) = (i64::from(sec).div_euclid(86_400), i64::from(sec).rem_euclid(86_400));
    let (year, month, day) = civil_from_days(days);
    format!(
        "run_{year:04}{month:02}{day:02}_{:02}{:02}{:02}_{}",
        second / 3600,
        second / 60 % 60,
        second % 60,
        cnc_msgs::chunk::hex(&goal[..4])
    )
}

/// Year, month and day of a number of days since 1970-01-01.
///
/// Source: the proleptic Gregorian calendar in eras of 400 years that begin on 1 March.
fn civil_from_days(days: i64) -> (i64, i64, i64) {
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    (year_of_era + era * 400 + i64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_named_by_the_second_in_utc() {
        let name = |sec| run_id(RosTime::from_parts(sec, 0), [0xab; 16]);
        assert_eq!(name(0), "run_19700101_000000_abababab");
        assert_eq!(name(951_782_399), "run_20000228_235959_abababab");
        assert_eq!(name(951_782_400), "run_20000229_000000_abababab");
        assert_eq!(name(1_795_222_861), "run_20261121_010101_abababab");
    }
}
