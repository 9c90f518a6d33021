//! Sends the requests of a client.

use crate::endpoints::wire::{CycloneHeader, padded};
use crate::rustdds::padded::Padded;
use crate::samples::gid::Gid;
use rustdds::no_key::DataWriterCdr;
use rustdds::{Timestamp, WriteOptionsBuilder};
use tokio::sync::oneshot;

/// A request that was sent.
pub(crate) struct Sent {
    /// Its number at this client.
    pub(crate) sequence: i64,
    /// Gets word when a reply has come, and is closed when none will, where the middleware says so.
    pub(crate) end: Option<oneshot::Receiver<()>>,
}

/// Numbers the requests of a client and sends them.
pub(crate) enum Requests {
    Dds(DdsRequests),
    #[cfg(feature = "zenoh")]
    Zenoh(crate::zenoh::client::Requests),
}

impl Requests {
    /// Sends the CDR of a request.
    pub(crate) fn send(&mut self, body: &[u8]) -> Result<Sent, String> {
        match self {
            Self::Dds(requests) => requests.send(body).map(|sequence| Sent { sequence, end: None }),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(requests) => {
                requests.send(body).map(|(sequence, end)| Sent { sequence, end: Some(end) })
            }
        }
    }

    /// Whether a request would reach a server. Routers of Zenoh hide those that a client has no right to.
    pub(crate) fn reach_a_server(&self) -> bool {
        match self {
            Self::Dds(_) => true,
            #[cfg(feature = "zenoh")]
            Self::Zenoh(requests) => requests.reach_a_server(),
        }
    }

    /// The address of the client.
    pub(crate) fn gid(&self) -> Gid {
        match self {
            Self::Dds(requests) => requests.gid(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(requests) => requests.gid(),
        }
    }
}

/// The requests of a client over DDS.
pub(crate) struct DdsRequests {
    writer: DataWriterCdr<Padded>,
    has_header: bool,
    /// The last sequence number, in the mapping where we number requests.
    sequence: i64,
}

impl DdsRequests {
    pub(crate) fn new(writer: DataWriterCdr<Padded>, has_header: bool) -> Self {
        Self { writer, has_header, sequence: 0 }
    }

    fn gid(&self) -> Gid {
        rustdds::RTPSEntity::guid(&self.writer).into()
    }

    fn send(&mut self, body: &[u8]) -> Result<i64, String> {
        let options = WriteOptionsBuilder::new().source_timestamp(Timestamp::now());
        let header = self.has_header.then(|| {
            self.sequence += 1;
            CycloneHeader::new(self.gid(), self.sequence)
        });
        let sent = self.writer.write_with_options(padded(header, body)?, options.build());
        let sent = sent.map_err(|error| error.to_string())?;
        Ok(match header {
            Some(header) => header.sequence(),
            None => i64::from(sent.sequence_number),
        })
    }
}
