//! What a link reports to its owner.

use crate::firmware::Firmware;
use crate::report::{Message, StatusReport};
use std::time::Duration;

/// What happened.
#[derive(Debug, Clone, PartialEq)]
pub enum LinkEvent<T> {
    /// The oldest line was answered; `error` is the code when it was refused.
    Answer {
        tag: T,
        error: Option<u16>,
    },
    /// Motion is locked. Lines that were not answered may never be.
    Alarm(u16),
    /// The controller (re)started; all lines that were not answered are gone.
    Banner {
        firmware: Firmware,
        text: String,
    },
    Status {
        report: Box<StatusReport>,
        /// The machine was looked at between then and now.
        since: Duration,
    },
    Message(Message),
    Setting {
        number: u16,
        value: String,
    },
    NamedSetting {
        name: String,
        value: String,
    },
    /// Text without meaning here.
    Text(String),
    /// The count of answers can no longer be trusted.
    Fault(LinkFault),
    /// Three status requests in a row were not answered.
    Silent,
}

/// Why the count of answers can no longer be trusted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LinkFault {
    #[error("the controller answered a line that was never sent")]
    UnexpectedAnswer,
    #[error("the controller is idle but {lines} lines have no answer: an answer was lost")]
    LostAnswer { lines: usize },
    #[error(
        "a check among the lines was not answered in its turn: a line or an answer was lost or \
         came twice, or the answer to the check was damaged"
    )]
    OutOfStep,
    #[error(
        "the controller refused a check among the lines (error:{code}): it was damaged on its way"
    )]
    CheckRefused { code: u16 },
    #[error(
        "the controller has read {read:?} where {sent:?} was sent: one of them was damaged on its way"
    )]
    ReadOtherwise { sent: String, read: String },
    #[error("a damaged line was received: {text:?}")]
    Damaged { text: String },
    #[error(
        "the controller holds {held} bytes, {sent} were counted: an answer came twice, or another sender wrote a line"
    )]
    Overfilled { held: usize, sent: usize },
    #[error("the controller holds {held} bytes, at least {sent} were counted: an answer was lost")]
    Underfilled { held: usize, sent: usize },
}
