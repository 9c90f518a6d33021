//! Action servers.
//!
//! The node takes offers from [`ActionServer::next_goal`] and accepts or
//! rejects each; how many may be active at once is its decision. Every request
//! is answered: an offer that is dropped is rejected, a goal that is dropped is
//! aborted, a result is available for a quarter of an hour.

mod goal;

pub use goal::{Goal, GoalOffer, Unfinished};

use super::GoalId;
use super::goals::{Answer, GoalOutcome, Goals, Offer};
use super::messages::{
    ActionNames, FeedbackMessage, GetResult, GetResultRequest, GetResultResponse, SendGoal,
    SendGoalRequest, SendGoalResponse,
};
use super::persistence::{self, Ledger};
use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::endpoints::publisher::Publisher;
use crate::endpoints::service::{Overload, RequestInfo};
use crate::process::time::RosTime;
use crate::samples::qos::Qos;
use cnc_msgs::cdr;
use cnc_msgs::count::counted;
use cnc_msgs::interface::Action;
use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
use cnc_msgs::wire::action_msgs::srv::CancelGoal;
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, oneshot, watch};

/// Offers that may wait for the node.
const OFFERS_MAX: usize = 16;
/// How long the node may take to decide on an offer.
const DECIDE_WITHIN: Duration = Duration::from_secs(4);

/// The server of action `A`, as its node sees it.
pub struct ActionServer<A: Action> {
    offers: mpsc::Receiver<GoalOffer<A>>,
    unfinished: Vec<Unfinished<A>>,
}

struct Shared<A: Action> {
    name: String,
    goals: Mutex<Goals<A::Result>>,
    /// Only where the node has a memory.
    ledger: Mutex<Ledger>,
    changes: watch::Sender<u64>,
    feedback: Publisher<FeedbackMessage<A::Feedback>>,
    status: Publisher<GoalStatusArray>,
    handle: Handle,
    start: Instant,
}

impl Handle {
    /// Offers an action.
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn action_server<A>(&self, name: &str) -> Result<ActionServer<A>, NodeError>
    where
        A: Action + 'static,
        A::Result: Default,
    {
        let name = self.names().resolve(name)?;
        let names = ActionNames::new::<A>(&name);
        let kept = self.memory().and_then(|memory| memory.get(&kept_name(&name)));
        let (goals, ledger) = match kept.map(|kept| persistence::decode(&kept)) {
            Some(Some(found)) => found,
            Some(None) => {
                tracing::error!("{name}: the goals of the previous process cannot be decoded");
                (Goals::new(), Ledger::default())
            }
            None => (Goals::new(), Ledger::default()),
        };
        let shared = Arc::new(Shared::<A> {
            name,
            goals: Mutex::new(goals),
            ledger: Mutex::new(ledger),
            changes: watch::Sender::new(0),
            feedback: self.publisher_of(&names.feedback.0, &names.feedback.1, Qos::DEFAULT)?,
            status: self.publisher(&names.status, Qos::LATCHED)?,
            handle: self.clone(),
            start: Instant::now(),
        });
        let (sender, offers) = mpsc::channel(OFFERS_MAX);
        let (unfinished, goals_asked, results_asked) = shared.unfinished();

        let state = Arc::clone(&shared);
        self.concurrent_service_of::<SendGoal<A>, _, _>(
            &names.send_goal.0,
            &names.send_goal.1,
            Overload::Wait,
            goals_asked,
            move |request, info| {
                let (state, sender) = (Arc::clone(&state), sender.clone());
                async move {
                    let id = GoalId(request.goal_id.uuid);
                    let accepted = state.decide(id, request.goal, info, &sender).await;
                    let (sec, nanosec) = accepted.unwrap_or_default().parts();
                    SendGoalResponse { accepted: accepted.is_some(), stamp: Time { sec, nanosec } }
                }
            },
        )?;

        let state = Arc::clone(&shared);
        self.service::<CancelGoal, _, _>(&names.cancel_goal, move |request, info| {
            let response = state.goals().cancel(&request.goal_info);
            tracing::info!(
                "{}: {} asks to cancel; canceling {} (code {})",
                state.name,
                info.writer,
                counted(response.goals_canceling.len(), "goal"),
                response.return_code
            );
            state.changed();
            std::future::ready(response)
        })?;

        let state = Arc::clone(&shared);
        self.concurrent_service_of::<GetResult<A>, _, _>(
            &names.get_result.0,
            &names.get_result.1,
            Overload::DropOldest,
            results_asked,
            move |request, info| {
                let state = Arc::clone(&state);
                async move {
                    let id = GoalId(request.goal_id.uuid);
                    let _waiting = Waiting::new(&state, id, info);
                    state.result(id).await
                }
            },
        )?;
        shared.changed();
        Ok(ActionServer { offers, unfinished })
    }
}

/// Under this name the goals of an action are kept.
fn kept_name(action: &str) -> String {
    format!("action {action}")
}

impl<A: Action> ActionServer<A> {
    /// The goals that the previous process did not finish; to be taken before
    /// [`Self::next_goal`]. A goal that is dropped is rejected or aborted.
    pub fn take_unfinished(&mut self) -> Vec<Unfinished<A>> {
        std::mem::take(&mut self.unfinished)
    }

    /// The next goal that a client sends; may be dropped while it waits.
    /// `None` when the node stops. The node must decide on it within 4 s.
    pub async fn next_goal(&mut self) -> Option<GoalOffer<A>> {
        self.offers.recv().await
    }
}

impl<A: Action> Shared<A> {
    fn goals(&self) -> MutexGuard<'_, Goals<A::Result>> {
        self.goals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notifies watchers and waiting requests that the state of a goal has changed.
    fn changed(&self) {
        // Under the lock, so that statuses go out in the order of the changes.
        let goals = self.goals();
        self.keep(&goals);
        self.status.publish(GoalStatusArray { status_list: goals.statuses() });
        drop(goals);
        self.changes.send_modify(|count| *count = count.wrapping_add(1));
    }

    /// Keeps the goals for the next process, if the node has a memory.
    fn keep(&self, goals: &Goals<A::Result>) {
        let Some(memory) = self.handle.memory() else { return };
        let mut ledger = self.ledger();
        ledger.unfinished.retain(|id, _| goals.is_unfinished(*id));
        memory.keep(&kept_name(&self.name), persistence::encode(goals, &ledger));
    }

    fn ledger(&self) -> MutexGuard<'_, Ledger> {
        self.ledger.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what is kept besides the goals.
    fn note(&self, change: impl FnOnce(&mut Ledger)) {
        if self.handle.memory().is_some() {
            let goals = self.goals();
            change(&mut self.ledger());
            self.keep(&goals);
        }
    }

    fn tag(&self, id: GoalId, tag: u64) {
        self.note(|ledger| {
            if let Some(unfinished) = ledger.unfinished.get_mut(&id) {
                unfinished.tag = tag;
            }
        });
    }

    fn kept_tag(&self, id: GoalId) -> u64 {
        self.ledger().unfinished.get(&id).map_or(0, |unfinished| unfinished.tag)
    }

    /// The goals that the previous process did not finish, and the requests that it did not
    /// answer: for a goal, and for a result.
    #[allow(clippy::type_complexity, reason = "three lists, named where they are taken apart")]
    fn unfinished(
        self: &Arc<Self>,
    ) -> (
        Vec<Unfinished<A>>,
        Vec<(SendGoalRequest<A::Goal>, RequestInfo)>,
        Vec<(GetResultRequest, RequestInfo)>,
    )
    where
        A::Result: Default,
    {
        let goals = self.goals();
        let mut ledger = self.ledger();
        let (mut unfinished, mut goals_asked) = (Vec::new(), Vec::new());
        for (id, kept) in &ledger.unfinished {
            let (id, info) = (*id, kept.info);
            let Ok(goal) = cdr::from_body::<A::Goal>(&kept.goal) else { continue };
            if goals.is_undecided(id) {
                let goal_id = UUID { uuid: id.0 };
                goals_asked.push((SendGoalRequest { goal_id, goal: goal.clone() }, info));
                let pending = Some((Arc::clone(self), None));
                unfinished.push(Unfinished::Offer(GoalOffer { goal, id, info, pending }));
            } else {
                let (shared, fallback) = (Arc::clone(self), Some(A::Result::default()));
                unfinished.push(Unfinished::Goal(Goal { goal, id, info, shared, fallback }));
            }
        }
        let asked = |(id, info): (GoalId, RequestInfo)| {
            (GetResultRequest { goal_id: UUID { uuid: id.0 } }, info)
        };
        let results_asked: Vec<_> = ledger.waiting().map(asked).collect();
        // They are handled as if they had just arrived.
        results_asked.iter().for_each(|(_, info)| ledger.answered(info));
        (unfinished, goals_asked, results_asked)
    }

    fn end(&self, id: GoalId, outcome: GoalOutcome, result: A::Result) {
        self.goals().end(id, outcome, result, self.start.elapsed());
        self.changed();
    }

    /// When the goal was accepted, or `None` if it was not.
    async fn decide(
        self: &Arc<Self>,
        id: GoalId,
        goal: A::Goal,
        info: RequestInfo,
        offers: &mpsc::Sender<GoalOffer<A>>,
    ) -> Option<RosTime> {
        let offer = self.goals().offer(id);
        match offer {
            Offer::Accepted(stamp) => Some(stamp),
            Offer::Rejected => None,
            Offer::Undecided => {
                let mut changes = self.changes.subscribe();
                while self.goals().is_undecided(id) {
                    drop(changes.changed().await);
                }
                self.goals().accepted(id)
            }
            Offer::New => {
                let (sender, mut decision) = oneshot::channel();
                let pending = Some((Arc::clone(self), Some(sender)));
                let unfinished = persistence::Unfinished { goal: cdr::body(&goal), info, tag: 0 };
                self.note(|ledger| drop(ledger.unfinished.insert(id, unfinished)));
                // An offer that does not fit is dropped, which rejects it.
                drop(offers.try_send(GoalOffer { goal, id, info, pending }));
                if let Ok(decided) = tokio::time::timeout(DECIDE_WITHIN, &mut decision).await {
                    return decided.ok().flatten();
                }
                // From here on the node can no longer accept it.
                let mut goals = self.goals();
                decision.close();
                if let Ok(decided) = decision.try_recv() {
                    return decided;
                }
                goals.reject(id, self.start.elapsed());
                drop(goals);
                tracing::error!("{}: goal {id} is rejected: the node is too busy", self.name);
                self.changed();
                None
            }
        }
    }

    /// Waits for the end of the goal; at once for one that is not known.
    async fn result(&self, id: GoalId) -> GetResultResponse<A::Result>
    where
        A::Result: Default,
    {
        let mut changes = self.changes.subscribe();
        loop {
            changes.borrow_and_update();
            let answer = self.goals().answer(id);
            match answer {
                Answer::Ended(outcome, result) => {
                    return GetResultResponse { status: outcome.status(), result };
                }
                Answer::Unknown => {
                    let (status, result) = (GoalStatus::STATUS_UNKNOWN, A::Result::default());
                    return GetResultResponse { status, result };
                }
                Answer::NotYet => drop(changes.changed().await),
            }
        }
    }
}

/// A client that waits for a result, as long as it does.
struct Waiting<A: Action> {
    shared: Arc<Shared<A>>,
    info: RequestInfo,
}

impl<A: Action> Waiting<A> {
    fn new(shared: &Arc<Shared<A>>, id: GoalId, info: RequestInfo) -> Self {
        shared.note(|ledger| ledger.wait(id, info));
        Self { shared: Arc::clone(shared), info }
    }
}

impl<A: Action> Drop for Waiting<A> {
    fn drop(&mut self) {
        self.shared.note(|ledger| ledger.answered(&self.info));
    }
}

impl<A: Action> std::fmt::Debug for ActionServer<A> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ActionServer").field("action", &A::TYPE_NAME).finish_non_exhaustive()
    }
}
