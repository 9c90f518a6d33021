//! Makes endpoints one after another, with a rate limit.
//!
//! An endpoint is made when the DDS layer has finished with the one before; `dds_threads` says why.
//!
//! With security they are made slowly too. The keys of each pair of endpoints travel in a
//! message of their own, and a participant keeps only 64 such messages unread. Messages of a
//! longer burst are lost for good, and the two endpoints never exchange a message. So a node
//! makes the first endpoints at once. It makes the others after the handshakes with its peers,
//! one at a time.
//! The reports: docs/upstream/rustdds-endpoint-deadlock.md and docs/upstream/rustdds-keep-all.md.

use crate::process::lock;
use crate::rustdds::dds_threads::DdsThreads;
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Endpoints that are made at once; enough for a client.
const BURST_MAX: u32 = 32;
/// How long the handshake with a peer may take; one to one and a half seconds are usual.
const HANDSHAKE: Duration = Duration::from_secs(3);
/// The time between two endpoints.
const GAP: Duration = Duration::from_millis(15);

/// Limits how fast the endpoints of a participant are made.
#[derive(Debug)]
pub(crate) struct EndpointRateLimit {
    threads: DdsThreads,
    /// `None` without security. Locked while an endpoint is made.
    schedule: Mutex<Option<Schedule>>,
}

/// Held while an endpoint is made.
pub(crate) type Turn<'a> = MutexGuard<'a, Option<Schedule>>;

#[derive(Debug)]
pub(crate) struct Schedule {
    made: u32,
    /// When the handshakes with the peers are over.
    settled: Instant,
    next: Instant,
}

impl EndpointRateLimit {
    /// For a participant with these threads that was made just now.
    pub(crate) fn new(threads: DdsThreads, has_keys: bool) -> Self {
        let schedule = has_keys.then(|| Schedule::new(Instant::now()));
        Self { threads, schedule: Mutex::new(schedule) }
    }

    /// Waits until an endpoint may be made.
    pub(crate) fn turn(&self) -> Turn<'_> {
        let mut turn = lock(&self.schedule);
        let wait =
            turn.as_mut().map_or(Some(Duration::ZERO), |schedule| schedule.take(Instant::now()));
        if let Some(wait) = wait {
            std::thread::sleep(wait);
            self.threads.wait_until_idle();
        }
        turn
    }
}

impl Schedule {
    fn new(joined: Instant) -> Self {
        let settled = joined + HANDSHAKE;
        Self { made: 0, settled, next: settled }
    }

    /// How long the next endpoint has to wait; `None`: it is made at once, before the handshakes.
    fn take(&mut self, now: Instant) -> Option<Duration> {
        self.made += 1;
        if self.made <= BURST_MAX {
            return (now >= self.settled).then_some(Duration::ZERO);
        }
        let at = self.next.max(now);
        self.next = at + GAP;
        Some(at.saturating_duration_since(now))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_does_not_wait_and_a_node_makes_no_burst() {
        let joined = Instant::now();
        let mut schedule = Schedule::new(joined);
        assert!((0..BURST_MAX).all(|_| schedule.take(joined).is_none()));
        assert_eq!(schedule.take(joined), Some(HANDSHAKE));
        assert_eq!(schedule.take(joined), Some(HANDSHAKE + GAP));
        // Later a single endpoint does not wait, but a burst does.
        let later = joined + 10 * HANDSHAKE;
        assert_eq!(schedule.take(later), Some(Duration::ZERO));
        assert_eq!(schedule.take(later), Some(GAP));
        // One of the first endpoints that is made late has peers already.
        let mut schedule = Schedule::new(joined);
        assert_eq!(schedule.take(later), Some(Duration::ZERO));
    }
}
