//! The id of a run, which names its bag.

use crate::run_bag::{RunBag, RunBagError, RunBagOptions};
use chrono::DateTime;
use runtime::RosTime;

/// Seconds that are tried, so that the name of a bag is unique.
const SECONDS_TRIED: i32 = 10;

/// `run_20261121_004500_1a2b3c4d`: UTC and the beginning of the goal's id.
pub(super) fn run_id(now: RosTime, goal: [u8; 16]) -> String {
    let (sec, nanosec) = now.parts();
    let date = DateTime::from_timestamp(sec.into(), nanosec).expect("32 bits of seconds");
    format!("run_{}_{}", date.format("%Y%m%d_%H%M%S"), cnc_msgs::chunk::hex(&goal[..4]))
}

/// Makes a bag for a run, with the first name from now on that no bag has.
///
/// A recorder that dies in the second in which it begins leaves a bag of that second. The
/// restarted recorder uses the name of the next second.
pub(super) fn create_bag(
    now: RosTime,
    goal: [u8; 16],
    options: impl Fn(&str) -> RunBagOptions,
) -> Result<(String, RunBag), RunBagError> {
    let (first, _) = now.parts();
    let mut tried = (first..first.saturating_add(SECONDS_TRIED)).map(|sec| {
        let run_id = run_id(RosTime::from_parts(sec, 0), goal);
        RunBag::create(options(&run_id)).map(|bag| (run_id, bag))
    });
    let is_decided = |made: &Result<_, _>| !matches!(made, Err(RunBagError::Exists { .. }));
    let Some(made) = tried.find(is_decided) else {
        let path = options(&run_id(now, goal)).path();
        return Err(RunBagError::Exists { path });
    };
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recorder_in_the_place_of_one_that_died_in_the_same_second_records() {
        let folder = tempfile::tempdir().expect("a folder");
        let now = RosTime::from_parts(951_782_399, 7);
        let create = |goal| create_bag(now, goal, |name| RunBagOptions::new(folder.path(), name));
        let name = |goal| create(goal).map(|(run_id, _)| run_id);
        assert_eq!(name([0xab; 16]).expect("a bag"), "run_20000228_235959_abababab");
        assert_eq!(name([0xab; 16]).expect("a bag"), "run_20000229_000000_abababab");
        assert_eq!(name([0xcd; 16]).expect("a bag"), "run_20000228_235959_cdcdcdcd");
        for _ in 2..SECONDS_TRIED {
            name([0xab; 16]).expect("a bag");
        }
        let error = name([0xab; 16]).expect_err("all ten are taken");
        assert!(error.to_string().contains("run_20000228_235959_abababab is there"), "{error}");
    }

    #[test]
    fn runs_are_named_by_the_second_in_utc() {
        let name = |sec| run_id(RosTime::from_parts(sec, 0), [0xab; 16]);
        assert_eq!(name(0), "run_19700101_000000_abababab");
        assert_eq!(name(951_782_399), "run_20000228_235959_abababab");
        assert_eq!(name(951_782_400), "run_20000229_000000_abababab");
        assert_eq!(name(1_795_222_861), "run_20261121_010101_abababab");
    }
}
