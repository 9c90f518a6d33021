//! The journal on its way out: in batches on a topic, and by service for whoever missed
//! some.

use crate::journal::{Entry, Ring, kind_to_wire};
use cnc_msgs::wire::builtin_interfaces::msg::{Duration as WireDuration, Time};
use cnc_msgs::wire::cnc_msgs::msg::{ControllerTraffic, TrafficEntry};
use cnc_msgs::wire::cnc_msgs::srv::{GetTrafficRequest, GetTrafficResponse};
use runtime::{Publisher, RosTime};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What the entries of one message may take, bytes.
const MESSAGE_BYTES_MAX: usize = 48_000;
/// Overhead per entry, bytes.
const ENTRY_BYTES: usize = 48;

/// Where entries go; clones share the ring.
#[derive(Debug, Clone)]
pub(super) struct Traffic {
    ring: Arc<Mutex<Ring>>,
    publisher: Arc<Publisher<ControllerTraffic>>,
    /// Wall time of the zero of the driver's clock, ns since the epoch.
    zero_ns: i64,
    /// Entries before this one have gone out already.
    publish_from: u64,
}

impl Traffic {
    /// `zero` is the wall time at which the driver's clock showed zero; what comes before
    /// `publish_from` is kept, and not published again.
    pub(super) fn new(
        publisher: Publisher<ControllerTraffic>,
        zero: RosTime,
        publish_from: u64,
    ) -> Self {
        let (ring, publisher) = (Arc::default(), Arc::new(publisher));
        Self { ring, publisher, zero_ns: zero.as_nanos(), publish_from }
    }

    fn ring(&self) -> MutexGuard<'_, Ring> {
        self.ring.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps a batch and publishes it; the number of the newest entry that went out.
    pub(super) fn push(&self, batch: Vec<Entry>) -> Option<u64> {
        let newest = batch.last().map(|entry| entry.sequence);
        let mut messages = vec![ControllerTraffic::default()];
        let mut bytes = 0;
        let mut ring = self.ring();
        for entry in batch {
            ring.push(&entry);
            if entry.sequence < self.publish_from {
                continue;
            }
            let entry = self.message(entry);
            let size = ENTRY_BYTES + entry.data.len();
            if bytes + size > MESSAGE_BYTES_MAX && bytes > 0 {
                messages.push(ControllerTraffic::default());
                bytes = 0;
            }
            bytes += size;
            if let Some(message) = messages.last_mut() {
                message.entries.push(entry);
            }
        }
        drop(ring);
        for message in messages.into_iter().filter(|message| !message.entries.is_empty()) {
            self.publisher.publish(message);
        }
        newest.filter(|newest| *newest >= self.publish_from)
    }

    fn message(&self, entry: Entry) -> TrafficEntry {
        let monotonic_ns = i64::try_from(entry.monotonic_ns).unwrap_or(i64::MAX);
        let (sec, nanosec) = RosTime::from_nanos(self.zero_ns.saturating_add(monotonic_ns)).parts();
        let (monotonic_sec, monotonic_nanosec) = RosTime::from_nanos(monotonic_ns).parts();
        TrafficEntry {
            sequence: entry.sequence,
            kind: kind_to_wire(entry.kind),
            stamp: Time { sec, nanosec },
            monotonic: WireDuration { sec: monotonic_sec, nanosec: monotonic_nanosec },
            data: entry.data,
        }
    }

    /// Answers `get_traffic`.
    pub(super) fn answer(&self, request: &GetTrafficRequest) -> GetTrafficResponse {
        type W = GetTrafficResponse;
        let ring = self.ring();
        let (oldest, newest) = (ring.oldest(), ring.newest());
        let mut response =
            GetTrafficResponse { oldest_sequence: oldest, newest_sequence: newest, ..W::default() };
        let first = match request.first_sequence {
            0 => ring.checkpoint().max(1),
            first => first,
        };
        if first < oldest {
            response.error_code = W::TOO_OLD;
            response.message = format!("entry {first} is no longer kept; the oldest is {oldest}");
            return response;
        }
        response.success = true;
        let mut bytes = 0;
        for entry in ring.from(first) {
            bytes += ENTRY_BYTES + entry.data.len();
            if bytes > MESSAGE_BYTES_MAX && !response.entries.is_empty() {
                break;
            }
            response.entries.push(self.message(entry));
        }
        response
    }
}
