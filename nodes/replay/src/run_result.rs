//! How the run of a bag ended: the driver's `run_result`, or the status of the goal in older bags.

use super::migration::Definitions;
use cnc_msgs::chunk::hex;
use cnc_msgs::interface::Message;
use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
use cnc_msgs::wire::cnc_msgs::msg::RunResult;
use run_recorder::bag_reader::{Bag, BagMessage, MessageFilter, RUN_RECORD};
use run_recorder::info::RunEnd;
use serde::de::DeserializeOwned;
use std::io::{Read, Seek};

/// The status topic of the goals of `run_program`; compared with the end of a topic's name.
pub const STATUS_TOPIC: &str = "run_program/_action/status";
/// Bags from before the topic `run_result` have no reason.
const NO_REASON: &str = "the reason is not in the bag, which is older than the topic run_result";

/// How the run ended for which the bag was recorded; `None` if the bag does not say.
pub fn of_bag<R: Read + Seek>(bag: &mut Bag<R>) -> Option<RunEnd> {
    let goal = bag.metadata_named(RUN_RECORD)?.get("goal_id")?.clone();
    let results = messages(bag, RunResult::TYPE_NAME, "");
    let statuses = messages(bag, GoalStatusArray::TYPE_NAME, STATUS_TOPIC);
    of_goal(&goal, &results, &statuses)
}

/// How the run of a goal ended.
pub fn of_goal(goal: &str, results: &[RunResult], statuses: &[GoalStatusArray]) -> Option<RunEnd> {
    if let Some(result) = last_result(results, goal) {
        return Some(of_message(result));
    }
    let (outcome, message) = match last_status(statuses, goal)? {
        GoalStatus::STATUS_SUCCEEDED => ("succeeded", ""),
        GoalStatus::STATUS_CANCELED => ("canceled", NO_REASON),
        GoalStatus::STATUS_ABORTED => ("aborted", NO_REASON),
        _ => return None,
    };
    Some(RunEnd { outcome: outcome.into(), error_code: 0, message: message.into(), last_line: 0 })
}

/// How a run ended, according to the driver.
pub fn of_message(result: &RunResult) -> RunEnd {
    let outcome = match result.outcome {
        RunResult::OUTCOME_SUCCEEDED => "succeeded",
        RunResult::OUTCOME_CANCELED => "canceled",
        RunResult::OUTCOME_ABORTED => "aborted",
        _ => "unknown",
    };
    RunEnd {
        outcome: outcome.into(),
        error_code: result.error_code,
        message: result.message.clone(),
        last_line: result.last_line,
    }
}

/// The driver's result for a goal. A latched result may be of the run before.
pub fn last_result<'a>(results: &'a [RunResult], goal: &str) -> Option<&'a RunResult> {
    results.iter().rfind(|result| hex(&result.goal_id.uuid) == goal)
}

/// The last status of a goal.
pub fn last_status(statuses: &[GoalStatusArray], goal: &str) -> Option<i8> {
    let rows = statuses.iter().flat_map(|array| &array.status_list);
    let of_goal = rows.filter(|row| hex(&row.goal_info.goal_id.uuid) == goal);
    of_goal.map(|row| row.status).next_back()
}

/// The messages of one topic; unreadable ones are skipped.
fn messages<R: Read + Seek, M: Message + DeserializeOwned>(
    bag: &mut Bag<R>,
    type_name: &str,
    topic_end: &str,
) -> Vec<M> {
    let channels = bag.channels().iter();
    let of_type =
        channels.filter(|it| it.type_name() == type_name && it.topic.ends_with(topic_end));
    let topics = of_type.map(|it| it.topic.clone()).collect();
    let filter = MessageFilter { topics: Some(topics), ..MessageFilter::default() };
    let mut definitions = Definitions::default();
    let read = bag.messages_where(filter).flatten();
    read.filter_map(|message: BagMessage| definitions.decode(&message, 0).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::wire::action_msgs::msg::GoalInfo;
    use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;

    #[test]
    fn the_driver_s_result_counts_or_else_the_status_of_the_goal() {
        let uuid = |byte| UUID { uuid: [byte; 16] };
        let result = |goal, outcome, error_code, message: &str, last_line| RunResult {
            goal_id: uuid(goal),
            outcome,
            error_code,
            message: message.into(),
            last_line,
            ..RunResult::default()
        };
        let status = |goal, status| GoalStatusArray {
            status_list: vec![GoalStatus {
                goal_info: GoalInfo { goal_id: uuid(goal), ..GoalInfo::default() },
                status,
            }],
        };
        let before = result(1, RunResult::OUTCOME_SUCCEEDED, 0, "done", 9);
        let refused = result(2, RunResult::OUTCOME_ABORTED, 309, "error:20 at\nline 5", 4);
        let aborted = [status(1, 4), status(2, 2), status(2, GoalStatus::STATUS_ABORTED)];
        for (results, statuses, expected) in [
            (
                vec![before.clone(), refused],
                &aborted[..],
                "aborted (309): error:20 at\\nline 5; the last line that was cut is 4",
            ),
            // A latched result of the run before does not count for this one.
            (
                vec![before],
                &aborted,
                "aborted: the reason is not in the bag, which is older than the topic run_result",
            ),
            (vec![], &[status(2, GoalStatus::STATUS_SUCCEEDED)], "succeeded"),
            (vec![], &[status(2, GoalStatus::STATUS_EXECUTING)], "nothing"),
        ] {
            let end = of_goal(&"02".repeat(16), &results, statuses);
            let text = end.map_or("nothing".to_owned(), |end| end.to_string());
            assert_eq!(text, expected);
        }
    }
}
