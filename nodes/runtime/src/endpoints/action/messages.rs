//! The messages of an action's services and topics.
//!
//! The generic parts; the types that do not depend on the action are those of
//! `action_msgs`. Their type names depend on the action and are given where
//! the endpoints are made.

use cnc_msgs::cdr_struct;
use cnc_msgs::interface::{Action, Message, Service};
use cnc_msgs::wire::builtin_interfaces::msg::Time;
use cnc_msgs::wire::unique_identifier_msgs::msg::UUID;
use std::marker::PhantomData;

#[derive(Debug, Clone)]
pub(super) struct SendGoalRequest<G> {
    pub(super) goal_id: UUID,
    pub(super) goal: G,
}

#[derive(Debug, Clone)]
pub(super) struct SendGoalResponse {
    pub(super) accepted: bool,
    pub(super) stamp: Time,
}

#[derive(Debug, Clone)]
pub(super) struct GetResultRequest {
    pub(super) goal_id: UUID,
}

#[derive(Debug, Clone)]
pub(super) struct GetResultResponse<R> {
    pub(super) status: i8,
    pub(super) result: R,
}

#[derive(Debug, Clone)]
pub(super) struct FeedbackMessage<F> {
    pub(super) goal_id: UUID,
    pub(super) feedback: F,
}

cdr_struct!(SendGoalRequest<G> { goal_id, goal });
cdr_struct!(SendGoalResponse { accepted, stamp });
cdr_struct!(GetResultRequest { goal_id });
cdr_struct!(GetResultResponse<R> { status, result });
cdr_struct!(FeedbackMessage<F> { goal_id, feedback });

impl<G: Message> Message for SendGoalRequest<G> {
    const TYPE_NAME: &'static str = G::TYPE_NAME;
}
impl Message for SendGoalResponse {
    const TYPE_NAME: &'static str = "";
}
impl Message for GetResultRequest {
    const TYPE_NAME: &'static str = "";
}
impl<R: Message> Message for GetResultResponse<R> {
    const TYPE_NAME: &'static str = R::TYPE_NAME;
}
impl<F: Message> Message for FeedbackMessage<F> {
    const TYPE_NAME: &'static str = F::TYPE_NAME;
}

/// The service `_action/send_goal` of an action.
pub(super) struct SendGoal<A>(PhantomData<A>);
/// The service `_action/get_result` of an action.
pub(super) struct GetResult<A>(PhantomData<A>);

impl<A: Action> Service for SendGoal<A> {
    type Request = SendGoalRequest<A::Goal>;
    type Response = SendGoalResponse;
    const TYPE_NAME: &'static str = A::TYPE_NAME;
}
impl<A: Action> Service for GetResult<A> {
    type Request = GetResultRequest;
    type Response = GetResultResponse<A::Result>;
    const TYPE_NAME: &'static str = A::TYPE_NAME;
}

/// The names of an action's endpoints and their types.
pub(super) struct ActionNames {
    pub(super) send_goal: (String, String),
    pub(super) get_result: (String, String),
    pub(super) cancel_goal: String,
    pub(super) feedback: (String, String),
    pub(super) status: String,
}

impl ActionNames {
    /// For the action `name`, which must be absolute already: its parts are not
    /// remapped one by one.
    pub(super) fn new<A: Action>(name: &str) -> Self {
        let kind = A::TYPE_NAME;
        Self {
            send_goal: (format!("{name}/_action/send_goal"), format!("{kind}_SendGoal")),
            get_result: (format!("{name}/_action/get_result"), format!("{kind}_GetResult")),
            cancel_goal: format!("{name}/_action/cancel_goal"),
            feedback: (format!("{name}/_action/feedback"), format!("{kind}_FeedbackMessage")),
            status: format!("{name}/_action/status"),
        }
    }
}
