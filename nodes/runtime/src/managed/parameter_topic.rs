//! The `node_parameters` topic: the parameters that a node runs with, for recorders.

use crate::endpoints::error::NodeError;
use crate::endpoints::node::Handle;
use crate::managed::parameter_services::row_to_wire;
use crate::process::lock;
use crate::samples::qos::Qos;
use cnc_msgs::wire::cnc_msgs::msg::NodeParameters;
use cnc_msgs::wire::rcl_interfaces::msg::Parameter;

impl Handle {
    /// Publishes all parameters now and after every change.
    ///
    /// # Errors
    /// DDS refused.
    pub(crate) fn announce_parameters(&self) -> Result<(), NodeError> {
        let publisher = self.publisher::<NodeParameters>("node_parameters", Qos::LATCHED)?;
        let (node, mut changes) = (self.clone(), self.parameter_changes());
        self.spawn("node_parameters", async move {
            loop {
                publisher.publish(NodeParameters {
                    stamp: node.now().into(),
                    node: node.names().fully_qualified(),
                    version: env!("CARGO_PKG_VERSION").to_owned(),
                    parameters: node.all_parameters(),
                });
                if changes.changed().await.is_err() {
                    break;
                }
            }
        });
        Ok(())
    }

    fn all_parameters(&self) -> Vec<Parameter> {
        let parameters = lock(&self.inner.parameters.parameters);
        parameters.iter().map(|(declared, value)| row_to_wire(declared, value)).collect()
    }
}
