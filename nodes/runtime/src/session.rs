//! One process, one participant, one node: start and end.
//!
//! More than one node on a participant would steal each other's events. What
//! the node does meanwhile is in `node`; signals and exit status are in `run`.

use crate::command_line::configuration::Configuration;
use crate::command_line::environment::{DiscoveryRange, Environment};
use crate::endpoints::error::{NodeError, failed};
use crate::endpoints::graph::{Graph, LOOPBACK_PARTICIPANTS_MAX};
use crate::endpoints::node::{Handle, Inner};
use crate::endpoints::qos::Qos;
use crate::managed::logger_services;
use crate::managed::parameter_services::serve;
use crate::managed::type_description;
use crate::parameters::USE_SIM_TIME;
use crate::parameters::live::LiveParameters;
use crate::process::lock;
use crate::process::shutdown::Shutdown;
use crate::process::supervision::Notifier;
use crate::rustdds::dds_threads::{DdsThreads, dds_threads};
use crate::rustdds::dds_watch::{DdsWatch, EndOfProcess};
use crate::rustdds::dropped_publishers::DroppedPublishers;
use crate::rustdds::endpoint_rate_limit::EndpointRateLimit;
use crate::rustdds::memory_bound::MemoryBound;
use crate::rustdds::sockets::{confine_since, open_sockets};
use ros2_client::{Context, NodeName, NodeOptions};
use rustdds::{DomainParticipant, DomainParticipantBuilder};
use std::net::Ipv4Addr;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A started node, with everything that must be torn down in order.
pub struct Session {
    /// Dropped before the threads that it watches.
    watch: DdsWatch,
    handle: Handle,
    context: Context,
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
        if let Some(end) = &end {
            end.memory.enforce();
        }
        let Configuration { names, environment, parameters, logs, enclave, .. } = configuration;
        raise_file_limit();
        let (participant, threads) = join(&environment, enclave.as_deref())?;
        if threads.count() == 0 {
            tracing::warn!("/proc does not show the threads of the DDS layer: nobody watches them");
        }
        let deaf = tokio::sync::watch::Sender::new(None);
        let watch = DdsWatch::start(
            participant.clone(),
            environment.domain_id,
            threads.clone(),
            deaf.clone(),
            end,
        )
        .map_err(|error| failed("the thread that watches the DDS layer", &error))?;
        let endpoint_rate = EndpointRateLimit::new(threads, enclave.is_some());
        // The context and the node have an endpoint each.
        let turn = endpoint_rate.turn();
        let context = Context::from_domain_participant(participant.clone())
            .map_err(|error| failed("the ROS context", &error))?;
        let node_name = NodeName::new(names.namespace(), names.node())
            .map_err(|error| failed("the node", &error))?;
        drop(turn);
        let turn = endpoint_rate.turn();
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let node = context
            .new_node(node_name, options)
            .map_err(|error| failed(&names.fully_qualified(), &error))?;
        drop(turn);
        let writers = participant
            .create_publisher(&Qos::SERVICES.policies())
            .map_err(|error| failed("the DDS publisher", &error))?;
        let shutdown = Shutdown::new();
        let dropped_publishers = DroppedPublishers::new(shutdown.clone());
        let inner = Inner {
            configuration: again,
            names,
            environment,
            node: Mutex::new(Some(node)),
            participant: participant.clone(),
            writers,
            endpoint_rate,
            graph: Graph::new(),
            parameters: Arc::new(LiveParameters::new(parameters)),
            clock: Arc::default(),
            lifecycle: tokio::sync::watch::Sender::new(None),
            shutdown,
            deaf,
            dropped_publishers,
            tasks: Mutex::default(),
            memory: std::sync::OnceLock::new(),
        };
        let handle = Handle { inner: Arc::new(inner) };
        handle.spawn("graph", Arc::clone(&handle.inner.graph).follow(participant.clone()));
        warn_of_too_many_participants(&handle);
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
        let end = EndOfProcess { logger, memory, when_deaf: false };
        Self::start_ruled(configuration, Some(end))
    }

    /// Restarts the node after its DDS layer has ended: see [`Handle::deaf`].
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn again(deaf: &Handle) -> Result<Self, NodeError> {
        Self::start_as_command(deaf.inner.configuration.clone())
    }

    /// Tears everything down in the order that DDS needs: tasks with their
    /// endpoints, the node, then the participant. The caller should drop its publishers and
    /// subscriptions first.
    ///
    /// The last answers get a tenth of a second to be sent, and reliable samples half a
    /// second to be repaired. A deaf node is left as it is.
    pub async fn stop(self) {
        if self.handle.inner.deaf.borrow().is_some() {
            // Its DDS layer would never finish; the process is about to end.
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
        inner.dropped_publishers.clear();
        drop(self.watch);
        drop(lock(&inner.node).take());
        drop(self.context);
    }
}

fn warn_of_too_many_participants(handle: &Handle) {
    let id = usize::from(handle.inner.participant.participant_id());
    let is_local = handle.inner.environment.range != DiscoveryRange::Subnet;
    if is_local && id >= LOOPBACK_PARTICIPANTS_MAX {
        tracing::error!(
            "this is participant {} of ROS_DOMAIN_ID {} on this computer; on the loopback \
             interface alone the others do not see more than {LOOPBACK_PARTICIPANTS_MAX}: \
             stop some, or use another domain, or ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET",
            id + 1,
            handle.inner.environment.domain_id
        );
    }
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Session").field(&self.handle).finish()
    }
}

/// One participant at a time: its sockets and threads are found by comparing before and after.
static JOINING: Mutex<()> = Mutex::new(());

fn join(
    environment: &Environment,
    enclave: Option<&Path>,
) -> Result<(DomainParticipant, DdsThreads), NodeError> {
    let _alone = lock(&JOINING);
    let (before, threads_before) = (open_sockets(), dds_threads());
    let participant = build(environment, enclave)?;
    let threads = DdsThreads::since(&threads_before);
    if environment.range != DiscoveryRange::Subnet {
        match before.and_then(|before| confine_since(&before)) {
            Ok(count) => tracing::debug!("{count} sockets are bound to the loopback interface"),
            Err(error) => {
                return Err(failed(
                    "a node that only this computer reaches",
                    &format_args!(
                        "its sockets cannot be bound to the loopback interface ({error}); in a \
                         container allow it with --cap-add SYS_PTRACE, or let other computers \
                         reach it with ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"
                    ),
                ));
            }
        }
    }
    Ok((participant, threads))
}

fn build(
    environment: &Environment,
    enclave: Option<&Path>,
) -> Result<DomainParticipant, NodeError> {
    let builder = DomainParticipantBuilder::new(environment.domain_id);
    let builder = match environment.range {
        DiscoveryRange::Subnet => builder,
        DiscoveryRange::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
        DiscoveryRange::Off => {
            builder.with_only_networks(std::iter::empty::<Ipv4Addr>()).same_host_loopback(false)
        }
    };
    let builder = match enclave {
        Some(enclave) => protect(builder, enclave),
        None => builder,
    };
    builder.build().map_err(|error| {
        failed(&format!("a participant in domain {}", environment.domain_id), &error)
    })
}

/// Gives the participant the keys and permissions of its enclave.
#[cfg(feature = "security")]
fn protect(builder: DomainParticipantBuilder, enclave: &Path) -> DomainParticipantBuilder {
    use rustdds::DomainParticipantSecurityConfigFiles;
    // SROS2 keys have no password: file permissions protect them.
    let files =
        DomainParticipantSecurityConfigFiles::with_ros_default_names(enclave, String::new());
    builder.builtin_security(files)
}

/// There is no enclave where security is not built in.
#[cfg(not(feature = "security"))]
fn protect(builder: DomainParticipantBuilder, _: &Path) -> DomainParticipantBuilder {
    builder
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
