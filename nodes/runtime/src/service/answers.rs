//! Sends answers, each as soon as its client can hear it.

use super::hearing::Hearing;
use super::{Replies, RequestInfo};
use crate::graph::Graph;
use crate::interface::Service;
use crate::node::lock;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::Semaphore;

/// How long an answer waits for a client that was not found yet.
const FOUND_WITHIN: Duration = Duration::from_millis(500);
/// Answers that may wait so; one more is sent at once, whether it is heard or not.
const WAITING_MAX: usize = 256;

/// Where answers go out, each as soon as its client can hear it.
pub(super) struct Answers<S: Service> {
    replies: Replies<S>,
    graph: Arc<Graph>,
    hearing: Arc<Mutex<Hearing>>,
    room: Arc<Semaphore>,
}

impl<S: Service> Clone for Answers<S> {
    fn clone(&self) -> Self {
        Self {
            replies: self.replies.clone(),
            graph: Arc::clone(&self.graph),
            hearing: Arc::clone(&self.hearing),
            room: Arc::clone(&self.room),
        }
    }
}

impl<S: Service + 'static> Answers<S> {
    pub(super) fn new(replies: Replies<S>, graph: Arc<Graph>) -> Self {
        Self {
            replies,
            graph,
            hearing: Arc::default(),
            room: Arc::new(Semaphore::new(WAITING_MAX)),
        }
    }

    fn can_hear(&self, to: &RequestInfo) -> bool {
        let matched = self.graph.matched_of(self.replies.gid(), to.writer.participant());
        lock(&self.hearing).can_hear(to.client, &matched)
    }

    /// Sends an answer now, or when its client was found.
    pub(super) fn send(&self, to: RequestInfo, response: S::Response) {
        if self.can_hear(&to) {
            return self.replies.send(to, response);
        }
        let Ok(place) = Arc::clone(&self.room).try_acquire_owned() else {
            return self.replies.send(to, response);
        };
        let answers = self.clone();
        // By itself: others do not wait for a client that has just come.
        tokio::spawn(async move {
            let mut changes = answers.graph.changes();
            let found = async {
                while !answers.can_hear(&to) {
                    // The sender lives as long as the graph.
                    drop(changes.changed().await);
                }
            };
            if tokio::time::timeout(FOUND_WITHIN, found).await.is_err() {
                lock(&answers.hearing).give_up(to.client);
            }
            answers.replies.send(to, response);
            drop(place);
        });
    }
}
