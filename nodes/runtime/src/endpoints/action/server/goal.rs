//! Goals as the node sees them: offered, and being executed.
//!
//! No goal stays open: an offer that is dropped is rejected, a goal that is dropped is aborted.

use super::Shared;
use crate::endpoints::action::GoalId;
use crate::endpoints::action::goals::GoalOutcome;
use crate::endpoints::action::messages::FeedbackMessage;
use crate::endpoints::service::RequestInfo;
use crate::process::time::RosTime;
use cnc_msgs::interface::Action;
use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;
use std::sync::Arc;
use tokio::sync::oneshot;

/// What the process before this one had not brought to an end; see [`crate::Memory`].
#[derive(Debug)]
pub enum Unfinished<A: Action> {
    /// It had not decided on it, or had not sent the decision.
    Offer(GoalOffer<A>),
    /// It was working on it.
    Goal(Goal<A>),
}

/// Receives when the goal was accepted; `None` if it was rejected.
pub(super) type Decision = oneshot::Sender<Option<RosTime>>;

/// A goal that a client has sent, not yet accepted.
pub struct GoalOffer<A: Action> {
    pub(super) goal: A::Goal,
    pub(super) id: GoalId,
    pub(super) info: RequestInfo,
    /// Taken when the node decides. For an offer from the process before, no request in this
    /// process waits for the decision.
    pub(super) pending: Option<(Arc<Shared<A>>, Option<Decision>)>,
}

/// A goal that is being executed.
pub struct Goal<A: Action> {
    pub(super) goal: A::Goal,
    pub(super) id: GoalId,
    pub(super) info: RequestInfo,
    pub(super) shared: Arc<Shared<A>>,
    /// Used when the goal is dropped without an end.
    pub(super) fallback: Option<A::Result>,
}

impl<A: Action> GoalOffer<A> {
    /// What is wanted.
    pub fn goal(&self) -> &A::Goal {
        &self.goal
    }

    /// The goal's name.
    pub fn id(&self) -> GoalId {
        self.id
    }

    /// Who wants it.
    pub fn info(&self) -> RequestInfo {
        self.info
    }

    /// Whether a client has canceled the goal before it was decided on.
    pub fn is_canceled(&self) -> bool {
        self.pending.as_ref().is_some_and(|(shared, _)| shared.goals().is_canceling(self.id))
    }

    /// Keeps the node's own number for the goal, for the process after this one.
    pub fn tag(&self, tag: u64) {
        if let Some((shared, _)) = &self.pending {
            shared.tag(self.id, tag);
        }
    }

    /// The number that [`Self::tag`] was given, in this process or the one before; 0: none.
    pub fn kept_tag(&self) -> u64 {
        self.pending.as_ref().map_or(0, |(shared, _)| shared.kept_tag(self.id))
    }

    /// Takes the goal on: from now on it is executing.
    ///
    /// Returns `None` if the decision came too late, or if the goal was canceled before it. The
    /// client then gets a rejection, and the node must not start any motion.
    pub fn accept(mut self) -> Option<Goal<A>>
    where
        A::Result: Default,
    {
        // Only `drop`, `reject` and this take it.
        let (shared, decision) = self.pending.take().expect("an offer is decided once");
        let now = shared.handle.now();
        let mut goals = shared.goals();
        if goals.is_canceling(self.id) {
            goals.reject(self.id, shared.start.elapsed());
            drop(goals);
            if let Some(decision) = decision {
                // Its client may have received the acceptance already.
                let _ = decision.send(None);
            }
            tracing::warn!("{}: goal {} was canceled before it began", shared.name, self.id);
            shared.changed();
            return None;
        }
        if decision.is_some_and(|decision| decision.send(Some(now)).is_err()) {
            return None;
        }
        goals.accept(self.id, now);
        drop(goals);
        shared.changed();
        let (goal, id, info) = (self.goal.clone(), self.id, self.info);
        Some(Goal { goal, id, info, shared, fallback: Some(A::Result::default()) })
    }

    /// Refuses the goal. ROS carries no reason to the client; it goes to the log.
    pub fn reject(mut self, reason: &str) {
        self.refuse(reason);
    }

    fn refuse(&mut self, reason: &str) {
        if let Some((shared, decision)) = self.pending.take() {
            let mut goals = shared.goals();
            if decision.is_none_or(|decision| decision.send(None).is_ok()) {
                goals.reject(self.id, shared.start.elapsed());
                drop(goals);
                tracing::warn!("{}: goal {} is rejected: {reason}", shared.name, self.id);
                shared.changed();
            }
        }
    }
}

impl<A: Action> Drop for GoalOffer<A> {
    fn drop(&mut self) {
        self.refuse("the node did not decide on it");
    }
}

impl<A: Action> Goal<A> {
    /// What is wanted.
    pub fn goal(&self) -> &A::Goal {
        &self.goal
    }

    /// The goal's name.
    pub fn id(&self) -> GoalId {
        self.id
    }

    /// Who wanted it.
    pub fn info(&self) -> RequestInfo {
        self.info
    }

    /// The number that [`GoalOffer::tag`] was given, in this process or the one before; 0: none.
    pub fn kept_tag(&self) -> u64 {
        self.shared.kept_tag(self.id)
    }

    /// Publishes progress; dropped when the transport is full.
    pub fn feedback(&self, feedback: A::Feedback) {
        let goal_id = UUID { uuid: self.id.0 };
        self.shared.feedback.publish(FeedbackMessage { goal_id, feedback });
    }

    /// Whether a client wants it canceled.
    pub fn is_cancel_requested(&self) -> bool {
        self.shared.goals().is_canceling(self.id)
    }

    /// Waits until a client wants it canceled; may be dropped and called again.
    pub async fn cancel_requested(&self) {
        let mut changes = self.shared.changes.subscribe();
        while !self.is_cancel_requested() {
            // The sender lives as long as `self`.
            drop(changes.changed().await);
        }
    }

    /// Ends the goal and sends its result to all clients that wait for it.
    pub fn end(mut self, outcome: GoalOutcome, result: A::Result) {
        self.fallback = None;
        self.shared.end(self.id, outcome, result);
    }
}

impl<A: Action> Drop for Goal<A> {
    fn drop(&mut self) {
        if let Some(result) = self.fallback.take() {
            tracing::error!("{}: goal {} was given up and is aborted", self.shared.name, self.id);
            self.shared.end(self.id, GoalOutcome::Aborted, result);
        }
    }
}

impl<A: Action> std::fmt::Debug for GoalOffer<A> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GoalOffer").field("id", &self.id).finish_non_exhaustive()
    }
}

impl<A: Action> std::fmt::Debug for Goal<A> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Goal").field("id", &self.id).finish_non_exhaustive()
    }
}
