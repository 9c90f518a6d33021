//! How the command ends.
//!
//! One meaning for each exit status, the same for every subcommand that is not a node.

use std::process::ExitCode;

/// Why a subcommand did not do what it was asked.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) status: Status,
    /// One sentence for people; empty when everything was said already.
    pub(crate) message: String,
}

/// The exit status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Status {
    /// The input was read and refused.
    Refused = 1,
    /// Arguments, a file that cannot be read, an invalid tool file, profile or bag.
    Usage = 2,
    /// No such node answered.
    NoAnswer = 3,
    /// The node refused, or the run aborted.
    NodeRefused = 4,
}

impl Status {
    /// The status with this number; of none of ours, that of a usage error.
    pub(crate) fn of(number: u8) -> Self {
        let all = [Self::Refused, Self::Usage, Self::NoAnswer, Self::NodeRefused];
        all.into_iter().find(|status| *status as u8 == number).unwrap_or(Self::Usage)
    }
}

impl Failure {
    pub(crate) fn new(status: Status, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }

    /// Status 2 with a sentence.
    pub(crate) fn usage(message: impl std::fmt::Display) -> Self {
        Self::new(Status::Usage, message.to_string())
    }

    /// Says what is left to say.
    pub(crate) fn say(&self) {
        if !self.message.is_empty() {
            eprintln!("kerf: {}", self.message);
        }
    }

    /// A failure about which everything was said.
    pub(crate) fn said(status: Status) -> Self {
        Self::new(status, "")
    }
}

/// How a subcommand ends.
pub(crate) type Outcome = Result<(), Failure>;

/// Says what is left to say, and gives the exit code.
pub(crate) fn conclude(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            failure.say();
            ExitCode::from(failure.status as u8)
        }
    }
}
