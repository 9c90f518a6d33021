//! Whether a run is under way, from the goals that the action server reports.

use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
use std::collections::BTreeSet;

/// Follows the status of `run_program`.
#[derive(Debug, Default)]
pub(super) struct RunWatch {
    active: BTreeSet<[u8; 16]>,
}

/// A change that matters to the recorder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Edge {
    /// The first goal was accepted.
    Begin { goal: [u8; 16] },
    /// No goal is active any more.
    End,
}

impl RunWatch {
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
        let before = std::mem::replace(&mut self.active, active);
        match (before.first(), self.active.first()) {
            (None, Some(&goal)) => Some(Edge::Begin { goal }),
            (Some(_), None) => Some(Edge::End),
            _ => None,
        }
    }
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
}
