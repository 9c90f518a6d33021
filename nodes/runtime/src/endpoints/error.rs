//! Why a node or an endpoint cannot be created.

use crate::command_line::names::NameError;

/// Why a node or an endpoint cannot be created.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    #[error(transparent)]
    Name(#[from] NameError),
    /// The DDS layer refused.
    #[error("cannot create {what}: {reason}")]
    Create { what: String, reason: String },
    /// The node is being taken down.
    #[error("cannot create {what}: the node is stopping")]
    Stopping { what: String },
}

pub(crate) fn failed(what: &str, reason: &dyn std::fmt::Display) -> NodeError {
    NodeError::Create { what: what.to_owned(), reason: reason.to_string() }
}
