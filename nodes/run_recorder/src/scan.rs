//! Finds the records of one file without decoding chunks.
//!
//! Walks the frames from the first byte on. So it needs neither footer nor index, and
//! reads a truncated file up to its last whole record. It skips chunks that
//! [`crate::chunk_index`] knows. It lists chunks by offset and time;
//! [`crate::bag_messages`] decodes them when their time comes.

#[cfg(feature = "std-fs")]
mod run_record;

use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;

use mcap::records::{Channel, Record, SchemaHeader, Statistics, op};

use crate::bag_problem::{BagError, Problem};
use crate::bag_reader::RUN_RECORD;
use crate::bag_writer::PROFILE;
use crate::chunk_index::{ClosingIndex, END, closing_index};
use crate::records::{CHUNK_HEAD, ChunkHead, FRAME, Frame, RECORD_SIZE_MAX, parse_body};
use crate::split::{PART_KEY, PART_RECORD};
#[cfg(feature = "std-fs")]
pub(crate) use run_record::run_of;

/// Loose messages are read in stretches of at most this many bytes and messages.
const STRETCH_BYTES: u64 = 1024 * 1024;
const STRETCH_MESSAGES: usize = 8192;
/// Bytes before the data of a message: channel, sequence number and two times.
pub(crate) const MESSAGE_HEAD: usize = 22;

/// A stretch of a file that holds messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stretch {
    pub(crate) kind: StretchKind,
    /// Place of the first frame in the file.
    pub(crate) offset: u64,
    /// Bytes, frames included.
    pub(crate) length: u64,
    /// Earliest and latest log time in it.
    pub(crate) start_ns: u64,
    pub(crate) end_ns: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StretchKind {
    /// One chunk record.
    Chunk,
    /// Records that are in no chunk.
    Loose { messages: usize },
}

/// Where an attachment lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct AttachmentPlace {
    pub(crate) name: String,
    pub(crate) media_type: String,
    pub(crate) log_time_ns: u64,
    pub(crate) size: u64,
    pub(crate) offset: u64,
    pub(crate) record_length: u64,
}

/// The records of one file outside of its chunks.
#[derive(Debug, Default)]
pub(crate) struct Scan {
    pub(crate) library: String,
    pub(crate) stretches: Vec<Stretch>,
    pub(crate) schemas: Vec<(SchemaHeader, Vec<u8>)>,
    pub(crate) channels: Vec<Channel>,
    pub(crate) attachments: Vec<AttachmentPlace>,
    pub(crate) metadata: Vec<mcap::records::Metadata>,
    pub(crate) statistics: Option<Statistics>,
    /// Which file of its bag it is, if the bag was split.
    pub(crate) part: Option<u64>,
    /// The stretches that repeat messages of earlier parts.
    pub(crate) repeated: Range<usize>,
    /// The file has its footer and closing magic.
    pub(crate) is_finished: bool,
    pub(crate) problems: Vec<Problem>,
}

/// Walks one file.
pub(crate) fn scan<R: Read + Seek>(file: &str, reader: &mut R) -> Result<Scan, BagError> {
    let io_error = |cause: io::Error| BagError::Io { file: file.to_owned(), cause };
    let length = reader.seek(SeekFrom::End(0)).map_err(io_error)?;
    if length == 0 {
        return Err(BagError::ZeroLength { file: file.to_owned() });
    }
    let index = closing_index(reader, length).map_err(io_error)?;
    let scan = walk(file, reader, length, &index)?;
    if index.chunks.is_empty() || scan.problems.is_empty() {
        return Ok(scan);
    }
    // Either the index is wrong or the records are damaged: the frames alone show which.
    let mut plain = walk(file, reader, length, &ClosingIndex::default())?;
    if plain.problems != scan.problems {
        let at = length.saturating_sub(END as u64);
        let why = "the index before it does not agree with the records".to_owned();
        plain.problems.push(Problem::DamagedRecord { file: file.to_owned(), at, why });
    }
    Ok(plain)
}

fn walk<R: Read + Seek>(
    file: &str,
    reader: &mut R,
    length: u64,
    index: &ClosingIndex,
) -> Result<Scan, BagError> {
    let io_error = |cause: io::Error| BagError::Io { file: file.to_owned(), cause };
    reader.seek(SeekFrom::Start(0)).map_err(io_error)?;
    let mut walk = Walk { file, reader, length, at: 0, position: 0, scan: Scan::default() };
    walk.magic_and_header()?;
    walk.records(index).map_err(io_error)?;
    Ok(walk.scan)
}

struct Walk<'a, R> {
    file: &'a str,
    reader: &'a mut R,
    length: u64,
    /// Offset of the current record.
    at: u64,
    /// Offset of the reader.
    position: u64,
    scan: Scan,
}

impl<R: Read + Seek> Walk<'_, R> {
    fn magic_and_header(&mut self) -> Result<(), BagError> {
        let file = self.file.to_owned();
        let length = self.length;
        let no_header = || BagError::NoHeader { file: file.clone(), length };
        let io_error = |cause| BagError::Io { file: file.clone(), cause };
        let magic_length = mcap::MAGIC.len() as u64;
        let beginning = self.take(length.min(magic_length)).map_err(io_error)?;
        self.at = self.position;
        if beginning != mcap::MAGIC[..beginning.len()] {
            return Err(BagError::NotABag { file });
        }
        let Some(frame) = self.frame().map_err(io_error)? else {
            return Err(no_header());
        };
        if frame.length > self.length - self.at - FRAME as u64 {
            return Err(no_header());
        }
        if frame.opcode != op::HEADER || frame.length > RECORD_SIZE_MAX {
            return Err(BagError::NotABag { file });
        }
        let body = self.body(frame).map_err(io_error)?;
        let Ok(Record::Header(header)) = parse_body(frame.opcode, &body) else {
            return Err(BagError::NotABag { file });
        };
        if header.profile != PROFILE {
            return Err(BagError::WrongProfile { file, profile: header.profile });
        }
        self.scan.library = header.library;
        self.at = self.position;
        Ok(())
    }

    /// Walks the records after the header, and skips the chunks that are known.
    fn records(&mut self, index: &ClosingIndex) -> io::Result<()> {
        if let Some((at, why)) = &index.damage {
            let (file, at, why) = (self.file.to_owned(), *at, why.clone());
            self.problem(Problem::DamagedRecord { file, at, why });
        }
        // Data that a damaged index repeats is not taken from it.
        let mut is_believed = true;
        loop {
            if let Some(chunk) = index.chunks.get(&self.at) {
                self.scan.stretches.push(chunk.stretch);
                self.at += chunk.length;
                continue;
            }
            let Some(frame) = self.frame()? else {
                self.broken_off();
                return Ok(());
            };
            let available = self.length - self.at - FRAME as u64;
            if frame.length > available {
                self.problem(Problem::CutRecord {
                    file: self.file.to_owned(),
                    at: self.at,
                    claimed: frame.length,
                    available,
                });
                return Ok(());
            }
            if frame.opcode == op::FOOTER {
                return self.end(frame);
            }
            if frame.opcode == op::DATA_END {
                is_believed = index.damage.is_none();
            }
            if is_believed {
                self.record(frame)?;
            }
            self.at += FRAME as u64 + frame.length;
        }
    }

    fn record(&mut self, frame: Frame) -> io::Result<()> {
        match frame.opcode {
            op::CHUNK => self.chunk(frame),
            op::MESSAGE => self.message(frame),
            op::ATTACHMENT => self.attachment(frame),
            op::SCHEMA | op::CHANNEL | op::METADATA | op::STATISTICS => self.small(frame),
            // Indexes only repeat other records; unknown kinds are skipped.
            _ => Ok(()),
        }
    }

    fn chunk(&mut self, frame: Frame) -> io::Result<()> {
        if frame.length < CHUNK_HEAD as u64 {
            self.damaged("the chunk is shorter than its head");
            return Ok(());
        }
        let head = ChunkHead::parse(&self.head()?);
        self.scan.stretches.push(Stretch {
            kind: StretchKind::Chunk,
            offset: self.at,
            length: FRAME as u64 + frame.length,
            start_ns: head.start_ns,
            end_ns: head.end_ns,
        });
        Ok(())
    }

    fn message(&mut self, frame: Frame) -> io::Result<()> {
        if frame.length < MESSAGE_HEAD as u64 {
            self.damaged("the message is shorter than its head");
            return Ok(());
        }
        let head: [u8; MESSAGE_HEAD] = self.head()?;
        // Channel and sequence number come before the log time.
        let time = u64::from_le_bytes(std::array::from_fn(|i| head[6 + i]));
        let length = FRAME as u64 + frame.length;
        if let Some(last) = self.scan.stretches.last_mut()
            && let StretchKind::Loose { messages } = &mut last.kind
            && last.offset + last.length == self.at
            && last.length + length <= STRETCH_BYTES
            && *messages < STRETCH_MESSAGES
        {
            *messages += 1;
            last.length += length;
            last.start_ns = last.start_ns.min(time);
            last.end_ns = last.end_ns.max(time);
            return Ok(());
        }
        self.scan.stretches.push(Stretch {
            kind: StretchKind::Loose { messages: 1 },
            offset: self.at,
            length,
            start_ns: time,
            end_ns: time,
        });
        Ok(())
    }

    fn attachment(&mut self, frame: Frame) -> io::Result<()> {
        if frame.length > RECORD_SIZE_MAX {
            self.damaged("the attachment is larger than this reader takes");
            return Ok(());
        }
        let body = self.body(frame)?;
        match parse_body(frame.opcode, &body) {
            Ok(Record::Attachment { header, data, .. }) => {
                self.scan.attachments.push(AttachmentPlace {
                    name: header.name,
                    media_type: header.media_type,
                    log_time_ns: header.log_time,
                    size: data.len() as u64,
                    offset: self.at,
                    record_length: frame.length,
                });
            }
            Ok(_) => {}
            Err(why) => self.damaged(&why),
        }
        Ok(())
    }

    fn small(&mut self, frame: Frame) -> io::Result<()> {
        if frame.length > RECORD_SIZE_MAX {
            self.damaged("it is larger than this reader takes");
            return Ok(());
        }
        let body = self.body(frame)?;
        match parse_body(frame.opcode, &body) {
            Ok(Record::Schema { header, data }) => {
                self.scan.schemas.push((header, data.into_owned()));
            }
            Ok(Record::Channel(channel)) => self.scan.channels.push(channel),
            Ok(Record::Metadata(metadata)) => self.metadata(metadata),
            Ok(Record::Statistics(statistics)) => self.scan.statistics = Some(statistics),
            Ok(_) => {}
            Err(why) => self.damaged(&why),
        }
        Ok(())
    }

    /// The repeated messages of a part are between the record of the part and that of the run.
    fn metadata(&mut self, metadata: mcap::records::Metadata) {
        let so_far = self.scan.stretches.len();
        if metadata.name == PART_RECORD {
            self.scan.part = metadata.metadata.get(PART_KEY).and_then(|part| part.parse().ok());
            // Until their end is known.
            self.scan.repeated = so_far..usize::MAX;
        } else if metadata.name == RUN_RECORD && self.scan.repeated.end == usize::MAX {
            self.scan.repeated.end = so_far;
        }
        self.scan.metadata.push(metadata);
    }

    fn end(&mut self, frame: Frame) -> io::Result<()> {
        self.at += FRAME as u64 + frame.length;
        self.go_to(self.at)?;
        let left = self.length - self.at;
        let magic = self.take(left.min(mcap::MAGIC.len() as u64 + 1))?;
        if magic.starts_with(mcap::MAGIC) {
            self.scan.is_finished = true;
            if magic.len() > mcap::MAGIC.len() {
                self.problem(Problem::AfterFooter {
                    file: self.file.to_owned(),
                    at: self.at + mcap::MAGIC.len() as u64,
                });
            }
        } else {
            self.broken_off();
        }
        Ok(())
    }

    /// The frame at `at`, with the reader right after it; `None` if the file ends before.
    fn frame(&mut self) -> io::Result<Option<Frame>> {
        if self.length.saturating_sub(self.at) < FRAME as u64 {
            return Ok(None);
        }
        self.go_to(self.at)?;
        Ok(Some(Frame::parse(&self.head()?)))
    }

    /// The body after the frame just read, whose length was compared with the file's.
    fn body(&mut self, frame: Frame) -> io::Result<Vec<u8>> {
        self.take(frame.length)
    }

    fn head<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut head = [0; N];
        self.reader.read_exact(&mut head)?;
        self.position += N as u64;
        Ok(head)
    }

    fn take(&mut self, count: u64) -> io::Result<Vec<u8>> {
        let bytes = read_bytes(self.reader, count)?;
        self.position += count;
        Ok(bytes)
    }

    /// Moves the reader, inside its buffer if it has one.
    fn go_to(&mut self, place: u64) -> io::Result<()> {
        let distance = i64::try_from(place).map_err(io::Error::other)?
            - i64::try_from(self.position).map_err(io::Error::other)?;
        self.reader.seek_relative(distance)?;
        self.position = place;
        Ok(())
    }

    fn broken_off(&mut self) {
        self.problem(Problem::Truncated {
            file: self.file.to_owned(),
            at: self.at,
            length: self.length,
        });
    }

    fn damaged(&mut self, why: &str) {
        self.problem(Problem::DamagedRecord {
            file: self.file.to_owned(),
            at: self.at,
            why: why.to_owned(),
        });
    }

    fn problem(&mut self, problem: Problem) {
        self.scan.problems.push(problem);
    }
}

/// Reads exactly `count` bytes.
pub(crate) fn read_bytes<R: Read>(reader: &mut R, count: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    reader.by_ref().take(count).read_to_end(&mut bytes)?;
    if bytes.len() as u64 == count { Ok(bytes) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}
