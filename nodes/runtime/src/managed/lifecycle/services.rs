//! The lifecycle interface of a managed node: five services and a topic, with the names
//! and QoS of rcl.

use super::{Lifecycle, Managed};
use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::endpoints::publisher::Publisher;
use crate::process::lifecycle_states::{
    LifecycleState, STATES, TRANSITIONS, Transition, transitions_from,
};
use crate::process::time::RosTime;
use crate::samples::qos::Qos;
use cnc_msgs::wire::lifecycle_msgs::msg as wire;
use cnc_msgs::wire::lifecycle_msgs::srv;
use std::future::ready;
use std::sync::Arc;

/// The topic that announces changes of state.
pub(super) fn events(node: &Handle) -> Result<Publisher<wire::TransitionEvent>, NodeError> {
    node.publisher("~/transition_event", Qos::DEFAULT)
}

/// Offers the services.
pub(super) fn offer<M: Managed>(
    node: &Handle,
    lifecycle: &Arc<Lifecycle<M>>,
) -> Result<(), NodeError> {
    let shared = Arc::clone(lifecycle);
    node.service::<srv::ChangeState, _, _>("~/change_state", move |request, info| {
        let lifecycle = Arc::clone(&shared);
        async move {
            let wire::Transition { id, label } = request.transition;
            let went = lifecycle.request(id, &label).await;
            if let Err(reason) = &went {
                tracing::warn!("a change of state that {} asked for: {reason}", info.client);
            }
            srv::ChangeStateResponse { success: went.is_ok() }
        }
    })?;
    let handle = node.clone();
    node.service::<srv::GetState, _, _>("~/get_state", move |_, _| {
        let current_state = state(now(&handle));
        ready(srv::GetStateResponse { current_state })
    })?;
    node.service::<srv::GetAvailableStates, _, _>("~/get_available_states", move |_, _| {
        let available_states = STATES.map(state).to_vec();
        ready(srv::GetAvailableStatesResponse { available_states })
    })?;
    let handle = node.clone();
    node.service::<srv::GetAvailableTransitions, _, _>(
        "~/get_available_transitions",
        move |_, _| {
            let available_transitions = transitions_from(now(&handle)).map(description).collect();
            ready(srv::GetAvailableTransitionsResponse { available_transitions })
        },
    )?;
    node.service::<srv::GetAvailableTransitions, _, _>("~/get_transition_graph", move |_, _| {
        let available_transitions = TRANSITIONS.iter().map(description).collect();
        ready(srv::GetAvailableTransitionsResponse { available_transitions })
    })
}

/// The message about a change. rcl leaves time and transition empty; we fill them.
pub(super) fn event(now: RosTime, transition: Transition) -> wire::TransitionEvent {
    let wire::TransitionDescription { transition, start_state, goal_state } =
        description(&transition);
    let timestamp = u64::try_from(now.as_nanos()).unwrap_or(0);
    wire::TransitionEvent { timestamp, transition, start_state, goal_state }
}

fn now(node: &Handle) -> LifecycleState {
    node.lifecycle_state().unwrap_or(LifecycleState::Unknown)
}

fn state(state: LifecycleState) -> wire::State {
    wire::State { id: state.id(), label: state.label().to_owned() }
}

fn description(transition: &Transition) -> wire::TransitionDescription {
    wire::TransitionDescription {
        transition: wire::Transition { id: transition.id, label: transition.label.to_owned() },
        start_state: state(transition.start),
        goal_state: state(transition.goal),
    }
}
