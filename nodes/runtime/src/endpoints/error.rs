//! Why a node or an endpoint cannot be created.

use crate::command_line::names::NameError;

/// Why a node or an endpoint cannot be created.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    #[error(transparent)]
    Name(#[from] NameError),
    /// The middleware refused.
    #[error("cannot create {what}: {reason}")]
    Create { what: String, reason: String },
    /// The node is being taken down.
    #[error("cannot create {what}: the node is stopping")]
    Stopping { what: String },
}

#[cfg(feature = "zenoh")]
impl From<crate::zenoh::error::ZenohError> for NodeError {
    fn from(error: crate::zenoh::error::ZenohError) -> Self {
        Self::Create { what: error.what, reason: error.reason }
    }
}

pub(crate) fn failed(what: &str, reason: &dyn std::fmt::Display) -> NodeError {
    NodeError::Create { what: what.to_owned(), reason: reason.to_string() }
}
