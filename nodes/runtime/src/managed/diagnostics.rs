//! `/diagnostics`: the health of each part of the node, once a second.

use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::samples::qos::Qos;
use cnc_msgs::wire::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus, KeyValue};
use std::time::Duration;
use tokio::time::MissedTickBehavior;

/// How often, as diagnostic aggregators expect.
const PERIOD: Duration = Duration::from_secs(1);

/// The health of one part of a node.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Health {
    /// The part: `serial link`.
    pub component: String,
    pub level: HealthLevel,
    /// For people, in a few words.
    pub message: String,
    /// Serial number or firmware; may be empty.
    pub hardware_id: String,
    /// Figures by name, in the order to show them.
    pub values: Vec<(String, String)>,
}

/// As in `diagnostic_msgs/DiagnosticStatus`, without STALE, which only a listener can detect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum HealthLevel {
    #[default]
    Ok,
    Warn,
    Error,
}

impl Handle {
    /// Publishes the result of `look` once a second, on the absolute topic
    /// `/diagnostics`.
    ///
    /// # Errors
    /// DDS refused.
    pub fn diagnostics(
        &self,
        look: impl Fn() -> Vec<Health> + Send + 'static,
    ) -> Result<(), NodeError> {
        let publisher = self.publisher::<DiagnosticArray>("/diagnostics", Qos::DEFAULT)?;
        let handle = self.clone();
        self.spawn("diagnostics", async move {
            let mut ticks = tokio::time::interval(PERIOD);
            ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
            loop {
                ticks.tick().await;
                let node = handle.names().fully_qualified();
                let mut array = DiagnosticArray::default();
                array.header.stamp = handle.now().into();
                array.status =
                    look().into_iter().map(|health| status(&node[1..], health)).collect();
                publisher.publish(array);
            }
        });
        Ok(())
    }
}

fn status(node: &str, health: Health) -> DiagnosticStatus {
    DiagnosticStatus {
        level: match health.level {
            HealthLevel::Ok => DiagnosticStatus::OK,
            HealthLevel::Warn => DiagnosticStatus::WARN,
            HealthLevel::Error => DiagnosticStatus::ERROR,
        },
        name: format!("{node}: {}", health.component),
        message: health.message,
        hardware_id: health.hardware_id,
        values: health.values.into_iter().map(|(key, value)| KeyValue { key, value }).collect(),
    }
}
