//! Reads which run a file belongs to from its first records.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::{Record, op};

use super::{Scan, Walk};
use crate::bag_problem::BagError;
use crate::bag_reader::RUN_RECORD;
use crate::records::{FRAME, parse_body};
use crate::split::PART_RECORD;

/// The library that wrote a file, and its run id; `None` if they are not in its first
/// records. Reads nothing else.
pub(crate) fn run_of<R: Read + Seek>(
    reader: &mut R,
) -> io::Result<Option<(String, BTreeMap<String, String>)>> {
    /// The largest record of a run, bytes; it has a few keys and values.
    const SIZE_MAX: u64 = 1024 * 1024;
    let length = reader.seek(SeekFrom::End(0))?;
    reader.seek(SeekFrom::Start(0))?;
    let mut walk = Walk { file: "", reader, length, at: 0, position: 0, scan: Scan::default() };
    match walk.magic_and_header() {
        Ok(()) => {}
        Err(BagError::Io { cause, .. }) => return Err(cause),
        Err(_) => return Ok(None),
    }
    loop {
        let Some(frame) = walk.frame()? else { return Ok(None) };
        let available = length - walk.at - FRAME as u64;
        if frame.opcode != op::METADATA || frame.length > available.min(SIZE_MAX) {
            return Ok(None);
        }
        match parse_body(frame.opcode, &walk.body(frame)?) {
            Ok(Record::Metadata(metadata)) if metadata.name == RUN_RECORD => {
                return Ok(Some((walk.scan.library, metadata.metadata)));
            }
            Ok(Record::Metadata(metadata)) if metadata.name == PART_RECORD => {}
            _ => return Ok(None),
        }
        walk.at += FRAME as u64 + frame.length;
    }
}
