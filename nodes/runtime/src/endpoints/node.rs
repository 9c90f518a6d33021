//! The node, as its tasks see it.
//!
//! Makes the endpoints and owns what they share. `session` starts and stops it.
//!
//! All endpoints are made at the start and kept until the node ends: peers do not notice
//! that a single endpoint is gone.

use crate::command_line::configuration::Configuration;
use crate::command_line::environment::{Environment, ServiceMapping};
use crate::command_line::names::{Names, Scope};
use crate::endpoints::client::{Client, Endpoints};
use crate::endpoints::error::{NodeError, failed};
use crate::endpoints::graph::Graph;
use crate::endpoints::other_middleware::mismatch;
use crate::endpoints::publisher::Publisher;
use crate::endpoints::qos::Qos;
use crate::endpoints::service::{
    Overload, Replies, Request, RequestInfo, Server, UNACKNOWLEDGED_MAX,
};
use crate::endpoints::subscription::{Reader, Subscription};
use crate::endpoints::wire::{dds_type, service_topics, service_types};
use crate::parameters::live::LiveParameters;
use crate::process::lifecycle_states::LifecycleState;
use crate::process::lock;
use crate::process::memory::Memory;
use crate::process::shutdown::Shutdown;
use crate::process::time::{Clock, RosTime};
use crate::rustdds::dropped_publishers::DroppedPublishers;
use crate::rustdds::endpoint_rate_limit::EndpointRateLimit;
use crate::rustdds::padded::Padded;
use cnc_msgs::interface::{Message, Service};
use rustdds::no_key::DataWriterCdr;
use rustdds::policy::ResourceLimits;
use rustdds::{DomainParticipant, QosPolicies, QosPolicyBuilder, Topic, TopicKind};
use std::sync::{Arc, Mutex, OnceLock};
use tokio::task::JoinSet;

/// The node as its tasks see it; clones are the same node.
#[derive(Clone)]
pub struct Handle {
    pub(crate) inner: Arc<Inner>,
}

/// Shared by all handles of a node.
pub(crate) struct Inner {
    /// To restart the node.
    pub(crate) configuration: Configuration,
    pub(crate) names: Names,
    pub(crate) environment: Environment,
    /// `None` once the node is being taken down.
    pub(crate) node: Mutex<Option<ros2_client::Node>>,
    pub(crate) participant: DomainParticipant,
    /// Makes the writers that ros2-client cannot make.
    pub(crate) writers: rustdds::Publisher,
    /// Limits how fast endpoints are made.
    pub(crate) endpoint_rate: EndpointRateLimit,
    pub(crate) graph: Arc<Graph>,
    pub(crate) parameters: Arc<LiveParameters>,
    pub(crate) clock: Arc<Clock>,
    /// `None` while the node is not managed.
    pub(crate) lifecycle: tokio::sync::watch::Sender<Option<LifecycleState>>,
    pub(crate) shutdown: Shutdown,
    /// Why the DDS layer does not serve this node any more; `None` while it does.
    pub(crate) deaf: tokio::sync::watch::Sender<Option<String>>,
    pub(crate) dropped_publishers: DroppedPublishers,
    pub(crate) tasks: Mutex<JoinSet<()>>,
    pub(crate) memory: OnceLock<Memory>,
}

impl Handle {
    /// The names of the node and what it resolves.
    pub fn names(&self) -> &Names {
        &self.inner.names
    }

    /// The settings from the environment.
    pub fn environment(&self) -> &Environment {
        &self.inner.environment
    }

    /// A sentence about participants, seen so far, of another middleware than this node's: topics
    /// of theirs arrive, services do not.
    pub fn other_middleware(&self) -> Option<String> {
        mismatch(self.inner.environment.mapping, self.inner.graph.vendors())
    }

    /// ROS time: the wall clock, or `/clock` with `use_sim_time`.
    pub fn now(&self) -> RosTime {
        self.inner.clock.now()
    }

    /// The shutdown signal.
    pub fn shutdown(&self) -> &Shutdown {
        &self.inner.shutdown
    }

    /// Waits until the DDS layer no longer serves this node, and returns the reason. From then on
    /// the node can neither send nor receive.
    pub async fn deaf(&self) -> String {
        let mut deaf = self.inner.deaf.subscribe();
        // The sender lives as long as `self`.
        match deaf.wait_for(Option::is_some).await {
            Ok(reason) => reason.clone().unwrap_or_default(),
            Err(_) => std::future::pending().await,
        }
    }

    /// Gives the node a memory; to be called before its actions are offered.
    ///
    /// # Panics
    /// It has one already.
    pub fn remember_in(&self, memory: Memory) {
        let given = self.inner.memory.set(memory);
        assert!(given.is_ok(), "a node has one memory");
    }

    /// The node's memory, if it has one.
    pub fn memory(&self) -> Option<&Memory> {
        self.inner.memory.get()
    }

    /// Publishes `T` on `topic` (relative, `~/private` or absolute).
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn publisher<T: Message>(&self, topic: &str, qos: Qos) -> Result<Publisher<T>, NodeError> {
        self.publisher_of(topic, T::TYPE_NAME, qos)
    }

    /// The same for a type whose name is only known at run time.
    pub(crate) fn publisher_of<T: Message>(
        &self,
        topic: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Publisher<T>, NodeError> {
        let name = self.inner.names.resolve_as(topic, Scope::Topic)?;
        let inner = self.padded_publisher(&name, type_name, qos)?;
        let dropped_publishers = self.inner.dropped_publishers.clone();
        Ok(Publisher::new(name, inner, Arc::clone(&self.inner.graph), dropped_publishers))
    }

    fn padded_publisher(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<ros2_client::Publisher<Padded>, NodeError> {
        self.ros_endpoint(name, type_name, qos, |dds| {
            self.with_node(name, |node| node.create_publisher(dds, None))
        })
    }

    /// Subscribes `T` on `topic`; up to `qos.depth` samples may wait unread.
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn subscription<T: Message>(
        &self,
        topic: &str,
        qos: Qos,
    ) -> Result<Subscription<T>, NodeError> {
        self.subscription_of(topic, T::TYPE_NAME, qos)
    }

    /// The same for a type whose name is only known at run time.
    pub(crate) fn subscription_of<T: Message>(
        &self,
        topic: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Subscription<T>, NodeError> {
        let name = self.inner.names.resolve_as(topic, Scope::Topic)?;
        Ok(Subscription::new(self.ros_reader(&name, type_name, qos)?))
    }

    /// Offers a service; requests are answered one after the other, in order.
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn service<S, F, Fut>(&self, name: &str, handler: F) -> Result<(), NodeError>
    where
        S: Service + 'static,
        F: FnMut(S::Request, RequestInfo) -> Fut + Send + 'static,
        Fut: Future<Output = S::Response> + Send + 'static,
    {
        let (reader, replies) = self.server_endpoints(name, S::TYPE_NAME)?;
        let graph = Arc::clone(&self.inner.graph);
        let server = Server::new::<S, F, Fut>(reader, replies, graph, Vec::new(), handler);
        self.spawn(&format!("service {name}"), server.serve());
        Ok(())
    }

    /// Offers a service whose answers may take long and come in any order.
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn concurrent_service<S, F, Fut>(&self, name: &str, handler: F) -> Result<(), NodeError>
    where
        S: Service + 'static,
        F: Fn(S::Request, RequestInfo) -> Fut + Send + 'static,
        Fut: Future<Output = S::Response> + Send + 'static,
    {
        let (overload, earlier) = (Overload::Wait, Vec::new());
        self.concurrent_service_of::<S, F, Fut>(name, S::TYPE_NAME, overload, earlier, handler)
    }

    /// The same for a type whose name is only known at run time. `earlier` are requests that the
    /// previous process did not answer.
    pub(crate) fn concurrent_service_of<S, F, Fut>(
        &self,
        name: &str,
        type_name: &str,
        overload: Overload,
        earlier: Vec<Request<S>>,
        handler: F,
    ) -> Result<(), NodeError>
    where
        S: Service + 'static,
        F: Fn(S::Request, RequestInfo) -> Fut + Send + 'static,
        Fut: Future<Output = S::Response> + Send + 'static,
    {
        let (reader, replies) = self.server_endpoints(name, type_name)?;
        let graph = Arc::clone(&self.inner.graph);
        let server = Server::new::<S, F, Fut>(reader, replies, graph, earlier, handler);
        self.spawn(&format!("service {name}"), server.serve_concurrently(overload));
        Ok(())
    }

    fn server_endpoints(
        &self,
        name: &str,
        type_name: &str,
    ) -> Result<(Reader, Replies), NodeError> {
        let name = self.inner.names.resolve_as(name, Scope::Service)?;
        let (request_topic, reply_topic) = service_topics(&name);
        let (request_type, reply_type) = service_types(type_name);
        let handle = self.clone();
        let policies = QosPolicyBuilder::new()
            .resource_limits(ResourceLimits {
                max_samples: UNACKNOWLEDGED_MAX,
                max_instances: -1,
                max_samples_per_instance: UNACKNOWLEDGED_MAX,
            })
            .build();
        let new_writer =
            Box::new(move || handle.writer(&reply_topic, &reply_type, Some(policies.clone())));
        let replies = Replies::new(&name, &self.inner.environment, new_writer)?;
        let has_header = self.has_header();
        let label = format!("requests of {name}");
        let reader =
            self.reader(label, &request_topic, &request_type, Qos::SERVICES, has_header)?;
        Ok((reader, replies))
    }

    /// Whether the service mapping puts a header before requests and replies.
    fn has_header(&self) -> bool {
        self.inner.environment.mapping == ServiceMapping::Cyclone
    }

    /// Makes a client of a service.
    ///
    /// # Errors
    /// The name is not valid, or DDS refused.
    pub fn client<S: Service + 'static>(&self, name: &str) -> Result<Client<S>, NodeError> {
        self.client_of(name, S::TYPE_NAME)
    }

    /// The same for a type whose name is only known at run time.
    pub(crate) fn client_of<S: Service + 'static>(
        &self,
        name: &str,
        type_name: &str,
    ) -> Result<Client<S>, NodeError> {
        let endpoints = self.client_endpoints(name, type_name)?;
        let mapping = self.inner.environment.mapping;
        let (client, dispatch) = Client::new(endpoints, mapping, Arc::clone(&self.inner.graph));
        self.spawn("replies", dispatch);
        Ok(client)
    }

    fn client_endpoints(&self, name: &str, type_name: &str) -> Result<Endpoints, NodeError> {
        let name = self.inner.names.resolve_as(name, Scope::Service)?;
        let (request_topic, reply_topic) = service_topics(&name);
        let (request_type, reply_type) = service_types(type_name);
        let has_header = self.has_header();
        let label = format!("replies of {name}");
        let reader = self.reader(label, &reply_topic, &reply_type, Qos::SERVICES, has_header)?;
        let writer = self.writer(&request_topic, &request_type, None)?;
        Ok(Endpoints { name, reader, writer })
    }

    pub(crate) fn participant(&self) -> &DomainParticipant {
        &self.inner.participant
    }

    /// Makes an endpoint on an absolute ROS topic.
    pub(crate) fn ros_endpoint<R>(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
        make: impl FnOnce(&Topic) -> Result<R, NodeError>,
    ) -> Result<R, NodeError> {
        self.endpoint(&format!("rt{name}"), &dds_type(type_name, ""), qos, make)
    }

    /// Makes an endpoint on a DDS topic, when the rate limit allows it.
    fn endpoint<R>(
        &self,
        topic: &str,
        dds_type: &str,
        qos: Qos,
        make: impl FnOnce(&Topic) -> Result<R, NodeError>,
    ) -> Result<R, NodeError> {
        let _turn = self.inner.endpoint_rate.turn();
        let topic = self
            .inner
            .participant
            .create_topic(topic.to_owned(), dds_type.to_owned(), &qos.policies(), TopicKind::NoKey)
            .map_err(|error| failed(topic, &error))?;
        make(&topic)
    }

    /// Makes a reader on an absolute ROS topic, for samples of any type.
    pub(crate) fn ros_reader(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Reader, NodeError> {
        let (dds_name, dds_type) = (format!("rt{name}"), dds_type(type_name, ""));
        self.reader(name.to_owned(), &dds_name, &dds_type, qos, false)
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
        Ok(Reader::new(label, inner, has_header))
    }

    fn writer(
        &self,
        topic: &str,
        dds_type: &str,
        policies: Option<QosPolicies>,
    ) -> Result<DataWriterCdr<Padded>, NodeError> {
        self.endpoint(topic, dds_type, Qos::SERVICES, |dds| {
            self.inner
                .writers
                .create_datawriter_no_key_cdr(dds, policies)
                .map_err(|error| failed(topic, &error))
        })
    }

    fn with_node<R>(
        &self,
        what: &str,
        make: impl FnOnce(&mut ros2_client::Node) -> ros2_client::CreateResult<R>,
    ) -> Result<R, NodeError> {
        match lock(&self.inner.node).as_mut() {
            Some(node) => make(node).map_err(|error| failed(what, &error)),
            None => Err(NodeError::Stopping { what: what.to_owned() }),
        }
    }
}

impl std::fmt::Debug for Handle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Handle").field(&self.inner.names.fully_qualified()).finish()
    }
}
