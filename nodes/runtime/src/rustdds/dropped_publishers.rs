//! Keeps publishers that are dropped while the node stops.
//!
//! RustDDS removes a writer as soon as it is dropped, with the samples that are not sent or not
//! acknowledged yet. So the last messages of a node would be lost.
//! The report: docs/upstream/rustdds-writer-drop.md.

use crate::process::lock;
use crate::process::shutdown::Shutdown;
use crate::rustdds::padded::Padded;
use std::sync::{Arc, Mutex};

/// Publishers that live until the node ends; clones share them.
#[derive(Clone)]
pub(crate) struct DroppedPublishers {
    shutdown: Shutdown,
    publishers: Arc<Mutex<Vec<ros2_client::Publisher<Padded>>>>,
}

impl DroppedPublishers {
    pub(crate) fn new(shutdown: Shutdown) -> Self {
        Self { shutdown, publishers: Arc::default() }
    }

    /// Takes a publisher that is no longer used. Drops it at once unless the node is stopping.
    pub(crate) fn keep_while_stopping(&self, publisher: ros2_client::Publisher<Padded>) {
        if self.shutdown.is_requested() {
            lock(&self.publishers).push(publisher);
        }
    }

    /// Drops them all.
    pub(crate) fn clear(&self) {
        lock(&self.publishers).clear();
    }
}
