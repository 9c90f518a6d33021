//! Typed publishers.
//!
//! Publishing never waits: when the window of unacknowledged samples is full,
//! the sample is dropped, counted, and reported at most every ten seconds.

use crate::endpoints::graph::Graph;
use crate::endpoints::middleware::Outgoing;
use crate::samples::gid::Gid;
use cnc_msgs::cdr;
use cnc_msgs::interface::Message;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often drops of one publisher are reported.
const REPORT_PERIOD: Duration = Duration::from_secs(10);

/// A typed publisher; may be shared between threads.
pub struct Publisher<T: Message> {
    outgoing: Outgoing,
    graph: Arc<Graph>,
    drops: Drops,
    message: PhantomData<fn(T)>,
}

impl<T: Message> Publisher<T> {
    pub(crate) fn new(topic: String, outgoing: Outgoing, graph: Arc<Graph>) -> Self {
        Self { outgoing, graph, drops: Drops::new(topic), message: PhantomData }
    }

    /// Passes a message to the transport, stamped with the wall time; returns
    /// at once. False when it was dropped, which is counted and reported.
    pub fn publish(&self, message: T) -> bool {
        self.publish_body(&cdr::body(&message))
    }

    fn publish_body(&self, body: &[u8]) -> bool {
        let sent = self.outgoing.publish(body);
        sent.map_err(|reason| self.drops.add(&reason)).is_ok()
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
        self.outgoing.gid()
    }
}

impl<T: Message> std::fmt::Debug for Publisher<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Publisher").field("topic", &self.drops.topic).finish_non_exhaustive()
    }
}

/// Counts dropped samples and reports them with a rate limit.
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
