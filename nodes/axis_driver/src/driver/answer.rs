//! The answer to a command: what was done, or why it was refused.

use serde::{Deserialize, Serialize};

/// Why a command was not followed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[error("{message}")]
pub struct Refusal {
    /// See [`error_code`](crate::codes::error_code).
    pub error_code: u16,
    pub message: String,
}

impl Refusal {
    pub(super) fn new(error_code: u16, message: impl Into<String>) -> Self {
        Self { error_code, message: message.into() }
    }
}

/// What to answer now; `None` when the answer comes later.
pub(super) type Answer = Option<Result<String, Refusal>>;

pub(super) fn done(text: &str) -> Answer {
    Some(Ok(text.to_owned()))
}

pub(super) fn refused(code: u16, text: impl Into<String>) -> Answer {
    Some(Err(Refusal::new(code, text)))
}
