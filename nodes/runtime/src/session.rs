//! One process, one participant or session, one node: start and end.
//!
//! More than one node on a participant would steal each other's events. What
//! the node does meanwhile is in `node`; signals and exit status are in `run`. `participant` joins a
//! domain of DDS, `zenoh::session` opens a session of Zenoh.

use crate::command_line::configuration::Configuration;
use crate::command_line::environment::ServiceMapping;
use crate::endpoints::error::{NodeError, failed};
use crate::endpoints::graph::Graph;
use crate::endpoints::middleware::Middleware;
use crate::endpoints::node::{Handle, Inner};
use crate::managed::logger_services;
use crate::managed::parameter_services::serve;
use crate::managed::type_description;
use crate::parameters::USE_SIM_TIME;
use crate::parameters::live::LiveParameters;
use crate::participant::{self, warn_of_too_many_participants};
use crate::process::lock;
use crate::process::shutdown::Shutdown;
use crate::process::supervision::Notifier;
use crate::process::watchdog::{EndOfProcess, Watchdog};
use crate::rustdds::memory_bound::MemoryBound;
use ros2_client::Context;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// How long the middleware may take to end.
const ENDS_WITHIN: Duration = Duration::from_secs(5);

/// A started node, with everything that must be torn down in order.
pub struct Session {
    /// Dropped before the threads that it watches.
    watch: Watchdog,
    handle: Handle,
    /// Of DDS alone.
    context: Option<Context>,
}

/// A node that has joined its domain.
pub(crate) struct Joined {
    pub(crate) middleware: Middleware,
    pub(crate) watch: Watchdog,
    pub(crate) context: Context,
}

impl Session {
    /// Joins the domain and announces the node. Needs a tokio runtime.
    ///
    /// # Errors
    /// The participant or the node cannot be made.
    pub fn start(configuration: Configuration) -> Result<Self, NodeError> {
        Self::start_ruled(configuration, None)
    }

    /// The same; `end` takes effect before the first packet is received.
    pub(crate) fn start_ruled(
        configuration: Configuration,
        end: Option<EndOfProcess>,
    ) -> Result<Self, NodeError> {
        let again = configuration.clone();
        let Configuration { names, environment, parameters, logs, enclave, .. } = configuration;
        raise_file_limit();
        let (deaf, graph) = (watch::Sender::new(None), Graph::new());
        let shutdown = Shutdown::new();
        let (middleware, watch, context) = match environment.mapping {
            ServiceMapping::Enhanced | ServiceMapping::Cyclone => {
                let Joined { middleware, watch, context } = participant::join(
                    &names,
                    &environment,
                    enclave.as_deref(),
                    (deaf.clone(), end),
                    shutdown.clone(),
                )?;
                (middleware, watch, Some(context))
            }
            #[cfg(feature = "zenoh")]
            ServiceMapping::Queries => {
                let changes = Arc::clone(&graph);
                let node = crate::zenoh::session::open(&names, &environment, move |change| {
                    use crate::zenoh::discovery::Change;
                    match change {
                        Change::Matched { local, remote } => changes.matched(local, remote),
                        Change::Lost { remote } => changes.lost(remote),
                    }
                })?;
                let watch = node.watch(deaf.clone(), end);
                let watch =
                    watch.map_err(|error| failed("the thread that watches Zenoh", &error))?;
                (Middleware::Zenoh(Box::new(node)), watch, None)
            }
            #[cfg(not(feature = "zenoh"))]
            ServiceMapping::Queries => {
                return Err(failed("a session of Zenoh", &"this build has no Zenoh"));
            }
        };
        let inner = Inner {
            configuration: again,
            names,
            environment,
            middleware,
            graph,
            parameters: Arc::new(LiveParameters::new(parameters)),
            clock: Arc::default(),
            lifecycle: tokio::sync::watch::Sender::new(None),
            shutdown,
            deaf,
            tasks: Mutex::default(),
            memory: std::sync::OnceLock::new(),
        };
        let handle = Handle { inner: Arc::new(inner) };
        if let Some(dds) = handle.inner.middleware.dds() {
            let graph = Arc::clone(&handle.inner.graph);
            handle.spawn("graph", graph.follow(dds.participant.clone()));
            warn_of_too_many_participants(dds);
        }
        serve(&handle, &handle.inner.parameters)?;
        logger_services::serve(&handle, &logs.levels)?;
        type_description::serve(&handle)?;
        handle.simulate_time(handle.parameter(USE_SIM_TIME));
        Ok(Self { watch, handle, context })
    }

    /// The node, for its tasks.
    pub fn handle(&self) -> &Handle {
        &self.handle
    }

    /// From now on the supervisor is notified that this process lives and serves.
    pub(crate) fn report_to(&self, notifier: Notifier) {
        self.watch.report_to(notifier);
    }

    /// Starts the node of a command, which exits when it takes too much memory, and reconnects
    /// when it is deaf.
    pub(crate) fn start_as_command(configuration: Configuration) -> Result<Self, NodeError> {
        let logger = configuration.names.logger();
        let memory = MemoryBound::usual();
        memory.enforce();
        let exceeded = Box::new(move || memory.exceeded());
        let end = EndOfProcess { logger, when_deaf: false, exceeded };
        Self::start_ruled(configuration, Some(end))
    }

    /// Restarts the node after its middleware has ended: see [`Handle::deaf`].
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn again(deaf: &Handle) -> Result<Self, NodeError> {
        Self::start_as_command(deaf.inner.configuration.clone())
    }

    /// Tears everything down in the order that the middleware needs: tasks with their
    /// endpoints, the node, then the participant or session. The caller should drop its publishers and
    /// subscriptions first.
    ///
    /// The last answers get a tenth of a second to be sent, and reliable samples half a
    /// second to be repaired. A deaf node is left as it is.
    pub async fn stop(self) {
        if self.handle.inner.deaf.borrow().is_some() {
            // Its middleware would never finish; the process is about to end.
            std::mem::forget(self);
            return;
        }
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
        let Self { watch, handle, context } = self;
        let ending = std::thread::spawn(move || {
            drop(watch);
            handle.inner.middleware.stop();
            drop(context);
        });
        let end = Instant::now() + ENDS_WITHIN;
        while !ending.is_finished() {
            if Instant::now() >= end {
                // It hangs in the middleware; the process is about to end.
                return tracing::warn!("the middleware does not end; the node stops without it");
            }
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Session").field(&self.handle).finish()
    }
}

/// Raises the limit of open files. Each endpoint takes three; a recorder with 300 topics
/// reaches the usual limit of 1024.
fn raise_file_limit() {
    use rustix::process::{Resource, getrlimit, setrlimit};
    let mut limit = getrlimit(Resource::Nofile);
    if limit.current.is_some() && limit.current != limit.maximum {
        limit.current = limit.maximum;
        // If this fails, creating an endpoint above the limit reports it.
        let _ = setrlimit(Resource::Nofile, limit);
    }
}
