//! The watchdog and restart policy: when a child counts as silent, and when it is restarted.
//!
//! Pure: gets the time and the child's messages. Time in which the supervisor itself did not run
//! (it was stopped, or the computer is overloaded) does not count as silence of the child.

use super::mailbox::Notices;
use std::time::{Duration, Instant};

/// The most that counts as silence between two looks of the supervisor.
const COUNTED_MAX: Duration = Duration::from_millis(500);

/// The limits of the watchdog and the restart delays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// The longest silence of a child that was ready; the child learns it as `WATCHDOG_USEC`.
    pub silence_max: Duration,
    /// The longest that a child takes from its start to `READY=1`.
    pub start_max: Duration,
    /// The longest that a child takes from `STOPPING=1` to its end.
    pub stop_max: Duration,
    /// The delay before a child that ended soon is restarted; it doubles each time.
    pub pause_min: Duration,
    /// The longest such delay.
    pub pause_max: Duration,
    /// A child that was ready and lived this long is restarted at once when it ends.
    pub settled_after: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            silence_max: Duration::from_secs(5),
            start_max: Duration::from_secs(60),
            // A machine may have to be stopped, a bag to be closed: a node takes 30 s at most.
            stop_max: Duration::from_secs(45),
            pause_min: Duration::from_millis(250),
            pause_max: Duration::from_secs(10),
            settled_after: Duration::from_secs(5),
        }
    }
}

/// The state of one child.
#[derive(Debug)]
pub(super) struct RestartPolicy {
    limits: Limits,
    phase: Phase,
    /// Silence so far.
    silence: Duration,
    looked: Instant,
    started: Instant,
    /// The next pause, unless the child settles.
    pause: Duration,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Starting,
    Ready,
    /// It is shutting down.
    Stopping,
}

impl RestartPolicy {
    pub(super) fn new(limits: Limits, now: Instant) -> Self {
        Self {
            limits,
            phase: Phase::Starting,
            silence: Duration::ZERO,
            looked: now,
            started: now,
            pause: Duration::ZERO,
        }
    }

    /// A child was started, the first one or another.
    pub(super) fn started(&mut self, now: Instant) {
        (self.phase, self.silence) = (Phase::Starting, Duration::ZERO);
        (self.looked, self.started) = (now, now);
    }

    /// Takes the messages since the last call; true when the child has just become ready.
    pub(super) fn take_notices(&mut self, notices: Notices, now: Instant) -> bool {
        self.silence += now.saturating_duration_since(self.looked).min(COUNTED_MAX);
        self.looked = now;
        // A shutdown is limited in time, even if the child sends messages.
        let is_sign = notices.alive || notices.ready || notices.stopping;
        if is_sign && self.phase != Phase::Stopping {
            self.silence = Duration::ZERO;
        }
        let becomes_ready = notices.ready && self.phase == Phase::Starting;
        if becomes_ready {
            self.phase = Phase::Ready;
        }
        if notices.stopping {
            self.phase = Phase::Stopping;
        }
        becomes_ready
    }

    /// How long the child has been silent, when that is too long.
    pub(super) fn silent_for(&self) -> Option<Duration> {
        let limit = match self.phase {
            Phase::Starting => self.limits.start_max,
            Phase::Ready => self.limits.silence_max,
            Phase::Stopping => self.limits.stop_max,
        };
        (self.silence > limit).then_some(self.silence)
    }

    pub(super) fn is_ready(&self) -> bool {
        self.phase == Phase::Ready
    }

    /// The child ended or could not be started: the delay until the next start.
    pub(super) fn pause(&mut self, now: Instant) -> Duration {
        let lived = now.saturating_duration_since(self.started);
        let has_settled = self.phase != Phase::Starting && lived >= self.limits.settled_after;
        if has_settled {
            self.pause = Duration::ZERO;
        }
        let pause = self.pause;
        self.pause = (2 * pause).clamp(self.limits.pause_min, self.limits.pause_max);
        pause
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        silence_max: Duration::from_secs(5),
        start_max: Duration::from_secs(30),
        stop_max: Duration::from_secs(40),
        pause_min: Duration::from_millis(250),
        pause_max: Duration::from_secs(2),
        settled_after: Duration::from_secs(5),
    };
    const NOTHING: Notices = Notices { ready: false, alive: false, stopping: false };
    const READY: Notices = Notices { ready: true, ..NOTHING };
    const ALIVE: Notices = Notices { alive: true, ..NOTHING };
    const STOPPING: Notices = Notices { stopping: true, ..NOTHING };

    /// Takes the same notices every 100 ms for so long.
    fn look(policy: &mut RestartPolicy, now: &mut Instant, seconds: f64, notices: Notices) {
        for _ in 0..(seconds * 10.0).round() as usize {
            *now += Duration::from_millis(100);
            policy.take_notices(notices, *now);
        }
    }

    #[test]
    fn a_child_that_was_ready_may_be_silent_for_so_long_and_no_longer() {
        let mut now = Instant::now();
        let mut policy = RestartPolicy::new(LIMITS, now);
        assert!(policy.take_notices(READY, now) && policy.is_ready());
        look(&mut policy, &mut now, 60.0, ALIVE);
        assert_eq!(policy.silent_for(), None);
        look(&mut policy, &mut now, 5.0, NOTHING);
        assert_eq!(policy.silent_for(), None);
        look(&mut policy, &mut now, 0.1, NOTHING);
        assert_eq!(policy.silent_for(), Some(Duration::from_millis(5_100)));
    }

    #[test]
    fn a_child_that_starts_has_longer() {
        let mut now = Instant::now();
        let mut policy = RestartPolicy::new(LIMITS, now);
        look(&mut policy, &mut now, 30.0, NOTHING);
        assert_eq!(policy.silent_for(), None);
        look(&mut policy, &mut now, 0.1, NOTHING);
        assert!(policy.silent_for().is_some());
    }

    #[test]
    fn a_minute_in_which_the_supervisor_was_stopped_is_no_silence() {
        let mut now = Instant::now();
        let mut policy = RestartPolicy::new(LIMITS, now);
        policy.take_notices(READY, now);
        look(&mut policy, &mut now, 4.0, NOTHING);
        now += Duration::from_secs(60);
        policy.take_notices(NOTHING, now);
        assert_eq!(policy.silent_for(), None);
        look(&mut policy, &mut now, 0.6, NOTHING);
        assert!(policy.silent_for().is_some(), "the child really is silent");
    }

    #[test]
    fn a_child_that_ends_in_its_own_order_has_its_time_for_it() {
        let mut now = Instant::now();
        let mut policy = RestartPolicy::new(LIMITS, now);
        policy.take_notices(READY, now);
        policy.take_notices(STOPPING, now);
        look(&mut policy, &mut now, 40.0, ALIVE);
        assert_eq!(policy.silent_for(), None);
        look(&mut policy, &mut now, 0.1, ALIVE);
        assert!(policy.silent_for().is_some());
    }

    #[test]
    fn pauses_double_until_a_child_settles() {
        let mut now = Instant::now();
        let mut policy = RestartPolicy::new(LIMITS, now);
        let mut pauses = Vec::new();
        for _ in 0..6 {
            now += Duration::from_secs(1);
            pauses.push(policy.pause(now).as_millis());
            policy.started(now);
        }
        assert_eq!(pauses, [0, 250, 500, 1_000, 2_000, 2_000]);
        // One that never was ready has not settled.
        now += Duration::from_secs(60);
        assert_eq!(policy.pause(now).as_millis(), 2_000);
        policy.started(now);
        policy.take_notices(READY, now);
        now += Duration::from_secs(60);
        assert_eq!(policy.pause(now).as_millis(), 0);
        policy.started(now);
        assert_eq!(policy.pause(now).as_millis(), 250);
    }
}
