//! What carries the bytes of a node: DDS, or Zenoh where it is built in.
//!
//! The one seam between endpoints and middleware. Above it are messages, handlers and calls; below
//! it are bytes. A further middleware is a member of each `enum` here.

use crate::endpoints::client::Endpoints;
use crate::endpoints::dds::{Dds, DdsPublisher, DdsSubscription};
use crate::endpoints::error::NodeError;
use crate::endpoints::raw::DiscoveredPublisher;
#[cfg(feature = "zenoh")]
use crate::endpoints::requests::Requests;
use crate::endpoints::service::Replying;
use crate::endpoints::subscription::Reader;
use crate::rustdds::padded::Padded;
use crate::samples::gid::Gid;
use crate::samples::qos::Qos;
use crate::samples::sample::Sample;
use rustdds::Timestamp;
use rustdds::no_key::DataWriterCdr;
use std::sync::Arc;

/// The node's side of its middleware.
pub(crate) enum Middleware {
    Dds(Arc<Dds>),
    #[cfg(feature = "zenoh")]
    Zenoh(Box<crate::zenoh::node::Node>),
}

/// Publishes on a topic.
pub(crate) enum Outgoing {
    Dds(DdsPublisher),
    #[cfg(feature = "zenoh")]
    Zenoh(crate::zenoh::publisher::Publisher),
}

/// Publishes on a topic what others have encoded.
pub(crate) enum RawOutgoing {
    Dds(DataWriterCdr<Padded>),
    #[cfg(feature = "zenoh")]
    Zenoh(crate::zenoh::publisher::Publisher),
}

/// Receives samples of a topic, requests or replies.
#[allow(clippy::large_enum_variant, reason = "there is one for each subscription")]
pub(crate) enum Incoming {
    Dds(DdsSubscription),
    #[cfg(feature = "zenoh")]
    Zenoh(crate::zenoh::inbox::Receiver),
}

impl Middleware {
    /// DDS, for what only DDS has.
    pub(crate) fn dds(&self) -> Option<&Dds> {
        match self {
            Self::Dds(dds) => Some(dds),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(_) => None,
        }
    }

    /// Publishes on an absolute topic.
    pub(crate) fn publisher(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Outgoing, NodeError> {
        match self {
            Self::Dds(dds) => dds.publisher(name, type_name, qos),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(node) => Ok(Outgoing::Zenoh(node.publisher(name, type_name, qos)?)),
        }
    }

    /// The same for bytes that others have encoded.
    pub(crate) fn raw_publisher(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<RawOutgoing, NodeError> {
        match self {
            Self::Dds(dds) => dds.raw_publisher(name, type_name, qos),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(node) => Ok(RawOutgoing::Zenoh(node.publisher(name, type_name, qos)?)),
        }
    }

    /// Subscribes an absolute topic.
    pub(crate) fn subscription(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Reader, NodeError> {
        match self {
            Self::Dds(dds) => dds.subscription(name, type_name, qos),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(node) => {
                let receiver = node.subscription(name, type_name, qos)?;
                Ok(Reader::new(name.to_owned(), Incoming::Zenoh(receiver), false))
            }
        }
    }

    /// Receives the requests of a service, and sends its answers.
    pub(crate) fn server(
        &self,
        name: &str,
        type_name: &str,
        depth: usize,
    ) -> Result<(Reader, Replying), NodeError> {
        match self {
            Self::Dds(dds) => {
                let (reader, replies) = dds.server(name, type_name, depth)?;
                Ok((reader, Replying::Dds(replies)))
            }
            #[cfg(feature = "zenoh")]
            Self::Zenoh(node) => {
                let (receiver, answers) = node.server(name, type_name, depth)?;
                let reader =
                    Reader::new(format!("requests of {name}"), Incoming::Zenoh(receiver), false);
                Ok((reader, Replying::Zenoh(answers)))
            }
        }
    }

    /// Sends requests to a service, and receives its answers.
    pub(crate) fn client(&self, name: &str, type_name: &str) -> Result<Endpoints, NodeError> {
        match self {
            Self::Dds(dds) => dds.client(name, type_name),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(node) => {
                let (receiver, requests) = node.client(name, type_name)?;
                let reader =
                    Reader::new(format!("replies of {name}"), Incoming::Zenoh(receiver), false);
                let requests = Requests::Zenoh(requests);
                Ok(Endpoints { name: name.to_owned(), reader, requests })
            }
        }
    }

    /// Leaves the domain.
    pub(crate) fn stop(&self) {
        match self {
            Self::Dds(dds) => dds.stop(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(node) => node.stop(),
        }
    }

    /// The publishers of other nodes on topics.
    pub(crate) fn discovered_publishers(&self) -> Vec<DiscoveredPublisher> {
        match self {
            Self::Dds(dds) => dds.discovered_publishers(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(node) => node
                .publishers()
                .into_iter()
                .map(|(topic, gid)| DiscoveredPublisher {
                    topic: topic.name,
                    type_name: topic.type_name,
                    qos: topic.qos.qos,
                    deadline_ns: topic.qos.deadline_ns,
                    lifespan_ns: topic.qos.lifespan_ns,
                    type_hash: Some(topic.type_hash),
                    gid,
                })
                .collect(),
        }
    }
}

impl Outgoing {
    /// Sends the CDR of a message; never waits.
    pub(crate) fn publish(&self, body: &[u8]) -> Result<(), String> {
        match self {
            Self::Dds(publisher) => publisher.publish(body),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(publisher) => publisher.publish(body),
        }
    }

    pub(crate) fn gid(&self) -> Gid {
        match self {
            Self::Dds(publisher) => publisher.gid(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(publisher) => publisher.gid(),
        }
    }
}

impl RawOutgoing {
    /// Sends the little-endian CDR of a message; never waits.
    pub(crate) fn publish(&self, body: &[u8]) -> Result<(), String> {
        match self {
            Self::Dds(writer) => {
                let payload = Padded::new(&[], body)?;
                let written = writer.write(payload, Some(Timestamp::now()));
                written.map_err(|error| error.to_string())
            }
            #[cfg(feature = "zenoh")]
            Self::Zenoh(publisher) => publisher.publish(body),
        }
    }

    pub(crate) fn gid(&self) -> Gid {
        match self {
            Self::Dds(writer) => rustdds::RTPSEntity::guid(writer).into(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(publisher) => publisher.gid(),
        }
    }
}

impl Incoming {
    /// The next sample, or why there is none. May be dropped while it waits without losing a sample.
    pub(crate) async fn next(&mut self) -> Result<Sample, String> {
        match self {
            Self::Dds(subscription) => subscription.next().await,
            #[cfg(feature = "zenoh")]
            Self::Zenoh(receiver) => receiver.next().await,
        }
    }

    /// A sample that is here already.
    pub(crate) fn take(&mut self) -> Option<Result<Sample, String>> {
        match self {
            Self::Dds(subscription) => subscription.take(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(receiver) => receiver.take(),
        }
    }

    pub(crate) fn gid(&self) -> Gid {
        match self {
            Self::Dds(subscription) => subscription.gid(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(receiver) => receiver.gid(),
        }
    }
}
