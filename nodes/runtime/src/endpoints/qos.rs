//! QoS profiles, by the purpose of a topic.
//!
//! Knows the ROS 2 defaults and their DDS settings. The code that makes a topic chooses
//! its profile.
//!
//! Publishers never wait for room: a full window is an error at once
//! (`max_blocking_time` zero). Subscriptions always have an explicit depth,
//! because the reader acknowledges a sample before it is taken: samples that do not
//! fit are lost silently, even when reliable, even with "keep all".

use ros2_client::QosProfile;
use ros2_client::qos::{Durability, History, WhenFull};

/// How a topic is carried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Qos {
    /// Lost samples are sent again.
    pub reliable: bool,
    /// Late joiners get the last `depth` samples.
    pub transient_local: bool,
    /// Samples kept, on the sender for repair and late joiners, on the
    /// receiver until they are taken.
    pub depth: usize,
}

impl Qos {
    /// The ROS 2 default: reliable, volatile, the last ten.
    pub const DEFAULT: Self = Self { reliable: true, transient_local: false, depth: 10 };
    /// A value that stays true until the next one: reliable, transient local, one.
    ///
    /// A publisher that had no reader yet hands all its earlier samples to the
    /// first one, so the receiver takes the newest by stamp or sequence number.
    pub const LATCHED: Self = Self { reliable: true, transient_local: true, depth: 1 };
    /// Cyclic state that is soon replaced: best effort, volatile, five.
    pub const SENSOR: Self = Self { reliable: false, transient_local: false, depth: 5 };
    /// `/clock`: only the newest counts.
    pub const CLOCK: Self = Self { reliable: false, transient_local: false, depth: 1 };
    /// Requests and replies of services: reliable, volatile, a hundred waiting.
    pub const SERVICES: Self = Self { reliable: true, transient_local: false, depth: 100 };
    /// `/parameter_events` and other streams that must not lose samples.
    pub const EVENTS: Self = Self { reliable: true, transient_local: false, depth: 1000 };
    /// `/rosout`: reliable, transient local, a thousand.
    pub const ROSOUT: Self = Self { reliable: true, transient_local: true, depth: 1000 };

    /// The same with another depth; at least one.
    pub const fn with_depth(mut self, depth: usize) -> Self {
        self.depth = if depth == 0 { 1 } else { depth };
        self
    }

    /// As ros2-client writes it.
    pub(crate) fn profile(self) -> QosProfile {
        let profile = QosProfile::subscription_default()
            .history(History::KeepLast { depth: self.depth.clamp(1, i32::MAX as usize) })
            .durability(if self.transient_local {
                Durability::TransientLocal
            } else {
                Durability::Volatile
            });
        if self.reliable {
            profile.reliability_reliable(WhenFull::Fail)
        } else {
            profile.reliability_best_effort()
        }
    }

    /// As RustDDS writes it.
    pub(crate) fn policies(self) -> rustdds::QosPolicies {
        self.profile().into()
    }
}

impl Default for Qos {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reliable_publisher_never_waits_for_room() {
        let policies = Qos::DEFAULT.policies();
        assert_eq!(policies.reliable_max_blocking_time(), Some(rustdds::Duration::ZERO));
    }

    #[test]
    fn a_depth_of_zero_becomes_one() {
        assert_eq!(Qos::DEFAULT.with_depth(0).depth, 1);
    }
}
