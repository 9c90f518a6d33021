//! How the run of a bag ended: the driver's `run_result`, or else the status of the goal and what `machine_state` says.

use super::migration::Definitions;
use cnc_msgs::chunk::hex;
use cnc_msgs::interface::Message;
use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
use cnc_msgs::wire::cnc_msgs::msg::{MachineState, RunResult};
use run_recorder::bag_reader::{Bag, BagMessage, MessageFilter, RUN_RECORD};
use run_recorder::info::RunEnd;
use std::io::{Read, Seek};

/// The status topic of the goals of `run_program`; compared with the end of a topic's name.
pub const STATUS_TOPIC: &str = "run_program/_action/status";
/// The outcome of a goal that was only checked.
pub(crate) const CHECKED: &str = "checked";

/// How the run ended for which the bag was recorded; `None` if it was recorded for none.
pub fn of_bag<R: Read + Seek>(bag: &mut Bag<R>) -> Option<RunEnd> {
    let goal = bag.metadata_named(RUN_RECORD)?.get("goal_id")?.clone();
    let results: Vec<RunResult> = messages(bag, RunResult::TYPE_NAME, "");
    if let Some(result) = last_result(&results, &goal) {
        return Some(of_message(result));
    }
    let has_topic = has_result_topic(bag);
    let statuses: Vec<_> = messages(bag, GoalStatusArray::TYPE_NAME, STATUS_TOPIC);
    let states: Vec<MachineState> = messages(bag, MachineState::TYPE_NAME, "");
    Some(without_result(last_status(&statuses, &goal), states.iter(), has_topic))
}

/// Whether a bag is not older than the topic `run_result`.
pub(crate) fn has_result_topic<R: Read + Seek>(bag: &Bag<R>) -> bool {
    bag.channels().iter().any(|it| it.type_name() == RunResult::TYPE_NAME)
}

/// How a run ended of which the driver has published no result.
///
/// A goal that is only checked has none. A driver that was killed has published none, and ended no goal.
pub(crate) fn without_result<'a>(
    status: Option<i8>,
    states: impl Iterator<Item = &'a MachineState>,
    has_topic: bool,
) -> RunEnd {
    let last = Last::of(states);
    let end = |outcome: &str, message: String, last_line| {
        let outcome = outcome.to_owned();
        RunEnd { outcome, error_code: 0, message, last_line }
    };
    match status {
        Some(GoalStatus::STATUS_SUCCEEDED) if has_topic => {
            end(CHECKED, "nothing was sent to the machine".into(), 0)
        }
        Some(GoalStatus::STATUS_SUCCEEDED) => end("succeeded", String::new(), last.line),
        Some(GoalStatus::STATUS_CANCELED) => end("canceled", String::new(), last.line),
        Some(GoalStatus::STATUS_ABORTED) => end("aborted", last.reason(), last.line),
        _ => {
            let message = format!("the driver has not said how the run ended; {}", last.reason());
            end("unknown", message, last.line)
        }
    }
}

/// What `machine_state` says of the end of a run.
#[derive(Debug, Default)]
struct Last<'a> {
    reason: Option<&'a str>,
    line: u32,
}

impl<'a> Last<'a> {
    /// The first reason since the machine ran on, but for those of a stop or a start that is under way.
    fn of(states: impl Iterator<Item = &'a MachineState>) -> Self {
        const UNDER_WAY: [&str; 3] = ["STOPPING:", "RESETTING:", "CONNECTING:"];
        let mut last = Self::default();
        for state in states {
            let is_run = state.state == MachineState::STATE_RUN;
            match state.reason.as_str() {
                "" if is_run => last = Self { reason: None, line: state.line },
                "" => {}
                text if UNDER_WAY.iter().any(|begins| text.starts_with(begins)) => {}
                text if last.reason.is_none() => {
                    // A driver that was started again does not know the line.
                    let line = if state.line == 0 { last.line } else { state.line };
                    last = Self { reason: Some(text), line };
                }
                _ => {}
            }
        }
        last
    }

    fn reason(&self) -> String {
        self.reason.map_or_else(
            || "machine_state gives no reason".to_owned(),
            |reason| format!("machine_state says {reason}"),
        )
    }
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
fn messages<R: Read + Seek, M: Message>(
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

    fn state(state: u8, reason: &str, line: u32) -> MachineState {
        MachineState { state, reason: reason.into(), line, ..MachineState::default() }
    }

    #[test]
    fn the_driver_s_result_of_the_goal_counts_and_not_that_of_the_run_before() {
        let uuid = |byte| UUID { uuid: [byte; 16] };
        let result = |goal, outcome, error_code, message: &str, last_line| RunResult {
            goal_id: uuid(goal),
            outcome,
            error_code,
            message: message.into(),
            last_line,
            ..RunResult::default()
        };
        let before = result(1, RunResult::OUTCOME_SUCCEEDED, 0, "done", 9);
        let refused = result(2, RunResult::OUTCOME_ABORTED, 309, "error:20 at\nline 5", 4);
        let goal = "02".repeat(16);
        assert_eq!(last_result(std::slice::from_ref(&before), &goal), None);
        let results = [before, refused];
        let end = of_message(last_result(&results, &goal).expect("its result"));
        let text = "aborted (309): error:20 at\\nline 5; the last line that was cut is 4";
        assert_eq!(end.to_string(), text);
        let status = |goal, status| GoalStatusArray {
            status_list: vec![GoalStatus {
                goal_info: GoalInfo { goal_id: uuid(goal), ..GoalInfo::default() },
                status,
            }],
        };
        let statuses = [status(2, 2), status(2, GoalStatus::STATUS_ABORTED), status(1, 4)];
        assert_eq!(last_status(&statuses, &goal), Some(GoalStatus::STATUS_ABORTED));
    }

    #[test]
    fn without_a_result_the_states_say_how_it_ended() {
        const RUN: u8 = MachineState::STATE_RUN;
        const HOLD: u8 = MachineState::STATE_HOLD;
        let states = [
            state(RUN, "", 3),
            state(HOLD, "COMMANDER_LOST: resume to go on", 4),
            state(RUN, "", 5),
            state(RUN, "STOPPING: the port has ended", 8),
            state(MachineState::STATE_UNKNOWN, "LINK_LOST: the port has ended", 8),
            state(MachineState::STATE_UNKNOWN, "LINK_LOST: cannot open it", 8),
        ];
        let (ran, held) = (&states[..1], &states[..2]);
        for (status, states, has_topic, expected) in [
            (4, ran, false, "succeeded; the last line that was cut is 3"),
            (4, ran, true, "checked: nothing was sent to the machine"),
            (5, ran, false, "canceled; the last line that was cut is 3"),
            (
                6,
                &states[..],
                false,
                "aborted: machine_state says LINK_LOST: the port has ended; the last line that was cut is 8",
            ),
            (
                6,
                ran,
                false,
                "aborted: machine_state gives no reason; the last line that was cut is 3",
            ),
            (
                2,
                held,
                true,
                "unknown: the driver has not said how the run ended; machine_state says COMMANDER_LOST: resume to go \
                 on; the last line that was cut is 4",
            ),
        ] {
            let end = without_result(Some(status), states.iter(), has_topic);
            assert_eq!(end.to_string(), expected);
        }
    }
}
