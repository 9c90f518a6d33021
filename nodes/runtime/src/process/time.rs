//! ROS time.
//!
//! ROS time is the wall clock, or what `/clock` says when `use_sim_time` is
//! set; it may jump. Durations and deadlines are measured on the steady clock
//! (`std::time::Instant`), never on this one.

use cnc_msgs::wire::builtin_interfaces::msg::Time;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// A point in ROS time, in nanoseconds since 1970-01-01 UTC, or since the
/// start of a simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct RosTime(i64);

impl RosTime {
    /// The beginning; what a simulated clock shows before its first message.
    pub const ZERO: Self = Self(0);

    /// From nanoseconds.
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// In nanoseconds.
    pub const fn as_nanos(self) -> i64 {
        self.0
    }

    /// From the two fields of `builtin_interfaces/Time`.
    pub const fn from_parts(sec: i32, nanosec: u32) -> Self {
        Self(sec as i64 * 1_000_000_000 + nanosec as i64)
    }

    /// The fields `sec` and `nanosec` of `builtin_interfaces/Time`; times
    /// after 2038 saturate.
    pub fn parts(self) -> (i32, u32) {
        match i32::try_from(self.0.div_euclid(1_000_000_000)) {
            Ok(sec) => (sec, self.0.rem_euclid(1_000_000_000) as u32),
            Err(_) if self.0 > 0 => (i32::MAX, 999_999_999),
            Err(_) => (i32::MIN, 0),
        }
    }

    /// The time so much earlier.
    #[must_use]
    pub fn before(self, age: Duration) -> Self {
        Self(self.0.saturating_sub(i64::try_from(age.as_nanos()).unwrap_or(i64::MAX)))
    }

    /// The wall clock.
    pub fn wall() -> Self {
        let nanos = match SystemTime::now().duration_since(UNIX_EPOCH) {
            Ok(since) => i64::try_from(since.as_nanos()).unwrap_or(i64::MAX),
            Err(before) => -i64::try_from(before.duration().as_nanos()).unwrap_or(i64::MAX),
        };
        Self(nanos)
    }
}

impl From<RosTime> for Time {
    fn from(time: RosTime) -> Self {
        let (sec, nanosec) = time.parts();
        Self { sec, nanosec }
    }
}

impl From<&Time> for RosTime {
    fn from(time: &Time) -> Self {
        Self::from_parts(time.sec, time.nanosec)
    }
}

/// The node's clock.
#[derive(Debug, Default)]
pub(crate) struct Clock {
    is_simulated: AtomicBool,
    is_followed: AtomicBool,
    simulated: AtomicI64,
}

impl Clock {
    pub(crate) fn now(&self) -> RosTime {
        if self.is_simulated.load(Ordering::Relaxed) {
            RosTime::from_nanos(self.simulated.load(Ordering::Relaxed))
        } else {
            RosTime::wall()
        }
    }

    /// Follows `use_sim_time`. True when `/clock` has to be subscribed: only the first time.
    pub(crate) fn simulate(&self, is_simulated: bool) -> bool {
        self.is_simulated.store(is_simulated, Ordering::Relaxed);
        is_simulated && !self.is_followed.swap(true, Ordering::Relaxed)
    }

    /// Takes over a message of `/clock`.
    pub(crate) fn set(&self, time: RosTime) {
        self.simulated.store(time.as_nanos(), Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_go_to_two_fields_and_back() {
        for nanos in
            [0, 1, 999_999_999, 1_000_000_000, -1, -1_500_000_000, 1_763_683_200_123_456_789]
        {
            let (sec, nanosec) = RosTime(nanos).parts();
            assert!(nanosec < 1_000_000_000);
            assert_eq!(RosTime::from_parts(sec, nanosec), RosTime(nanos));
        }
        assert_eq!(RosTime(i64::MAX).parts(), (i32::MAX, 999_999_999));
        assert_eq!(RosTime(i64::MIN).parts(), (i32::MIN, 0));
    }

    #[test]
    fn a_simulated_clock_stands_at_zero_until_the_first_message() {
        let clock = Clock::default();
        assert!(clock.now() > RosTime::ZERO);
        assert!(clock.simulate(true), "/clock is needed");
        assert_eq!(clock.now(), RosTime::ZERO);
        clock.set(RosTime::from_nanos(42));
        assert_eq!(clock.now(), RosTime::from_nanos(42));
        assert!(!clock.simulate(false));
        assert!(!clock.simulate(true), "/clock is followed already");
        assert!(!clock.simulate(false));
        assert!(clock.now() > RosTime::from_nanos(42));
    }
}
