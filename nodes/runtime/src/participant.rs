//! Joins a domain of DDS: the participant, its context and its node.

use crate::command_line::environment::{DiscoveryRange, Environment};
use crate::command_line::names::Names;
use crate::endpoints::dds::Dds;
use crate::endpoints::error::{NodeError, failed};
use crate::endpoints::graph::LOOPBACK_PARTICIPANTS_MAX;
use crate::endpoints::middleware::Middleware;
use crate::process::shutdown::Shutdown;
use crate::process::watchdog::{Deafness, EndOfProcess};
use crate::rustdds::dds_watch;
use crate::rustdds::dropped_publishers::DroppedPublishers;
use crate::rustdds::type_hashes;
use crate::samples::qos::Qos;
use crate::session::Joined;
use ros2_client::{Context, NodeName, NodeOptions};
use rustdds::{DomainParticipant, DomainParticipantBuilder, PEERS_MAX, own_addresses};
use std::net::{IpAddr, Ipv4Addr, ToSocketAddrs};
use std::path::Path;
use std::sync::{Arc, Mutex};
use tokio::sync::watch;

/// Joins the domain and announces the node. `deaf` gets the reason when the DDS layer ends, unless
/// `end` says that the process ends with it.
pub(crate) fn join(
    names: &Names,
    environment: &Environment,
    enclave: Option<&Path>,
    (deaf, end): (watch::Sender<Option<Deafness>>, Option<EndOfProcess>),
    shutdown: Shutdown,
) -> Result<Joined, NodeError> {
    let participant = participant(environment, enclave)?;
    let watch = dds_watch::start(participant.loop_turns(), deaf, end)
        .map_err(|error| failed("the thread that watches the DDS layer", &error))?;
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
    let middleware = Middleware::Dds(Arc::new(Dds {
        node: Mutex::new(Some(node)),
        participant,
        writers,
        dropped_publishers: DroppedPublishers::new(shutdown),
        environment: environment.clone(),
    }));
    Ok(Joined { middleware, watch, context })
}

pub(crate) fn warn_of_too_many_participants(dds: &Dds) {
    let id = usize::from(dds.participant.participant_id());
    let is_local = dds.environment.range != DiscoveryRange::Subnet;
    if is_local && id >= LOOPBACK_PARTICIPANTS_MAX {
        tracing::error!(
            "this is participant {} of ROS_DOMAIN_ID {} on this computer; on the loopback \
             interface alone the others do not see more than {LOOPBACK_PARTICIPANTS_MAX}: \
             stop some, or use another domain, or ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET",
            id + 1,
            dds.environment.domain_id
        );
    }
}

fn participant(
    environment: &Environment,
    enclave: Option<&Path>,
) -> Result<DomainParticipant, NodeError> {
    type_hashes::announce_and_compare();
    let builder = DomainParticipantBuilder::new(environment.domain_id)
        .with_peers(addresses_of(&environment.static_peers)?);
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

/// The IPv4 addresses of other computers. A name without one ends the node: it would wait for a peer in vain.
fn addresses_of(peers: &[String]) -> Result<Vec<Ipv4Addr>, NodeError> {
    let mut addresses = Vec::new();
    for peer in peers {
        let what = || format!("a participant with the peer {peer} of ROS_STATIC_PEERS");
        let found =
            (peer.as_str(), 0).to_socket_addrs().map_err(|error| failed(&what(), &error))?;
        let before = addresses.len();
        addresses.extend(found.filter_map(|address| match address.ip() {
            IpAddr::V4(address) => Some(address),
            IpAddr::V6(_) => None,
        }));
        if addresses.len() == before {
            return Err(failed(&what(), &"it has no IPv4 address"));
        }
    }
    // All computers of a cell may have the same list.
    let own = own_addresses();
    addresses.retain(|address| !address.is_loopback() && !own.contains(address));
    addresses.sort_unstable();
    addresses.dedup();
    if addresses.len() > PEERS_MAX {
        let reason =
            format!("they have {} addresses; at most {PEERS_MAX} are possible", addresses.len());
        return Err(failed("a participant with the peers of ROS_STATIC_PEERS", &reason));
    }
    Ok(addresses)
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
