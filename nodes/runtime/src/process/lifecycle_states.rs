//! The lifecycle state machine: the states of a managed node and its transitions.
//!
//! Pure. Numbers, labels and their order are those of `lifecycle_msgs` and of the
//! state machine that `rcl_lifecycle` builds, so that tools print the same.

use LifecycleState::{
    Activating, Active, CleaningUp, Configuring, Deactivating, ErrorProcessing, Finalized,
    Inactive, ShuttingDown, Unconfigured, Unknown,
};

/// The state of a node. The first five are lasting; the others are transitional.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum LifecycleState {
    Unknown = 0,
    Unconfigured = 1,
    Inactive = 2,
    Active = 3,
    Finalized = 4,
    Configuring = 10,
    CleaningUp = 11,
    ShuttingDown = 12,
    Activating = 13,
    Deactivating = 14,
    ErrorProcessing = 15,
}

/// All states, in the order in which tools list them.
pub(crate) const STATES: [LifecycleState; 11] = [
    Unknown,
    Unconfigured,
    Inactive,
    Active,
    Finalized,
    Configuring,
    CleaningUp,
    ShuttingDown,
    Activating,
    Deactivating,
    ErrorProcessing,
];

impl LifecycleState {
    /// As in `lifecycle_msgs/msg/State`.
    pub fn id(self) -> u8 {
        self as u8
    }

    /// As `ros2 lifecycle get` shows it.
    pub fn label(self) -> &'static str {
        match self {
            Unknown => "unknown",
            Unconfigured => "unconfigured",
            Inactive => "inactive",
            Active => "active",
            Finalized => "finalized",
            Configuring => "configuring",
            CleaningUp => "cleaningup",
            ShuttingDown => "shuttingdown",
            Activating => "activating",
            Deactivating => "deactivating",
            ErrorProcessing => "errorprocessing",
        }
    }

    /// Whether it is transitional.
    pub(crate) fn is_transitional(self) -> bool {
        self.id() >= Configuring.id()
    }
}

/// A transition from one state to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Transition {
    pub(crate) id: u8,
    pub(crate) label: &'static str,
    pub(crate) start: LifecycleState,
    pub(crate) goal: LifecycleState,
}

/// The outcome of a transition's step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TransitionOutcome {
    Success,
    /// It failed and changed nothing.
    Failure,
    /// It was half done.
    Error,
}

impl TransitionOutcome {
    fn label(self) -> &'static str {
        match self {
            Self::Success => "transition_success",
            Self::Failure => "transition_failure",
            Self::Error => "transition_error",
        }
    }
}

const fn transition(
    id: u8,
    label: &'static str,
    start: LifecycleState,
    goal: LifecycleState,
) -> Transition {
    Transition { id, label, start, goal }
}

/// All transitions, in the order in which tools list them.
pub(crate) const TRANSITIONS: [Transition; 25] = [
    transition(1, "configure", Unconfigured, Configuring),
    transition(10, "transition_success", Configuring, Inactive),
    transition(11, "transition_failure", Configuring, Unconfigured),
    transition(12, "transition_error", Configuring, ErrorProcessing),
    transition(2, "cleanup", Inactive, CleaningUp),
    transition(20, "transition_success", CleaningUp, Unconfigured),
    transition(21, "transition_failure", CleaningUp, Inactive),
    transition(22, "transition_error", CleaningUp, ErrorProcessing),
    transition(3, "activate", Inactive, Activating),
    transition(30, "transition_success", Activating, Active),
    transition(31, "transition_failure", Activating, Inactive),
    transition(32, "transition_error", Activating, ErrorProcessing),
    transition(4, "deactivate", Active, Deactivating),
    transition(40, "transition_success", Deactivating, Inactive),
    transition(41, "transition_failure", Deactivating, Active),
    transition(42, "transition_error", Deactivating, ErrorProcessing),
    transition(5, "shutdown", Unconfigured, ShuttingDown),
    transition(6, "shutdown", Inactive, ShuttingDown),
    transition(7, "shutdown", Active, ShuttingDown),
    transition(50, "transition_success", ShuttingDown, Finalized),
    transition(51, "transition_failure", ShuttingDown, Finalized),
    transition(52, "transition_error", ShuttingDown, ErrorProcessing),
    transition(60, "transition_success", ErrorProcessing, Unconfigured),
    transition(61, "transition_failure", ErrorProcessing, Finalized),
    transition(62, "transition_error", ErrorProcessing, Finalized),
];

/// The transitions that lead away from a state.
pub(crate) fn transitions_from(state: LifecycleState) -> impl Iterator<Item = &'static Transition> {
    TRANSITIONS.iter().filter(move |transition| transition.start == state)
}

/// The transition that a request asks for in this state.
///
/// A label wins over the number: a request by label leaves the number zero.
///
/// # Errors
/// There is none from here; with those that there are.
pub(crate) fn requested(state: LifecycleState, id: u8, label: &str) -> Result<Transition, String> {
    let is_meant = |transition: &&Transition| match label {
        "" => transition.id == id,
        label => transition.label == label,
    };
    // A request cannot set the outcome of a transition.
    let is_transitional = state.is_transitional();
    transitions_from(state).filter(|_| !is_transitional).find(is_meant).copied().ok_or_else(|| {
        let asked = if label.is_empty() { format!("{id}") } else { format!("\"{label}\"") };
        let known: Vec<_> = transitions_from(state)
            .filter(|_| !is_transitional)
            .map(|transition| format!("{} ({})", transition.label, transition.id))
            .collect();
        let known = if known.is_empty() { "nothing".to_owned() } else { known.join(", ") };
        format!("there is no transition {asked} from {}: {known} can be asked for", state.label())
    })
}

/// The transition by which a transitional state is left.
///
/// # Panics
/// The state is not transitional: nothing is under transition.
pub(crate) fn ended(state: LifecycleState, outcome: TransitionOutcome) -> Transition {
    let transition = transitions_from(state).find(|transition| transition.label == outcome.label());
    *transition.unwrap_or_else(|| panic!("nothing is under transition in {}", state.label()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::wire::lifecycle_msgs::msg::{State as Wire, Transition as WireTransition};

    #[test]
    fn every_request_in_every_state_leads_where_rcl_leads() {
        // By number 0 to 99, and by label: what is not listed is refused.
        let table = [
            (Unconfigured, 1, "configure", Configuring),
            (Unconfigured, 5, "shutdown", ShuttingDown),
            (Inactive, 2, "cleanup", CleaningUp),
            (Inactive, 3, "activate", Activating),
            (Inactive, 6, "shutdown", ShuttingDown),
            (Active, 4, "deactivate", Deactivating),
            (Active, 7, "shutdown", ShuttingDown),
        ];
        let labels: Vec<&str> = TRANSITIONS
            .iter()
            .map(|transition| transition.label)
            .chain(["create", "destroy", "x"])
            .collect();
        for state in STATES {
            for id in 0..100 {
                let row = table.iter().find(|row| row.0 == state && row.1 == id);
                let goal = requested(state, id, "").map(|transition| transition.goal);
                assert_eq!(goal.ok(), row.map(|row| row.3), "{state:?} {id}");
            }
            for label in &labels {
                let row = table.iter().find(|row| row.0 == state && row.2 == *label);
                // The number that comes with a label does not count.
                for id in [0, 1, 4, 99] {
                    let transition = requested(state, id, label).ok();
                    assert_eq!(
                        transition.map(|transition| transition.goal),
                        row.map(|row| row.3),
                        "{state:?} {label}"
                    );
                    assert_eq!(
                        transition.map(|transition| transition.id),
                        row.map(|row| row.1),
                        "{state:?} {label}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_was_under_way_ends_where_rcl_ends_it() {
        use TransitionOutcome::{Error, Failure, Success};
        let table = [
            (Configuring, [Inactive, Unconfigured, ErrorProcessing]),
            (CleaningUp, [Unconfigured, Inactive, ErrorProcessing]),
            (Activating, [Active, Inactive, ErrorProcessing]),
            (Deactivating, [Inactive, Active, ErrorProcessing]),
            (ShuttingDown, [Finalized, Finalized, ErrorProcessing]),
            (ErrorProcessing, [Unconfigured, Finalized, Finalized]),
        ];
        for (state, goals) in table {
            for (outcome, goal) in [Success, Failure, Error].into_iter().zip(goals) {
                assert_eq!(ended(state, outcome).goal, goal, "{state:?} {outcome:?}");
            }
        }
        assert_eq!(table.len(), STATES.iter().filter(|state| state.is_transitional()).count());
    }

    #[test]
    fn a_refusal_says_what_can_be_asked_for() {
        let refusal = |state, id, label| requested(state, id, label).expect_err("refused");
        assert_eq!(
            refusal(Active, 3, ""),
            "there is no transition 3 from active: deactivate (4), shutdown (7) can be asked for"
        );
        assert_eq!(
            refusal(Finalized, 0, "configure"),
            "there is no transition \"configure\" from finalized: nothing can be asked for"
        );
    }

    #[test]
    fn numbers_are_those_of_lifecycle_msgs() {
        let states = [
            (Unknown, Wire::PRIMARY_STATE_UNKNOWN),
            (Unconfigured, Wire::PRIMARY_STATE_UNCONFIGURED),
            (Inactive, Wire::PRIMARY_STATE_INACTIVE),
            (Active, Wire::PRIMARY_STATE_ACTIVE),
            (Finalized, Wire::PRIMARY_STATE_FINALIZED),
            (Configuring, Wire::TRANSITION_STATE_CONFIGURING),
            (CleaningUp, Wire::TRANSITION_STATE_CLEANINGUP),
            (ShuttingDown, Wire::TRANSITION_STATE_SHUTTINGDOWN),
            (Activating, Wire::TRANSITION_STATE_ACTIVATING),
            (Deactivating, Wire::TRANSITION_STATE_DEACTIVATING),
            (ErrorProcessing, Wire::TRANSITION_STATE_ERRORPROCESSING),
        ];
        assert_eq!(states.map(|(state, _)| state.id()), states.map(|(_, id)| id));
        assert_eq!(states.map(|(state, _)| state), STATES);
        use WireTransition as W;
        let ids = [
            W::TRANSITION_CONFIGURE,
            W::TRANSITION_ON_CONFIGURE_SUCCESS,
            W::TRANSITION_ON_CONFIGURE_FAILURE,
            W::TRANSITION_ON_CONFIGURE_ERROR,
            W::TRANSITION_CLEANUP,
            W::TRANSITION_ON_CLEANUP_SUCCESS,
            W::TRANSITION_ON_CLEANUP_FAILURE,
            W::TRANSITION_ON_CLEANUP_ERROR,
            W::TRANSITION_ACTIVATE,
            W::TRANSITION_ON_ACTIVATE_SUCCESS,
            W::TRANSITION_ON_ACTIVATE_FAILURE,
            W::TRANSITION_ON_ACTIVATE_ERROR,
            W::TRANSITION_DEACTIVATE,
            W::TRANSITION_ON_DEACTIVATE_SUCCESS,
            W::TRANSITION_ON_DEACTIVATE_FAILURE,
            W::TRANSITION_ON_DEACTIVATE_ERROR,
            W::TRANSITION_UNCONFIGURED_SHUTDOWN,
            W::TRANSITION_INACTIVE_SHUTDOWN,
            W::TRANSITION_ACTIVE_SHUTDOWN,
            W::TRANSITION_ON_SHUTDOWN_SUCCESS,
            W::TRANSITION_ON_SHUTDOWN_FAILURE,
            W::TRANSITION_ON_SHUTDOWN_ERROR,
            W::TRANSITION_ON_ERROR_SUCCESS,
            W::TRANSITION_ON_ERROR_FAILURE,
            W::TRANSITION_ON_ERROR_ERROR,
        ];
        assert_eq!(TRANSITIONS.map(|transition| transition.id), ids);
    }
}
