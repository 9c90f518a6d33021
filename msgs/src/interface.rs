//! What is common to all messages, services and actions.
//!
//! Traits only; the implementations are generated beside the structs in
//! [`crate::wire`], and the schemas lie in [`crate::schema`].

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A struct that is one CDR message.
pub trait Message: Serialize + DeserializeOwned + Clone + Send + Sync + 'static {
    /// `cnc_msgs/msg/Program`, or `cnc_msgs/srv/LoadProgram_Request` for a part
    /// of a service.
    const TYPE_NAME: &'static str;
}

/// A question and its answer.
pub trait Service {
    /// What the client sends.
    type Request: Message;
    /// What the server answers.
    type Response: Message;
    /// `cnc_msgs/srv/LoadProgram`.
    const TYPE_NAME: &'static str;
}

/// Something that takes time, tells how far it is and can be cancelled.
pub trait Action {
    /// What is to be done.
    type Goal: Message;
    /// How it ended.
    type Result: Message;
    /// How far it is.
    type Feedback: Message;
    /// `cnc_msgs/action/RunProgram`.
    const TYPE_NAME: &'static str;
}
