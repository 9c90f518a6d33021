//! Why something of a store was not done; each names its object.

use std::fmt::Display;

#[derive(Debug, Clone, thiserror::Error)]
pub enum FleetError {
    /// Arguments.
    #[error("{0}")]
    Usage(String),
    #[error("{store}: {object}: {why}")]
    Object { store: String, object: String, why: String },
    #[error("{store}: {object}: the store refuses these credentials or this user: {why}")]
    Denied { store: String, object: String, why: String },
    #[error("{object}: {why}")]
    Table { object: String, why: String },
    #[error("{path}: {why}")]
    File { path: String, why: String },
    /// It may be there again later.
    #[error(
        "{store}: the store does not answer: {why}; mount it or give the right --store, or \
         `kerf fleet push --create` makes one"
    )]
    NoStore { store: String, why: String },
    /// What was to be done is not; each reason has been printed.
    #[error("{0}")]
    NotDone(String),
}

impl FleetError {
    pub fn file(path: &std::path::Path, why: impl Display) -> Self {
        Self::File { path: path.display().to_string(), why: why.to_string() }
    }

    pub fn no_store(store: &str, why: &dyn Display) -> Self {
        Self::NoStore { store: store.to_owned(), why: why.to_string() }
    }

    /// The status of the command: 2 for wrong arguments, else 1.
    pub fn status(&self) -> u8 {
        if matches!(self, Self::Usage(_)) { 2 } else { 1 }
    }
}
