//! Opens a bag: its topics, definitions, attachments and problems.
//!
//! Works on anything that reads and seeks; paths are for [`crate::files`].
//! A finished bag is opened from its index, a truncated one by reading it once.
//! [`Bag::messages`] returns the messages in the order of time.

use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::sync::Arc;

use mcap::records::{Record, op};
use rosidl::schema::{MessageSchema, SchemaError};

use crate::bag_messages::visit_stretch;
pub use crate::bag_messages::{BagMessage, MessageFilter, Messages, WINDOW_BYTES};
pub use crate::bag_problem::{BagError, Problem};
use crate::bag_writer::{QOS_KEY, TYPE_HASH_KEY};
use crate::closing::Closing;
use crate::joined::{PartsRead, scan_all};
use crate::metadata::{BagSummary, Claims, TopicSummary};
use crate::outline::Outline;
use crate::qos::{QosProfile, profiles_from_yaml};
pub use crate::records::RECORD_SIZE_MAX;
use crate::records::{FRAME, parse_body};
use crate::scan::{AttachmentPlace, Stretch, read_bytes};
use crate::verify::{Facts, verify};

/// The metadata record at the beginning of a run.
pub const RUN_RECORD: &str = "cnc_run";
/// The metadata record at the end of a run: `complete` and `reasons`.
pub const RESULT_RECORD: &str = "cnc_run_result";
/// The reason of a bag whose recorder started in mid-run. Earlier inputs and serial traffic
/// are there, unless the bag has other reasons too.
pub const LATE: &str = "recorded only from here on: the run was under way before";

/// One file of a bag.
#[derive(Debug)]
pub struct BagSource<R> {
    /// Its name in messages.
    pub name: String,
    pub reader: R,
}

/// A definition embedded in the bag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BagSchema {
    /// `package/msg/Type`.
    pub name: String,
    /// `ros2msg` in bags of ours.
    pub encoding: String,
    pub text: Vec<u8>,
}

impl BagSchema {
    /// Reads the definition, for [`rosidl::decode::decode`].
    pub fn parse(&self) -> Result<Arc<MessageSchema>, SchemaError> {
        MessageSchema::from_bytes(&self.name, &self.text)
    }
}

/// One topic of a bag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BagChannel {
    pub topic: String,
    /// Sometimes missing in bags of other recorders; then messages cannot be decoded.
    pub schema: Option<Arc<BagSchema>>,
    /// `cdr` in bags of ROS.
    pub message_encoding: String,
    /// The QoS that its publishers offered; empty if not recorded or not readable.
    pub qos: Vec<QosProfile>,
    /// `RIHS01_` and 64 digits, empty if not known.
    pub type_hash: String,
    /// The channel's metadata as written.
    pub metadata: BTreeMap<String, String>,
    /// Messages in the bag.
    pub message_count: u64,
}

impl BagChannel {
    /// `package/msg/Type`, empty without a schema.
    pub fn type_name(&self) -> &str {
        self.schema.as_ref().map_or("", |schema| &schema.name)
    }
}

/// A record of keys and values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BagMetadata {
    pub name: String,
    pub values: BTreeMap<String, String>,
}

/// A file inside the bag; [`Bag::read_attachment`] reads it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BagAttachmentInfo {
    pub name: String,
    pub media_type: String,
    /// Nanoseconds since the epoch.
    pub log_time_ns: u64,
    /// Bytes.
    pub size: u64,
    source: usize,
    place: AttachmentPlace,
}

/// An opened bag.
#[derive(Debug)]
pub struct Bag<R> {
    pub(crate) sources: Vec<BagSource<R>>,
    pub(crate) stretches: Vec<(usize, Stretch)>,
    /// Index into `channels` by file and the file's own channel number.
    pub(crate) channel_of: BTreeMap<(usize, u16), usize>,
    pub(crate) channels: Vec<Arc<BagChannel>>,
    pub(crate) problems: Vec<Problem>,
    attachments: Vec<BagAttachmentInfo>,
    metadata: Vec<BagMetadata>,
    time_range_ns: Option<(u64, u64)>,
    library: String,
    is_finished: bool,
    /// The content of metadata.yaml, and its directory.
    pub(crate) claims: Option<(String, Claims)>,
}

impl<R: Read + Seek> Bag<R> {
    /// Opens a bag of one file.
    pub fn open(name: &str, reader: R) -> Result<Self, BagError> {
        Self::from_sources(vec![BagSource { name: name.to_owned(), reader }])
    }

    /// Opens a bag of several files, in their order.
    ///
    /// An unreadable file is left out and reported; if all are unreadable, that is an error.
    /// Messages that a part repeats from earlier ones are left out.
    pub fn from_sources(mut sources: Vec<BagSource<R>>) -> Result<Self, BagError> {
        let mut outline = Outline::default();
        let mut is_finished = !sources.is_empty();
        let mut is_outlined = true;
        let mut time_range_ns = None;
        let mut stretches = Vec::new();
        let mut attachments = Vec::new();
        let mut metadata = Vec::new();
        let mut problems = Vec::new();
        let mut library = String::new();
        let mut repeated = Vec::new();
        let mut parts = PartsRead::default();
        for (index, mut found) in scan_all(&mut sources, &mut problems)? {
            library = std::mem::take(&mut found.library);
            is_finished &= found.is_finished;
            parts.take(&sources[index].name, &found, &mut problems);
            let is_repeated = |place: usize| parts.has_earlier && found.repeated.contains(&place);
            for (place, stretch) in found.stretches.iter().enumerate() {
                let list = if is_repeated(place) { &mut repeated } else { &mut stretches };
                list.push((index, *stretch));
            }
            problems.extend(found.problems);
            metadata.extend(
                found
                    .metadata
                    .into_iter()
                    .map(|record| BagMetadata { name: record.name, values: record.metadata }),
            );
            attachments.extend(found.attachments.into_iter().map(|place| BagAttachmentInfo {
                name: place.name.clone(),
                media_type: place.media_type.clone(),
                log_time_ns: place.log_time_ns,
                size: place.size,
                source: index,
                place,
            }));
            for (header, text) in found.schemas {
                outline.schema(index, header, text);
            }
            for channel in found.channels {
                outline.channel(index, channel);
            }
            match found.statistics {
                Some(statistics) if found.is_finished && outline.knows_all(index, &statistics) => {
                    outline.take_counts(index, &statistics);
                    if statistics.message_count > 0 {
                        let (start, end) =
                            (statistics.message_start_time, statistics.message_end_time);
                        widen(&mut time_range_ns, start);
                        widen(&mut time_range_ns, end.max(start));
                    }
                }
                _ => is_outlined = false,
            }
        }
        parts.end(&mut problems);
        let mut bag = Self {
            sources,
            stretches,
            channel_of: BTreeMap::new(),
            channels: Vec::new(),
            problems,
            attachments,
            metadata,
            time_range_ns,
            library,
            is_finished,
            claims: None,
        };
        if is_outlined {
            bag.take_back(&repeated, &mut outline)?;
        } else {
            bag.read_once(&repeated, &mut outline)?;
        }
        bag.take_outline(outline);
        bag.recorder_says();
        Ok(bag)
    }

    /// The topics, in the order of their definition.
    pub fn channels(&self) -> &[Arc<BagChannel>] {
        &self.channels
    }

    /// Files inside the bag.
    pub fn attachments(&self) -> &[BagAttachmentInfo] {
        &self.attachments
    }

    /// Records of keys and values, in the order of the file.
    pub fn metadata(&self) -> &[BagMetadata] {
        &self.metadata
    }

    /// The last record of this name.
    pub fn metadata_named(&self, name: &str) -> Option<&BTreeMap<String, String>> {
        let mut records = self.metadata.iter().rev();
        records.find(|record| record.name == name).map(|record| &record.values)
    }

    /// The program that wrote the bag, as its header says.
    pub fn library(&self) -> &str {
        &self.library
    }

    /// The problems so far; reading messages may add more, since it checks chunks.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }

    /// Adds a problem outside of the files' content.
    pub fn add_problem(&mut self, problem: Problem) {
        if !self.problems.contains(&problem) {
            self.problems.push(problem);
        }
    }

    /// Whether the bag was closed properly, lost nothing, and has no problem so far.
    ///
    /// Damage inside a chunk is found only when it is read: see [`Bag::verify`].
    pub fn is_complete(&self) -> bool {
        self.is_finished && self.problems.iter().all(Problem::is_of_players)
    }

    /// The figures of the bag.
    pub fn summary(&self) -> BagSummary {
        let topics = self.channels.iter().map(|channel| TopicSummary {
            topic: channel.topic.clone(),
            type_name: channel.type_name().to_owned(),
            type_hash: channel.type_hash.clone(),
            qos: channel.qos.clone(),
            message_count: channel.message_count,
        });
        BagSummary {
            topics: topics.collect(),
            message_count: self.channels.iter().map(|c| c.message_count).sum(),
            time_range_ns: self.time_range_ns,
        }
    }

    /// All messages by (log time, place in the file).
    pub fn messages(&mut self) -> Messages<'_, R> {
        self.messages_where(MessageFilter::default())
    }

    /// The messages that a filter lets through, by (log time, place in the file).
    pub fn messages_where(&mut self, filter: MessageFilter) -> Messages<'_, R> {
        Messages::new(self, filter)
    }

    /// Reads an attachment whole.
    pub fn read_attachment(&mut self, info: &BagAttachmentInfo) -> Result<Vec<u8>, BagError> {
        let source = &mut self.sources[info.source];
        let io_error = |cause| BagError::Io { file: source.name.clone(), cause };
        let at = info.place.offset + FRAME as u64;
        source.reader.seek(SeekFrom::Start(at)).map_err(io_error)?;
        let body = read_bytes(&mut source.reader, info.place.record_length).map_err(io_error)?;
        match parse_body(op::ATTACHMENT, &body) {
            Ok(Record::Attachment { data, .. }) => Ok(data.into_owned()),
            // It was whole when the bag was opened.
            _ => Err(io_error(std::io::ErrorKind::InvalidData.into())),
        }
    }

    /// Reads every chunk and message once; afterwards [`Bag::problems`] is complete.
    pub fn verify(&mut self) -> Result<(), BagError> {
        let promised = self.summary().message_count;
        let mut found = 0;
        for message in self.messages() {
            message?;
            found += 1;
        }
        if found != promised {
            self.add_problem(Problem::MessagesMissing { promised, found });
        }
        self.verify_indexes()
    }

    /// Compares the summaries of the files and metadata.yaml with the content. Finds problems
    /// that [`Bag::messages`] does not check.
    pub fn verify_indexes(&mut self) -> Result<(), BagError> {
        // A truncated file has no indexes, and metadata about it is outdated.
        if !self.is_finished {
            return Ok(());
        }
        let mut facts = Vec::new();
        for index in 0..self.sources.len() {
            let BagSource { name, reader } = &mut self.sources[index];
            let verified = verify(name, reader);
            let (found, problems) =
                verified.map_err(|cause| BagError::Io { file: name.clone(), cause })?;
            facts.push(found);
            problems.into_iter().for_each(|problem| self.add_problem(problem));
        }
        let facts: Vec<&Facts> = facts.iter().collect();
        if let Some((directory, claims)) = &self.claims
            && facts.iter().all(|it| !it.is_part)
        {
            let directory = directory.clone();
            for why in claims.differences(&facts) {
                self.add_problem(Problem::MetadataDiffers { directory: directory.clone(), why });
            }
        }
        Ok(())
    }

    /// Reads every chunk for its channels and counts, if the closing index does not have them.
    /// Messages of `repeated` chunks do not count, but definitions may stand only there.
    fn read_once(
        &mut self,
        repeated: &[(usize, Stretch)],
        outline: &mut Outline,
    ) -> Result<(), BagError> {
        outline.counts.fill(0);
        self.time_range_ns = None;
        for &place in repeated {
            let (source, _) = place;
            let visited =
                visit_stretch(&mut self.sources, place, |opcode, body, _| {
                    match parse_body(opcode, body) {
                        Ok(Record::Schema { header, data }) => {
                            outline.schema(source, header, data.into_owned());
                        }
                        Ok(Record::Channel(channel)) => outline.channel(source, channel),
                        _ => {}
                    }
                })?;
            if let Some(problem) = visited {
                self.add_problem(problem);
            }
        }
        for index in 0..self.stretches.len() {
            let (source, _) = self.stretches[index];
            let time_range_ns = &mut self.time_range_ns;
            let visited =
                visit_stretch(&mut self.sources, self.stretches[index], |opcode, body, _| {
                    match parse_body(opcode, body) {
                        Ok(Record::Schema { header, data }) => {
                            outline.schema(source, header, data.into_owned());
                        }
                        Ok(Record::Channel(channel)) => outline.channel(source, channel),
                        Ok(Record::Message { header, .. })
                            if outline.count(source, header.channel_id) =>
                        {
                            widen(time_range_ns, header.log_time);
                        }
                        _ => {}
                    }
                })?;
            if let Some(problem) = visited {
                self.add_problem(problem);
            }
        }
        Ok(())
    }

    /// Subtracts repeated messages from the counts of the files.
    fn take_back(
        &mut self,
        repeated: &[(usize, Stretch)],
        outline: &mut Outline,
    ) -> Result<(), BagError> {
        for &(source, stretch) in repeated {
            let place = (source, stretch);
            let visited = visit_stretch(&mut self.sources, place, |opcode, body, _| {
                if let Ok(Record::Message { header, .. }) = parse_body(opcode, body) {
                    outline.uncount(source, header.channel_id);
                }
            })?;
            if let Some(problem) = visited {
                self.add_problem(problem);
            }
        }
        Ok(())
    }

    fn take_outline(&mut self, outline: Outline) {
        for (source, channel) in outline.order {
            let schema = outline.schemas.get(&(source, channel.schema_id)).cloned();
            let place = outline.place_of[&(source, channel.id)];
            self.channel_of.insert((source, channel.id), place);
            if place < self.channels.len() {
                continue;
            }
            if schema.is_none() {
                self.add_problem(Problem::SchemaMissing { topic: channel.topic.clone() });
            }
            let text = |key: &str| channel.metadata.get(key).map_or("", String::as_str);
            self.channels.push(Arc::new(BagChannel {
                qos: profiles_from_yaml(text(QOS_KEY)).unwrap_or_default(),
                type_hash: text(TYPE_HASH_KEY).to_owned(),
                message_count: outline.counts[place],
                topic: channel.topic,
                schema,
                message_encoding: channel.message_encoding,
                metadata: channel.metadata,
            }));
        }
    }

    fn recorder_says(&mut self) {
        let Some(closing) = self.closing() else { return };
        if !closing.complete {
            self.add_problem(Problem::RecorderSays { reason: closing.reasons });
        }
        // A damaged bag has fewer messages; the damage is reported already.
        if self.problems().iter().any(Problem::is_damage) || closing.written.is_empty() {
            return;
        }
        let mut counts = closing.written;
        for channel in &self.channels {
            counts.entry(channel.topic.clone()).or_insert(0);
        }
        for (topic, written) in counts {
            let of_topic = self.channels.iter().filter(|channel| channel.topic == topic);
            let found = of_topic.map(|channel| channel.message_count).sum();
            if found != written {
                self.add_problem(Problem::MessagesChanged { topic, written, found });
            }
        }
    }

    /// The record that the recorder wrote when it closed the bag; `None` for other recorders and
    /// bags that were not closed.
    pub fn closing(&self) -> Option<Closing> {
        self.metadata_named(RESULT_RECORD).map(Closing::from_record)
    }
}

/// Extends a range to include a time.
fn widen(range: &mut Option<(u64, u64)>, time: u64) {
    let (start, end) = range.unwrap_or((time, time));
    *range = Some((start.min(time), end.max(time)));
}
