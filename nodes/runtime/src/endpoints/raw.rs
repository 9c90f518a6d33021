//! Discovers topics, and reads and writes their samples as bytes, without types.
//!
//! For a recorder. A sample is handed on as it came, with the four bytes that
//! name its encoding in front, which is what a bag holds. Subscriptions are those of the node:
//! `ros2 topic info -v` names it.

use crate::command_line::names::Scope;
use crate::endpoints::error::NodeError;
use crate::endpoints::middleware::RawOutgoing;
use crate::endpoints::node::Handle;
use crate::endpoints::publisher::Drops;
use crate::endpoints::subscription::Reader;
use crate::samples::gid::Gid;
use crate::samples::qos::Qos;
use crate::samples::sample::{ByteOrder, Received, SampleInfo};

/// A publisher of another node, as it announced itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DiscoveredPublisher {
    /// Absolute name of the topic.
    pub topic: String,
    /// `package/msg/Type`.
    pub type_name: String,
    /// Its QoS. The discovery of DDS does not carry the depth; it is 0 then.
    pub qos: Qos,
    /// Its deadline period, if it offers one, in nanoseconds.
    pub deadline_ns: Option<i64>,
    /// Lifespan of its samples, if limited, in nanoseconds.
    pub lifespan_ns: Option<i64>,
    /// `RIHS01_...`, where its middleware announces it.
    pub type_hash: Option<String>,
    pub gid: Gid,
}

/// One sample as it travelled.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RawSample {
    /// Four bytes that name the encoding, then the payload, padded to a
    /// multiple of four where the wire of DDS did so.
    pub bytes: Vec<u8>,
    pub info: SampleInfo,
}

/// A subscription of bytes; it lives as long as the value.
pub struct RawSubscription {
    topic: String,
    reader: Reader,
}

/// A publisher of bytes.
pub struct RawPublisher {
    writer: RawOutgoing,
    drops: Drops,
}

impl Handle {
    /// The publishers of other nodes on ROS topics, by topic and address;
    /// services and actions' services are not among them, actions' topics are.
    pub fn discovered_publishers(&self) -> Vec<DiscoveredPublisher> {
        let mut found = self.inner.middleware.discovered_publishers();
        found.sort_by(|a, b| (&a.topic, a.gid).cmp(&(&b.topic, b.gid)));
        found
    }

    /// Subscribes the bytes of an absolute topic of the ROS type `type_name`.
    ///
    /// `qos` must ask for no more than the publishers offer; `depth` is what
    /// may wait unread (a recorder takes 20 000).
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn raw_subscription(
        &self,
        topic: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<RawSubscription, NodeError> {
        let name = self.names().resolve_as(topic, Scope::Topic)?;
        let reader = self.inner.middleware.subscription(&name, type_name, qos)?;
        Ok(RawSubscription { topic: name, reader })
    }

    /// Publishes bytes, each with its encoding in front, on an absolute topic.
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn raw_publisher(
        &self,
        topic: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<RawPublisher, NodeError> {
        let name = self.names().resolve_as(topic, Scope::Topic)?;
        let writer = self.inner.middleware.raw_publisher(&name, type_name, qos)?;
        Ok(RawPublisher { writer, drops: Drops::new(name) })
    }
}

impl RawSubscription {
    /// The next sample, in the order of arrival. Never ends by itself; may be
    /// dropped while it waits without losing a sample.
    pub async fn next(&mut self) -> RawSample {
        let sample = self.reader.next_received().await;
        RawSample { bytes: encapsulated(&sample.received), info: sample.info }
    }

    /// The absolute name of the topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// The endpoint's own address.
    pub fn gid(&self) -> Gid {
        self.reader.gid()
    }
}

impl RawPublisher {
    /// Sends a payload with its four bytes of encoding in front, which must
    /// say little-endian CDR (`00 01`); returns at once. False when it was not
    /// sent.
    pub fn publish(&self, bytes: &[u8]) -> bool {
        let [0, 1, _, _, payload @ ..] = bytes else {
            self.drops.add("only little-endian CDR can be published as it is");
            return false;
        };
        let sent = self.writer.publish(payload);
        sent.map_err(|reason| self.drops.add(&reason)).is_ok()
    }

    /// The endpoint's own address.
    pub fn gid(&self) -> Gid {
        self.writer.gid()
    }
}

/// A payload with its encoding in front: CDR, little-endian or big-endian.
fn encapsulated(received: &Received) -> Vec<u8> {
    let order = match received.order {
        ByteOrder::Big => 0,
        ByteOrder::Little => 1,
    };
    let mut bytes = Vec::with_capacity(received.bytes.len() + 4);
    bytes.extend_from_slice(&[0, order, 0, 0]);
    bytes.extend_from_slice(&received.bytes);
    bytes
}

impl std::fmt::Debug for RawSubscription {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RawSubscription").field("topic", &self.topic).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for RawPublisher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RawPublisher").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_encoding_of_a_sample_names_its_byte_order() {
        let of = |order| encapsulated(&Received { bytes: vec![7, 8], order });
        assert_eq!(of(ByteOrder::Little), [0, 1, 0, 0, 7, 8]);
        assert_eq!(of(ByteOrder::Big), [0, 0, 0, 0, 7, 8]);
    }
}
