//! What is common to all messages, services and actions.
//!
//! Traits only; the implementations are generated with the structs in
//! [`crate::wire`], and the schemas are in [`crate::schema`].

use crate::cdr::Cdr;

/// A struct that is one CDR message.
pub trait Message: Cdr + Clone + Send + Sync + 'static {
    /// `cnc_msgs/msg/Program`, or `cnc_msgs/srv/LoadProgram_Request` for a part
    /// of a service.
    const TYPE_NAME: &'static str;
}

/// A request and its response.
pub trait Service {
    /// What the client sends.
    type Request: Message;
    /// What the server answers.
    type Response: Message;
    /// `cnc_msgs/srv/LoadProgram`.
    const TYPE_NAME: &'static str;
}

/// A task that takes time, reports progress and can be canceled.
pub trait Action {
    /// The task.
    type Goal: Message;
    /// How it ended.
    type Result: Message;
    /// The progress.
    type Feedback: Message;
    /// `cnc_msgs/action/RunProgram`.
    const TYPE_NAME: &'static str;
}
