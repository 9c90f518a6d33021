//! The recorder in `/diagnostics`.

use cnc_msgs::wire::cnc_msgs::msg::Recording;
use runtime::{Health, HealthLevel};

/// The health of the recorder, from the status of its newest bag.
///
/// An incomplete bag is an error until the next run: it cannot prove what happened.
pub(super) fn health(newest: &Recording) -> Health {
    let run = &newest.run_id;
    let (level, message) = match (run.is_empty(), newest.complete, newest.is_recording) {
        (true, ..) => (HealthLevel::Ok, "nothing was recorded yet".to_owned()),
        (_, false, true) => {
            (HealthLevel::Error, format!("the bag of {run} misses something: {}", newest.reason))
        }
        (_, false, false) => {
            (HealthLevel::Error, format!("the bag of {run} is not complete: {}", newest.reason))
        }
        (_, true, true) => (HealthLevel::Ok, format!("recording {run}")),
        (_, true, false) => (HealthLevel::Ok, format!("the bag of {run} is complete")),
    };
    let values = [
        ("bag", newest.uri.clone()),
        ("messages", newest.message_count.to_string()),
        ("bytes", newest.size.to_string()),
        ("messages lost", newest.lost_count.to_string()),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .to_vec();
    Health { component: "bag".into(), level, message, values, ..Health::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bag_that_misses_something_is_an_error() {
        let bag = |run_id: &str, is_recording, complete| Recording {
            run_id: run_id.into(),
            is_recording,
            complete,
            reason: if complete { "" } else { "the disk is full" }.into(),
            ..Recording::default()
        };
        let table = [
            (bag("", false, false), HealthLevel::Ok, "nothing was recorded yet"),
            (bag("run_1", true, true), HealthLevel::Ok, "recording run_1"),
            (bag("run_1", false, true), HealthLevel::Ok, "the bag of run_1 is complete"),
            (
                bag("run_1", true, false),
                HealthLevel::Error,
                "the bag of run_1 misses something: the disk is full",
            ),
            (
                bag("run_1", false, false),
                HealthLevel::Error,
                "the bag of run_1 is not complete: the disk is full",
            ),
        ];
        for (recording, level, message) in table {
            let health = health(&recording);
            assert_eq!((health.level, health.message.as_str()), (level, message));
        }
    }
}
