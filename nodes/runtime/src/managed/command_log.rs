//! The `command_log` topic: each request to a node, its sender and the answer.

use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::endpoints::publisher::Publisher;
use crate::samples::gid::Gid;
use crate::samples::qos::Qos;
use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use cnc_msgs::wire::cnc_msgs::msg::Command;
use std::sync::Arc;

/// Longer requests are cut, so that the message stays short.
const REQUEST_BYTES_MAX: usize = 32 * 1024;

/// Publishes each request with its answer; clones share the publisher.
#[derive(Debug, Clone)]
pub struct CommandLog {
    handle: Handle,
    publisher: Arc<Publisher<Command>>,
}

/// The answer to a request.
#[derive(Debug, Clone, Copy)]
pub struct Answer<'a> {
    pub success: bool,
    pub error_code: u16,
    pub message: &'a str,
}

impl CommandLog {
    /// Makes the topic.
    ///
    /// # Errors
    /// DDS refused.
    pub fn new(handle: &Handle) -> Result<Self, NodeError> {
        let publisher = handle.publisher::<Command>("command_log", Qos::EVENTS)?;
        Ok(Self { handle: handle.clone(), publisher: Arc::new(publisher) })
    }

    /// Publishes one request. `endpoint` is the service, action or topic as it
    /// was given to the handle, `endpoint_type` its full type name.
    pub fn record<M: Message>(
        &self,
        endpoint: &str,
        endpoint_type: &str,
        sender: impl Into<Gid>,
        request: &M,
        answer: Answer<'_>,
    ) {
        let mut request = cdr::body(request);
        let request_is_cut = request.len() > REQUEST_BYTES_MAX;
        request.truncate(REQUEST_BYTES_MAX);
        let names = self.handle.names();
        self.publisher.publish(Command {
            stamp: self.handle.now().into(),
            node: names.fully_qualified(),
            endpoint: names.resolve(endpoint).unwrap_or_else(|_| endpoint.to_owned()),
            endpoint_type: endpoint_type.to_owned(),
            sender: sender.into().into(),
            request,
            request_is_cut,
            success: answer.success,
            error_code: answer.error_code,
            message: answer.message.to_owned(),
        });
        if !answer.success {
            tracing::warn!("{endpoint} refused: {}", answer.message);
        }
    }
}
