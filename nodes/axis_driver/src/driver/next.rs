//! Where the driver goes when a phase has ended.
//!
//! Only phases in which nothing is under way are here. So one phase never names another:
//! each returns this, and `transition.rs` makes the transition.

/// A phase in which nothing is under way.
#[derive(Debug, PartialEq)]
pub(super) enum Next {
    /// Waits for commands.
    Ready,
    /// Which lines the controller has still to answer is unknown: only a soft reset helps.
    Adrift { reason: String },
    /// There is no port.
    Closed { reason: String },
}

impl Next {
    pub(super) fn adrift(reason: impl Into<String>) -> Self {
        Self::Adrift { reason: reason.into() }
    }
}
