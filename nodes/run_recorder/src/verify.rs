//! Verifies what a finished file says about itself: checksums, indexes, counts, offsets.
//!
//! Reads the whole file once more, record by record, and compares redundant data with its
//! source. Opening and reading a bag does not need this: chunks have checksums. An error found
//! only here loses no message, but misleads other readers.

mod summary;

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::{
    AttachmentIndex, Channel, ChunkIndex, MessageIndexEntry, MetadataIndex, Record, op,
};

use crate::bag_problem::Problem;
use crate::bag_writer::PRODUCT;
use crate::metadata::Claims;
use crate::playable::refused_chunk;
use crate::records::{FRAME, Frame, RECORD_SIZE_MAX, parse_body, visit_chunk};
use crate::scan::read_bytes;
use summary::Summary;

/// The metadata record of rosbag2, and its key.
const ROSBAG2: (&str, &str) = ("rosbag2", "serialized_metadata");

/// The content of a file, from its records.
#[derive(Debug, Default)]
pub(crate) struct Facts {
    /// Messages by topic.
    pub(crate) counts: BTreeMap<String, u64>,
    pub(crate) message_count: u64,
    /// First and last log time, nanoseconds.
    pub(crate) range_ns: Option<(u64, u64)>,
    /// Written by [`PRODUCT`].
    pub(crate) is_ours: bool,
    /// Not every chunk could be read.
    pub(crate) is_part: bool,
}

/// Reads a finished file; returns its content, and what it says wrongly about itself.
pub(crate) fn verify<R: Read + Seek>(
    file: &str,
    reader: &mut R,
) -> io::Result<(Facts, Vec<Problem>)> {
    let length = reader.seek(SeekFrom::End(0))?;
    reader.seek(SeekFrom::Start(0))?;
    let mut check = FileCheck { file: file.to_owned(), ..FileCheck::default() };
    // A file that could not be read at all is reported already.
    if length < mcap::MAGIC.len() as u64 {
        check.is_unread = true;
        return Ok(check.end());
    }
    check.crc.update(&read_bytes(reader, mcap::MAGIC.len() as u64)?);
    check.at = mcap::MAGIC.len() as u64;
    while let Some(body_at) = check.at.checked_add(FRAME as u64).filter(|at| *at <= length) {
        let head: [u8; FRAME] = read_bytes(reader, FRAME as u64)?.try_into().expect("a frame");
        let frame = Frame::parse(&head);
        let available = length - body_at;
        if frame.length > available.min(RECORD_SIZE_MAX) {
            check.is_unread = true;
            check.wrong(format!("it claims {} bytes, and {available} follow", frame.length));
            break;
        }
        let body = read_bytes(reader, frame.length)?;
        check.record(frame.opcode, &head, &body);
        check.at = body_at + frame.length;
        if frame.opcode == op::FOOTER {
            break;
        }
    }
    Ok(check.end())
}

/// A chunk, until its own index is over.
#[derive(Debug)]
struct OpenChunk {
    index: ChunkIndex,
    /// Times and places of its messages by channel; `None` if it cannot be read.
    entries: Option<BTreeMap<u16, Vec<MessageIndexEntry>>>,
}

#[derive(Debug, Default)]
struct FileCheck {
    file: String,
    /// Offset of the current record.
    at: u64,
    /// Over all records so far of the data, then of the summary.
    crc: crc32fast::Hasher,
    /// The data is over.
    is_summary: bool,
    /// A checksum over the data does not hold, and why.
    wrong_data: Option<(u64, String)>,
    facts: Facts,
    channels: BTreeMap<u16, Channel>,
    /// Name, encoding and text by number.
    schemas: BTreeMap<u16, (String, String, Vec<u8>)>,
    counts: BTreeMap<u16, u64>,
    /// A chunk could not be read, so that nothing can be counted.
    is_unread: bool,
    open: Option<OpenChunk>,
    chunks: BTreeMap<u64, ChunkIndex>,
    attachments: BTreeMap<u64, AttachmentIndex>,
    metadata: BTreeMap<u64, MetadataIndex>,
    /// What the record of rosbag2 says, and where.
    rosbag2: Option<(u64, String)>,
    summary: Summary,
    problems: Vec<Problem>,
}

impl FileCheck {
    fn record(&mut self, opcode: u8, head: &[u8; FRAME], body: &[u8]) {
        if opcode != op::MESSAGE_INDEX {
            self.close_chunk();
        }
        let parsed = match parse_body(opcode, body) {
            Ok(parsed) => parsed,
            Err(why) => return self.wrong(format!("it cannot be read: {why}")),
        };
        if let Record::DataEnd(end) = &parsed {
            let calculated = std::mem::take(&mut self.crc).finalize();
            let saved = end.data_section_crc;
            if saved != 0 && saved != calculated {
                let why = format!(
                    "the records before it have the checksum {calculated:08x} where {saved:08x} \
                     was written"
                );
                self.wrong_data = Some((self.at, why));
            }
            if body.len() != 4 {
                self.wrong("the record that ends the data has the wrong length".to_owned());
            }
            self.is_summary = true;
            self.summary.start = self.at + (FRAME + body.len()) as u64;
            return;
        }
        if let Record::Footer(footer) = &parsed {
            if !self.is_summary {
                self.wrong("the record that ends the data is missing before it".to_owned());
            }
            self.crc.update(head);
            self.crc.update(&body[..body.len().min(16)]);
            let calculated = std::mem::take(&mut self.crc).finalize();
            let found = self.summary.footer(self.at, footer, calculated);
            found.into_iter().for_each(|why| self.wrong(why));
            return;
        }
        self.crc.update(head);
        self.crc.update(body);
        let length = (FRAME + body.len()) as u64;
        match parsed {
            Record::Header(header) => {
                self.facts.is_ours = header.library.starts_with(PRODUCT);
            }
            Record::Schema { header, data } => {
                let schema = (header.name, header.encoding, data.into_owned());
                self.schema(header.id, schema);
            }
            Record::Channel(channel) => self.channel(channel),
            Record::Message { header, .. } => self.message(header.channel_id, header.log_time),
            Record::Chunk { .. } => self.chunk(body, length),
            Record::MessageIndex(index) => self.message_index(index, length),
            Record::Attachment { header, data, .. } => {
                let place = AttachmentIndex {
                    offset: self.at,
                    length,
                    log_time: header.log_time,
                    create_time: header.create_time,
                    data_size: data.len() as u64,
                    name: header.name,
                    media_type: header.media_type,
                };
                self.attachments.insert(self.at, place);
            }
            Record::Metadata(metadata) => {
                let place = MetadataIndex { offset: self.at, length, name: metadata.name.clone() };
                self.metadata.insert(self.at, place);
                if metadata.name == ROSBAG2.0
                    && let Some(text) = metadata.metadata.get(ROSBAG2.1)
                {
                    self.rosbag2 = Some((self.at, text.clone()));
                }
            }
            _ => {}
        }
        if self.is_summary {
            self.summary.record(self.at, opcode, body);
        }
    }

    fn schema(&mut self, id: u16, schema: (String, String, Vec<u8>)) {
        let known = self.schemas.entry(id).or_insert_with(|| schema.clone());
        if *known != schema {
            self.lost(format!(
                "the definition {} differs from an earlier one of the same id",
                schema.0
            ));
        }
    }

    fn channel(&mut self, channel: Channel) {
        let known = self.channels.entry(channel.id).or_insert_with(|| channel.clone());
        if *known != channel {
            self.lost(format!(
                "the topic {} differs from an earlier one of the same id",
                channel.topic
            ));
        }
    }

    fn message(&mut self, channel: u16, log_time: u64) {
        *self.counts.entry(channel).or_default() += 1;
        let (start, end) = self.facts.range_ns.unwrap_or((log_time, log_time));
        self.facts.range_ns = Some((start.min(log_time), end.max(log_time)));
    }

    fn chunk(&mut self, body: &[u8], length: u64) {
        let Ok(Record::Chunk { header, .. }) = parse_body(op::CHUNK, body) else { return };
        let mut entries: BTreeMap<u16, Vec<MessageIndexEntry>> = BTreeMap::new();
        let mut defined = Vec::new();
        let visited = visit_chunk(body, |opcode, body, at| match parse_body(opcode, body) {
            Ok(Record::Message { header, .. }) => {
                let entry = MessageIndexEntry { log_time: header.log_time, offset: at as u64 };
                entries.entry(header.channel_id).or_default().push(entry);
            }
            Ok(record @ (Record::Schema { .. } | Record::Channel(_))) => {
                defined.push(record.into_owned());
            }
            _ => {}
        });
        for record in defined {
            match record {
                Record::Schema { header, data } => {
                    let schema = (header.name, header.encoding, data.into_owned());
                    self.schema(header.id, schema);
                }
                Record::Channel(channel) => self.channel(channel),
                _ => {}
            }
        }
        let times = || entries.values().flatten().map(|entry| entry.log_time);
        let range = (times().min().unwrap_or(0), times().max().unwrap_or(0));
        if visited.is_ok()
            && !entries.is_empty()
            && range != (header.message_start_time, header.message_end_time)
        {
            self.wrong(format!(
                "the chunk says that it is from {} ns to {} ns, and its messages are from {} ns to \
                 {} ns",
                header.message_start_time, header.message_end_time, range.0, range.1
            ));
        }
        for (channel, entries) in &entries {
            entries.iter().for_each(|entry| self.message(*channel, entry.log_time));
        }
        self.is_unread |= visited.is_err();
        self.open = Some(OpenChunk {
            index: ChunkIndex {
                message_start_time: header.message_start_time,
                message_end_time: header.message_end_time,
                chunk_start_offset: self.at,
                chunk_length: length,
                message_index_offsets: BTreeMap::new(),
                message_index_length: 0,
                compression: header.compression,
                compressed_size: header.compressed_size,
                uncompressed_size: header.uncompressed_size,
            },
            entries: visited.is_ok().then_some(entries),
        });
    }

    fn message_index(&mut self, index: mcap::records::MessageIndex, length: u64) {
        let Some(open) = &mut self.open else {
            return self.wrong("an index of messages does not follow a chunk".to_owned());
        };
        let chunk = open.index.chunk_start_offset;
        open.index.message_index_length += length;
        let twice = open.index.message_index_offsets.insert(index.channel_id, self.at).is_some();
        let of_channel = open.entries.as_ref().map(|it| it.get(&index.channel_id));
        let mut indexed = index.records;
        indexed.sort_by_key(|entry| entry.offset);
        if twice || of_channel.is_some_and(|it| it.map_or(&[][..], |it| it) != indexed) {
            self.wrong(format!(
                "the index of the messages of channel {} is not that of the chunk at byte {chunk}",
                index.channel_id
            ));
        }
    }

    /// The index of a chunk is over: where there is one, it has every channel.
    fn close_chunk(&mut self) {
        let Some(OpenChunk { index, entries }) = self.open.take() else { return };
        let has_index = |channel: &u16| index.message_index_offsets.contains_key(channel);
        let lacking = entries.iter().flat_map(BTreeMap::keys).find(|channel| !has_index(channel));
        if let Some(channel) = lacking.filter(|_| index.message_index_length > 0) {
            self.wrong(format!(
                "the chunk at byte {} has no index of the messages of channel {channel}",
                index.chunk_start_offset
            ));
        }
        self.chunks.insert(index.chunk_start_offset, index);
    }

    fn end(mut self) -> (Facts, Vec<Problem>) {
        self.close_chunk();
        self.facts.is_part = self.is_unread;
        self.facts.message_count = self.counts.values().sum();
        for (channel, count) in &self.counts {
            if let Some(channel) = self.channels.get(channel) {
                *self.facts.counts.entry(channel.topic.clone()).or_default() += count;
            }
        }
        let found = DataSection {
            chunks: &self.chunks,
            attachments: &self.attachments,
            metadata: &self.metadata,
            counts: &self.counts,
            range_ns: self.facts.range_ns,
            is_counted: !self.is_unread,
            channel_count: self.channels.len(),
            schema_count: self.schemas.len(),
        };
        if let Some(at) = refused_chunk(self.chunks.values()) {
            self.problems.push(Problem::NotPlayable { file: self.file.clone(), at });
        }
        let wrong = self.summary.compare(&found);
        for (at, why) in wrong {
            self.wrong_at(at, why);
        }
        if let Some(promised) = self.summary.promised().filter(|_| !self.is_unread)
            && promised != self.facts.message_count
        {
            let found = self.facts.message_count;
            self.problems.push(Problem::MessagesMissing { promised, found });
        }
        // Other recorders write it at other moments.
        if let Some((at, text)) =
            self.rosbag2.take().filter(|_| self.facts.is_ours && !self.is_unread)
        {
            match Claims::of_record(&text) {
                Ok(claims) => {
                    let differences = claims.differences(&[&self.facts]);
                    for why in differences {
                        self.wrong_at(at, format!("the record of rosbag2 says {why}"));
                    }
                }
                Err(why) => self.wrong_at(at, format!("the record of rosbag2 is broken: {why}")),
            }
        }
        // If nothing else explains it, any record may be damaged.
        if let Some((at, why)) = self.wrong_data.take()
            && self.problems.iter().all(Problem::is_of_players)
        {
            let file = self.file.clone();
            self.problems.push(Problem::DamagedRecord { file, at, why });
        }
        (self.facts, self.problems)
    }

    fn wrong(&mut self, why: String) {
        self.wrong_at(self.at, why);
    }

    /// Other data may be wrong too.
    fn lost(&mut self, why: String) {
        let (file, at) = (self.file.clone(), self.at);
        self.problems.push(Problem::DamagedRecord { file, at, why });
    }

    fn wrong_at(&mut self, at: u64, why: String) {
        self.problems.push(Problem::DamagedIndex { file: self.file.clone(), at, why });
    }
}

/// The content of a file's data section, to compare with its summary.
#[derive(Debug)]
pub(crate) struct DataSection<'a> {
    chunks: &'a BTreeMap<u64, ChunkIndex>,
    attachments: &'a BTreeMap<u64, AttachmentIndex>,
    metadata: &'a BTreeMap<u64, MetadataIndex>,
    counts: &'a BTreeMap<u16, u64>,
    range_ns: Option<(u64, u64)>,
    is_counted: bool,
    channel_count: usize,
    schema_count: usize,
}
