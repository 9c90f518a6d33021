//! Saves the goals of an action, so that the next process of the node can continue them.
//!
//! Pure: encodes to bytes and back. Besides the table of goals it saves, for each unfinished
//! goal, its request and the node's own number for it, and the clients that wait for a result.

use super::GoalId;
use super::goals::{GoalRecord, Goals};
use crate::endpoints::service::RequestInfo;
use crate::process::time::RosTime;
use crate::samples::gid::Gid;
use cnc_msgs::cdr::{self, Cdr};
use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;
use std::collections::BTreeMap;

/// Waiting clients that are saved, at most; further ones have to ask again.
const WAITING_MAX: usize = 64;

/// What the next process needs besides the table of goals.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Ledger {
    pub(super) unfinished: BTreeMap<GoalId, Unfinished>,
    waiting: Vec<(GoalId, RequestInfo)>,
}

/// The data of a goal that has not ended.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unfinished {
    /// The goal as it was sent, in CDR.
    pub(super) goal: Vec<u8>,
    pub(super) info: RequestInfo,
    /// The node's own number for it; 0: none yet.
    pub(super) tag: u64,
}

#[derive(Debug, Serialize, Deserialize)]
struct Kept {
    goals: Vec<GoalRecord>,
    unfinished: Vec<([u8; 16], ByteBuf, Requester, u64)>,
    waiting: Vec<([u8; 16], Requester)>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Requester {
    writer: [u8; 16],
    client: [u8; 16],
    sequence: i64,
    reception_ns: i64,
}

impl From<RequestInfo> for Requester {
    fn from(info: RequestInfo) -> Self {
        Self {
            writer: info.writer.0,
            client: info.client.0,
            sequence: info.sequence,
            reception_ns: info.reception_time.as_nanos(),
        }
    }
}

impl From<Requester> for RequestInfo {
    fn from(kept: Requester) -> Self {
        Self {
            writer: Gid(kept.writer),
            client: Gid(kept.client),
            sequence: kept.sequence,
            reception_time: RosTime::from_nanos(kept.reception_ns),
        }
    }
}

impl Ledger {
    /// Somebody waits for the result of a goal.
    pub(super) fn wait(&mut self, id: GoalId, info: RequestInfo) {
        if self.waiting.len() < WAITING_MAX {
            self.waiting.push((id, info));
        }
    }

    /// It was answered, or given up.
    pub(super) fn answered(&mut self, info: &RequestInfo) {
        self.waiting.retain(|(_, waiting)| {
            (waiting.client, waiting.sequence) != (info.client, info.sequence)
        });
    }

    /// Who waits for a result.
    pub(super) fn waiting(&self) -> impl Iterator<Item = (GoalId, RequestInfo)> {
        self.waiting.iter().copied()
    }
}

/// Encodes goals and ledger.
pub(super) fn encode<R: Cdr + Clone>(goals: &Goals<R>, ledger: &Ledger) -> Vec<u8> {
    let unfinished = ledger.unfinished.iter().map(|(id, Unfinished { goal, info, tag })| {
        (id.0, ByteBuf::from(goal.clone()), Requester::from(*info), *tag)
    });
    cdr::record(&Kept {
        goals: goals.records(),
        unfinished: unfinished.collect(),
        waiting: ledger.waiting().map(|(id, info)| (id.0, info.into())).collect(),
    })
}

/// Decodes goals and ledger; `None` when the bytes are invalid.
pub(super) fn decode<R: Cdr + Clone>(bytes: &[u8]) -> Option<(Goals<R>, Ledger)> {
    let Kept { goals, unfinished, waiting } = cdr::from_record(bytes).ok()?;
    let goals = Goals::from_records(goals)?;
    let unfinished = unfinished.into_iter().map(|(id, goal, info, tag)| {
        (GoalId(id), Unfinished { goal: goal.into_vec(), info: info.into(), tag })
    });
    let waiting = waiting.into_iter().map(|(id, info)| (GoalId(id), info.into()));
    Some((goals, Ledger { unfinished: unfinished.collect(), waiting: waiting.collect() }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::endpoints::action::GoalOutcome;
    use crate::endpoints::action::goals::Offer;
    use std::time::Duration;

    fn info(sequence: i64) -> RequestInfo {
        let (writer, client) = (Gid([1; 16]), Gid([2; 16]));
        RequestInfo { writer, client, sequence, reception_time: RosTime::from_nanos(7) }
    }

    #[test]
    fn goals_in_every_state_come_back_and_are_answered_as_before() {
        let ids: [GoalId; 6] = std::array::from_fn(|index| GoalId([index as u8 + 1; 16]));
        let [offered, canceled_offer, rejected, active, canceling, ended] = ids;
        let mut goals = Goals::<String>::new();
        for id in ids {
            assert_eq!(goals.offer(id), Offer::New);
        }
        goals.reject(rejected, Duration::ZERO);
        for id in [active, canceling, ended] {
            goals.accept(id, RosTime::from_parts(5, 6));
        }
        goals.end(ended, GoalOutcome::Succeeded, "done".into(), Duration::ZERO);
        for id in [canceled_offer, canceling] {
            let goal_id = cnc_msgs::wire::unique_identifier_msgs::msg::UUID { uuid: id.0 };
            goals.cancel(&cnc_msgs::wire::action_msgs::msg::GoalInfo {
                goal_id,
                ..Default::default()
            });
        }
        let mut ledger = Ledger::default();
        for (tag, id) in (1..).zip([offered, canceled_offer, active, canceling]) {
            let unfinished = Unfinished { goal: vec![tag; 3], info: info(3), tag: tag.into() };
            ledger.unfinished.insert(id, unfinished);
        }
        ledger.wait(active, info(8));
        ledger.wait(active, info(9));
        ledger.answered(&info(8));

        let (mut after, ledger_after) =
            decode::<String>(&encode(&goals, &ledger)).expect("what was written");
        assert_eq!(ledger_after, ledger);
        assert_eq!(ledger_after.waiting().collect::<Vec<_>>(), [(active, info(9))]);
        assert_eq!(after.statuses(), goals.statuses());
        for id in ids {
            assert_eq!(after.answer(id), goals.answer(id), "{id}");
            assert_eq!(after.is_canceling(id), goals.is_canceling(id), "{id}");
            assert_eq!(after.offer(id), goals.offer(id), "{id}");
        }
    }

    #[test]
    fn invalid_bytes_are_rejected() {
        assert!(decode::<String>(&[1, 2, 3]).is_none());
        assert!(decode::<String>(&[0xff; 64]).is_none());
    }
}
