//! Endpoints over DDS: how RustDDS and ros2-client carry topics and services.
//!
//! One of the two sides of `middleware`. Writers that ros2-client cannot make are those of RustDDS.

use crate::command_line::environment::{Environment, ServiceMapping};
use crate::endpoints::client::Endpoints;
use crate::endpoints::error::{NodeError, failed};
use crate::endpoints::middleware::{Incoming, Outgoing, RawOutgoing};
use crate::endpoints::raw::DiscoveredPublisher;
use crate::endpoints::requests::{DdsRequests, Requests};
use crate::endpoints::service::{Replies, UNACKNOWLEDGED_MAX};
use crate::endpoints::subscription::Reader;
use crate::endpoints::wire::{padded, service_topics, service_types};
use crate::process::lock;
use crate::process::time::RosTime;
use crate::rustdds::dropped_publishers::DroppedPublishers;
use crate::rustdds::padded::Padded;
use crate::rustdds::received::AsReceived;
use crate::rustdds::type_hashes::type_hash;
use crate::samples::gid::Gid;
use crate::samples::qos::Qos;
use crate::samples::sample::{Received, RequestId, Sample, SampleInfo};
use crate::samples::type_names::{dds_type, ros_type};
use futures::StreamExt;
use ros2_client::MessageInfo;
use rustdds::no_key::DataWriterCdr;
use rustdds::policy::{Durability, Reliability, ResourceLimits};
use rustdds::{DomainParticipant, QosPolicies, QosPolicyBuilder, Topic, TopicKind};
use std::pin::pin;
use std::sync::{Arc, Mutex};

/// The node's side of DDS.
pub(crate) struct Dds {
    /// `None` once the node is being taken down.
    pub(crate) node: Mutex<Option<ros2_client::Node>>,
    pub(crate) participant: DomainParticipant,
    /// Makes the writers that ros2-client cannot make.
    pub(crate) writers: rustdds::Publisher,
    pub(crate) dropped_publishers: DroppedPublishers,
    pub(crate) environment: Environment,
}

/// A publisher of bytes.
pub(crate) struct DdsPublisher {
    /// `None` only while this is dropped.
    inner: Option<ros2_client::Publisher<Padded>>,
    dropped_publishers: DroppedPublishers,
}

impl Drop for DdsPublisher {
    fn drop(&mut self) {
        if let Some(inner) = self.inner.take() {
            self.dropped_publishers.keep_while_stopping(inner);
        }
    }
}

impl DdsPublisher {
    fn inner(&self) -> &ros2_client::Publisher<Padded> {
        self.inner.as_ref().expect("it is taken by drop alone")
    }

    pub(crate) fn publish(&self, body: &[u8]) -> Result<(), String> {
        let message = padded(None, body)?;
        self.inner().publish(message).map_err(|error| error.to_string())
    }

    pub(crate) fn gid(&self) -> Gid {
        self.inner().guid().into()
    }
}

impl Dds {
    pub(crate) fn publisher(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Outgoing, NodeError> {
        let inner = self.ros_endpoint(name, type_name, qos, |dds| {
            self.with_node(name, |node| node.create_publisher(dds, None))
        })?;
        let dropped_publishers = self.dropped_publishers.clone();
        Ok(Outgoing::Dds(DdsPublisher { inner: Some(inner), dropped_publishers }))
    }

    pub(crate) fn raw_publisher(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<RawOutgoing, NodeError> {
        let publisher = self
            .participant
            .create_publisher(&qos.policies())
            .map_err(|reason| failed(name, &reason))?;
        let writer = self.ros_endpoint(name, type_name, qos, |dds| {
            let writer = publisher.create_datawriter_no_key_cdr(dds, None);
            writer.map_err(|reason| failed(name, &reason))
        })?;
        Ok(RawOutgoing::Dds(writer))
    }

    pub(crate) fn subscription(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Reader, NodeError> {
        let (dds_name, dds_type) = (format!("rt{name}"), dds_type(type_name, ""));
        self.reader(name.to_owned(), &dds_name, &dds_type, qos, false)
    }

    pub(crate) fn server(
        self: &Arc<Self>,
        name: &str,
        type_name: &str,
        depth: usize,
    ) -> Result<(Reader, Replies), NodeError> {
        let (request_topic, reply_topic) = service_topics(name);
        let (request_type, reply_type) = service_types(type_name);
        let policies = QosPolicyBuilder::new()
            .resource_limits(ResourceLimits {
                max_samples: UNACKNOWLEDGED_MAX,
                max_instances: -1,
                max_samples_per_instance: UNACKNOWLEDGED_MAX,
            })
            .build();
        let dds = Arc::clone(self);
        let new_writer =
            Box::new(move || dds.writer(&reply_topic, &reply_type, Some(policies.clone())));
        let replies = Replies::new(name, &self.environment, new_writer)?;
        let label = format!("requests of {name}");
        let has_header = self.has_header();
        let qos = Qos::SERVICES.with_depth(depth);
        let reader = self.reader(label, &request_topic, &request_type, qos, has_header)?;
        Ok((reader, replies))
    }

    pub(crate) fn client(&self, name: &str, type_name: &str) -> Result<Endpoints, NodeError> {
        let (request_topic, reply_topic) = service_topics(name);
        let (request_type, reply_type) = service_types(type_name);
        let label = format!("replies of {name}");
        let has_header = self.has_header();
        let reader = self.reader(label, &reply_topic, &reply_type, Qos::SERVICES, has_header)?;
        let writer = self.writer(&request_topic, &request_type, None)?;
        let requests = Requests::Dds(DdsRequests::new(writer, has_header));
        Ok(Endpoints { name: name.to_owned(), reader, requests })
    }

    /// Whether the service mapping puts a header before requests and replies.
    fn has_header(&self) -> bool {
        self.environment.mapping == ServiceMapping::Cyclone
    }

    /// Drops the endpoints that are left, and the node.
    pub(crate) fn stop(&self) {
        self.dropped_publishers.clear();
        drop(lock(&self.node).take());
    }

    /// Makes an endpoint on an absolute ROS topic.
    fn ros_endpoint<R>(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
        make: impl FnOnce(&Topic) -> Result<R, NodeError>,
    ) -> Result<R, NodeError> {
        self.endpoint(&format!("rt{name}"), &dds_type(type_name, ""), qos, make)
    }

    /// Makes an endpoint on a DDS topic.
    fn endpoint<R>(
        &self,
        topic: &str,
        dds_type: &str,
        qos: Qos,
        make: impl FnOnce(&Topic) -> Result<R, NodeError>,
    ) -> Result<R, NodeError> {
        let topic = self
            .participant
            .create_topic(topic.to_owned(), dds_type.to_owned(), &qos.policies(), TopicKind::NoKey)
            .map_err(|error| failed(topic, &error))?;
        make(&topic)
    }

    fn reader(
        &self,
        label: String,
        topic: &str,
        dds_type: &str,
        qos: Qos,
        has_header: bool,
    ) -> Result<Reader, NodeError> {
        let inner = self.endpoint(topic, dds_type, qos, |topic| {
            self.with_node(&label, |node| node.create_subscription(topic, None))
        })?;
        Ok(Reader::new(label, Incoming::Dds(DdsSubscription { inner }), has_header))
    }

    fn writer(
        &self,
        topic: &str,
        dds_type: &str,
        policies: Option<QosPolicies>,
    ) -> Result<DataWriterCdr<Padded>, NodeError> {
        self.endpoint(topic, dds_type, Qos::SERVICES, |dds| {
            self.writers
                .create_datawriter_no_key_cdr(dds, policies)
                .map_err(|error| failed(topic, &error))
        })
    }

    fn with_node<R>(
        &self,
        what: &str,
        make: impl FnOnce(&mut ros2_client::Node) -> ros2_client::CreateResult<R>,
    ) -> Result<R, NodeError> {
        match lock(&self.node).as_mut() {
            Some(node) => make(node).map_err(|error| failed(what, &error)),
            None => Err(NodeError::Stopping { what: what.to_owned() }),
        }
    }

    pub(crate) fn discovered_publishers(&self) -> Vec<DiscoveredPublisher> {
        let writers = self.participant.discovered_writers().into_iter();
        writers
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
                    type_hash: type_hash(&writer.user_data).map(str::to_owned),
                    gid: data.key.into(),
                })
            })
            .collect()
    }
}

/// A subscription of bytes.
pub(crate) struct DdsSubscription {
    inner: ros2_client::Subscription<Received>,
}

impl DdsSubscription {
    /// The next sample, or why it could not be taken. May be dropped while it waits without losing
    /// a sample.
    pub(crate) async fn next(&mut self) -> Result<Sample, String> {
        let mut stream = pin!(self.inner.async_stream_seed(AsReceived));
        stream.select_next_some().await.map(sample).map_err(|error| error.to_string())
    }

    pub(crate) fn take(&mut self) -> Option<Result<Sample, String>> {
        let taken = self.inner.take_seed(AsReceived).transpose()?;
        Some(taken.map(sample).map_err(|error| error.to_string()))
    }

    pub(crate) fn gid(&self) -> Gid {
        self.inner.guid().into()
    }
}

fn sample((received, info): (Received, MessageInfo)) -> Sample {
    let time = |time: ros2_client::ROSTime| RosTime::from_nanos(time.to_nanos());
    Sample {
        received,
        info: SampleInfo {
            publisher: info.publisher_gid().into(),
            sequence: info.sequence_number(),
            source_time: info.source_timestamp().map(time),
            reception_time: info.received_timestamp().map_or(RosTime::ZERO, time),
        },
        request: info
            .related_request_id()
            .map(|id| RequestId { client: id.writer_gid.into(), sequence: id.sequence_number }),
    }
}
