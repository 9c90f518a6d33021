//! What a message, a service and an action are.
//!
//! The structs are generated in `cnc_msgs`; these traits tie each to its ROS name.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A struct that travels.
pub trait Message: Serialize + DeserializeOwned + Clone + Send + Sync + 'static {
    /// `package/msg/Type`.
    const TYPE_NAME: &'static str;
}

/// A question and its answer.
pub trait Service {
    /// What the client sends.
    type Request: Message;
    /// What the server answers.
    type Response: Message;
    /// `package/srv/Type`.
    const TYPE_NAME: &'static str;
}

/// Something that takes time, can be watched and canceled.
pub trait Action {
    /// What is to be done.
    type Goal: Message;
    /// How it ended.
    type Result: Message;
    /// How far it is.
    type Feedback: Message;
    /// `package/action/Type`.
    const TYPE_NAME: &'static str;
}
