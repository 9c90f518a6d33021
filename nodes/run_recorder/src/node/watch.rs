//! Whether a run is under way, from the goals that the action server reports.

use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
use runtime::RosTime;
use std::collections::BTreeSet;

/// Follows the status of `run_program`.
#[derive(Debug, Default)]
pub(super) struct RunWatch {
    /// The goal of the run.
    current: Option<[u8; 16]>,
}

/// A change that matters to the recorder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Edge {
    /// A goal is active, and the one before, if there was one, is not any more.
    Begin { goal: [u8; 16] },
    /// No goal is active any more.
    End,
}

impl RunWatch {
    /// The goal that is active.
    pub(super) fn goal(&self) -> Option<[u8; 16]> {
        self.current
    }

    /// Takes the newest status; says what it changes.
    pub(super) fn update(&mut self, status: &GoalStatusArray) -> Option<Edge> {
        let active: BTreeSet<[u8; 16]> = status
            .status_list
            .iter()
            .filter(|goal| {
                matches!(
                    goal.status,
                    GoalStatus::STATUS_ACCEPTED
                        | GoalStatus::STATUS_EXECUTING
                        | GoalStatus::STATUS_CANCELING
                )
            })
            .map(|goal| goal.goal_info.goal_id.uuid)
            .collect();
        if self.current.is_some_and(|goal| active.contains(&goal)) {
            return None;
        }
        let before = std::mem::replace(&mut self.current, active.first().copied());
        match (before, self.current) {
            (_, Some(goal)) => Some(Edge::Begin { goal }),
            (Some(_), None) => Some(Edge::End),
            (None, None) => None,
        }
    }
}

/// Whether a goal was accepted before a moment.
pub(super) fn is_accepted_before(
    status: &GoalStatusArray,
    goal: [u8; 16],
    moment: RosTime,
) -> bool {
    status.status_list.iter().any(|known| {
        let at = &known.goal_info.stamp;
        known.goal_info.goal_id.uuid == goal && RosTime::from_parts(at.sec, at.nanosec) < moment
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(rows: &[(u8, i8)]) -> GoalStatusArray {
        let mut array = GoalStatusArray::default();
        for &(id, status) in rows {
            let mut goal = GoalStatus { status, ..GoalStatus::default() };
            goal.goal_info.goal_id.uuid = [id; 16];
            array.status_list.push(goal);
        }
        array
    }

    #[test]
    fn a_run_begins_with_its_goal_and_ends_with_its_result() {
        let mut watch = RunWatch::default();
        assert_eq!(watch.update(&status(&[])), None);
        assert_eq!(
            watch.update(&status(&[(1, GoalStatus::STATUS_EXECUTING)])),
            Some(Edge::Begin { goal: [1; 16] })
        );
        assert_eq!(watch.update(&status(&[(1, GoalStatus::STATUS_CANCELING)])), None);
        assert_eq!(watch.update(&status(&[(1, GoalStatus::STATUS_CANCELED)])), Some(Edge::End));
        assert_eq!(
            watch.update(&status(&[
                (1, GoalStatus::STATUS_CANCELED),
                (2, GoalStatus::STATUS_ACCEPTED)
            ])),
            Some(Edge::Begin { goal: [2; 16] })
        );
    }

    #[test]
    fn the_next_goal_is_a_run_of_its_own_in_any_order_of_reports() {
        const ACCEPTED: i8 = GoalStatus::STATUS_ACCEPTED;
        const SUCCEEDED: i8 = GoalStatus::STATUS_SUCCEEDED;
        let begin = |id: u8| Some(Edge::Begin { goal: [id; 16] });
        let mut watch = RunWatch::default();
        assert_eq!(watch.update(&status(&[(5, ACCEPTED)])), begin(5));
        // One ends and the next begins in the same message, in either order of their ids.
        assert_eq!(watch.update(&status(&[(5, SUCCEEDED), (7, ACCEPTED)])), begin(7));
        assert_eq!(watch.update(&status(&[(7, SUCCEEDED), (2, ACCEPTED)])), begin(2));
        // A goal that waits for its turn is not a run yet.
        assert_eq!(watch.update(&status(&[(2, ACCEPTED), (1, ACCEPTED)])), None);
        assert_eq!(watch.update(&status(&[(2, SUCCEEDED), (1, ACCEPTED)])), begin(1));
        assert_eq!(watch.update(&status(&[(1, SUCCEEDED)])), Some(Edge::End));
        assert_eq!(watch.update(&status(&[])), None);
    }

    #[test]
    fn a_goal_that_was_accepted_before_is_found_by_its_stamp() {
        let mut array =
            status(&[(1, GoalStatus::STATUS_SUCCEEDED), (2, GoalStatus::STATUS_EXECUTING)]);
        for (goal, sec) in array.status_list.iter_mut().zip([10, 20]) {
            goal.goal_info.stamp.sec = sec;
        }
        let at = |sec| RosTime::from_parts(sec, 0);
        for (goal, moment, expected) in
            [(2, 19, false), (2, 20, false), (2, 21, true), (1, 19, true), (3, 99, false)]
        {
            assert_eq!(is_accepted_before(&array, [goal; 16], at(moment)), expected, "{goal}");
        }
    }
}
