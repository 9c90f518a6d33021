//! Discovers topics, and reads and writes their samples as bytes, without types.
//!
//! For a recorder. A sample is handed on as it came, with the four bytes that
//! name its encoding in front, which is what a bag holds.

use crate::command_line::names::Scope;
use crate::endpoints::error::{NodeError, failed};
use crate::endpoints::node::Handle;
use crate::endpoints::publisher::Drops;
use crate::endpoints::qos::Qos;
use crate::endpoints::subscription::SampleInfo;
use crate::endpoints::wire::{Gid, ros_type};
use crate::process::time::RosTime;
use crate::rustdds::padded::Padded;
use futures::StreamExt;
use rustdds::dds::CreateError;
use rustdds::no_key::{DataWriterCdr, Decode, DefaultDecoder, DeserializerAdapter};
use rustdds::no_key::{DeserializedCacheChange, SimpleDataReader};
use rustdds::policy::{Durability, Reliability};
use rustdds::{RepresentationIdentifier, Timestamp};
use std::convert::Infallible;
use std::pin::pin;

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
    reader: SimpleDataReader<Payload, Verbatim>,
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
        let failed = |reason: CreateError| failed(&name, &reason);
        let subscriber = self.participant().create_subscriber(&qos.policies()).map_err(failed)?;
        let reader = self.ros_endpoint(&name, type_name, qos, |dds| {
            subscriber.create_simple_datareader_no_key(dds, None).map_err(failed)
        })?;
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
        loop {
            let mut stream = pin!(self.reader.as_async_stream());
            match stream.select_next_some().await {
                Ok(change) => return sample(change),
                // An encoding that DDS does not know at all.
                Err(error) => tracing::warn!("{}: {error}", self.topic),
            }
        }
    }

    /// The absolute name of the topic.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// The endpoint's own address.
    pub fn gid(&self) -> Gid {
        self.reader.guid().into()
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

fn sample(change: DeserializedCacheChange<Payload>) -> RawSample {
    let time = |stamp: Timestamp| {
        ros2_client::ROSTime::try_from(stamp)
            .map_or(RosTime::ZERO, |time| RosTime::from_nanos(time.to_nanos()))
    };
    let info = SampleInfo {
        publisher: change.writer_guid().into(),
        sequence: change.sequence_number.into(),
        source_time: change.source_timestamp().map(time),
        reception_time: time(change.receive_instant),
    };
    let payload = change.into_value();
    let mut bytes = Vec::with_capacity(payload.bytes.len() + 4);
    bytes.extend_from_slice(&payload.encoding);
    bytes.extend_from_slice(&[0, 0]);
    bytes.extend_from_slice(&payload.bytes);
    RawSample { bytes, info }
}

/// `typehash=RIHS01_...;` in the data that a ROS middleware adds to an
/// endpoint, after its length.
fn type_hash(user_data: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(user_data.get(4..)?);
    let (_, rest) = text.split_once("typehash=")?;
    let (hash, _) = rest.split_once(';')?;
    hash.starts_with("RIHS01_").then(|| hash.to_owned())
}

/// Bytes as they are, with their encoding.
struct Payload {
    encoding: [u8; 2],
    bytes: Vec<u8>,
}

/// Reads [`Payload`].
struct Verbatim;

#[derive(Clone)]
struct VerbatimDecoder;

impl DeserializerAdapter<Payload> for Verbatim {
    type Error = Infallible;
    type Decoded = Payload;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        use RepresentationIdentifier as Encoding;
        &[
            Encoding::CDR_LE,
            Encoding::CDR_BE,
            Encoding::PL_CDR_LE,
            Encoding::PL_CDR_BE,
            Encoding::CDR2_LE,
            Encoding::CDR2_BE,
            Encoding::PL_CDR2_LE,
            Encoding::PL_CDR2_BE,
            Encoding::D_CDR_LE,
            Encoding::D_CDR_BE,
            Encoding::XCDR2_LE,
            Encoding::XCDR2_BE,
            Encoding::D_CDR2_LE,
            Encoding::D_CDR2_BE,
        ]
    }

    fn transform_decoded(decoded: Payload) -> Payload {
        decoded
    }
}

impl DefaultDecoder<Payload> for Verbatim {
    type Decoder = VerbatimDecoder;
    const DECODER: VerbatimDecoder = VerbatimDecoder;
}

impl<'de> Decode<'de, Payload> for VerbatimDecoder {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &'de [u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Payload, Infallible> {
        Ok(Payload { encoding: encoding.to_bytes(), bytes: bytes.to_vec() })
    }
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
    fn the_type_hash_is_found_after_its_length() {
        let mut data = vec![18, 0, 0, 0];
        data.extend_from_slice(b"typehash=RIHS01_df66;");
        assert_eq!(type_hash(&data).as_deref(), Some("RIHS01_df66"));
        for data in [&b""[..], b"abc", b"\0\0\0\0typehash=;", b"\0\0\0\0typehash=RIHS01_df"] {
            assert_eq!(type_hash(data), None);
        }
    }
}
