//! The goals of one action server, and what to answer about them.
//!
//! Pure: requests and steady time in, answers out. Whether a goal is accepted
//! is the node's decision, not this table's.

use super::GoalId;
use crate::process::time::RosTime;
use cnc_msgs::cdr::{self, Cdr};
use cnc_msgs::wire::action_msgs::msg::{GoalInfo, GoalStatus};
use cnc_msgs::wire::action_msgs::srv::CancelGoalResponse;
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;
use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;
use std::collections::BTreeMap;
use std::time::Duration;

/// How long a result can be asked for after the end, as in rcl.
const KEEP_RESULT: Duration = Duration::from_secs(15 * 60);
/// How long a rejection is remembered: longer than any client retries.
const KEEP_REFUSAL: Duration = Duration::from_secs(60);
/// Ended goals, and refused ones, that are kept at most; the status message grows by each that
/// has ended.
const ENDED_MAX: usize = 256;

/// How a goal ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GoalOutcome {
    Succeeded,
    Canceled,
    Aborted,
}

impl GoalOutcome {
    /// The value in `action_msgs/GoalStatus`.
    pub fn status(self) -> i8 {
        match self {
            Self::Succeeded => GoalStatus::STATUS_SUCCEEDED,
            Self::Canceled => GoalStatus::STATUS_CANCELED,
            Self::Aborted => GoalStatus::STATUS_ABORTED,
        }
    }

    /// Of the value in `action_msgs/GoalStatus`; `None` for goals that have not
    /// ended or are not known.
    pub fn from_status(status: i8) -> Option<Self> {
        match status {
            GoalStatus::STATUS_SUCCEEDED => Some(Self::Succeeded),
            GoalStatus::STATUS_CANCELED => Some(Self::Canceled),
            GoalStatus::STATUS_ABORTED => Some(Self::Aborted),
            _ => None,
        }
    }
}

/// All goals by id.
#[derive(Debug)]
pub(super) struct Goals<R> {
    goals: BTreeMap<GoalId, GoalState<R>>,
}

#[derive(Debug)]
enum GoalState<R> {
    /// The node has not decided yet; it will not run if a client cancels it meanwhile.
    Offered {
        is_canceling: bool,
    },
    /// It was rejected at this time; a repeated request gets the same answer.
    Rejected {
        at: Duration,
    },
    Active {
        accepted: RosTime,
        is_canceling: bool,
    },
    Ended {
        accepted: RosTime,
        outcome: GoalOutcome,
        result: R,
        at: Duration,
    },
}

/// A goal as it is kept.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct GoalRecord {
    id: [u8; 16],
    state: RecordState,
}

#[derive(Debug, Serialize, Deserialize)]
enum RecordState {
    Offered { is_canceling: bool },
    Rejected,
    Active { accepted_ns: i64, is_canceling: bool },
    Ended { accepted_ns: i64, status: i8, result: ByteBuf },
}

/// The answer to a goal request.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Offer {
    /// Ask the node.
    New,
    /// The node is being asked already: wait for its decision.
    Undecided,
    /// The same request arrived before and was accepted; it is not started twice.
    Accepted(RosTime),
    /// The same request arrived before and was rejected; its client may know already.
    Rejected,
}

/// The answer to a result request.
#[derive(Debug, PartialEq)]
pub(super) enum Answer<R> {
    NotYet,
    Unknown,
    Ended(GoalOutcome, R),
}

impl<R: Clone> Goals<R> {
    pub(super) fn new() -> Self {
        Self { goals: BTreeMap::new() }
    }

    /// A request to do something.
    pub(super) fn offer(&mut self, id: GoalId) -> Offer {
        match self.goals.get(&id) {
            None => {
                self.goals.insert(id, GoalState::Offered { is_canceling: false });
                Offer::New
            }
            Some(GoalState::Offered { .. }) => Offer::Undecided,
            Some(GoalState::Rejected { .. }) => Offer::Rejected,
            Some(GoalState::Active { accepted, .. } | GoalState::Ended { accepted, .. }) => {
                Offer::Accepted(*accepted)
            }
        }
    }

    pub(super) fn accept(&mut self, id: GoalId, accepted: RosTime) {
        self.goals.insert(id, GoalState::Active { accepted, is_canceling: false });
    }

    pub(super) fn reject(&mut self, id: GoalId, now: Duration) {
        self.goals.insert(id, GoalState::Rejected { at: now });
        self.forget(now);
    }

    /// When the goal was accepted; `None` while it is not.
    pub(super) fn accepted(&self, id: GoalId) -> Option<RosTime> {
        match self.goals.get(&id)? {
            GoalState::Offered { .. } | GoalState::Rejected { .. } => None,
            GoalState::Active { accepted, .. } | GoalState::Ended { accepted, .. } => {
                Some(*accepted)
            }
        }
    }

    /// Whether the node still has to decide on the goal.
    pub(super) fn is_undecided(&self, id: GoalId) -> bool {
        matches!(self.goals.get(&id), Some(GoalState::Offered { .. }))
    }

    /// Whether the goal has neither ended nor been refused.
    pub(super) fn is_unfinished(&self, id: GoalId) -> bool {
        matches!(self.goals.get(&id), Some(GoalState::Offered { .. } | GoalState::Active { .. }))
    }

    /// Whether the goal was canceled, running or not yet accepted.
    pub(super) fn is_canceling(&self, id: GoalId) -> bool {
        matches!(
            self.goals.get(&id),
            Some(
                GoalState::Active { is_canceling: true, .. }
                    | GoalState::Offered { is_canceling: true }
            )
        )
    }

    /// Ends a goal; one that has ended keeps its first end.
    pub(super) fn end(&mut self, id: GoalId, outcome: GoalOutcome, result: R, now: Duration) {
        if let Some(state) = self.goals.get_mut(&id)
            && let GoalState::Active { accepted, .. } = *state
        {
            *state = GoalState::Ended { accepted, outcome, result, at: now };
        }
        self.forget(now);
    }

    pub(super) fn answer(&self, id: GoalId) -> Answer<R> {
        match self.goals.get(&id) {
            None | Some(GoalState::Rejected { .. }) => Answer::Unknown,
            Some(GoalState::Offered { .. } | GoalState::Active { .. }) => Answer::NotYet,
            Some(GoalState::Ended { outcome, result, .. }) => {
                Answer::Ended(*outcome, result.clone())
            }
        }
    }

    /// Cancels by the rules of `action_msgs/CancelGoal`: the goal with the id,
    /// and all accepted at the stamp or before; no id and no stamp: all. A goal that
    /// is still being decided on is among them, whatever the stamp: it arrived before.
    pub(super) fn cancel(&mut self, request: &GoalInfo) -> CancelGoalResponse {
        let id = GoalId(request.goal_id.uuid);
        let stamp = RosTime::from_parts(request.stamp.sec, request.stamp.nanosec);
        let (has_id, has_stamp) = (id != GoalId::default(), stamp != RosTime::ZERO);
        let mut goals_canceling = Vec::new();
        for (goal, state) in &mut self.goals {
            let (accepted, is_canceling) = match state {
                GoalState::Active { accepted, is_canceling } => (*accepted, is_canceling),
                GoalState::Offered { is_canceling } => (RosTime::ZERO, is_canceling),
                GoalState::Ended { .. } | GoalState::Rejected { .. } => continue,
            };
            let is_meant = match (has_id, has_stamp) {
                (false, false) => true,
                (true, false) => *goal == id,
                (false, true) => accepted <= stamp,
                (true, true) => *goal == id || accepted <= stamp,
            };
            if is_meant {
                *is_canceling = true;
                goals_canceling.push(goal_info(*goal, accepted));
            }
        }
        let return_code = match self.goals.get(&id) {
            _ if !goals_canceling.is_empty() => CancelGoalResponse::ERROR_NONE,
            Some(GoalState::Ended { .. }) => CancelGoalResponse::ERROR_GOAL_TERMINATED,
            Some(GoalState::Rejected { .. }) => CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID,
            Some(_) => CancelGoalResponse::ERROR_REJECTED,
            None if has_id => CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID,
            // "All" of no goals is no error.
            None => CancelGoalResponse::ERROR_NONE,
        };
        CancelGoalResponse { return_code, goals_canceling }
    }

    /// The content of the status topic.
    pub(super) fn statuses(&self) -> Vec<GoalStatus> {
        let entry = |(id, state): (&GoalId, &GoalState<R>)| {
            let (accepted, status) = match state {
                GoalState::Offered { .. } | GoalState::Rejected { .. } => return None,
                GoalState::Active { accepted, is_canceling: false } => {
                    (accepted, GoalStatus::STATUS_EXECUTING)
                }
                GoalState::Active { accepted, is_canceling: true } => {
                    (accepted, GoalStatus::STATUS_CANCELING)
                }
                GoalState::Ended { accepted, outcome, .. } => (accepted, outcome.status()),
            };
            Some(GoalStatus { goal_info: goal_info(*id, *accepted), status })
        };
        self.goals.iter().filter_map(entry).collect()
    }

    /// All goals, to be kept; how old an end or a refusal is, is not.
    pub(super) fn records(&self) -> Vec<GoalRecord>
    where
        R: Cdr,
    {
        let record = |(id, state): (&GoalId, &GoalState<R>)| {
            let state = match state {
                GoalState::Offered { is_canceling } => {
                    RecordState::Offered { is_canceling: *is_canceling }
                }
                GoalState::Rejected { .. } => RecordState::Rejected,
                GoalState::Active { accepted, is_canceling } => RecordState::Active {
                    accepted_ns: accepted.as_nanos(),
                    is_canceling: *is_canceling,
                },
                GoalState::Ended { accepted, outcome, result, .. } => RecordState::Ended {
                    accepted_ns: accepted.as_nanos(),
                    status: outcome.status(),
                    result: cdr::body(result).into(),
                },
            };
            GoalRecord { id: id.0, state }
        };
        self.goals.iter().map(record).collect()
    }

    /// A table from records; `None` when one is not understood. Ends and refusals are of now.
    pub(super) fn from_records(records: Vec<GoalRecord>) -> Option<Self>
    where
        R: Cdr,
    {
        let (mut goals, at) = (BTreeMap::new(), Duration::ZERO);
        for GoalRecord { id, state } in records {
            let state = match state {
                RecordState::Offered { is_canceling } => GoalState::Offered { is_canceling },
                RecordState::Rejected => GoalState::Rejected { at },
                RecordState::Active { accepted_ns, is_canceling } => {
                    GoalState::Active { accepted: RosTime::from_nanos(accepted_ns), is_canceling }
                }
                RecordState::Ended { accepted_ns, status, result } => GoalState::Ended {
                    accepted: RosTime::from_nanos(accepted_ns),
                    outcome: GoalOutcome::from_status(status)?,
                    result: cdr::from_body(&result).ok()?,
                    at,
                },
            };
            goals.insert(GoalId(id), state);
        }
        Some(Self { goals })
    }

    /// Drops results that are older than [`KEEP_RESULT`] or too many, and refusals.
    fn forget(&mut self, now: Duration) {
        let (mut ended, mut rejected) = (Vec::new(), Vec::new());
        for (id, state) in &self.goals {
            match state {
                GoalState::Ended { at, .. } => ended.push((*at, *id)),
                GoalState::Rejected { at } => rejected.push((*at, *id)),
                GoalState::Offered { .. } | GoalState::Active { .. } => {}
            }
        }
        for (mut over, keep) in [(ended, KEEP_RESULT), (rejected, KEEP_REFUSAL)] {
            over.sort_unstable();
            let excess = over.len().saturating_sub(ENDED_MAX);
            let is_old = |at: Duration| now.saturating_sub(at) > keep;
            for (index, (at, id)) in over.into_iter().enumerate() {
                if index < excess || is_old(at) {
                    self.goals.remove(&id);
                }
            }
        }
    }
}

fn goal_info(id: GoalId, accepted: RosTime) -> GoalInfo {
    let (sec, nanosec) = accepted.parts();
    GoalInfo { goal_id: UUID { uuid: id.0 }, stamp: Time { sec, nanosec } }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: GoalId = GoalId([1; 16]);
    const B: GoalId = GoalId([2; 16]);
    const C: GoalId = GoalId([3; 16]);

    fn at(seconds: i32) -> RosTime {
        RosTime::from_parts(seconds, 0)
    }

    /// A, B and C accepted at 1, 2 and 3 s.
    fn three() -> Goals<u32> {
        let mut goals = Goals::new();
        for (id, seconds) in [(A, 1), (B, 2), (C, 3)] {
            assert_eq!(goals.offer(id), Offer::New);
            goals.accept(id, at(seconds));
        }
        goals
    }

    fn cancel(goals: &mut Goals<u32>, id: GoalId, stamp: RosTime) -> (i8, Vec<GoalId>) {
        let response = goals.cancel(&goal_info(id, stamp));
        let ids = response.goals_canceling.iter().map(|info| GoalId(info.goal_id.uuid)).collect();
        (response.return_code, ids)
    }

    #[test]
    fn a_request_that_arrives_twice_is_started_once() {
        let mut goals = Goals::<u32>::new();
        assert_eq!(goals.offer(A), Offer::New);
        assert_eq!(goals.offer(A), Offer::Undecided);
        goals.accept(A, at(7));
        assert_eq!(goals.offer(A), Offer::Accepted(at(7)));
        goals.end(A, GoalOutcome::Succeeded, 42, Duration::ZERO);
        assert_eq!(goals.offer(A), Offer::Accepted(at(7)));
        assert_eq!(goals.answer(A), Answer::Ended(GoalOutcome::Succeeded, 42));
    }

    #[test]
    fn a_rejected_goal_stays_rejected_however_often_its_request_arrives() {
        let mut goals = Goals::<u32>::new();
        assert_eq!(goals.offer(A), Offer::New);
        goals.reject(A, Duration::ZERO);
        assert_eq!(goals.answer(A), Answer::Unknown);
        assert!(goals.statuses().is_empty());
        assert_eq!(goals.offer(A), Offer::Rejected);
        assert_eq!(cancel(&mut goals, A, RosTime::ZERO), (2, vec![]));
        // Longer than anybody asks again it is not kept.
        goals.offer(B);
        goals.reject(B, KEEP_REFUSAL + Duration::from_secs(1));
        assert_eq!(goals.offer(A), Offer::New);
    }

    #[test]
    fn a_goal_that_is_canceled_before_it_is_decided_is_known_to_be() {
        for (id, stamp) in [(A, RosTime::ZERO), (GoalId::default(), RosTime::ZERO), (B, at(1))] {
            let mut goals = Goals::<u32>::new();
            goals.offer(A);
            assert!(!goals.is_canceling(A));
            assert_eq!(cancel(&mut goals, id, stamp), (0, vec![A]));
            assert!(goals.is_canceling(A) && goals.is_undecided(A));
            assert!(goals.statuses().is_empty());
        }
    }

    #[test]
    fn cancel_reaches_one_goal_or_all_or_those_up_to_a_time() {
        let none = GoalId::default();
        let table = [
            (none, RosTime::ZERO, vec![A, B, C]),
            (B, RosTime::ZERO, vec![B]),
            (none, at(2), vec![A, B]),
            (C, at(1), vec![A, C]),
        ];
        for (id, stamp, expected) in table {
            let mut goals = three();
            assert_eq!(cancel(&mut goals, id, stamp), (0, expected), "{id} {stamp:?}");
        }
    }

    #[test]
    fn cancel_distinguishes_unknown_and_ended_goals() {
        let mut goals = three();
        assert_eq!(cancel(&mut goals, GoalId([9; 16]), RosTime::ZERO), (2, vec![]));
        goals.end(A, GoalOutcome::Aborted, 0, Duration::ZERO);
        assert_eq!(cancel(&mut goals, A, RosTime::ZERO), (3, vec![]));
        let mut idle = Goals::<u32>::new();
        assert_eq!(cancel(&mut idle, GoalId::default(), RosTime::ZERO), (0, vec![]));
    }

    #[test]
    fn the_status_topic_shows_every_goal_that_was_accepted() {
        let mut goals = three();
        cancel(&mut goals, B, RosTime::ZERO);
        goals.end(C, GoalOutcome::Canceled, 0, Duration::ZERO);
        goals.offer(GoalId([4; 16]));
        let shown: Vec<i8> = goals.statuses().iter().map(|status| status.status).collect();
        assert_eq!(shown, [2, 3, 5]);
        assert!(goals.is_canceling(B) && !goals.is_canceling(A));
    }

    #[test]
    fn a_result_is_kept_a_quarter_of_an_hour_and_the_first_end_counts() {
        let mut goals = three();
        goals.end(A, GoalOutcome::Succeeded, 1, Duration::ZERO);
        goals.end(A, GoalOutcome::Aborted, 2, Duration::from_secs(1));
        goals.end(B, GoalOutcome::Succeeded, 3, KEEP_RESULT);
        assert_eq!(goals.answer(A), Answer::Ended(GoalOutcome::Succeeded, 1));
        goals.end(C, GoalOutcome::Succeeded, 4, KEEP_RESULT + Duration::from_secs(1));
        assert_eq!(goals.answer(A), Answer::Unknown);
        assert_eq!(goals.answer(B), Answer::Ended(GoalOutcome::Succeeded, 3));
    }

    #[test]
    fn the_oldest_of_many_results_go_first() {
        let mut goals = Goals::<u32>::new();
        for index in 0..300_u32 {
            let mut id = GoalId([7; 16]);
            id.0[..4].copy_from_slice(&index.to_be_bytes());
            goals.offer(id);
            goals.accept(id, at(1));
            goals.end(id, GoalOutcome::Succeeded, index, Duration::from_millis(index.into()));
        }
        assert_eq!(goals.statuses().len(), ENDED_MAX);
        let mut first = GoalId([7; 16]);
        first.0[..4].copy_from_slice(&0_u32.to_be_bytes());
        assert_eq!(goals.answer(first), Answer::Unknown);
    }
}
