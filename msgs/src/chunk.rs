//! Long values in short messages: a manifest and numbered, checksummed chunks.
//!
//! A message stays under [`MESSAGE_BYTES_MAX`], whatever it holds. The sender
//! cuts a value once and can build any chunk at any time. The receiver collects
//! chunks in any order and requests the missing ones. It gets the whole value
//! only when every count and checksum agrees.

mod collect;
mod cut;

pub use collect::{Chunk, ChunkError, Collector};

use crate::cdr::{Cdr, Writer};
use crate::contour::{ContourEvent, ContourEventKind, ProgrammedContour};
use crate::convert::{chain_to_wire, path_element_to_wire};
use crate::path::CompensatedPath;
use crate::units::point_from_position;
use crate::wire::cnc_msgs::msg as wire;
use cut::{Cut, Cutter};
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
    cuts: Vec<Cut<1>>,
    sha256: String,
}

impl ContourChunks {
    /// Cuts it; the checksum over all chunks is computed once, here.
    pub fn new(program_id: String, contour: ProgrammedContour) -> Self {
        let mut cutter = Cutter::new(&contour.calls);
        for (index, event) in contour.events.iter().enumerate() {
            cutter.take([index], EVENT_BYTES + action_bytes(event), event.source.call);
        }
        let cuts = cutter.finish([contour.events.len()]);
        let mut chunks = Self { program_id, contour, cuts, sha256: String::new() };
        let mut hasher = Sha256::new();
        for index in 0..chunks.count() {
            let (events, event_calls, calls) = chunks.body(index);
            hasher.update(contour_body(&events, &event_calls, &calls));
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
            call_count: self.contour.calls.rows().len() as u64,
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

    fn body(&self, index: u32) -> (Vec<wire::ContourEvent>, Vec<u32>, Vec<wire::Call>) {
        let (from, to) = (self.cuts[index as usize], self.cuts[index as usize + 1]);
        let events = &self.contour.events[from.items[0]..to.items[0]];
        let calls = calls_of(events.iter().map(|event| event.source.call));
        let rows = &self.contour.calls.rows()[from.rows..to.rows];
        (events.iter().map(Into::into).collect(), calls, chain_to_wire(rows))
    }

    /// The chunk of this number, if there is one.
    pub fn chunk(&self, index: u32) -> Option<wire::ContourChunk> {
        if index >= self.count() {
            return None;
        }
        let (events, event_calls, calls) = self.body(index);
        Some(wire::ContourChunk {
            program_id: self.program_id.clone(),
            index,
            chunk_count: self.count(),
            first_event: self.cuts[index as usize].items[0] as u64,
            crc32: crc32fast::hash(&contour_body(&events, &event_calls, &calls)),
            events,
            event_calls,
            calls,
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
    cuts: Vec<Cut<2>>,
    sha256: String,
}

impl PathChunks {
    /// Cuts it; the checksum over all chunks is computed once, here.
    pub fn new(program_id: String, revision: u64, path: Arc<CompensatedPath>) -> Self {
        let mut cutter = Cutter::new(&path.calls);
        let mut event = 0;
        for element in 0..=path.elements.len() {
            // An event is in the chunk of the element that follows it.
            while let Some(next) = path.events.get(event)
                && next.at_element <= element
            {
                let size = EVENT_BYTES + FUNCTION_BYTES + next.action.text().len();
                cutter.take([element, event], size, next.source.call);
                event += 1;
            }
            if let Some(it) = path.elements.get(element) {
                cutter.take([element, event], ELEMENT_BYTES, it.source.call);
            }
        }
        let cuts = cutter.finish([path.elements.len(), path.events.len()]);
        let mut chunks = Self { program_id, revision, path, cuts, sha256: String::new() };
        let mut hasher = Sha256::new();
        for index in 0..chunks.count() {
            hasher.update(path_body(&chunks.body(index)));
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
            call_count: self.path.calls.rows().len() as u64,
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

    /// The body of a chunk, in a chunk that has nothing else.
    fn body(&self, index: u32) -> wire::PathChunk {
        let (from, to) = (self.cuts[index as usize], self.cuts[index as usize + 1]);
        let range = from.items[0]..to.items[0];
        let elements = &self.path.elements[range.clone()];
        let events = &self.path.events[from.items[1]..to.items[1]];
        let to_wire = |(index, element)| path_element_to_wire(self.path.start_of(index), element);
        let mut body = wire::PathChunk {
            elements: range.zip(elements).map(to_wire).collect(),
            events: events.iter().map(Into::into).collect(),
            element_calls: elements.iter().map(|element| element.source.call).collect(),
            event_calls: events.iter().map(|event| event.source.call).collect(),
            calls: chain_to_wire(&self.path.calls.rows()[from.rows..to.rows]),
            ..wire::PathChunk::default()
        };
        if body.element_calls.iter().chain(&body.event_calls).all(|&call| call == 0) {
            (body.element_calls, body.event_calls) = (Vec::new(), Vec::new());
        }
        body
    }

    /// The chunk of this number, if there is one.
    pub fn chunk(&self, index: u32) -> Option<wire::PathChunk> {
        if index >= self.count() {
            return None;
        }
        let body = self.body(index);
        Some(wire::PathChunk {
            program_id: self.program_id.clone(),
            revision: self.revision,
            index,
            chunk_count: self.count(),
            first_element: self.cuts[index as usize].items[0] as u64,
            crc32: crc32fast::hash(&path_body(&body)),
            ..body
        })
    }
}

/// Nothing where none of them has a call.
fn calls_of(calls: impl Iterator<Item = u32> + Clone) -> Vec<u32> {
    if calls.clone().all(|call| call == 0) { Vec::new() } else { calls.collect() }
}

/// The bytes that the checksums of a chunk of a contour cover. Without calls they are those of its
/// events, as before there were calls.
fn contour_body(
    events: &Vec<wire::ContourEvent>,
    event_calls: &Vec<u32>,
    calls: &Vec<wire::Call>,
) -> Vec<u8> {
    let mut out = Writer::default();
    events.write(&mut out);
    if !event_calls.is_empty() || !calls.is_empty() {
        out = Writer::after(out.into_bytes());
        event_calls.write(&mut out);
        calls.write(&mut out);
    }
    out.into_bytes()
}

/// The same of a chunk of a path.
fn path_body(chunk: &wire::PathChunk) -> Vec<u8> {
    let wire::PathChunk { elements, events, element_calls, event_calls, calls, .. } = chunk;
    let mut out = Writer::default();
    elements.write(&mut out);
    events.write(&mut out);
    if !element_calls.is_empty() || !event_calls.is_empty() || !calls.is_empty() {
        out = Writer::after(out.into_bytes());
        element_calls.write(&mut out);
        event_calls.write(&mut out);
        calls.write(&mut out);
    }
    out.into_bytes()
}
