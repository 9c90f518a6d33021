//! Discovery: the peers of a node.
//!
//! The only reader of the participant's status channel. It remembers which
//! remote endpoints are matched with each of ours and since when, wakes the tasks
//! that wait for a peer, and reports peers that are refused for their QoS.

use crate::samples::gid::Gid;
use futures::StreamExt;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent as Event, GUID, StatusEvented};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// How many participants find each other on the loopback interface alone:
/// discovery without multicast probes the ports of so many ids (`SPDP_LOCALHOST_PEER_COUNT` of our RustDDS).
pub const LOOPBACK_PARTICIPANTS_MAX: usize = 64;

/// The known peers; shared by all endpoints.
#[derive(Debug)]
pub(crate) struct Graph {
    peers: Mutex<Peers>,
    changes: watch::Sender<u64>,
}

#[derive(Debug, Default)]
struct Peers {
    /// Remote endpoints by local endpoint, with the time of the match.
    matched: BTreeMap<Gid, BTreeMap<Gid, Instant>>,
    /// Their DDS vendors.
    participants: BTreeMap<[u8; 12], [u8; 2]>,
}

impl Graph {
    pub(crate) fn new() -> Arc<Self> {
        Arc::new(Self { peers: Mutex::default(), changes: watch::Sender::new(0) })
    }

    fn peers(&self) -> MutexGuard<'_, Peers> {
        self.peers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A remote endpoint is matched with one of ours.
    #[cfg(feature = "zenoh")]
    pub(crate) fn matched(&self, local: Gid, remote: Gid) {
        self.peers().matched.entry(local).or_default().entry(remote).or_insert_with(Instant::now);
        self.wake();
    }

    /// A remote endpoint has gone.
    #[cfg(feature = "zenoh")]
    pub(crate) fn lost(&self, remote: Gid) {
        self.peers().lose(remote);
        self.wake();
    }

    fn wake(&self) {
        self.changes.send_modify(|count| *count = count.wrapping_add(1));
    }

    /// How many remote endpoints the local one is matched with.
    pub(crate) fn matches(&self, local: Gid) -> usize {
        self.peers().matched.get(&local).map_or(0, BTreeMap::len)
    }

    /// The endpoints of a process that the local one is matched with.
    pub(crate) fn matched_of(&self, local: Gid, participant: [u8; 12]) -> Vec<Gid> {
        let peers = self.peers();
        let remotes = peers.matched.get(&local).into_iter().flat_map(BTreeMap::keys);
        remotes.filter(|remote| remote.participant() == participant).copied().collect()
    }

    /// The DDS vendors of the other participants.
    pub(crate) fn vendors(&self) -> Vec<[u8; 2]> {
        self.peers().participants.values().copied().collect()
    }

    /// Wakes at every change, without saying what has changed.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// How long ago the first peer that is still there was matched with each
    /// of `locals`: the youngest of these; `None` while one of them has no peer.
    fn matched_for(&self, locals: &[Gid]) -> Option<Duration> {
        let peers = self.peers();
        let mut youngest = Duration::MAX;
        for local in locals {
            let since = peers.matched.get(local)?.values().min()?;
            youngest = youngest.min(since.elapsed());
        }
        Some(youngest)
    }

    /// Waits until each of `locals` has had a peer for `settle`; false when
    /// `deadline` came first.
    pub(crate) async fn wait_for_peers(
        &self,
        locals: &[Gid],
        settle: Duration,
        deadline: Duration,
    ) -> bool {
        let mut changes = self.changes.subscribe();
        let waiting = async {
            loop {
                changes.borrow_and_update();
                match self.matched_for(locals) {
                    Some(age) if age >= settle => return,
                    Some(age) => tokio::time::sleep(settle - age).await,
                    // The sender lives as long as `self`.
                    None => drop(changes.changed().await),
                }
            }
        };
        tokio::time::timeout(deadline, waiting).await.is_ok()
    }

    /// Follows the participant's status channel and never returns; exactly one task may.
    pub(crate) async fn follow(self: Arc<Self>, participant: DomainParticipant) {
        let listener = participant.status_listener();
        let mut events = listener.as_async_status_stream();
        while let Some(event) = events.next().await {
            self.take(event);
            self.wake();
        }
    }

    fn take(&self, event: Event) {
        let mut peers = self.peers();
        match event {
            Event::RemoteReaderMatched { local_writer, remote_reader } => {
                peers.add(local_writer, remote_reader);
            }
            Event::RemoteWriterMatched { local_reader, remote_writer } => {
                peers.add(local_reader, remote_writer);
            }
            Event::ReaderLost { guid, .. } | Event::WriterLost { guid, .. } => {
                peers.lose(guid.into());
            }
            Event::ParticipantDiscovered { dpd } => {
                let participant = Gid::from(dpd.guid).participant();
                peers.participants.insert(participant, dpd.vendor_id.as_bytes());
            }
            Event::ParticipantLost { id, .. } => {
                let prefix: &[u8] = id.as_ref();
                peers.participants.retain(|known, _| known != prefix);
                for remotes in peers.matched.values_mut() {
                    remotes.retain(|remote, _| remote.participant() != *prefix);
                }
            }
            Event::RemoteReaderQosIncompatible { remote_reader, requested_qos, .. } => {
                tracing::warn!(
                    "subscriber {} gets no messages: its QoS asks for more than this publisher \
                     offers: {requested_qos:?}",
                    Gid::from(remote_reader)
                );
            }
            Event::RemoteWriterQosIncompatible { remote_writer, offered_qos, .. } => {
                tracing::warn!(
                    "publisher {} is not received: its QoS offers less than this subscription \
                     asks for: {offered_qos:?}",
                    Gid::from(remote_writer)
                );
            }
            _ => {}
        }
    }
}

impl Peers {
    fn lose(&mut self, lost: Gid) {
        for remotes in self.matched.values_mut() {
            remotes.remove(&lost);
        }
    }

    fn add(&mut self, local: GUID, remote: GUID) {
        let remotes = self.matched.entry(local.into()).or_default();
        remotes.entry(remote.into()).or_insert_with(Instant::now);
    }
}
