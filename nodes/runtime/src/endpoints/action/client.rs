//! Action clients.

use super::goals::GoalOutcome;
use super::messages::{
    ActionNames, FeedbackMessage, GetResult, GetResultRequest, SendGoal, SendGoalRequest,
};
use super::{CancelAnswer, GoalId};
use crate::endpoints::client::{CallError, Client};
use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::endpoints::subscription::Subscription;
use crate::samples::qos::Qos;
use cnc_msgs::interface::Action;
use cnc_msgs::wire::action_msgs::msg::GoalInfo;
use cnc_msgs::wire::action_msgs::srv::{CancelGoal, CancelGoalRequest, CancelGoalResponse};
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::mpsc;

/// How long the answer to a goal, and to a request to cancel it, may take.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// How long to try to cancel a goal that was not answered.
const UNFOLLOWED_WITHIN: Duration = Duration::from_secs(1);
/// Feedback that may wait unread; what is newer is dropped.
const FEEDBACK_MAX: usize = 256;
/// When to ask for a result again, in case the server was restarted:
/// after 5 s, then after twice as long each time, up to 160 s.
const RESULT_AGAIN: (Duration, u32) = (Duration::from_secs(5), 6);

/// Why there is no result.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GoalError {
    #[error("{action} rejected the goal (its log says why)")]
    Rejected { action: String },
    /// The server was restarted, or no longer has the result.
    #[error("{action} no longer knows the goal: its node was restarted")]
    Forgotten { action: String },
    #[error(transparent)]
    Call(#[from] CallError),
}

/// A client of action `A`; clones share the endpoints.
pub struct ActionClient<A: Action> {
    shared: Arc<Shared<A>>,
}

/// A goal that was accepted. Dropping it does not cancel the goal.
pub struct GoalHandle<A: Action> {
    id: GoalId,
    feedback: mpsc::Receiver<A::Feedback>,
    shared: Arc<Shared<A>>,
}

/// The feedback of an action, whoever sent the goals.
pub struct ActionFeedback<A: Action>(Subscription<FeedbackMessage<A::Feedback>>);

struct Shared<A: Action> {
    name: String,
    send_goal: Client<SendGoal<A>>,
    get_result: Client<GetResult<A>>,
    cancel_goal: Client<CancelGoal>,
    listeners: Arc<Listeners<A::Feedback>>,
}

type Listeners<F> = Mutex<BTreeMap<GoalId, mpsc::Sender<F>>>;

impl Handle {
    /// Asks for an action.
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn action_client<A: Action + 'static>(
        &self,
        name: &str,
    ) -> Result<ActionClient<A>, NodeError> {
        let name = self.names().resolve(name)?;
        let names = ActionNames::new::<A>(&name);
        let qos = Qos::DEFAULT.with_depth(FEEDBACK_MAX);
        let feedback = self.subscription_of(&names.feedback.0, &names.feedback.1, qos)?;
        let listeners = Arc::default();
        self.spawn("feedback", distribute(feedback, Arc::clone(&listeners)));
        let shared = Shared {
            name,
            send_goal: self.client_of(&names.send_goal.0, &names.send_goal.1)?,
            get_result: self.client_of(&names.get_result.0, &names.get_result.1)?,
            cancel_goal: self.client(&names.cancel_goal)?,
            listeners,
        };
        Ok(ActionClient { shared: Arc::new(shared) })
    }
}

impl Handle {
    /// Follows the feedback of an action without a goal of its own.
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn action_feedback<A: Action + 'static>(
        &self,
        name: &str,
    ) -> Result<ActionFeedback<A>, NodeError> {
        let names = ActionNames::new::<A>(&self.names().resolve(name)?);
        let qos = Qos::DEFAULT.with_depth(FEEDBACK_MAX);
        self.subscription_of(&names.feedback.0, &names.feedback.1, qos).map(ActionFeedback)
    }
}

impl<A: Action + 'static> ActionFeedback<A> {
    /// The next feedback.
    pub async fn next(&mut self) -> A::Feedback {
        self.0.next().await.0.feedback
    }
}

impl<A: Action + 'static> ActionClient<A> {
    /// Waits for a server; false when `deadline` came first.
    pub async fn wait_for_server(&self, deadline: Duration) -> bool {
        let shared = &self.shared;
        futures::join!(
            shared.send_goal.wait_for_server(deadline),
            shared.get_result.wait_for_server(deadline),
            shared.cancel_goal.wait_for_server(deadline),
        ) == (true, true, true)
    }

    /// Sends a goal and waits until it is accepted or rejected. A request that
    /// got lost is sent again; the server starts the goal once.
    ///
    /// # Errors
    /// See [`GoalError`].
    pub async fn send_goal(&self, goal: A::Goal) -> Result<GoalHandle<A>, GoalError> {
        let id = new_goal_id();
        // Before the goal, so that its first feedback is not lost.
        let (sender, feedback) = mpsc::channel(FEEDBACK_MAX);
        lock(&self.shared.listeners).insert(id, sender);
        let handle = GoalHandle { id, feedback, shared: Arc::clone(&self.shared) };
        let request = SendGoalRequest { goal_id: UUID { uuid: id.0 }, goal };
        let answer = self.shared.send_goal.call_idempotent(&request, ANSWER_WITHIN).await;
        if answer.is_err() {
            // The server may have accepted it, and no client would follow it.
            let _ = tokio::time::timeout(UNFOLLOWED_WITHIN, self.shared.cancel(id)).await;
        }
        if answer?.accepted {
            Ok(handle)
        } else {
            Err(GoalError::Rejected { action: self.shared.name.clone() })
        }
    }

    /// Follows a goal that was sent before, perhaps by another node.
    pub fn follow(&self, id: GoalId) -> GoalHandle<A> {
        let (sender, feedback) = mpsc::channel(FEEDBACK_MAX);
        lock(&self.shared.listeners).insert(id, sender);
        GoalHandle { id, feedback, shared: Arc::clone(&self.shared) }
    }

    /// Cancels all goals of the server, from all clients.
    ///
    /// # Errors
    /// See [`CallError`].
    pub async fn cancel_all(&self) -> Result<CancelAnswer, CallError> {
        self.shared.cancel(GoalId::default()).await
    }
}

impl<A: Action + 'static> GoalHandle<A> {
    /// The goal's name.
    pub fn id(&self) -> GoalId {
        self.id
    }

    /// The next feedback; `None` when the node stops. May be dropped while it
    /// waits.
    pub async fn feedback(&mut self) -> Option<A::Feedback> {
        self.feedback.recv().await
    }

    /// Waits for the end of the goal; may be asked again, and while feedback
    /// is being read.
    ///
    /// # Errors
    /// The server does not answer within `within`, or has forgotten the goal.
    pub fn result(
        &self,
        within: Duration,
    ) -> impl Future<Output = Result<(GoalOutcome, A::Result), GoalError>> + Send + use<A> {
        let (id, shared) = (self.id, Arc::clone(&self.shared));
        async move {
            let request = GetResultRequest { goal_id: UUID { uuid: id.0 } };
            let again = |sent: usize| {
                let doublings = u32::try_from(sent).unwrap_or(u32::MAX).min(RESULT_AGAIN.1);
                RESULT_AGAIN.0 * 2_u32.pow(doublings.saturating_sub(1))
            };
            let (response, _) = shared.get_result.call_again(&request, within, again).await?;
            match GoalOutcome::from_status(response.status) {
                Some(outcome) => Ok((outcome, response.result)),
                None => Err(GoalError::Forgotten { action: shared.name.clone() }),
            }
        }
    }

    /// Asks to cancel the goal; [`Self::result`] returns when it has ended.
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn cancel(&self) -> impl Future<Output = Result<CancelAnswer, CallError>> + Send + use<A> {
        let (id, shared) = (self.id, Arc::clone(&self.shared));
        async move { shared.cancel(id).await }
    }
}

impl<A: Action> Drop for GoalHandle<A> {
    fn drop(&mut self) {
        lock(&self.shared.listeners).remove(&self.id);
    }
}

impl<A: Action> Shared<A> {
    async fn cancel(&self, id: GoalId) -> Result<CancelAnswer, CallError> {
        let goal_info =
            GoalInfo { goal_id: UUID { uuid: id.0 }, stamp: Time { sec: 0, nanosec: 0 } };
        let request = CancelGoalRequest { goal_info };
        let response = self.cancel_goal.call_idempotent(&request, ANSWER_WITHIN).await?;
        Ok(match response.return_code {
            CancelGoalResponse::ERROR_NONE => {
                CancelAnswer::Canceling(response.goals_canceling.len())
            }
            CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID => CancelAnswer::UnknownGoal,
            CancelGoalResponse::ERROR_GOAL_TERMINATED => CancelAnswer::AlreadyEnded,
            _ => CancelAnswer::Refused,
        })
    }
}

/// Passes feedback to the goals of this client; skips that of others.
async fn distribute<F: cnc_msgs::interface::Message>(
    mut feedback: Subscription<FeedbackMessage<F>>,
    listeners: Arc<Listeners<F>>,
) {
    loop {
        let (message, _) = feedback.next().await;
        if let Some(listener) = lock(&listeners).get(&GoalId(message.goal_id.uuid)) {
            // A goal that is not read from loses feedback.
            drop(listener.try_send(message.feedback));
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A random version 4 UUID, from the randomness of the standard hasher.
fn new_goal_id() -> GoalId {
    use std::hash::{BuildHasher, RandomState};
    let mut bytes = [0; 16];
    bytes[..8].copy_from_slice(&RandomState::new().hash_one(1).to_ne_bytes());
    bytes[8..].copy_from_slice(&RandomState::new().hash_one(2).to_ne_bytes());
    bytes[6] = bytes[6] & 0x0f | 0x40;
    bytes[8] = bytes[8] & 0x3f | 0x80;
    GoalId(bytes)
}

impl<A: Action> Clone for ActionClient<A> {
    fn clone(&self) -> Self {
        Self { shared: Arc::clone(&self.shared) }
    }
}

impl<A: Action> std::fmt::Debug for ActionClient<A> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ActionClient").field("action", &self.shared.name).finish_non_exhaustive()
    }
}

impl<A: Action> std::fmt::Debug for GoalHandle<A> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GoalHandle").field("id", &self.id).finish_non_exhaustive()
    }
}

impl<A: Action> std::fmt::Debug for ActionFeedback<A> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ActionFeedback").finish_non_exhaustive()
    }
}
