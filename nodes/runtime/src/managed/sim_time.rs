//! Follows `/clock` while the parameter `use_sim_time` is set.

use crate::endpoints::node::Handle;
use crate::process::time::RosTime;
use crate::samples::qos::Qos;
use cnc_msgs::wire::rosgraph_msgs::msg::Clock as ClockMessage;
use std::sync::Arc;

impl Handle {
    /// Follows `use_sim_time`.
    pub(crate) fn simulate_time(&self, is_simulated: bool) {
        if !self.inner.clock.simulate(is_simulated) {
            return;
        }
        let clock = Arc::clone(&self.inner.clock);
        match self.subscription::<ClockMessage>("/clock", Qos::CLOCK) {
            Ok(mut messages) => self.spawn("clock", async move {
                loop {
                    clock.set(RosTime::from(&messages.next().await.0.clock));
                }
            }),
            Err(error) => tracing::error!("simulated time cannot be followed: {error}"),
        }
    }
}
