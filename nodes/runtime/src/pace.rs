//! Endpoints one after another.
//!
//! One is made when the DDS layer has done with the one before; `dds_threads` says why, and
//! docs/upstream/rustdds-endpoint-deadlock.md to those who can mend it.
//!
//! Where they have keys, they are made slowly too: the keys of each two endpoints that meet
//! travel in a message of their own, and of those a participant of the DDS layer keeps 64 that
//! it has not read. What comes in a burst beyond them is lost for good, and the two never hear
//! each other. So a node with many endpoints makes the first few at once, the others when its
//! peers have had time to shake hands with it, and each a little after the one before.

use crate::dds_threads::DdsThreads;
use crate::node::lock;
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// What fits into any burst; enough for a client.
const AT_ONCE: u32 = 32;
/// How long peers may take to shake hands; one to one and a half seconds are usual.
const HANDSHAKE: Duration = Duration::from_secs(3);
/// Between an endpoint and the next.
const GAP: Duration = Duration::from_millis(15);

/// Whose turn it is to make an endpoint of a participant.
#[derive(Debug)]
pub(crate) struct Pace {
    threads: DdsThreads,
    /// With keys. Held while an endpoint is made.
    plan: Mutex<Option<Plan>>,
}

/// Held by who makes an endpoint, until it is made.
pub(crate) type Turn<'a> = MutexGuard<'a, Option<Plan>>;

#[derive(Debug)]
pub(crate) struct Plan {
    made: u32,
    /// When the peers have shaken hands.
    settled: Instant,
    next: Instant,
}

impl Pace {
    /// Of the participant that has these threads, and was made just now.
    pub(crate) fn new(threads: DdsThreads, has_keys: bool) -> Self {
        let plan = has_keys.then(|| Plan::new(Instant::now()));
        Self { threads, plan: Mutex::new(plan) }
    }

    /// Waits until it is time for an endpoint.
    pub(crate) fn turn(&self) -> Turn<'_> {
        let mut turn = lock(&self.plan);
        let wait = turn.as_mut().map_or(Some(Duration::ZERO), |plan| plan.take(Instant::now()));
        if let Some(wait) = wait {
            std::thread::sleep(wait);
            self.threads.wait_for_rest();
        }
        turn
    }
}

impl Plan {
    fn new(joined: Instant) -> Self {
        let settled = joined + HANDSHAKE;
        Self { made: 0, settled, next: settled }
    }

    /// How long the next endpoint has to wait; `None` for one that is made at once: nothing is
    /// known of the peers yet, and what is made while they shake hands may miss its keys.
    fn take(&mut self, now: Instant) -> Option<Duration> {
        self.made += 1;
        if self.made <= AT_ONCE {
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
        let mut plan = Plan::new(joined);
        assert!((0..AT_ONCE).all(|_| plan.take(joined).is_none()));
        assert_eq!(plan.take(joined), Some(HANDSHAKE));
        assert_eq!(plan.take(joined), Some(HANDSHAKE + GAP));
        // Later, one by one, none waits; a burst does.
        let later = joined + 10 * HANDSHAKE;
        assert_eq!(plan.take(later), Some(Duration::ZERO));
        assert_eq!(plan.take(later), Some(GAP));
        // One of the first few that is made late has peers already.
        let mut plan = Plan::new(joined);
        assert_eq!(plan.take(later), Some(Duration::ZERO));
    }
}
