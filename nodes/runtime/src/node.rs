//! The node: one process, one participant, one node.
//!
//! Makes the endpoints and owns what they need. Leaves what travels on them to
//! their own files, and start and stop of the process to `shutdown`.
//!
//! All endpoints are made at the start and kept for life: others do not learn
//! that one is gone until the node is.

use crate::cancel::Shutdown;
use crate::client::Client;
use crate::configuration::Configuration;
use crate::environment::{DiscoveryRange, Environment};
use crate::graph::{Graph, LOOPBACK_PARTICIPANTS_MAX};
use crate::interface::{Message, Service};
use crate::names::{NameError, Names};
use crate::parameter_services::{LiveParameters, serve};
use crate::parameters::{ParameterValue, USE_SIM_TIME};
use crate::publisher::Publisher;
use crate::qos::Qos;
use crate::service::{RequestInfo, Server};
use crate::subscription::{Reader, Subscription};
use crate::time::{Clock, RosTime};
use crate::wire::{Decoder, Framed, dds_type, service_topics, service_types};
use cnc_msgs::wire::rosgraph_msgs::msg::Clock as ClockMessage;
use futures::FutureExt;
use ros2_client::{Context, NodeName, NodeOptions};
use rustdds::no_key::DataWriterCdr;
use rustdds::{DomainParticipant, DomainParticipantBuilder, Topic, TopicKind};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::net::Ipv4Addr;
use std::panic::AssertUnwindSafe;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::task::JoinSet;

/// Why a node or an endpoint cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    #[error(transparent)]
    Name(#[from] NameError),
    /// The DDS layer refused.
    #[error("cannot create {what}: {reason}")]
    Create { what: String, reason: String },
    /// The node is being taken down.
    #[error("cannot create {what}: the node is stopping")]
    Stopping { what: String },
}

/// The node as its tasks see it; clones are the same node.
#[derive(Clone)]
pub struct Handle {
    inner: Arc<Inner>,
}

struct Inner {
    names: Names,
    environment: Environment,
    /// `None` once the node is being taken down.
    node: Mutex<Option<ros2_client::Node>>,
    participant: DomainParticipant,
    /// Makes the writers that ros2-client has no way to make.
    writers: rustdds::Publisher,
    graph: Arc<Graph>,
    parameters: Arc<LiveParameters>,
    clock: Arc<Clock>,
    shutdown: Shutdown,
    tasks: Mutex<JoinSet<()>>,
}

/// The two endpoints of a client or a server.
pub(crate) struct Endpoints<In, Out: Serialize> {
    pub(crate) name: String,
    pub(crate) reader: Reader<In>,
    pub(crate) writer: DataWriterCdr<Framed<Out>>,
}

/// A started node, with what must be taken down in order.
pub struct Session {
    handle: Handle,
    context: Context,
}

impl Session {
    /// Joins the domain and announces the node. Needs a tokio runtime.
    ///
    /// # Errors
    /// The participant or the node cannot be made.
    pub fn start(configuration: Configuration) -> Result<Self, NodeError> {
        let Configuration { names, environment, parameters, .. } = configuration;
        raise_file_limit();
        let participant = join(&environment)?;
        let context = Context::from_domain_participant(participant.clone())
            .map_err(|error| failed("the ROS context", &error))?;
        let node_name = NodeName::new(names.namespace(), names.node())
            .map_err(|error| failed("the node", &error))?;
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let node = context
            .new_node(node_name, options)
            .map_err(|error| failed(&names.fully_qualified(), &error))?;
        let writers = participant
            .create_publisher(&Qos::SERVICES.policies())
            .map_err(|error| failed("the DDS publisher", &error))?;
        let inner = Inner {
            names,
            environment,
            node: Mutex::new(Some(node)),
            participant: participant.clone(),
            writers,
            graph: Graph::new(),
            parameters: Arc::new(LiveParameters::new(parameters)),
            clock: Arc::default(),
            shutdown: Shutdown::new(),
            tasks: Mutex::default(),
        };
        let handle = Handle { inner: Arc::new(inner) };
        handle.spawn("graph", Arc::clone(&handle.inner.graph).follow(participant.clone()));
        handle.warn_of_crowd();
        serve(&handle, &handle.inner.parameters)?;
        handle.simulate_time(handle.parameter(USE_SIM_TIME));
        Ok(Self { handle, context })
    }

    /// The node, for its tasks.
    pub fn handle(&self) -> &Handle {
        &self.handle
    }

    /// Takes everything down in the order that DDS needs: tasks with their
    /// endpoints, the node, then the participant. Publishers and subscriptions
    /// that the caller holds should be gone before.
    ///
    /// The last answers get a tenth of a second to go out, and what was sent
    /// reliably half a second to be repaired.
    pub async fn stop(self) {
        let inner = &self.handle.inner;
        inner.shutdown.request("the node stops");
        tokio::time::sleep(Duration::from_millis(100)).await;
        let mut tasks = std::mem::take(&mut *lock(&inner.tasks));
        tasks.abort_all();
        let ended = async { while tasks.join_next().await.is_some() {} };
        if tokio::time::timeout(Duration::from_secs(2), ended).await.is_err() {
            tracing::warn!("a task does not end; the node stops without it");
        }
        tokio::time::sleep(Duration::from_millis(500)).await;
        drop(lock(&inner.node).take());
        drop(self.context);
    }
}

impl Handle {
    /// The names of the node and what it resolves.
    pub fn names(&self) -> &Names {
        &self.inner.names
    }

    /// What the environment said.
    pub fn environment(&self) -> &Environment {
        &self.inner.environment
    }

    /// ROS time: the wall clock, or `/clock` with `use_sim_time`.
    pub fn now(&self) -> RosTime {
        self.inner.clock.now()
    }

    /// The word that it is time to stop.
    pub fn shutdown(&self) -> &Shutdown {
        &self.inner.shutdown
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
        let name = self.inner.names.resolve(topic)?;
        let dds = self.ros_topic(&name, type_name, qos)?;
        let inner = self.with_node(&name, |node| node.create_publisher::<T>(&dds, None))?;
        Ok(Publisher::new(name, inner, Arc::clone(&self.inner.graph)))
    }

    /// Subscribes `T` on `topic`; `qos.depth` is what may wait unread.
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
        let name = self.inner.names.resolve(topic)?;
        let (dds_name, dds_type) = (format!("rt{name}"), dds_type(type_name, ""));
        Ok(Subscription::new(self.reader(name, &dds_name, &dds_type, qos, Decoder::plain())?))
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
        let server = self.server::<S>(name, S::TYPE_NAME)?;
        self.spawn(&format!("service {name}"), server.serve(handler));
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
        self.concurrent_service_of::<S, F, Fut>(name, S::TYPE_NAME, handler)
    }

    /// The same for a type whose name is only known at run time.
    pub(crate) fn concurrent_service_of<S, F, Fut>(
        &self,
        name: &str,
        type_name: &str,
        handler: F,
    ) -> Result<(), NodeError>
    where
        S: Service + 'static,
        F: Fn(S::Request, RequestInfo) -> Fut + Send + 'static,
        Fut: Future<Output = S::Response> + Send + 'static,
    {
        let server = self.server::<S>(name, type_name)?;
        self.spawn(&format!("service {name}"), server.serve_concurrently(handler));
        Ok(())
    }

    fn server<S: Service + 'static>(
        &self,
        name: &str,
        type_name: &str,
    ) -> Result<Server<S>, NodeError> {
        let name = self.inner.names.resolve(name)?;
        let (request_topic, reply_topic) = service_topics(&name);
        let (request_type, reply_type) = service_types(type_name);
        let mapping = self.inner.environment.mapping;
        let writer = self.writer(&reply_topic, &reply_type)?;
        let decoder = Decoder::of_service(mapping);
        let reader = self.reader(
            format!("requests of {name}"),
            &request_topic,
            &request_type,
            Qos::SERVICES,
            decoder,
        )?;
        Ok(Server::new(Endpoints { name, reader, writer }, mapping))
    }

    /// Asks a service.
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
        let name = self.inner.names.resolve(name)?;
        let (request_topic, reply_topic) = service_topics(&name);
        let (request_type, reply_type) = service_types(type_name);
        let mapping = self.inner.environment.mapping;
        let decoder = Decoder::of_service(mapping);
        let reader = self.reader(
            format!("replies of {name}"),
            &reply_topic,
            &reply_type,
            Qos::SERVICES,
            decoder,
        )?;
        let writer = self.writer(&request_topic, &request_type)?;
        let endpoints = Endpoints { name, reader, writer };
        let (client, dispatch) = Client::new(endpoints, mapping, Arc::clone(&self.inner.graph));
        self.spawn("replies", dispatch);
        Ok(client)
    }

    /// The value of a parameter now.
    ///
    /// # Panics
    /// The node did not declare it, or declared another type.
    pub fn parameter<T: TryFrom<ParameterValue>>(&self, name: &str) -> T {
        let value = self.inner.parameters.get(name);
        let value = value.unwrap_or_else(|| panic!("parameter \"{name}\" is not declared"));
        let type_name = value.type_name();
        T::try_from(value)
            .unwrap_or_else(|_| panic!("parameter \"{name}\" is declared as {type_name}"))
    }

    /// Has a say in changes of parameters while the node runs: all of them
    /// together, after they fit the declarations. The reason if it refuses.
    pub fn guard_parameters(
        &self,
        guard: impl Fn(&[(String, ParameterValue)]) -> Result<(), String> + Send + 'static,
    ) {
        self.inner.parameters.set_guard(Box::new(guard));
    }

    /// Sees every change of the parameters that comes after this call.
    pub fn parameter_changes(&self) -> tokio::sync::watch::Receiver<u64> {
        self.inner.parameters.subscribe()
    }

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
            Err(error) => tracing::error!("time stands still: {error}"),
        }
    }

    /// Runs a named thread that ends by itself when the node stops; for work
    /// that must not wait for others. One that panics stops the node.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn spawn_thread(
        &self,
        name: &str,
        work: impl FnOnce() + Send + 'static,
    ) -> std::io::Result<std::thread::JoinHandle<()>> {
        let (label, shutdown) = (name.to_owned(), self.inner.shutdown.clone());
        std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            if let Err(panic) = std::panic::catch_unwind(AssertUnwindSafe(work)) {
                let reason = panic_text(&*panic);
                tracing::error!("thread \"{label}\" panicked: {reason}; the node stops");
                shutdown.fail(&format!("thread \"{label}\" panicked: {reason}"));
            }
        })
    }

    /// Runs a task that ends with the node. One that panics stops the node.
    pub fn spawn<F>(&self, name: &str, task: F)
    where
        F: Future<Output = ()> + Send + 'static,
    {
        let (name, shutdown) = (name.to_owned(), self.inner.shutdown.clone());
        let mut tasks = lock(&self.inner.tasks);
        while tasks.try_join_next().is_some() {}
        tasks.spawn(async move {
            if let Err(panic) = AssertUnwindSafe(task).catch_unwind().await {
                let reason = panic_text(&*panic);
                tracing::error!("task \"{name}\" panicked: {reason}; the node stops");
                shutdown.fail(&format!("task \"{name}\" panicked: {reason}"));
            }
        });
    }

    pub(crate) fn participant(&self) -> &DomainParticipant {
        &self.inner.participant
    }

    /// The DDS topic of an absolute ROS topic.
    pub(crate) fn ros_topic(
        &self,
        name: &str,
        type_name: &str,
        qos: Qos,
    ) -> Result<Topic, NodeError> {
        self.topic(&format!("rt{name}"), &dds_type(type_name, ""), qos)
    }

    fn topic(&self, name: &str, dds_type: &str, qos: Qos) -> Result<Topic, NodeError> {
        self.inner
            .participant
            .create_topic(name.to_owned(), dds_type.to_owned(), &qos.policies(), TopicKind::NoKey)
            .map_err(|error| failed(name, &error))
    }

    fn reader<T: DeserializeOwned + 'static>(
        &self,
        label: String,
        topic: &str,
        dds_type: &str,
        qos: Qos,
        decoder: Decoder<T>,
    ) -> Result<Reader<T>, NodeError> {
        let topic = self.topic(topic, dds_type, qos)?;
        let inner = self.with_node(&label, |node| node.create_subscription(&topic, None))?;
        Ok(Reader::new(label, inner, decoder))
    }

    fn writer<T: Serialize>(
        &self,
        topic: &str,
        dds_type: &str,
    ) -> Result<DataWriterCdr<Framed<T>>, NodeError> {
        let dds = self.topic(topic, dds_type, Qos::SERVICES)?;
        self.inner
            .writers
            .create_datawriter_no_key_cdr(&dds, None)
            .map_err(|error| failed(topic, &error))
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

    fn warn_of_crowd(&self) {
        let id = usize::from(self.inner.participant.participant_id());
        let is_local = self.inner.environment.range != DiscoveryRange::Subnet;
        if is_local && id >= LOOPBACK_PARTICIPANTS_MAX {
            tracing::error!(
                "this is participant {} of ROS_DOMAIN_ID {} on this computer; on the loopback \
                 interface alone the others do not see more than {LOOPBACK_PARTICIPANTS_MAX}: \
                 stop some, or use another domain, or ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET",
                id + 1,
                self.inner.environment.domain_id
            );
        }
    }
}

impl std::fmt::Debug for Handle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Handle").field(&self.inner.names.fully_qualified()).finish()
    }
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Session").field(&self.handle).finish()
    }
}

fn join(environment: &Environment) -> Result<DomainParticipant, NodeError> {
    let builder = DomainParticipantBuilder::new(environment.domain_id);
    let builder = match environment.range {
        DiscoveryRange::Subnet => builder,
        DiscoveryRange::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
        DiscoveryRange::Off => {
            builder.with_only_networks(std::iter::empty::<Ipv4Addr>()).same_host_loopback(false)
        }
    };
    builder.build().map_err(|error| {
        failed(&format!("a participant in domain {}", environment.domain_id), &error)
    })
}

/// Each endpoint takes three files; the usual limit of 1024 is reached by a
/// recorder with 300 topics.
fn raise_file_limit() {
    use rustix::process::{Resource, getrlimit, setrlimit};
    let mut limit = getrlimit(Resource::Nofile);
    if limit.current.is_some() && limit.current != limit.maximum {
        limit.current = limit.maximum;
        // Without it, creating the endpoint that is one too many says so.
        let _ = setrlimit(Resource::Nofile, limit);
    }
}

fn failed(what: &str, reason: &dyn std::fmt::Display) -> NodeError {
    NodeError::Create { what: what.to_owned(), reason: reason.to_string() }
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned())
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
