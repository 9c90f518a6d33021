//! Endpoints one after another, where they have keys.
//!
//! The keys of each two endpoints that meet travel in a message of their own, and of those a
//! participant of the DDS layer keeps 64 that it has not read. What comes in a burst beyond
//! them is lost for good, and the two never hear each other. So a node with many endpoints
//! makes the first few at once, the others when its peers have had time to shake hands with
//! it, and each a little after the one before.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What fits into any burst; enough for a client.
const AT_ONCE: u32 = 32;
/// How long peers may take to shake hands; one to one and a half seconds are usual.
const HANDSHAKE: Duration = Duration::from_secs(3);
/// Between an endpoint and the next.
const GAP: Duration = Duration::from_millis(15);

/// When the next endpoint may be made.
#[derive(Debug)]
pub(crate) struct Pace(Mutex<Plan>);

#[derive(Debug)]
struct Plan {
    made: u32,
    next: Instant,
}

impl Pace {
    /// Of a participant that was made at this time.
    pub(crate) fn new(joined: Instant) -> Self {
        Self(Mutex::new(Plan { made: 0, next: joined + HANDSHAKE }))
    }

    /// Waits until it is time.
    pub(crate) fn wait(&self) {
        let wait = self.0.lock().unwrap_or_else(PoisonError::into_inner).take(Instant::now());
        std::thread::sleep(wait);
    }
}

impl Plan {
    /// How long the next endpoint has to wait.
    fn take(&mut self, now: Instant) -> Duration {
        self.made += 1;
        if self.made <= AT_ONCE {
            return Duration::ZERO;
        }
        let at = self.next.max(now);
        self.next = at + GAP;
        at.saturating_duration_since(now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_does_not_wait_and_a_node_makes_no_burst() {
        let joined = Instant::now();
        let mut plan = Plan { made: 0, next: joined + HANDSHAKE };
        assert!((0..AT_ONCE).all(|_| plan.take(joined).is_zero()));
        assert_eq!(plan.take(joined), HANDSHAKE);
        assert_eq!(plan.take(joined), HANDSHAKE + GAP);
        // Later, one by one, none waits; a burst does.
        let later = joined + 10 * HANDSHAKE;
        assert_eq!(plan.take(later), Duration::ZERO);
        assert_eq!(plan.take(later), GAP);
    }
}
