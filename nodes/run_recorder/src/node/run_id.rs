//! What a run is called.

use chrono::DateTime;
use runtime::RosTime;

/// `run_20261121_004500_1a2b3c4d`: UTC and the beginning of the goal's id.
pub(super) fn run_id(now: RosTime, goal: [u8; 16]) -> String {
    let (sec, nanosec) = now.parts();
    let date = DateTime::from_timestamp(sec.into(), nanosec).expect("32 bits of seconds");
    format!("run_{}_{}", date.format("%Y%m%d_%H%M%S"), cnc_msgs::chunk::hex(&goal[..4]))
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
