//! Sends each answer as soon as the reader of its client has been discovered.

use super::client_readers::ClientReaders;
use super::{Replies, RequestInfo};
use crate::endpoints::graph::Graph;
use crate::process::lock;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::Semaphore;

/// How long an answer waits for a client's reader: as long as discovery may take on a busy computer.
const FOUND_WITHIN: Duration = Duration::from_secs(3);
/// Answers that may wait; a further one is sent at once, even if it is lost.
const WAITING_MAX: usize = 256;

/// Sends each answer as soon as its client can receive it.
#[derive(Clone)]
pub(super) struct Answers {
    replies: Replies,
    graph: Arc<Graph>,
    client_readers: Arc<Mutex<ClientReaders>>,
    room: Arc<Semaphore>,
}

impl Answers {
    pub(super) fn new(replies: Replies, graph: Arc<Graph>) -> Self {
        Self {
            replies,
            graph,
            client_readers: Arc::default(),
            room: Arc::new(Semaphore::new(WAITING_MAX)),
        }
    }

    fn can_receive(&self, to: &RequestInfo) -> bool {
        let matched = self.graph.matched_of(self.replies.gid(), to.writer.participant());
        lock(&self.client_readers).has_reader(to.client, &matched)
    }

    /// Sends an answer, the CDR of a response, now or when the client's reader has been
    /// discovered.
    pub(super) fn send(&self, to: RequestInfo, response: Vec<u8>) {
        if self.can_receive(&to) {
            return self.replies.send(to, &response);
        }
        let Ok(place) = Arc::clone(&self.room).try_acquire_owned() else {
            return self.replies.send(to, &response);
        };
        let answers = self.clone();
        // In a task of its own: other clients do not wait for this one.
        tokio::spawn(async move {
            let mut changes = answers.graph.changes();
            let found = async {
                while !answers.can_receive(&to) {
                    // The sender lives as long as the graph.
                    drop(changes.changed().await);
                }
            };
            if tokio::time::timeout(FOUND_WITHIN, found).await.is_err() {
                lock(&answers.client_readers).give_up(to.client);
            }
            answers.replies.send(to, &response);
            drop(place);
        });
    }
}
