//! Sends long data over DDS in chunks: on a topic at a limited rate, and by service
//! as fast as the client asks.
//!
//! [`cnc_msgs::chunk`] defines what a chunk is; this file only transports them.

use crate::endpoints::client::{ANSWER_WITHIN, CallError, Client};
use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::samples::qos::Qos;
use cnc_msgs::cdr;
use cnc_msgs::chunk::{Chunk, ChunkError, Collector, MESSAGE_BYTES_MAX};
use cnc_msgs::interface::{Message, Service};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;

/// Time between two chunks on a topic: a reader that died holds at most 8192
/// of them before its lease ends, and no other reader is slowed.
const CHUNK_PERIOD: Duration = Duration::from_millis(10);
/// Bytes of a service reply that are not chunks, at most.
const ENVELOPE_BYTES: usize = 4_000;

/// Makes the chunk with a number; `None` after the last.
pub type Cut<C> = Arc<dyn Fn(u32) -> Option<C> + Send + Sync>;

/// A topic that publishes the chunks of the newest data.
pub struct ChunkTopic<C> {
    newest: watch::Sender<Option<Cut<C>>>,
}

impl<C> std::fmt::Debug for ChunkTopic<C> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ChunkTopic").finish_non_exhaustive()
    }
}

impl<C: Message> ChunkTopic<C> {
    /// Makes the topic; nothing is published yet.
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn new(handle: &Handle, topic: &str) -> Result<Self, NodeError> {
        let publisher = handle.publisher::<C>(topic, Qos::EVENTS)?;
        let (newest, mut changes) = watch::channel(None::<Cut<C>>);
        handle.spawn(topic, async move {
            while changes.changed().await.is_ok() {
                let Some(cut) = changes.borrow_and_update().clone() else { continue };
                let mut index = 0;
                while let Some(chunk) = cut(index) {
                    publisher.publish(chunk);
                    index += 1;
                    tokio::time::sleep(CHUNK_PERIOD).await;
                    // Newer data replaces this; the rest of it is not sent.
                    if changes.has_changed().unwrap_or(true) {
                        break;
                    }
                }
            }
        });
        Ok(Self { newest })
    }

    /// Publishes the chunks of this data; stops publishing the data before it.
    pub fn send(&self, cut: Cut<C>) {
        self.newest.send_replace(Some(cut));
    }
}

/// The chunks from `first` on that fit one message; at least one if there is one.
pub fn page<C: Message>(first: u32, cut: &Cut<C>) -> Vec<C> {
    let mut chunks = Vec::new();
    let mut bytes = ENVELOPE_BYTES;
    for index in first..=u32::MAX {
        let Some(chunk) = cut(index) else { break };
        bytes += cdr::body(&chunk).len();
        if bytes > MESSAGE_BYTES_MAX && !chunks.is_empty() {
            break;
        }
        chunks.push(chunk);
    }
    chunks
}

/// Why the chunks could not be fetched.
#[derive(Debug, thiserror::Error)]
pub enum PullError {
    #[error(transparent)]
    Call(#[from] CallError),
    #[error(transparent)]
    Chunk(#[from] ChunkError),
    /// The other node refused.
    #[error("{service} refused: {message}")]
    Refused { service: String, message: String },
    #[error("{service} answered without chunk {index}")]
    NoProgress { service: String, index: u32 },
}

/// Fetches all chunks that are missing.
///
/// `request` makes a request for the chunks from a number on; `chunks` takes
/// the chunks out of the answer, or the reason why it has none.
///
/// # Errors
/// The service does not answer or refuses, or its chunks are not the announced ones.
pub async fn pull<S: Service + 'static, C: Chunk>(
    client: &Client<S>,
    collector: &mut Collector<C>,
    request: impl Fn(u32) -> S::Request,
    chunks: impl Fn(S::Response) -> Result<Vec<C>, String>,
) -> Result<(), PullError> {
    while let Some(first) = collector.missing() {
        let response = client.call_idempotent(&request(first), ANSWER_WITHIN).await?;
        let service = || client.name().to_owned();
        let chunks = chunks(response)
            .map_err(|message| PullError::Refused { service: service(), message })?;
        for chunk in chunks {
            collector.add(chunk)?;
        }
        if collector.missing() == Some(first) {
            return Err(PullError::NoProgress { service: service(), index: first });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::wire::cnc_msgs::msg::ProgramChunk;

    #[test]
    fn whatever_chunk_is_asked_for_there_is_an_answer() {
        let cut: Cut<ProgramChunk> =
            Arc::new(|index| (index < 3).then(|| ProgramChunk { index, ..Default::default() }));
        for (first, count) in [(0, 3), (2, 1), (3, 0), (u32::MAX, 0)] {
            assert_eq!(page(first, &cut).len(), count, "{first}");
        }
    }
}
