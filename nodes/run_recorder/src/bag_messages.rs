//! Messages of a bag in the order of (log time, offset in the file).
//!
//! A chunk is decoded when its first message is due and dropped after its last. So
//! memory holds only chunks that overlap in time: one or two in a recorded bag. If
//! more than [`WINDOW_BYTES`] overlap, order is given up to save memory, and the bag
//! gets a [`Problem::OrderNotKept`].

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};
use std::io::{Read, Seek, SeekFrom};
use std::sync::Arc;

use mcap::records::{Record, op};

use crate::bag_problem::{BagError, Problem};
use crate::bag_reader::{Bag, BagChannel, BagSource};
use crate::records::{
    CHUNK_HEAD, ChunkHead, FRAME, Frame, RECORD_SIZE_MAX, parse_body, visit_chunk, visit_plain,
};
use crate::scan::{Stretch, StretchKind, read_bytes};

/// Message bytes held at once before order is given up.
pub const WINDOW_BYTES: usize = 256 * 1024 * 1024;

/// One message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BagMessage {
    /// Index of its topic in [`Bag::channels`].
    pub channel_index: usize,
    pub channel: Arc<BagChannel>,
    /// Counts by channel in bags of ours; 0 in bags of rosbag2.
    pub sequence: u32,
    /// When it was received, nanoseconds since the epoch.
    pub log_time_ns: u64,
    /// When it was sent, nanoseconds since the epoch.
    pub publish_time_ns: u64,
    /// CDR with its four bytes of encapsulation.
    pub data: Vec<u8>,
}

/// Which messages to read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MessageFilter {
    /// Full names; all topics if `None`.
    pub topics: Option<BTreeSet<String>>,
    /// Log times from here on, nanoseconds.
    pub from_ns: Option<u64>,
    /// Log times before this, nanoseconds.
    pub before_ns: Option<u64>,
}

impl MessageFilter {
    fn lets_time(&self, time_ns: u64) -> bool {
        self.from_ns.is_none_or(|from| time_ns >= from)
            && self.before_ns.is_none_or(|before| time_ns < before)
    }

    fn lets_stretch(&self, stretch: &Stretch) -> bool {
        self.from_ns.is_none_or(|from| stretch.end_ns >= from)
            && self.before_ns.is_none_or(|before| stretch.start_ns < before)
    }

    fn lets_topic(&self, topic: &str) -> bool {
        self.topics.as_ref().is_none_or(|topics| topics.contains(topic))
    }
}

/// The sort key of a message: time, then offset (file, stretch, byte in it).
type Key = (u64, usize, u64, usize);

#[derive(Debug, PartialEq, Eq)]
struct WaitingMessage {
    key: Key,
    message: BagMessage,
}

impl Ord for WaitingMessage {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key.cmp(&other.key)
    }
}

impl PartialOrd for WaitingMessage {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Iterates over messages; see [`Bag::messages`].
#[derive(Debug)]
pub struct Messages<'a, R> {
    bag: &'a mut Bag<R>,
    filter: MessageFilter,
    /// Still to be decoded, the earliest last.
    ahead: Vec<(usize, Stretch)>,
    waiting: BinaryHeap<Reverse<WaitingMessage>>,
    waiting_bytes: usize,
    window: usize,
    last_ns: u64,
}

impl<'a, R: Read + Seek> Messages<'a, R> {
    pub(crate) fn new(bag: &'a mut Bag<R>, filter: MessageFilter) -> Self {
        let mut ahead: Vec<_> = bag
            .stretches
            .iter()
            .filter(|(_, stretch)| filter.lets_stretch(stretch))
            .copied()
            .collect();
        ahead.sort_by_key(|(source, stretch)| Reverse((stretch.start_ns, *source, stretch.offset)));
        Self {
            bag,
            filter,
            ahead,
            waiting: BinaryHeap::new(),
            waiting_bytes: 0,
            window: WINDOW_BYTES,
            last_ns: 0,
        }
    }

    /// Holds at most about `bytes` of messages at once, instead of [`WINDOW_BYTES`].
    #[must_use]
    pub fn with_window(mut self, bytes: usize) -> Self {
        self.window = bytes;
        self
    }

    /// Decodes stretches that may have an earlier message than the first that waits.
    fn look_ahead(&mut self) -> Result<(), BagError> {
        while let Some((_, next)) = self.ahead.last() {
            let next_ns = next.start_ns;
            if let Some(Reverse(first)) = self.waiting.peek() {
                if first.key.0 < next_ns {
                    break;
                }
                if self.waiting_bytes > self.window {
                    break;
                }
            }
            if let Some(place) = self.ahead.pop() {
                self.load(place)?;
            }
        }
        Ok(())
    }

    fn order_not_kept(&mut self, log_time_ns: u64) {
        let is_order = |problem: &Problem| matches!(problem, Problem::OrderNotKept { .. });
        if !self.bag.problems.iter().any(is_order) {
            self.bag.add_problem(Problem::OrderNotKept { log_time_ns });
        }
    }

    fn load(&mut self, place: (usize, Stretch)) -> Result<(), BagError> {
        let (source, stretch) = place;
        let bag = &mut *self.bag;
        let file = bag.sources[source].name.clone();
        let mut problems = Vec::new();
        let visited = visit_stretch(&mut bag.sources, place, |opcode, body, at| {
            if opcode != op::MESSAGE {
                return;
            }
            let (header, data) = match parse_body(opcode, body) {
                Ok(Record::Message { header, data }) => (header, data),
                Ok(_) => return,
                Err(why) => {
                    problems.push(Problem::DamagedRecord {
                        file: file.clone(),
                        at: stretch.offset,
                        why,
                    });
                    return;
                }
            };
            let Some(index) = bag.channel_of.get(&(source, header.channel_id)) else {
                problems.push(Problem::UnknownChannel {
                    file: file.clone(),
                    at: stretch.offset,
                    channel: header.channel_id,
                });
                return;
            };
            let channel = &bag.channels[*index];
            if !self.filter.lets_time(header.log_time) || !self.filter.lets_topic(&channel.topic) {
                return;
            }
            self.waiting_bytes += size_of::<WaitingMessage>() + data.len();
            self.waiting.push(Reverse(WaitingMessage {
                key: (header.log_time, source, stretch.offset, at),
                message: BagMessage {
                    channel_index: *index,
                    channel: channel.clone(),
                    sequence: header.sequence,
                    log_time_ns: header.log_time,
                    publish_time_ns: header.publish_time,
                    data: data.into_owned(),
                },
            }));
        })?;
        problems.extend(visited);
        for problem in problems {
            bag.add_problem(problem);
        }
        Ok(())
    }
}

impl<R: Read + Seek> Iterator for Messages<'_, R> {
    type Item = Result<BagMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Err(error) = self.look_ahead() {
            // The file cannot be read any more: the rest would be out of order or missing.
            self.ahead.clear();
            self.waiting.clear();
            return Some(Err(error));
        }
        let Reverse(first) = self.waiting.pop()?;
        self.waiting_bytes -= size_of::<WaitingMessage>() + first.message.data.len();
        let now_ns = first.message.log_time_ns;
        if now_ns < self.last_ns {
            self.order_not_kept(now_ns);
        }
        self.last_ns = self.last_ns.max(now_ns);
        Some(Ok(first.message))
    }
}

/// Calls `visit` with kind, body and offset of every record in a stretch.
///
/// Returns what is wrong with it, if anything.
pub(crate) fn visit_stretch<R: Read + Seek>(
    sources: &mut [BagSource<R>],
    (source, stretch): (usize, Stretch),
    visit: impl FnMut(u8, &[u8], usize),
) -> Result<Option<Problem>, BagError> {
    let BagSource { name, reader } = &mut sources[source];
    let damaged =
        |why: String| Problem::DamagedChunk { file: name.clone(), at: stretch.offset, why };
    if stretch.length > RECORD_SIZE_MAX {
        let why = format!(
            "it has {} bytes, more than the {RECORD_SIZE_MAX} this reader takes",
            stretch.length
        );
        return Ok(Some(damaged(why)));
    }
    let bytes = reader
        .seek(SeekFrom::Start(stretch.offset))
        .and_then(|_| read_bytes(reader, stretch.length))
        .map_err(|cause| BagError::Io { file: name.clone(), cause })?;
    let visited = match stretch.kind {
        StretchKind::Chunk => visit_indexed_chunk(&bytes, stretch, visit),
        StretchKind::Loose { .. } => visit_plain(&bytes, visit),
    };
    Ok(visited.err().map(damaged))
}

/// Reads a chunk at the offset in the index.
fn visit_indexed_chunk(
    bytes: &[u8],
    stretch: Stretch,
    visit: impl FnMut(u8, &[u8], usize),
) -> Result<(), String> {
    let is_there = bytes.split_first_chunk::<FRAME>().is_some_and(|(head, body)| {
        let frame = Frame::parse(head);
        frame.opcode == op::CHUNK && frame.length == body.len() as u64
    });
    if !is_there {
        return Err("the index names a chunk where there is none of that length".to_owned());
    }
    let body = &bytes[FRAME..];
    if let Some((head, _)) = body.split_first_chunk::<CHUNK_HEAD>() {
        let ChunkHead { start_ns, end_ns } = ChunkHead::parse(head);
        if (start_ns, end_ns) != (stretch.start_ns, stretch.end_ns) {
            return Err(format!(
                "the index says that it is from {} ns to {} ns, and the chunk, from {start_ns} \
                 ns to {end_ns} ns",
                stretch.start_ns, stretch.end_ns
            ));
        }
    }
    visit_chunk(body, visit)
}
