//! Sends replies even if some clients hang.
//!
//! A reply writer reaches the readers of all clients, and keeps each reply until
//! all of them have acknowledged it. A client that hangs or was killed does not,
//! until its lease ends 50 s later; meanwhile the window fills, and then no client
//! gets a reply. So a writer whose window is full is replaced by a new one, which sends
//! replies once the clients have discovered it.

use super::RequestInfo;
use crate::command_line::environment::{Environment, ServiceMapping};
use crate::endpoints::error::NodeError;
use crate::endpoints::publisher::Drops;
use crate::endpoints::wire::{CycloneHeader, padded};
use crate::process::lock;
use crate::rustdds::padded::Padded;
use crate::samples::gid::Gid;
use rustdds::dds::WriteError;
use rustdds::no_key::DataWriterCdr;
use rustdds::{SampleIdentity, Timestamp, WriteOptionsBuilder};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Unacknowledged replies that are kept. More takes more memory for a client that hangs;
/// fewer replaces the writer more often.
pub(crate) const UNACKNOWLEDGED_MAX: i32 = 2048;
/// How long clients need to discover a new writer.
const SETTLE: Duration = Duration::from_millis(200);
/// Replies that may wait for that, at most. The clients of further ones retry or time out.
const WAITING_MAX: usize = 1000;
/// Bytes of replies that a writer sends before it is replaced, and of those that may wait: so many it may
/// have to keep.
const BYTES_MAX: usize = 128 << 20;

type Writer = DataWriterCdr<Padded>;
type NewWriter = dyn Fn() -> Result<Writer, NodeError> + Send + Sync;

/// The replies of a service; clones share the writer.
#[derive(Clone)]
pub(crate) struct Replies {
    shared: Arc<Shared>,
}

struct Shared {
    /// Whether the mapping puts a header before replies.
    has_header: bool,
    new_writer: Box<NewWriter>,
    state: Mutex<ReplyState>,
    drops: Drops,
}

struct ReplyState {
    writer: Writer,
    /// Bytes of the replies that it has sent, and of those that wait.
    bytes: usize,
    /// Replies that wait until a new writer is discovered; `None`: no reply has to wait.
    waiting: Option<Vec<(RequestInfo, Padded)>>,
}

impl Replies {
    pub(crate) fn new(
        name: &str,
        environment: &Environment,
        new_writer: Box<NewWriter>,
    ) -> Result<Self, NodeError> {
        let has_header = environment.mapping == ServiceMapping::Cyclone;
        let state = Mutex::new(ReplyState { writer: new_writer()?, bytes: 0, waiting: None });
        let drops = Drops::new(format!("replies of {name}"));
        Ok(Self { shared: Arc::new(Shared { has_header, new_writer, state, drops }) })
    }

    /// The address of the writer.
    pub(super) fn gid(&self) -> Gid {
        rustdds::RTPSEntity::guid(&lock(&self.shared.state).writer).into()
    }

    /// Sends a reply, the CDR of a response, now or as soon as the clients know a new writer.
    pub(super) fn send(&self, to: RequestInfo, response: &[u8]) {
        let reply = match self.shared.encode(to, response) {
            Ok(reply) => reply,
            Err(reason) => return self.shared.drops.add(&reason),
        };
        let mut state = lock(&self.shared.state);
        let ReplyState { bytes, waiting, .. } = &mut *state;
        let is_room = *bytes + reply.len() <= BYTES_MAX;
        if let Some(waiting) = waiting {
            if waiting.len() >= WAITING_MAX || !is_room {
                return self.shared.drops.add("too many replies wait for a new writer");
            }
            *bytes += reply.len();
            return waiting.push((to, reply));
        }
        if !is_room {
            *bytes = reply.len();
            *waiting = Some(vec![(to, reply)]);
            drop(state);
            return self.replace_writer();
        }
        *bytes += reply.len();
        match self.shared.write(&state.writer, to, reply) {
            Ok(()) => {}
            Err(Unsent::Full(reply)) => {
                state.bytes = reply.len();
                state.waiting = Some(vec![(to, reply)]);
                drop(state);
                self.replace_writer();
            }
            Err(Unsent::Failed(reason)) => self.shared.drops.add(&reason),
        }
    }

    fn replace_writer(&self) {
        let replies = self.clone();
        tokio::spawn(async move {
            match (replies.shared.new_writer)() {
                Ok(writer) => {
                    // This drops the old writer with its unacknowledged replies.
                    let old = std::mem::replace(&mut lock(&replies.shared.state).writer, writer);
                    tokio::time::sleep(SETTLE).await;
                    drop(old);
                }
                Err(error) => replies.shared.drops.add(&error.to_string()),
            }
            replies.catch_up();
        });
    }

    /// Sends the waiting replies.
    fn catch_up(&self) {
        let mut state = lock(&self.shared.state);
        for (to, reply) in state.waiting.take().unwrap_or_default() {
            if let Err(unsent) = self.shared.write(&state.writer, to, reply) {
                self.shared.drops.add(match &unsent {
                    Unsent::Full(_) => "the new writer is full as well",
                    Unsent::Failed(reason) => reason,
                });
            }
        }
    }
}

/// Why a reply was not sent.
enum Unsent {
    /// Too many replies are not acknowledged.
    Full(Padded),
    Failed(String),
}

impl Shared {
    fn encode(&self, to: RequestInfo, response: &[u8]) -> Result<Padded, String> {
        let header = self.has_header.then(|| CycloneHeader::new(to.client, to.sequence));
        padded(header, response)
    }

    fn write(&self, writer: &Writer, to: RequestInfo, reply: Padded) -> Result<(), Unsent> {
        let options = WriteOptionsBuilder::new().source_timestamp(Timestamp::now());
        let options = match self.has_header {
            true => options,
            false => options.related_sample_identity(SampleIdentity {
                writer_guid: rustdds::GUID::from_bytes(to.client.0),
                sequence_number: to.sequence.into(),
            }),
        };
        match writer.write_with_options(reply, options.build()) {
            Ok(_) => Ok(()),
            Err(WriteError::WouldBlock { data }) => Err(Unsent::Full(data)),
            Err(error) => Err(Unsent::Failed(error.to_string())),
        }
    }
}
