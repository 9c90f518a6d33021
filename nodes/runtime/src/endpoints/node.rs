//! The node, as its tasks see it.
//!
//! Makes the endpoints and owns what they share. `session` starts and stops it.
//!
//! All endpoints are made at the start and kept until the node ends: peers do not notice
//! that a single endpoint is gone.

use crate::command_line::configuration::Configuration;
use crate::command_line::environment::Environment;
use crate::command_line::names::{Names, Scope};
use crate::endpoints::client::Client;
use crate::endpoints::error::NodeError;
use crate::endpoints::graph::Graph;
use crate::endpoints::middleware::Middleware;
use crate::endpoints::other_middleware::mismatch;
use crate::endpoints::publisher::Publisher;
use crate::endpoints::service::{Overload, Replying, Request, RequestInfo, Server};
use crate::endpoints::subscription::{Reader, Subscription};
use crate::parameters::ParameterValue;
use crate::parameters::common::{SERVICE_DEPTH, SERVICE_DEPTH_USUAL};
use crate::parameters::live::LiveParameters;
use crate::process::lifecycle_states::LifecycleState;
use crate::process::memory::Memory;
use crate::process::shutdown::Shutdown;
use crate::process::time::{Clock, RosTime};
use crate::process::watchdog::Deafness;
use crate::samples::qos::Qos;
use cnc_msgs::interface::{Message, Service};
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
    pub(crate) middleware: Middleware,
    pub(crate) graph: Arc<Graph>,
    pub(crate) parameters: Arc<LiveParameters>,
    pub(crate) clock: Arc<Clock>,
    /// `None` while the node is not managed.
    pub(crate) lifecycle: tokio::sync::watch::Sender<Option<LifecycleState>>,
    pub(crate) shutdown: Shutdown,
    /// Why the middleware does not serve this node any more; `None` while it does.
    pub(crate) deaf: tokio::sync::watch::Sender<Option<Deafness>>,
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

    /// Waits until the middleware no longer serves this node, and returns the reason. From then on
    /// the node can neither send nor receive.
    pub async fn deaf(&self) -> String {
        let mut deaf = self.inner.deaf.subscribe();
        // The sender lives as long as `self`.
        if deaf.wait_for(Option::is_some).await.is_err() {
            return std::future::pending().await;
        }
        let mut reason = String::new();
        self.inner.deaf.send_if_modified(|deafness| {
            if let Some(deafness) = deafness {
                deafness.is_heard = true;
                reason.clone_from(&deafness.reason);
            }
            false
        });
        reason
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
    /// The name is not valid, or the middleware refused.
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
        let outgoing = self.inner.middleware.publisher(&name, type_name, qos)?;
        Ok(Publisher::new(name, outgoing, Arc::clone(&self.inner.graph)))
    }

    /// Subscribes `T` on `topic`; up to `qos.depth` samples may wait unread.
    ///
    /// # Errors
    /// The name is not valid, or the middleware refused.
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
        Ok(Subscription::new(self.inner.middleware.subscription(&name, type_name, qos)?))
    }

    /// Offers a service; requests are answered one after the other, in order.
    ///
    /// # Errors
    /// The name is not valid, or the middleware refused.
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
    /// The name is not valid, or the middleware refused.
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
    ) -> Result<(Reader, Replying), NodeError> {
        let name = self.inner.names.resolve_as(name, Scope::Service)?;
        let depth = match self.inner.parameters.get(SERVICE_DEPTH) {
            Some(ParameterValue::Integer(depth)) => usize::try_from(depth).unwrap_or(1),
            _ => SERVICE_DEPTH_USUAL as usize,
        };
        self.inner.middleware.server(&name, type_name, depth)
    }

    /// Makes a client of a service.
    ///
    /// # Errors
    /// The name is not valid, or the middleware refused.
    pub fn client<S: Service + 'static>(&self, name: &str) -> Result<Client<S>, NodeError> {
        self.client_of(name, S::TYPE_NAME)
    }

    /// The same for a type whose name is only known at run time.
    pub(crate) fn client_of<S: Service + 'static>(
        &self,
        name: &str,
        type_name: &str,
    ) -> Result<Client<S>, NodeError> {
        let name = self.inner.names.resolve_as(name, Scope::Service)?;
        let endpoints = self.inner.middleware.client(&name, type_name)?;
        let (client, dispatch) = Client::new(endpoints, Arc::clone(&self.inner.graph));
        self.spawn("replies", dispatch);
        Ok(client)
    }
}

impl std::fmt::Debug for Handle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Handle").field(&self.inner.names.fully_qualified()).finish()
    }
}
