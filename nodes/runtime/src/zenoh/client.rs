//! Sends requests, each as a query, and passes the replies on.

use crate::process::lock;
use crate::process::time::RosTime;
use crate::samples::check_length;
use crate::samples::gid::Gid;
use crate::samples::sample::{RequestId, Sample, SampleInfo};
use crate::zenoh::attachment::{Attachment, encapsulated, received};
use crate::zenoh::discovery::Announced;
use crate::zenoh::inbox::Inbox;
use crate::zenoh::link::beside_other_tasks;
use crate::zenoh::names::gid_of;
use std::sync::{Arc, Mutex};
use tokio::sync::oneshot;
use zenoh::Wait;
use zenoh::query::{Querier, Reply};

/// The requests of a client.
pub(crate) struct Requests {
    querier: Querier<'static>,
    gid: Gid,
    wire_gid: [u8; 16],
    /// The number of the last request.
    sequence: i64,
    replies: Arc<Inbox>,
    _announced: Announced,
}

impl Requests {
    pub(crate) fn new(
        querier: Querier<'static>,
        (gid, wire_gid): (Gid, [u8; 16]),
        replies: Arc<Inbox>,
        announced: Announced,
    ) -> Self {
        Self { querier, gid, wire_gid, sequence: 0, replies, _announced: announced }
    }

    pub(crate) fn gid(&self) -> Gid {
        self.gid
    }

    /// Whether a request would reach a server.
    pub(crate) fn reach_a_server(&self) -> bool {
        // What cannot be known is tried.
        self.querier.matching_status().wait().map_or(true, |status| status.matching())
    }

    /// Sends the CDR of a request; returns its number, and what says that a reply has come, or is closed
    /// when none will: the server has it no more, or the link to it was lost.
    pub(crate) fn send(&mut self, body: &[u8]) -> Result<(i64, oneshot::Receiver<()>), String> {
        check_length(body.len())?;
        self.sequence += 1;
        let request = RequestId { client: self.gid, sequence: self.sequence };
        let attachment = Attachment {
            sequence: self.sequence,
            source_time: RosTime::wall().as_nanos(),
            wire_gid: self.wire_gid,
        };
        let replies = Arc::clone(&self.replies);
        // Zenoh drops the callback with the query.
        let (replied, end) = oneshot::channel::<()>();
        let replied = Mutex::new(Some(replied));
        let query =
            self.querier.get().payload(encapsulated(body)).attachment(attachment.bytes()).callback(
                move |reply: Reply| {
                    if let Some(item) = sample(&reply, request) {
                        drop(replies.push(item));
                        // Whoever waited may have given up.
                        let _ = lock(&replied).take().map(|it| it.send(()));
                    }
                },
            );
        let sent = beside_other_tasks(|| query.wait());
        sent.map_err(|error| error.to_string())?;
        Ok((self.sequence, end))
    }
}

/// A reply; none for one that says that there is none: the caller notices it by the end of the query.
fn sample(reply: &Reply, request: RequestId) -> Option<Result<Sample, String>> {
    let found = reply.result().ok()?;
    // The server, by its session.
    let server = reply.replier_id().map(|id| gid_of(id.zid().to_le_bytes(), id.eid()));
    let attachment = found.attachment().and_then(|it| Attachment::parse(&it.to_bytes()));
    Some(received(&found.payload().to_bytes()).map(|received| Sample {
        received,
        info: SampleInfo {
            publisher: server.unwrap_or_default(),
            sequence: request.sequence,
            source_time: attachment.map(|it| RosTime::from_nanos(it.source_time)),
            reception_time: RosTime::wall(),
        },
        request: Some(request),
    }))
}
