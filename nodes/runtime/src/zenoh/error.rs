//! Why Zenoh does not do what a node needs.

/// What could not be made, and why.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("cannot create {what}: {reason}")]
pub struct ZenohError {
    pub(crate) what: String,
    pub(crate) reason: String,
}

impl ZenohError {
    pub(crate) fn new(what: &str, reason: &dyn std::fmt::Display) -> Self {
        Self { what: what.to_owned(), reason: reason.to_string() }
    }
}
