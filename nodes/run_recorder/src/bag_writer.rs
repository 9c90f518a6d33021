//! Writes one bag file as `ros2 bag record -s mcap` does, with more safety.
//!
//! This file knows the records and their order: profile `ros2`, zstd chunks
//! with checksums, one channel a topic with its QoS and type hash, sequence
//! numbers that show losses. A definition is written with the next message, never
//! in a chunk of its own: [`crate::playable`] says why. Equal calls give equal bytes.
//! It knows neither files nor threads nor clocks: see [`crate::run_bag`].

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, WriteOptions};
use rosidl::schema::{MessageSchema, SchemaError};

use crate::metadata::{BagSummary, TopicSummary, serialized_metadata};
use crate::playable::has_messages_in_each;
use crate::qos::{QosProfile, profiles_to_yaml};

/// Bytes of records in a chunk before it is compressed and written; rosbag2's figure.
pub const CHUNK_SIZE: u64 = 768 * 1024;
/// The profile that ROS 2 readers insist on.
pub const PROFILE: &str = "ros2";
/// The first word of [`LIBRARY`], of every version.
pub const PRODUCT: &str = env!("CARGO_PKG_NAME");
/// The library named in the file's header.
pub const LIBRARY: &str = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"));
/// Key of a channel's QoS profiles.
pub const QOS_KEY: &str = "offered_qos_profiles";
/// Key of a channel's type hash.
pub const TYPE_HASH_KEY: &str = "topic_type_hash";

/// A topic to record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelSpec {
    /// Full name, with the leading slash.
    pub topic: String,
    /// `package/msg/Type`.
    pub type_name: String,
    /// The text of the `.msg` file and of every type it needs, as rosbag2 joins them.
    pub schema_text: String,
    /// `RIHS01_` and 64 digits, empty if not known.
    pub type_hash: String,
    /// The QoS that its publishers offer.
    pub qos: Vec<QosProfile>,
}

/// A channel of one [`BagWriter`]: its place in the order of [`BagWriter::add_channel`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChannelIndex(pub u16);

/// A file that travels inside the bag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BagAttachment {
    /// Unique name, for example `program.mpf`.
    pub name: String,
    /// MIME type, for example `text/plain`.
    pub media_type: String,
    /// When it was attached, nanoseconds since the epoch.
    pub log_time_ns: u64,
    /// Its content, byte for byte.
    pub data: Vec<u8>,
}

/// Why a bag cannot be written to.
#[derive(Debug, thiserror::Error)]
pub enum BagWriteError {
    #[error("the bag cannot be written: {0}; what was flushed before can still be read")]
    Io(#[from] io::Error),
    #[error("topic \"{0}\" is not a full name; it has to begin with a slash")]
    TopicName(String),
    #[error("topic {0} is in the bag already; a topic has one channel")]
    TopicTwice(String),
    #[error("type \"{type_name}\" of topic {topic} is not of the form package/msg/Type")]
    TypeName { topic: String, type_name: String },
    #[error("type {0} has another definition in this bag already; record them to two bags")]
    TypeTwice(String),
    #[error("the definition of {type_name} cannot be used: {source}")]
    Schema { type_name: String, source: SchemaError },
    #[error("channel {0} is not one of this bag")]
    Channel(u16),
    #[error("the bag cannot be written: {0}")]
    Container(McapError),
}

impl From<McapError> for BagWriteError {
    fn from(error: McapError) -> Self {
        match error {
            McapError::Io(error) => Self::Io(error),
            other => Self::Container(other),
        }
    }
}

struct ChannelState {
    /// Its number in the file; `None` until its definition is written.
    id: Option<u16>,
    next_sequence: u32,
    summary: TopicSummary,
}

/// A bag file in the making.
///
/// Chunks are put together in memory and written in one go, so the sink needs
/// no seeking and a broken-off bag ends between two records or inside its last.
/// Dropping it without [`BagWriter::finish`] leaves an unfinished bag, which
/// [`crate::bag_reader`] reads up to the last flush. Memory: one chunk, and
/// about 1 kB of index for every chunk written.
pub struct BagWriter<W: Write> {
    // `None` once finished.
    inner: Option<mcap::Writer<NoSeek<W>>>,
    channels: Vec<ChannelState>,
    /// How many of the channels have their definition in the file.
    defined: usize,
    topics: BTreeSet<String>,
    /// Definitions by type.
    schemas: BTreeMap<String, String>,
    time_range_ns: Option<(u64, u64)>,
}

impl<W: Write> std::fmt::Debug for BagWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BagWriter").field("channels", &self.channels.len()).finish_non_exhaustive()
    }
}

impl<W: Write> BagWriter<W> {
    /// Begins a bag: magic and header.
    pub fn new(sink: W) -> Result<Self, BagWriteError> {
        let inner = WriteOptions::new()
            .profile(PROFILE)
            .library(LIBRARY)
            .compression(Some(Compression::Zstd))
            // Threads would make the bytes depend on the machine, and gain nothing.
            .compression_threads(0)
            .chunk_size(Some(CHUNK_SIZE))
            .disable_seeking(true)
            .create(NoSeek::new(sink))?;
        Ok(Self {
            inner: Some(inner),
            channels: Vec::new(),
            defined: 0,
            topics: BTreeSet::new(),
            schemas: BTreeMap::new(),
            time_range_ns: None,
        })
    }

    /// Begins another file of the same bag, with the same channels and continued sequence
    /// numbers.
    pub fn next_part(&self, sink: W) -> Result<Self, BagWriteError> {
        let mut next = Self::new(sink)?;
        for state in &self.channels {
            let TopicSummary { topic, type_name, type_hash, qos, .. } = state.summary.clone();
            let schema_text = self.schemas[&type_name].clone();
            next.add_channel(&ChannelSpec { topic, type_name, schema_text, type_hash, qos })?;
        }
        for (before, after) in self.channels.iter().zip(&mut next.channels) {
            after.next_sequence = before.next_sequence;
        }
        Ok(next)
    }

    /// Adds a topic. Checks its definition: a bag that cannot be decoded is useless.
    ///
    /// The definition is written with the next message of any topic. A topic that is added after
    /// the last message of a file is only in its metadata, as in bags of rosbag2.
    pub fn add_channel(&mut self, spec: &ChannelSpec) -> Result<ChannelIndex, BagWriteError> {
        check_spec(spec)?;
        if self.topics.contains(&spec.topic) {
            return Err(BagWriteError::TopicTwice(spec.topic.clone()));
        }
        match self.schemas.get(&spec.type_name) {
            Some(text) if *text != spec.schema_text => {
                return Err(BagWriteError::TypeTwice(spec.type_name.clone()));
            }
            Some(_) => {}
            None => {
                self.schemas.insert(spec.type_name.clone(), spec.schema_text.clone());
            }
        }
        let Ok(index) = u16::try_from(self.channels.len()) else {
            return Err(BagWriteError::Container(McapError::TooManyChannels));
        };
        let index = ChannelIndex(index);
        self.topics.insert(spec.topic.clone());
        self.channels.push(ChannelState {
            id: None,
            next_sequence: 0,
            summary: TopicSummary {
                topic: spec.topic.clone(),
                type_name: spec.type_name.clone(),
                type_hash: spec.type_hash.clone(),
                qos: spec.qos.clone(),
                message_count: 0,
            },
        });
        Ok(index)
    }

    /// Writes one message: CDR with its four bytes of encapsulation.
    ///
    /// `log_time_ns` is when it was received, `publish_time_ns` when it was
    /// sent, both nanoseconds since the epoch. The sequence number counts by channel from 0.
    pub fn write(
        &mut self,
        channel: ChannelIndex,
        log_time_ns: u64,
        publish_time_ns: u64,
        data: &[u8],
    ) -> Result<(), BagWriteError> {
        let sequence = self.state(channel)?.next_sequence;
        self.write_with_sequence(channel, sequence, log_time_ns, publish_time_ns, data)
    }

    /// Writes one message with the sequence number it had, for copies of bags; the next one
    /// of its channel follows it.
    pub fn write_with_sequence(
        &mut self,
        channel: ChannelIndex,
        sequence: u32,
        log_time_ns: u64,
        publish_time_ns: u64,
        data: &[u8],
    ) -> Result<(), BagWriteError> {
        self.repeat(channel, sequence, log_time_ns, publish_time_ns, data)?;
        self.state(channel)?.next_sequence = sequence.wrapping_add(1);
        Ok(())
    }

    /// Repeats a message of an earlier file, with its sequence number; the channel's count is
    /// unchanged.
    pub fn repeat(
        &mut self,
        channel: ChannelIndex,
        sequence: u32,
        log_time_ns: u64,
        publish_time_ns: u64,
        data: &[u8],
    ) -> Result<(), BagWriteError> {
        self.state(channel)?;
        self.define_channels()?;
        let header = MessageHeader {
            channel_id: self.state(channel)?.id.expect("it was just defined"),
            sequence,
            log_time: log_time_ns,
            publish_time: publish_time_ns,
        };
        self.inner().write_to_known_channel(&header, data)?;
        self.state(channel)?.summary.message_count += 1;
        let (start, end) = self.time_range_ns.unwrap_or((log_time_ns, log_time_ns));
        self.time_range_ns = Some((start.min(log_time_ns), end.max(log_time_ns)));
        Ok(())
    }

    /// The sequence number of the next message of a channel.
    pub fn next_sequence(&self, channel: ChannelIndex) -> u32 {
        self.channels.get(usize::from(channel.0)).map_or(0, |state| state.next_sequence)
    }

    /// Messages so far by topic; only topics with messages.
    pub(crate) fn counts(&self) -> BTreeMap<String, u64> {
        let topics = self.channels.iter().map(|state| &state.summary);
        let counts = topics.map(|topic| (topic.topic.clone(), topic.message_count));
        counts.filter(|(_, count)| *count > 0).collect()
    }

    /// Leaves a gap of `count` in a channel's sequence numbers, for messages known to be lost.
    pub fn skip(&mut self, channel: ChannelIndex, count: u32) -> Result<(), BagWriteError> {
        let state = self.state(channel)?;
        state.next_sequence = state.next_sequence.wrapping_add(count);
        Ok(())
    }

    /// Attaches a file. Closes the open chunk.
    pub fn attach(&mut self, attachment: &BagAttachment) -> Result<(), BagWriteError> {
        self.inner().attach(&Attachment {
            log_time: attachment.log_time_ns,
            create_time: attachment.log_time_ns,
            name: attachment.name.clone(),
            media_type: attachment.media_type.clone(),
            data: (&attachment.data).into(),
        })?;
        Ok(())
    }

    /// Writes a record of keys and values, for example `cnc_run`. Closes the open chunk.
    pub fn write_metadata(
        &mut self,
        name: &str,
        values: &BTreeMap<String, String>,
    ) -> Result<(), BagWriteError> {
        self.inner()
            .write_metadata(&Metadata { name: name.to_owned(), metadata: values.clone() })?;
        Ok(())
    }

    /// Closes the open chunk, so that everything written so far stays readable.
    pub fn flush(&mut self) -> Result<(), BagWriteError> {
        Ok(self.inner().flush()?)
    }

    /// The figures so far.
    pub fn summary(&self) -> BagSummary {
        let topics: Vec<_> = self.channels.iter().map(|c| c.summary.clone()).collect();
        BagSummary {
            message_count: topics.iter().map(|topic| topic.message_count).sum(),
            topics,
            time_range_ns: self.time_range_ns,
        }
    }

    /// Writes the closing `rosbag2` record, the index and the footer, and hands the sink back.
    ///
    /// `file_name` is the name of the file in metadata.yaml, `custom_data` its free keys and
    /// values.
    pub fn finish(
        mut self,
        file_name: &str,
        custom_data: &BTreeMap<String, String>,
    ) -> Result<(W, BagSummary), BagWriteError> {
        let summary = self.summary();
        let text = serialized_metadata(&summary, file_name, custom_data);
        self.write_metadata(
            "rosbag2",
            &BTreeMap::from([("serialized_metadata".to_owned(), text)]),
        )?;
        let mut inner = self.inner.take().expect("a finished writer is consumed");
        let finished = inner.finish();
        let sink = inner.into_inner().into_inner();
        let finished = finished?;
        debug_assert!(
            has_messages_in_each(&finished.chunk_indexes),
            "a chunk of {file_name} has no messages: `ros2 bag play` would play nothing of it"
        );
        Ok((sink, summary))
    }

    fn inner(&mut self) -> &mut mcap::Writer<NoSeek<W>> {
        self.inner.as_mut().expect("a finished writer is consumed")
    }

    fn state(&mut self, channel: ChannelIndex) -> Result<&mut ChannelState, BagWriteError> {
        let state = self.channels.get_mut(usize::from(channel.0));
        state.ok_or(BagWriteError::Channel(channel.0))
    }

    /// Writes the definitions that are not in the file yet, in front of a message.
    fn define_channels(&mut self) -> Result<(), BagWriteError> {
        while let Some(state) = self.channels.get_mut(self.defined) {
            let inner = self.inner.as_mut().expect("a finished writer is consumed");
            let TopicSummary { topic, type_name, type_hash, qos, .. } = &state.summary;
            // The same number again for a type that is in the file.
            let text = self.schemas[type_name].as_bytes();
            let schema_id = inner.add_schema(type_name, "ros2msg", text)?;
            let metadata = BTreeMap::from([
                (QOS_KEY.to_owned(), profiles_to_yaml(qos)),
                (TYPE_HASH_KEY.to_owned(), type_hash.clone()),
            ]);
            state.id = Some(inner.add_channel(schema_id, topic, "cdr", &metadata)?);
            self.defined += 1;
        }
        Ok(())
    }
}

impl<W: Write> Drop for BagWriter<W> {
    fn drop(&mut self) {
        // The container library would write a footer, and a truncated bag would look complete.
        if let Some(inner) = self.inner.take() {
            drop(inner.into_inner());
        }
    }
}

pub(crate) fn check_spec(spec: &ChannelSpec) -> Result<(), BagWriteError> {
    if !spec.topic.starts_with('/') || spec.topic.len() < 2 {
        return Err(BagWriteError::TopicName(spec.topic.clone()));
    }
    let parts: Vec<&str> = spec.type_name.split('/').collect();
    if parts.len() != 3 || parts.iter().any(|part| part.is_empty()) {
        return Err(BagWriteError::TypeName {
            topic: spec.topic.clone(),
            type_name: spec.type_name.clone(),
        });
    }
    MessageSchema::parse(&spec.type_name, &spec.schema_text)
        .map(|_| ())
        .map_err(|source| BagWriteError::Schema { type_name: spec.type_name.clone(), source })
}
