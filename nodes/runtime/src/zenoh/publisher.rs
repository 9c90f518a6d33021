//! Publishes on a topic.

use crate::process::lock;
use crate::process::time::RosTime;
use crate::samples::check_length;
use crate::samples::gid::Gid;
use crate::zenoh::attachment::{Attachment, encapsulated};
use crate::zenoh::discovery::Announced;
use std::sync::Mutex;
use zenoh::Wait;
use zenoh_ext::AdvancedPublisher;

/// With or without a memory for late subscribers.
pub(crate) enum Writer {
    Volatile(zenoh::pubsub::Publisher<'static>),
    Latched(AdvancedPublisher<'static>),
}

/// A publisher of bytes.
pub(crate) struct Publisher {
    writer: Writer,
    gid: Gid,
    wire_gid: [u8; 16],
    /// The number of the last sample; locked while one is sent, so that they leave in order.
    sequence: Mutex<i64>,
    _announced: Announced,
}

impl Publisher {
    pub(crate) fn new(writer: Writer, gid: Gid, wire_gid: [u8; 16], announced: Announced) -> Self {
        Self { writer, gid, wire_gid, sequence: Mutex::new(0), _announced: announced }
    }

    pub(crate) fn gid(&self) -> Gid {
        self.gid
    }

    /// Sends the little-endian CDR of a message. Where a peer does not take it, it is dropped there.
    pub(crate) fn publish(&self, body: &[u8]) -> Result<(), String> {
        check_length(body.len())?;
        let payload = encapsulated(body);
        let mut sequence = lock(&self.sequence);
        let attachment = Attachment {
            sequence: *sequence + 1,
            source_time: RosTime::wall().as_nanos(),
            wire_gid: self.wire_gid,
        };
        let attachment = attachment.bytes();
        let sent = match &self.writer {
            Writer::Volatile(publisher) => publisher.put(payload).attachment(attachment).wait(),
            Writer::Latched(publisher) => publisher.put(payload).attachment(attachment).wait(),
        };
        sent.map_err(|error| error.to_string())?;
        *sequence += 1;
        Ok(())
    }
}
