//! Long values in short messages: a manifest and numbered, checksummed chunks.
//!
//! A message stays under [`MESSAGE_BYTES_MAX`], whatever it holds. The sender
//! cuts a value once and can build any chunk at any time. The receiver collects
//! chunks in any order and requests the missing ones. It gets the whole value
//! only when every count and checksum agrees.

mod collect;

pub use collect::{Chunk, ChunkError, Collector};

use crate::cdr;
use crate::contour::{ContourEvent, ContourEventKind, ProgrammedContour};
use crate::convert::path_element_to_wire;
use crate::path::CompensatedPath;
use crate::units::point_from_position;
use crate::wire::cnc_msgs::msg as wire;
use sha2::{Digest, Sha256};
use std::sync::Arc;

/// No message is larger than this: peers with other DDS implementations lose larger ones.
pub const MESSAGE_BYTES_MAX: usize = 60_000;

/// Size limit of a chunk's body; the rest is for the envelope and a service reply around it.
const BODY_BYTES_MAX: usize = 48_000;

/// No program, contour or path is longer than this many events or elements.
pub const ITEM_COUNT_MAX: u64 = 50_000_000;

/// Upper bounds of a CDR struct without its strings, bytes.
const ELEMENT_BYTES: usize = 136;
const FUNCTION_BYTES: usize = 88;
const EVENT_BYTES: usize = 136;

/// Lower-case hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 of some bytes, 64 hex digits.
pub fn sha256_hex(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// CRC-32 (IEEE 802.3) of some bytes.
pub fn crc32(bytes: &[u8]) -> u32 {
    crc32fast::hash(bytes)
}

/// The id of a program: the same text under the same rules is the same program.
///
/// `rules` is the whole profile in force.
pub fn program_id(rules: &str, text: &[u8]) -> String {
    let mut hasher = Sha256::new();
    hasher.update(rules.as_bytes());
    hasher.update([0]);
    hasher.update(text);
    hex(&hasher.finalize()[..8])
}

/// A program text, cut.
#[derive(Debug, Clone)]
pub struct ProgramChunks {
    pub program_id: String,
    pub text: Vec<u8>,
}

impl ProgramChunks {
    /// Number of chunks; one even for an empty text, so that the receiver gets something.
    pub fn count(&self) -> u32 {
        self.text.len().div_ceil(BODY_BYTES_MAX).max(1) as u32
    }

    /// The chunk of this number, if there is one.
    pub fn chunk(&self, index: u32) -> Option<wire::ProgramChunk> {
        if index >= self.count() {
            return None;
        }
        let from = index as usize * BODY_BYTES_MAX;
        let data = &self.text[from..self.text.len().min(from + BODY_BYTES_MAX)];
        Some(wire::ProgramChunk {
            program_id: self.program_id.clone(),
            index,
            chunk_count: self.count(),
            data: data.to_vec(),
            crc32: crc32fast::hash(data),
        })
    }
}

/// A contour, cut.
#[derive(Debug, Clone)]
pub struct ContourChunks {
    program_id: String,
    contour: ProgrammedContour,
    /// First event of each chunk, and the end.
    cuts: Vec<usize>,
    sha256: String,
}

impl ContourChunks {
    /// Cuts it; the checksum over all chunks is computed once, here.
    pub fn new(program_id: String, contour: ProgrammedContour) -> Self {
        let mut cuts = vec![0];
        let mut bytes = 0;
        for (index, event) in contour.events.iter().enumerate() {
            let size = EVENT_BYTES + action_bytes(event);
            if bytes + size > BODY_BYTES_MAX {
                cuts.push(index);
                bytes = 0;
            }
            bytes += size;
        }
        cuts.push(contour.events.len());
        let mut chunks = Self { program_id, contour, cuts, sha256: String::new() };
        let mut hasher = Sha256::new();
        for index in 0..chunks.count() {
            hasher.update(cdr::body(&chunks.events(index)));
        }
        chunks.sha256 = hex(&hasher.finalize());
        chunks
    }

    /// The part of its manifest that describes the content; the caller adds the rest.
    pub fn manifest(&self) -> wire::ProgrammedContour {
        wire::ProgrammedContour {
            event_count: self.contour.events.len() as u64,
            chunk_count: self.count(),
            sha256: self.sha256.clone(),
            start: point_from_position(self.contour.start),
            assumed_axes: self.contour.assumed_axes.bits(),
            ..wire::ProgrammedContour::default()
        }
    }

    /// The id of the program that it is the contour of.
    pub fn program_id(&self) -> &str {
        &self.program_id
    }

    /// The contour that was cut.
    pub fn contour(&self) -> &ProgrammedContour {
        &self.contour
    }

    pub fn count(&self) -> u32 {
        (self.cuts.len() - 1) as u32
    }

    /// SHA-256 over the bodies of all chunks.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    fn events(&self, index: u32) -> Vec<wire::ContourEvent> {
        let range = self.cuts[index as usize]..self.cuts[index as usize + 1];
        self.contour.events[range].iter().map(Into::into).collect()
    }

    /// The chunk of this number, if there is one.
    pub fn chunk(&self, index: u32) -> Option<wire::ContourChunk> {
        if index >= self.count() {
            return None;
        }
        let events = self.events(index);
        Some(wire::ContourChunk {
            program_id: self.program_id.clone(),
            index,
            chunk_count: self.count(),
            first_event: self.cuts[index as usize] as u64,
            crc32: crc32fast::hash(&cdr::body(&events)),
            events,
        })
    }
}

fn action_bytes(event: &ContourEvent) -> usize {
    match event.kind {
        ContourEventKind::Action(action) => FUNCTION_BYTES + action.text().len(),
        _ => 0,
    }
}

/// A path, cut.
#[derive(Debug, Clone)]
pub struct PathChunks {
    program_id: String,
    revision: u64,
    path: Arc<CompensatedPath>,
    /// First element and first event of each chunk, and the end.
    cuts: Vec<(usize, usize)>,
    sha256: String,
}

impl PathChunks {
    /// Cuts it; the checksum over all chunks is computed once, here.
    pub fn new(program_id: String, revision: u64, path: Arc<CompensatedPath>) -> Self {
        let mut cuts = vec![(0, 0)];
        let (mut bytes, mut event) = (0, 0);
        for element in 0..=path.elements.len() {
            // An event is in the chunk of the element that follows it.
            while path.events.get(event).is_some_and(|next| next.at_element <= element) {
                let size = EVENT_BYTES + FUNCTION_BYTES + path.events[event].action.text().len();
                if bytes + size > BODY_BYTES_MAX {
                    cuts.push((element, event));
                    bytes = 0;
                }
                bytes += size;
                event += 1;
            }
            if element < path.elements.len() {
                if bytes + ELEMENT_BYTES > BODY_BYTES_MAX {
                    cuts.push((element, event));
                    bytes = 0;
                }
                bytes += ELEMENT_BYTES;
            }
        }
        cuts.push((path.elements.len(), path.events.len()));
        let mut chunks = Self { program_id, revision, path, cuts, sha256: String::new() };
        let mut hasher = Sha256::new();
        for index in 0..chunks.count() {
            hasher.update(cdr::body(&chunks.body(index)));
        }
        chunks.sha256 = hex(&hasher.finalize());
        chunks
    }

    /// The part of its manifest that describes the content; the caller adds the rest.
    pub fn manifest(&self) -> wire::CompensatedPath {
        wire::CompensatedPath {
            element_count: self.path.elements.len() as u64,
            event_count: self.path.events.len() as u64,
            chunk_count: self.count(),
            sha256: self.sha256.clone(),
            start: point_from_position(self.path.start),
            assumed_axes: self.path.assumed_axes.bits(),
            ..wire::CompensatedPath::default()
        }
    }

    /// The path that was cut.
    pub fn path(&self) -> &Arc<CompensatedPath> {
        &self.path
    }

    pub fn count(&self) -> u32 {
        (self.cuts.len() - 1) as u32
    }

    /// SHA-256 over the bodies of all chunks.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    fn body(&self, index: u32) -> (Vec<wire::PathElement>, Vec<wire::PathEvent>) {
        let (from, to) = (self.cuts[index as usize], self.cuts[index as usize + 1]);
        let elements = (from.0..to.0)
            .map(|index| {
                path_element_to_wire(self.path.start_of(index), &self.path.elements[index])
            })
            .collect();
        (elements, self.path.events[from.1..to.1].iter().map(Into::into).collect())
    }

    /// The chunk of this number, if there is one.
    pub fn chunk(&self, index: u32) -> Option<wire::PathChunk> {
        if index >= self.count() {
            return None;
        }
        let body = self.body(index);
        let crc32 = crc32fast::hash(&cdr::body(&body));
        Some(wire::PathChunk {
            program_id: self.program_id.clone(),
            revision: self.revision,
            index,
            chunk_count: self.count(),
            first_element: self.cuts[index as usize].0 as u64,
            elements: body.0,
            events: body.1,
            crc32,
        })
    }
}
