//! What goes out on a topic.
//!
//! Publishing never waits: when the window of unacknowledged samples is full,
//! the sample is dropped, counted, and reported at most every ten seconds.

use crate::graph::Graph;
use crate::interface::Message;
use crate::wire::Gid;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often drops of one publisher are reported.
const REPORT_PERIOD: Duration = Duration::from_secs(10);

/// A typed publisher; may be shared between threads.
pub struct Publisher<T: Message> {
    inner: ros2_client::Publisher<T>,
    graph: Arc<Graph>,
    drops: Drops,
}

impl<T: Message> Publisher<T> {
    pub(crate) fn new(topic: String, inner: ros2_client::Publisher<T>, graph: Arc<Graph>) -> Self {
        Self { inner, graph, drops: Drops::new(topic) }
    }

    /// Hands a message to the transport, stamped with the wall time; returns
    /// at once. False when it was dropped, which is counted and reported.
    pub fn publish(&self, message: T) -> bool {
        match self.inner.publish(message) {
            Ok(()) => true,
            Err(error) => {
                self.drops.add(&error.to_string());
                false
            }
        }
    }

    /// The absolute name of the topic.
    pub fn topic(&self) -> &str {
        &self.drops.topic
    }

    /// The subscribers that are matched now.
    pub fn subscribers(&self) -> usize {
        self.graph.matches(self.gid())
    }

    /// Waits for a first subscriber; false when `deadline` came first.
    pub async fn wait_for_subscriber(&self, deadline: Duration) -> bool {
        self.graph.wait_for_peers(&[self.gid()], Duration::ZERO, deadline).await
    }

    /// Messages that were dropped, since the start.
    pub fn dropped(&self) -> u64 {
        self.drops.count.load(Ordering::Relaxed)
    }

    /// The endpoint's own address.
    pub fn gid(&self) -> Gid {
        self.inner.guid().into()
    }
}

impl<T: Message> std::fmt::Debug for Publisher<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Publisher").field("topic", &self.drops.topic).finish_non_exhaustive()
    }
}

/// Counts what was dropped, and says so now and then.
#[derive(Debug)]
pub(crate) struct Drops {
    topic: String,
    count: AtomicU64,
    reported: Mutex<Option<Instant>>,
}

impl Drops {
    pub(crate) fn new(topic: String) -> Self {
        Self { topic, count: AtomicU64::new(0), reported: Mutex::new(None) }
    }

    pub(crate) fn add(&self, reason: &str) {
        let count = self.count.fetch_add(1, Ordering::Relaxed) + 1;
        let mut reported = self.reported.lock().unwrap_or_else(PoisonError::into_inner);
        if reported.is_none_or(|at| at.elapsed() >= REPORT_PERIOD) {
            *reported = Some(Instant::now());
            drop(reported);
            tracing::warn!("{}: {count} messages dropped so far: {reason}", self.topic);
        }
    }
}
