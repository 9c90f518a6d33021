//! Announces the entities of this process, and follows those of others.

use crate::process::lock;
use crate::samples::gid::Gid;
use crate::zenoh::error::ZenohError;
use crate::zenoh::names::{Token, Topic, all_tokens};
use crate::zenoh::table::{Arrival, Table};
use std::sync::{Arc, Mutex};
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};

/// A change of what our endpoints exchange samples with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Change {
    Matched { local: Gid, remote: Gid },
    Lost { remote: Gid },
}

type OnChange = Box<dyn Fn(Change) + Send + Sync>;

/// The graph of a domain, as this process knows it.
pub(crate) struct Discovery {
    table: Mutex<Table>,
    /// Held until a change has been reported, so that a match is never reported after its loss.
    order: Mutex<()>,
    on_change: OnChange,
}

/// An entity of this process, announced as long as this lives.
pub(crate) struct Announced {
    discovery: Arc<Discovery>,
    gid: Gid,
    /// Dropping it takes the announcement back.
    _token: LivelinessToken,
}

impl Drop for Announced {
    fn drop(&mut self) {
        lock(&self.discovery.table).remove_local(self.gid);
    }
}

impl Discovery {
    /// Follows the tokens of a domain as long as the subscriber lives.
    pub(crate) fn start(
        session: &zenoh::Session,
        domain_id: u16,
        on_change: OnChange,
    ) -> Result<(Arc<Self>, Subscriber<()>), ZenohError> {
        let table = Mutex::new(Table::new(&session.zid().to_string()));
        let discovery = Arc::new(Self { table, order: Mutex::default(), on_change });
        let follower = Arc::clone(&discovery);
        let subscriber = session
            .liveliness()
            .declare_subscriber(all_tokens(domain_id))
            .history(true)
            .callback(move |sample: Sample| follower.take(&sample))
            .wait()
            .map_err(|error| ZenohError::new("the view of the graph", &error))?;
        Ok((discovery, subscriber))
    }

    /// Announces an entity.
    pub(crate) fn announce(
        self: &Arc<Self>,
        session: &zenoh::Session,
        token: Token,
    ) -> Result<Announced, ZenohError> {
        let (text, gid) = (token.text(), token.gid());
        let order = lock(&self.order);
        let arrival = lock(&self.table).add_local(token);
        self.report(arrival);
        drop(order);
        let declared = session.liveliness().declare_token(text.as_str()).wait();
        let declared = declared.map_err(|error| ZenohError::new(&text, &error))?;
        Ok(Announced { discovery: Arc::clone(self), gid, _token: declared })
    }

    /// The address here of who sent a sample.
    pub(crate) fn gid_of(&self, wire_gid: [u8; 16]) -> Gid {
        lock(&self.table).gid_of(wire_gid)
    }

    pub(crate) fn publishers(&self) -> Vec<(Topic, Gid)> {
        lock(&self.table).publishers()
    }

    pub(crate) fn type_hash(&self, topic: &str, type_name: &str) -> Option<String> {
        lock(&self.table).type_hash(topic, type_name).map(str::to_owned)
    }

    fn take(&self, sample: &Sample) {
        let text = sample.key_expr().as_str();
        let _order = lock(&self.order);
        match sample.kind() {
            SampleKind::Put => {
                let arrival = lock(&self.table).arrived(text);
                self.report(arrival.unwrap_or_default());
            }
            SampleKind::Delete => {
                let left = lock(&self.table).left(text);
                if let Some(remote) = left {
                    (self.on_change)(Change::Lost { remote });
                }
            }
        }
    }

    fn report(&self, arrival: Arrival) {
        for (local, remote) in arrival.matched {
            (self.on_change)(Change::Matched { local, remote });
        }
        for difference in arrival.differences {
            tracing::warn!("{difference}");
        }
    }
}

impl std::fmt::Debug for Discovery {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Discovery").finish_non_exhaustive()
    }
}
