//! Keeps the queries of a service until they are answered.

use crate::process::lock;
use crate::process::time::RosTime;
use crate::samples::check_length;
use crate::samples::sample::{RequestId, Sample, SampleInfo};
use crate::zenoh::attachment::{Attachment, encapsulated, received};
use crate::zenoh::discovery::Discovery;
use crate::zenoh::link::beside_other_tasks;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use zenoh::Wait;
use zenoh::query::Query;

/// Requests that may wait for their answers; a further one drops the oldest, whose client then has none.
const PENDING_MAX: usize = 1024;

/// The answers of a service; clones share the queries.
#[derive(Clone)]
pub(crate) struct Answers {
    /// The key of the service.
    key: Arc<str>,
    pending: Arc<Mutex<VecDeque<Pending>>>,
}

struct Pending {
    id: RequestId,
    /// The client, as its requests name it.
    wire_gid: [u8; 16],
    query: Query,
}

impl Answers {
    pub(crate) fn new(key: &str) -> Self {
        Self { key: key.into(), pending: Arc::default() }
    }

    /// Whether a query is for this service. One for `**`, by which tools look around, reaches every
    /// service of every domain.
    pub(crate) fn is_meant(&self, query: &Query) -> bool {
        query.key_expr().as_str() == &*self.key
    }

    /// Takes a request in.
    ///
    /// # Errors
    /// It is none.
    pub(crate) fn take(&self, query: Query, discovery: &Discovery) -> Result<Sample, String> {
        let attachment = query.attachment().and_then(|it| Attachment::parse(&it.to_bytes()));
        let Some(Attachment { sequence, source_time, wire_gid }) = attachment else {
            return Err("a request without the numbers that its answer goes by".to_owned());
        };
        let received = received(&query.payload().map(|it| it.to_bytes()).unwrap_or_default())?;
        let client = discovery.gid_of(wire_gid);
        let id = RequestId { client, sequence };
        let mut pending = lock(&self.pending);
        if pending.len() >= PENDING_MAX {
            pending.pop_front();
        }
        pending.push_back(Pending { id, wire_gid, query });
        drop(pending);
        Ok(Sample {
            received,
            info: SampleInfo {
                publisher: client,
                sequence,
                source_time: Some(RosTime::from_nanos(source_time)),
                reception_time: RosTime::wall(),
            },
            request: Some(id),
        })
    }

    /// A request that will have no answer: its client hears so.
    pub(crate) fn forget(&self, request: RequestId) {
        lock(&self.pending).retain(|waiting| waiting.id != request);
    }

    /// Sends an answer, the CDR of a response. A client that asked a process before this one has to
    /// ask again.
    pub(crate) fn send(&self, to: RequestId, response: &[u8]) {
        let mut pending = lock(&self.pending);
        let at = pending.iter().position(|waiting| waiting.id == to);
        let waiting = at.and_then(|at| pending.remove(at));
        drop(pending);
        let Some(Pending { wire_gid, query, .. }) = waiting else { return };
        let source_time = RosTime::wall().as_nanos();
        let attachment = Attachment { sequence: to.sequence, source_time, wire_gid };
        let sent = check_length(response.len()).and_then(|()| {
            let reply = query.reply(&*self.key, encapsulated(response));
            let reply = reply.attachment(attachment.bytes());
            beside_other_tasks(|| reply.wait()).map_err(|error| error.to_string())
        });
        if let Err(error) = sent {
            tracing::warn!("an answer of {} was not sent: {error}", self.key);
        }
    }
}
