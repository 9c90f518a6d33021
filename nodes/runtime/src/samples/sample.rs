//! A sample as it arrived, whatever carried it.

use crate::process::time::RosTime;
use crate::samples::gid::Gid;

/// The bytes of a message of any type, without what names their encoding.
#[derive(Debug)]
pub(crate) struct Received {
    pub(crate) bytes: Vec<u8>,
    pub(crate) order: ByteOrder,
}

/// The byte order of the computer that sent a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ByteOrder {
    Little,
    Big,
}

/// Where and when a sample came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SampleInfo {
    /// The endpoint that sent it.
    pub publisher: Gid,
    /// Its number at that endpoint, from 1; a gap is a lost sample.
    pub sequence: i64,
    /// Wall time at the sender, if the sample has it.
    pub source_time: Option<RosTime>,
    /// Wall time at which it arrived here.
    pub reception_time: RosTime,
}

impl From<&SampleInfo> for Gid {
    fn from(info: &SampleInfo) -> Self {
        info.publisher
    }
}

/// A sample of a topic, a request or a reply.
#[derive(Debug)]
pub(crate) struct Sample {
    pub(crate) received: Received,
    pub(crate) info: SampleInfo,
    /// The request that it is or answers, if the middleware says so outside of the bytes.
    pub(crate) request: Option<RequestId>,
}

/// A request, as its middleware names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RequestId {
    pub(crate) client: Gid,
    /// The number of the request at its client.
    pub(crate) sequence: i64,
}
