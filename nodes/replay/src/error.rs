//! Why a bag cannot be replayed.

use cnc_msgs::cdr::CdrError;
use cnc_msgs::chunk::ChunkError;
use cnc_msgs::wire::cnc_msgs::msg::Command;
use run_recorder::bag_reader::{BagError, BagMessage};
use run_recorder::bag_writer::BagWriteError;
use std::fmt::Display;
use std::path::{Path, PathBuf};

#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    #[error(transparent)]
    Bag(#[from] BagError),
    #[error(transparent)]
    Chunk(#[from] ChunkError),
    #[error("{what} of {of} is not in the bag; it cannot be replayed")]
    Incomplete { what: &'static str, of: String },
    #[error("the input of {of} cannot be used: {reason}")]
    Input { of: String, reason: String },
    #[error("{place}: {error}")]
    Content { place: String, error: String },
    #[error(
        "{type_name} was recorded with {recorded}, which cannot be converted to today's definition: {gaps}"
    )]
    Definition { type_name: &'static str, recorded: String, gaps: String },
    #[error("the {level} cannot be replayed: {missing}; {help}")]
    Absent { level: &'static str, missing: String, help: &'static str },
    #[error(
        "{topics} are of one type: the bag holds several machines, and one is replayed; record \
         the topics of one namespace (`ros2 bag record --regex '/cell1/.*'`)"
    )]
    Several { topics: String },
    #[error(
        "the bag is damaged, and may have lost inputs: {0}; `kerf bag recover` copies what \
         can be read"
    )]
    Damaged(String),
    #[error("the bag says it is not complete ({gaps}); the {level} cannot be replayed from it")]
    Gaps { level: &'static str, gaps: String },
    #[error("the bag holds {what}, which the stack level does not play")]
    Unplayable { what: String },
    /// The exit status for the command that played the level.
    #[error("{message}")]
    Stack { status: u8, message: String },
    #[error("the level stack is not available here")]
    NoStack,
    #[error("the bag was not changed: {0}")]
    Update(String),
    #[error("the bag holds neither a plan nor a run; there is nothing to show")]
    NothingToShow,
    #[error("{} already exists and is not overwritten; choose another --out", file.display())]
    OutputTaken { file: PathBuf },
    #[error(
        "{} and {} would both be written to {}; replay them one after the other, each with its \
         own --out",
        one.display(), other.display(), file.display()
    )]
    OutputTwice { file: PathBuf, one: PathBuf, other: PathBuf },
    #[error("the output cannot be written: {0}")]
    Write(#[from] BagWriteError),
}

impl ReplayError {
    /// The error text with the name of the bag, which occurs once.
    pub fn of(&self, bag: &Path) -> String {
        match self {
            // The texts of these errors name their files.
            Self::Bag(_) | Self::OutputTaken { .. } | Self::OutputTwice { .. } => self.to_string(),
            _ => format!("{}: {self}", bag.display()),
        }
    }

    /// An invalid message, with its topic, number and time.
    ///
    /// `number` counts the messages of its topic from 1.
    pub fn content(message: &BagMessage, number: u64, error: impl Display) -> Self {
        let (seconds, rest) =
            (message.log_time_ns / 1_000_000_000, message.log_time_ns % 1_000_000_000);
        let place =
            format!("message {number} of {} at {seconds}.{rest:09} s", message.channel.topic);
        Self::Content { place, error: error.to_string() }
    }

    /// An invalid request in a command, with endpoint and time.
    pub fn request(command: &Command, error: impl Display) -> Self {
        let Command { endpoint, endpoint_type, stamp, .. } = command;
        let place = format!(
            "the request to {endpoint} ({endpoint_type}) on command_log, stamped {}.{:09} s",
            stamp.sec, stamp.nanosec
        );
        Self::Content { place, error: error.to_string() }
    }
}

/// For messages that the cores made just now. Messages from a bag have a place: see
/// [`ReplayError::content`] and [`ReplayError::request`].
impl From<CdrError> for ReplayError {
    fn from(error: CdrError) -> Self {
        Self::Content { place: "a message that was made now".into(), error: error.to_string() }
    }
}
