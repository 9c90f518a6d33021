//! Reads records of the container format, without trusting them.
//!
//! Knows the frame (one byte of kind, eight bytes of length), and checks the length of a
//! body first, because the parser of crate `mcap` panics on short ones. Decodes
//! one chunk at a time; [`crate::scan`] finds the records in a file.

use mcap::records::{Record, op};
use mcap::sans_io::LinearReader;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReaderOptions};

/// Bytes before the body of a record.
pub(crate) const FRAME: usize = 9;
/// The largest record or chunk this reader takes into memory, bytes.
pub const RECORD_SIZE_MAX: u64 = 256 * 1024 * 1024;

/// The head of a record.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) opcode: u8,
    pub(crate) length: u64,
}

impl Frame {
    pub(crate) fn parse(head: &[u8; FRAME]) -> Self {
        let mut length = [0; 8];
        length.copy_from_slice(&head[1..]);
        Self { opcode: head[0], length: u64::from_le_bytes(length) }
    }
}

/// Parses the body of a record; the text says what is wrong with it.
pub(crate) fn parse_body(opcode: u8, body: &[u8]) -> Result<Record<'_>, String> {
    if opcode == op::ATTACHMENT {
        // Two times, two texts, a length and a checksum.
        check_attachment(body)?;
    }
    mcap::parse_record(opcode, body).map_err(|error| explain(&error))
}

fn check_attachment(body: &[u8]) -> Result<(), String> {
    let length_at = |at: usize| -> Option<usize> {
        let bytes = body.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?) as usize)
    };
    let end = length_at(16).and_then(|name| {
        let media_type_at = 20_usize.checked_add(name)?;
        let media_type = length_at(media_type_at)?;
        // Followed by eight bytes of length and four of checksum.
        media_type_at.checked_add(4)?.checked_add(media_type)?.checked_add(12)
    });
    match end {
        Some(end) if end <= body.len() => Ok(()),
        _ => Err("the attachment is shorter than it says".to_owned()),
    }
}

/// The error of the container library in one line, with its cause.
pub(crate) fn explain(error: &mcap::McapError) -> String {
    use mcap::McapError as E;
    match error {
        E::BadChunkCrc { saved, calculated } => {
            format!("its checksum is {calculated:08x} where {saved:08x} was written")
        }
        E::BadAttachmentCrc { saved, calculated } => {
            format!("the attachment's checksum is {calculated:08x} where {saved:08x} was written")
        }
        E::Io(cause) => format!("it does not decompress: {cause}"),
        E::Parse(_) => {
            "a record is shorter than it says or holds text that is not UTF-8".to_owned()
        }
        other => other.to_string().to_lowercase(),
    }
}

/// The head of a chunk and where its records begin in the body.
#[derive(Debug, Clone)]
pub(crate) struct ChunkHead {
    pub(crate) start_ns: u64,
    pub(crate) end_ns: u64,
}

/// Bytes of a chunk's head that [`ChunkHead::parse`] needs.
pub(crate) const CHUNK_HEAD: usize = 16;

impl ChunkHead {
    pub(crate) fn parse(head: &[u8; CHUNK_HEAD]) -> Self {
        let time = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| head[at + i]));
        Self { start_ns: time(0), end_ns: time(8) }
    }
}

/// Calls `visit` with kind, body and offset of each record in a chunk.
///
/// A checksum is verified before any record is visited. Without one (rosbag2
/// writes none) the records before the damage are visited. The text says what is wrong.
pub(crate) fn visit_chunk(
    body: &[u8],
    mut visit: impl FnMut(u8, &[u8], usize),
) -> Result<(), String> {
    let Record::Chunk { header, data } = parse_body(op::CHUNK, body)? else {
        return Err("it is not a chunk".to_owned());
    };
    if header.uncompressed_size > RECORD_SIZE_MAX {
        return Err(format!(
            "it claims {} bytes, more than the {RECORD_SIZE_MAX} this reader takes",
            header.uncompressed_size
        ));
    }
    if header.compression.is_empty() {
        let saved = header.uncompressed_crc;
        if saved != 0 {
            let calculated = crc32fast::hash(&data);
            if calculated != saved {
                return Err(explain(&mcap::McapError::BadChunkCrc { saved, calculated }));
            }
        }
        return visit_plain(&data, visit);
    }
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(RECORD_SIZE_MAX as usize);
    let mut reader = LinearReader::new_with_options(options);
    let mut head = [op::CHUNK; FRAME];
    head[1..].copy_from_slice(&(body.len() as u64).to_le_bytes());
    let mut rest: &[u8] = body;
    reader.insert(FRAME).copy_from_slice(&head);
    reader.notify_read(FRAME);
    let mut at = 0_usize;
    while let Some(event) = reader.next_event() {
        match event.map_err(|error| explain(&error))? {
            LinearReadEvent::ReadRequest(_) if rest.is_empty() => break,
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                let room = reader.insert(now.len());
                room[..now.len()].copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record { data, opcode } => {
                visit(opcode, data, at);
                at += FRAME + data.len();
            }
        }
    }
    if at as u64 == header.uncompressed_size {
        Ok(())
    } else {
        Err(format!("it holds {at} of the {} bytes it claims", header.uncompressed_size))
    }
}

/// Calls `visit` for each record of an uncompressed stretch.
pub(crate) fn visit_plain(
    mut data: &[u8],
    mut visit: impl FnMut(u8, &[u8], usize),
) -> Result<(), String> {
    let mut at = 0;
    while !data.is_empty() {
        let broken = || format!("the record at byte {at} of it is cut off");
        let (head, rest) = data.split_first_chunk::<FRAME>().ok_or_else(broken)?;
        let frame = Frame::parse(head);
        let length = usize::try_from(frame.length).map_err(|_| broken())?;
        let body = rest.get(..length).ok_or_else(broken)?;
        visit(frame.opcode, body, at);
        data = &rest[length..];
        at += FRAME + length;
    }
    Ok(())
}
