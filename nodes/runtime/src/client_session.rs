//! A short-lived node for a command that calls services and exits.

use crate::command_line::configuration::{Configuration, ConfigurationError};
use crate::endpoints::error::NodeError;
use crate::session::Session;

/// Why there is no such node.
#[derive(Debug, thiserror::Error)]
pub enum ClientSessionError {
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    #[error(transparent)]
    Node(#[from] NodeError),
    #[error("argument \"{0}\" is not known; arguments for ROS follow --ros-args")]
    Argument(String),
}

/// Starts a node of this name with the environment of the process; `words`
/// are its arguments. Needs a tokio runtime; nothing is logged.
///
/// # Errors
/// Arguments or environment are wrong, or DDS refused.
pub fn client_session(name: &str, words: &[String]) -> Result<Session, ClientSessionError> {
    let variables = std::env::vars_os()
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
        .collect();
    // Settings for the nodes of the machine do not apply to a command.
    let configuration = Configuration::read(name, Vec::new(), words, &variables)?;
    if let Some(word) = configuration.rest.first() {
        return Err(ClientSessionError::Argument(word.clone()));
    }
    Ok(Session::start_as_command(configuration)?)
}
