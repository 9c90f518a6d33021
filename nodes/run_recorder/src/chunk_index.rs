//! Reads the closing index of a finished file, if it is valid: where the chunks are.
//!
//! With it a file is opened without reading its chunks. It is used only if its
//! checksum is right. Even then, [`crate::bag_messages`] compares each chunk with its
//! index entry when it reads the chunk, and [`crate::scan`] walks the records
//! between chunks.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::{Record, op};

use crate::records::{FRAME, Frame, RECORD_SIZE_MAX, parse_body, visit_plain};
use crate::scan::{Stretch, StretchKind, read_bytes};

/// Two places and a checksum.
const FOOTER: usize = 20;
/// The footer with its frame, and the magic bytes that end a file.
pub(crate) const END: usize = FRAME + FOOTER + mcap::MAGIC.len();

/// A chunk, and how many bytes it and its own index take.
pub(crate) struct IndexedChunk {
    pub(crate) stretch: Stretch,
    pub(crate) length: u64,
}

/// The index at the end of a file.
#[derive(Default)]
pub(crate) struct ClosingIndex {
    /// By their places.
    pub(crate) chunks: BTreeMap<u64, IndexedChunk>,
    /// Offset of the footer and what is wrong; the index is not used then.
    pub(crate) damage: Option<(u64, String)>,
}

/// Reads the index; an empty one if there is none with a checksum.
pub(crate) fn closing_index<R: Read + Seek>(
    reader: &mut R,
    file_length: u64,
) -> io::Result<ClosingIndex> {
    Ok(read_index(reader, file_length)?.unwrap_or_default())
}

fn read_index<R: Read + Seek>(
    reader: &mut R,
    file_length: u64,
) -> io::Result<Option<ClosingIndex>> {
    let Some(footer_at) = file_length.checked_sub(END as u64) else { return Ok(None) };
    reader.seek(SeekFrom::Start(footer_at))?;
    let mut end = [0; END];
    reader.read_exact(&mut end)?;
    let (head, rest) = end.split_first_chunk::<FRAME>().expect("END is longer");
    let frame = Frame::parse(head);
    let is_footer = frame.opcode == op::FOOTER && frame.length == FOOTER as u64;
    if !is_footer || &rest[FOOTER..] != mcap::MAGIC {
        return Ok(None);
    }
    let Ok(Record::Footer(footer)) = parse_body(op::FOOTER, &rest[..FOOTER]) else {
        return Ok(None);
    };
    // Without a checksum a damaged index cannot be detected.
    let Some(length) = footer_at.checked_sub(footer.summary_start) else { return Ok(None) };
    if footer.summary_start == 0 || footer.summary_crc == 0 || length > RECORD_SIZE_MAX {
        return Ok(None);
    }
    reader.seek(SeekFrom::Start(footer.summary_start))?;
    let summary = read_bytes(reader, length)?;
    let mut crc = crc32fast::Hasher::new();
    crc.update(&summary);
    // The footer up to the checksum itself.
    crc.update(&end[..FRAME + FOOTER - 4]);
    let (calculated, saved) = (crc.finalize(), footer.summary_crc);
    if calculated != saved {
        let why = format!(
            "the index before it has the checksum {calculated:08x} where {saved:08x} was written"
        );
        let damage = Some((footer_at, why));
        return Ok(Some(ClosingIndex { damage, ..ClosingIndex::default() }));
    }
    let mut chunks = BTreeMap::new();
    let visited = visit_plain(&summary, |opcode, body, _| {
        if opcode == op::CHUNK_INDEX
            && let Ok(Record::ChunkIndex(index)) = parse_body(opcode, body)
            && let Some(chunk) = indexed(&index, footer.summary_start)
        {
            chunks.insert(index.chunk_start_offset, chunk);
        }
    });
    Ok(visited.is_ok().then_some(ClosingIndex { chunks, damage: None }))
}

fn indexed(index: &mcap::records::ChunkIndex, data_end: u64) -> Option<IndexedChunk> {
    let length = index.chunk_length.checked_add(index.message_index_length)?;
    let end = index.chunk_start_offset.checked_add(length)?;
    let is_possible = index.chunk_length > FRAME as u64 && end <= data_end;
    is_possible.then_some(IndexedChunk {
        stretch: Stretch {
            kind: StretchKind::Chunk,
            offset: index.chunk_start_offset,
            length: index.chunk_length,
            start_ns: index.message_start_time,
            end_ns: index.message_end_time,
        },
        length,
    })
}
