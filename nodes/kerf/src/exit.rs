//! Exit statuses and messages of the command.
//!
//! Each exit status has one meaning, the same for every subcommand that is not a node.

use crate::node_message::with_commands;
use std::process::ExitCode;

/// Why a subcommand failed.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) status: Status,
    /// One sentence for people; empty when everything has been printed already.
    pub(crate) message: String,
}

/// The exit status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Status {
    /// The input was read and rejected.
    Refused = 1,
    /// Arguments, a file that cannot be read, an invalid tool file, profile or bag.
    Usage = 2,
    /// No node answered.
    NoAnswer = 3,
    /// The node refused, or the run was aborted.
    NodeRefused = 4,
}

impl Status {
    /// The status with this number; unknown numbers become a usage error.
    pub(crate) fn of(number: u8) -> Self {
        let all = [Self::Refused, Self::Usage, Self::NoAnswer, Self::NodeRefused];
        all.into_iter().find(|status| *status as u8 == number).unwrap_or(Self::Usage)
    }
}

impl Failure {
    pub(crate) fn new(status: Status, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }

    /// Status 2 with a message.
    pub(crate) fn usage(message: impl std::fmt::Display) -> Self {
        Self::new(Status::Usage, message.to_string())
    }

    /// A node refused, and says why.
    pub(crate) fn of_node(message: &str) -> Self {
        Self::new(Status::NodeRefused, with_commands(message))
    }

    /// Prints the message, if there is one.
    pub(crate) fn say(&self) {
        if !self.message.is_empty() {
            eprintln!("kerf: {}", self.message);
        }
    }

    /// A failure whose message has been printed already.
    pub(crate) fn said(status: Status) -> Self {
        Self::new(status, "")
    }
}

/// The result of a subcommand.
pub(crate) type CommandResult = Result<(), Failure>;

/// What comes of writing to standard output.
pub(crate) fn printed(written: std::io::Result<()>) -> CommandResult {
    written.map_err(|error| Failure::usage(format!("cannot write to standard output: {error}")))
}

/// Prints what has not been printed, and returns the exit code.
pub(crate) fn conclude(outcome: CommandResult) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            failure.say();
            ExitCode::from(failure.status as u8)
        }
    }
}
