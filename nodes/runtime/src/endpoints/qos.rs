//! QoS profiles on DDS.
//!
//! Publishers never wait for room: a full window is an error at once
//! (`max_blocking_time` zero). Subscriptions always have an explicit depth,
//! because the reader acknowledges a sample before it is taken: samples that do not
//! fit are lost silently, even when reliable, even with "keep all".

use crate::samples::qos::Qos;
use ros2_client::QosProfile;
use ros2_client::qos::{Durability, History, WhenFull};

impl Qos {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reliable_publisher_never_waits_for_room() {
        let policies = Qos::DEFAULT.policies();
        assert_eq!(policies.reliable_max_blocking_time(), Some(rustdds::Duration::ZERO));
    }
}
