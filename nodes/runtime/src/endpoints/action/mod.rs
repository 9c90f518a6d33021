//! Actions: goals that take time, can be watched and canceled.
//!
//! An action is three services and two topics. The table of goals
//! (`goals`, pure) knows the answer to each request, and `persistence` (pure) saves it for the
//! next process; `server` and `client` use it.
//! Written here because the action server of ros2-client
//! blocks when two results wait, forgets results, and answers cancel requests
//! with the wrong codes.

mod client;
mod goals;
mod messages;
mod persistence;
mod server;

pub use client::{ActionClient, ActionFeedback, GoalError, GoalHandle};
pub use goals::GoalOutcome;
pub use server::{ActionServer, Goal, GoalOffer, Unfinished};

/// Names one goal; the client chooses it at random.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct GoalId(pub [u8; 16]);

impl std::fmt::Display for GoalId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (index, byte) in self.0.iter().enumerate() {
            if matches!(index, 4 | 6 | 8 | 10) {
                f.write_str("-")?;
            }
            write!(f, "{byte:02x}")?;
        }
        Ok(())
    }
}

impl std::fmt::Debug for GoalId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Display::fmt(self, f)
    }
}

/// What a server answered to a request to cancel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CancelAnswer {
    /// This many goals are being canceled.
    Canceling(usize),
    /// The server does not cancel this goal.
    Refused,
    /// The server does not know the goal.
    UnknownGoal,
    /// The goal had ended already.
    AlreadyEnded,
}
