//! Discovers topics, and reads and writes their samples as bytes, without types.
//!
//! For a recorder. A sample is handed on as it came, with the four bytes that
//! name its encoding in front, which is what a bag holds. Subscriptions are those of the node:
//! `ros2 topic info -v` names it.

use crate::command_line::names::Scope;
use crate::endpoints::error::{NodeError, failed};
use crate::endpoints::node::Handle;
use crate::endpoints::publisher::Drops;
use crate::endpoints::qos::Qos;
use crate::endpoints::subscription::{Reader, SampleInfo, sample_info};
use crate::endpoints::wire::{Gid, ros_type};
use crate::rustdds::padded::Padded;
use crate::rustdds::received::{ByteOrder, Received};
use rustdds::Timestamp;
use rustdds::dds::CreateError;
use rustdds::no_key::DataWriterCdr;
use rustdds::policy::{Durability, Reliability};

/// A publisher of another node, as it announced itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DiscoveredPublisher {
    /// Absolute name of the topic.
    pub topic: String,
    /// `package/msg/Type`.
    pub type_name: String,
    /// Its QoS. Discovery does not carry the depth; it is 0 here.
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
    /// multiple of four as it was on the wire.
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
    writer: DataWriterCdr<Padded>,
    drops: Drops,
}

impl Handle {
    /// The publishers of other nodes on ROS topics, by topic and address;
    /// services and actions' services are not among them, actions' topics are.
    pub fn discovered_publishers(&self) -> Vec<DiscoveredPublisher> {
        let mut found: Vec<_> = self
            .participant()
            .discovered_writers()
            .into_iter()
            .filter_map(|writer| {
                let data = writer.publication_topic_data;
                let nanos = |duration: rustdds::Duration| {
                    (duration != rustdds::Duration::INFINITE).then(|| duration.to_nanoseconds())
                };
                Some(DiscoveredPublisher {
                    topic: data.topic_name.strip_prefix("rt")?.to_owned(),
                    type_name: ros_type(&data.type_name),
                    qos: Qos {
                        reliable: matches!(data.reliability, Some(Reliability::Reliable { .. })),
                        transient_local: !matches!(
                            data.durability,
                            None | Some(Durability::Volatile)
                        ),
                        depth: 0,
                    },
                    deadline_ns: data.deadline.and_then(|deadline| nanos(deadline.0)),
                    lifespan_ns: data.lifespan.and_then(|lifespan| nanos(lifespan.duration)),
                    type_hash: type_hash(&writer.user_data),
                    gid: data.key.into(),
                })
            })
            .collect();
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
        let reader = self.ros_reader(&name, type_name, qos)?;
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
        let failed = |reason: CreateError| failed(&name, &reason);
        let publisher = self.participant().create_publisher(&qos.policies()).map_err(failed)?;
        let writer = self.ros_endpoint(&name, type_name, qos, |dds| {
            publisher.create_datawriter_no_key_cdr(dds, None).map_err(failed)
        })?;
        Ok(RawPublisher { writer, drops: Drops::new(name) })
    }
}

impl RawSubscription {
    /// The next sample, in the order of arrival. Never ends by itself; may be
    /// dropped while it waits without losing a sample.
    pub async fn next(&mut self) -> RawSample {
        let (received, info) = self.reader.next_received().await;
        RawSample { bytes: encapsulated(&received), info: sample_info(&info) }
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
        let sent = Padded::new(&[], payload).and_then(|payload| {
            let written = self.writer.write(payload, Some(Timestamp::now()));
            written.map_err(|error| error.to_string())
        });
        sent.map_err(|reason| self.drops.add(&reason)).is_ok()
    }

    /// The endpoint's own address.
    pub fn gid(&self) -> Gid {
        rustdds::RTPSEntity::guid(&self.writer).into()
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

/// `typehash=RIHS01_...;` in the data that a ROS middleware adds to an
/// endpoint, after its length.
fn type_hash(user_data: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(user_data.get(4..)?);
    let (_, rest) = text.split_once("typehash=")?;
    let (hash, _) = rest.split_once(';')?;
    hash.starts_with("RIHS01_").then(|| hash.to_owned())
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

    #[test]
    fn the_type_hash_is_found_after_its_length() {
        let mut data = vec![18, 0, 0, 0];
        data.extend_from_slice(b"typehash=RIHS01_df66;");
        assert_eq!(type_hash(&data).as_deref(), Some("RIHS01_df66"));
        for data in [&b""[..], b"abc", b"\0\0\0\0typehash=;", b"\0\0\0\0typehash=RIHS01_df"] {
            assert_eq!(type_hash(data), None);
        }
    }
}
