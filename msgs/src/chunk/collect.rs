//! Reassembles chunks.

use super::{ITEM_COUNT_MAX, hex};
use crate::calls::Calls;
use crate::contour::{ContourEvent, ContourEventKind, ProgrammedContour};
use crate::convert::{WireError, checked_position};
use crate::geometry::{AxisSet, Shape};
use crate::path::{CompensatedPath, PathElement, PathEvent};
use crate::wire::cnc_msgs::msg as wire;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;

/// Why chunks are not what their manifest announced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ChunkError {
    #[error("{count} {what} are announced; at most {max} are accepted")]
    TooMany { what: &'static str, count: u64, max: u64 },
    #[error("chunk {index} is of {found}, not of {wanted}")]
    Foreign { index: u32, found: String, wanted: String },
    #[error("chunk {index} of {count} does not exist")]
    Index { index: u32, count: u32 },
    #[error("chunk {index} is damaged: its checksum is {found:08x}, not {stated:08x}")]
    Damaged { index: u32, found: u32, stated: u32 },
    #[error("chunk {index}: {error}")]
    Content { index: u32, error: WireError },
    #[error("the chunks hold {found} {what}; the manifest announced {announced}")]
    Count { what: &'static str, found: u64, announced: u64 },
    #[error("the chunks together have checksum {found}, not {announced}")]
    Checksum { found: String, announced: String },
    #[error("element {index} starts at {start:?}, but the one before it ends at {end:?}")]
    Gap { index: u64, start: [f64; 3], end: [f64; 3] },
    #[error("the manifest is not valid: {0}")]
    Manifest(WireError),
}

/// A chunk of a program, a contour or a path.
pub trait Chunk: Sized {
    fn index(&self) -> u32;
    fn chunk_count(&self) -> u32;
    /// What it belongs to: a program, or a program and a revision.
    fn owner(&self) -> (&str, u64);
    /// The checksum that it states, and its actual one.
    fn checksums(&self) -> (u32, u32);
    /// The bytes that the checksums cover.
    fn body(&self) -> Vec<u8>;
}

impl Chunk for wire::ProgramChunk {
    fn index(&self) -> u32 {
        self.index
    }
    fn chunk_count(&self) -> u32 {
        self.chunk_count
    }
    fn owner(&self) -> (&str, u64) {
        (&self.program_id, 0)
    }
    fn checksums(&self) -> (u32, u32) {
        (self.crc32, crc32fast::hash(&self.data))
    }
    fn body(&self) -> Vec<u8> {
        self.data.clone()
    }
}

impl Chunk for wire::ContourChunk {
    fn index(&self) -> u32 {
        self.index
    }
    fn chunk_count(&self) -> u32 {
        self.chunk_count
    }
    fn owner(&self) -> (&str, u64) {
        (&self.program_id, 0)
    }
    fn checksums(&self) -> (u32, u32) {
        (self.crc32, crc32fast::hash(&self.body()))
    }
    fn body(&self) -> Vec<u8> {
        super::contour_body(&self.events, &self.event_calls, &self.calls)
    }
}

impl Chunk for wire::PathChunk {
    fn index(&self) -> u32 {
        self.index
    }
    fn chunk_count(&self) -> u32 {
        self.chunk_count
    }
    fn owner(&self) -> (&str, u64) {
        (&self.program_id, self.revision)
    }
    fn checksums(&self) -> (u32, u32) {
        (self.crc32, crc32fast::hash(&self.body()))
    }
    fn body(&self) -> Vec<u8> {
        super::path_body(self)
    }
}

/// Collects the chunks of one manifest.
#[derive(Debug, Clone)]
pub struct Collector<C> {
    program_id: String,
    revision: u64,
    count: u32,
    /// `None` when checksums are not compared.
    sha256: Option<String>,
    chunks: BTreeMap<u32, C>,
    /// All chunks before this one have arrived.
    next: u32,
}

impl<C: Chunk> Collector<C> {
    fn new(program_id: &str, revision: u64, count: u32, sha256: &str) -> Self {
        Self {
            program_id: program_id.into(),
            revision,
            count,
            sha256: Some(sha256.into()),
            chunks: BTreeMap::new(),
            next: 0,
        }
    }

    /// Ignores the checksums: they cover the bytes that were sent, and these chunks had an
    /// older definition then. The caller has to know that the chunks are complete.
    pub fn without_checksums(self) -> Self {
        Self { sha256: None, ..self }
    }

    /// Takes a chunk; one that has arrived before changes nothing.
    pub fn add(&mut self, chunk: C) -> Result<(), ChunkError> {
        let index = chunk.index();
        let (program_id, revision) = chunk.owner();
        if (program_id, revision) != (&self.program_id, self.revision) {
            return Err(ChunkError::Foreign {
                index,
                found: format!("{program_id} revision {revision}"),
                wanted: format!("{} revision {}", self.program_id, self.revision),
            });
        }
        if index >= self.count || chunk.chunk_count() != self.count {
            return Err(ChunkError::Index { index, count: self.count });
        }
        let (stated, found) = chunk.checksums();
        if self.sha256.is_some() && stated != found {
            return Err(ChunkError::Damaged { index, found, stated });
        }
        self.chunks.entry(index).or_insert(chunk);
        while self.chunks.contains_key(&self.next) {
            self.next += 1;
        }
        Ok(())
    }

    /// The first chunk that has not arrived; `None` when all have.
    pub fn missing(&self) -> Option<u32> {
        (self.next < self.count).then_some(self.next)
    }

    /// Whether the chunk belongs to what is collected here.
    pub fn wants(&self, chunk: &C) -> bool {
        chunk.owner() == (self.program_id.as_str(), self.revision)
    }

    /// The chunks that have arrived, in order.
    pub fn into_chunks(self) -> Vec<C> {
        self.chunks.into_values().collect()
    }

    fn check_sum(&self) -> Result<(), ChunkError> {
        let Some(announced) = &self.sha256 else { return Ok(()) };
        let mut hasher = Sha256::new();
        for chunk in self.chunks.values() {
            hasher.update(chunk.body());
        }
        let found = hex(&hasher.finalize());
        if found == *announced {
            Ok(())
        } else {
            Err(ChunkError::Checksum { found, announced: announced.clone() })
        }
    }
}

fn check_announced(what: &'static str, count: u64, max: u64) -> Result<(), ChunkError> {
    if count > max { Err(ChunkError::TooMany { what, count, max }) } else { Ok(()) }
}

fn check_count(what: &'static str, found: usize, announced: u64) -> Result<(), ChunkError> {
    if found as u64 == announced {
        Ok(())
    } else {
        Err(ChunkError::Count { what, found: found as u64, announced })
    }
}

impl Collector<wire::ProgramChunk> {
    /// A collector for the program of this manifest.
    pub fn for_program(manifest: &wire::Program) -> Result<Self, ChunkError> {
        check_announced("bytes", manifest.size, ITEM_COUNT_MAX * 100)?;
        check_announced("chunks", manifest.chunk_count.into(), manifest.size / 1000 + 1)?;
        Ok(Self::new(&manifest.program_id, 0, manifest.chunk_count, &manifest.sha256))
    }

    /// The text, once nothing is missing.
    pub fn finish(self, manifest: &wire::Program) -> Result<Vec<u8>, ChunkError> {
        self.check_sum()?;
        let text: Vec<u8> = self.chunks.into_values().flat_map(|chunk| chunk.data).collect();
        check_count("bytes", text.len(), manifest.size)?;
        Ok(text)
    }
}

impl Collector<wire::ContourChunk> {
    /// A collector for the contour of this manifest.
    pub fn for_contour(manifest: &wire::ProgrammedContour) -> Result<Self, ChunkError> {
        check_announced("events", manifest.event_count, ITEM_COUNT_MAX)?;
        check_announced("calls", manifest.call_count, ITEM_COUNT_MAX)?;
        let items = manifest.event_count + manifest.call_count;
        check_announced("chunks", manifest.chunk_count.into(), items + 1)?;
        Ok(Self::new(&manifest.program_id, 0, manifest.chunk_count, &manifest.sha256))
    }

    /// The contour, once nothing is missing.
    pub fn finish(
        self,
        manifest: &wire::ProgrammedContour,
    ) -> Result<ProgrammedContour, ChunkError> {
        self.check_sum()?;
        let mut events: Vec<ContourEvent> = Vec::new();
        let mut calls = Calls::default();
        for (index, chunk) in self.chunks {
            let content = |error| ChunkError::Content { index, error };
            calls.extend_from_wire(&chunk.calls).map_err(content)?;
            let rows = row_of_each("event_calls", &chunk.event_calls, chunk.events.len(), &calls);
            for (event, call) in chunk.events.iter().zip(rows.map_err(content)?) {
                let mut event = ContourEvent::try_from(event).map_err(content)?;
                event.source.call = call;
                events.push(event);
            }
        }
        check_count("events", events.len(), manifest.event_count)?;
        check_count("calls", calls.rows().len(), manifest.call_count)?;
        let start = checked_position("start", &manifest.start).map_err(ChunkError::Manifest)?;
        let assumed_axes = AxisSet::from_bits(manifest.assumed_axes);
        let mut contour = ProgrammedContour { start, assumed_axes, events, calls };
        level_centers(&mut contour);
        Ok(contour)
    }
}

/// The row of each item of a chunk.
fn row_of_each<'c>(
    field: &'static str,
    rows: &'c [u32],
    count: usize,
    calls: &Calls,
) -> Result<impl Iterator<Item = u32> + use<'c>, WireError> {
    if !rows.is_empty() && rows.len() != count {
        return Err(WireError::Number { field, value: rows.len() as f64 });
    }
    for &row in rows {
        calls.known(row)?;
    }
    Ok(rows.iter().copied().chain(std::iter::repeat(0)))
}

/// Sets each centre to the height of its start, bit for bit, as before sending.
fn level_centers(contour: &mut ProgrammedContour) {
    let mut position = contour.start;
    for event in &mut contour.events {
        if let ContourEventKind::Motion(motion) = &mut event.kind {
            if let Shape::Arc(arc) = &mut motion.shape {
                let normal = arc.plane.axes()[2];
                arc.center[normal] = position[normal];
            }
            position = motion.end;
        }
    }
}

impl Collector<wire::PathChunk> {
    /// A collector for the path of this manifest.
    pub fn for_path(manifest: &wire::CompensatedPath) -> Result<Self, ChunkError> {
        check_announced("elements", manifest.element_count, ITEM_COUNT_MAX)?;
        check_announced("events", manifest.event_count, ITEM_COUNT_MAX)?;
        check_announced("calls", manifest.call_count, ITEM_COUNT_MAX)?;
        let items = manifest.element_count + manifest.event_count + manifest.call_count;
        check_announced("chunks", manifest.chunk_count.into(), items + 1)?;
        Ok(Self::new(
            &manifest.program_id,
            manifest.revision,
            manifest.chunk_count,
            &manifest.sha256,
        ))
    }

    /// The path, once nothing is missing; every element starts where the one before it ended.
    pub fn finish(self, manifest: &wire::CompensatedPath) -> Result<CompensatedPath, ChunkError> {
        self.check_sum()?;
        let start = checked_position("start", &manifest.start).map_err(ChunkError::Manifest)?;
        let mut path = CompensatedPath {
            start,
            assumed_axes: AxisSet::from_bits(manifest.assumed_axes),
            ..CompensatedPath::default()
        };
        let mut end = manifest.start.clone();
        for (index, chunk) in self.chunks {
            let content = |error| ChunkError::Content { index, error };
            path.calls.extend_from_wire(&chunk.calls).map_err(content)?;
            let (of_elements, of_events) = (&chunk.element_calls, &chunk.event_calls);
            let rows = row_of_each("element_calls", of_elements, chunk.elements.len(), &path.calls);
            for (element, call) in chunk.elements.iter().zip(rows.map_err(content)?) {
                if element.start != end {
                    return Err(ChunkError::Gap {
                        index: path.elements.len() as u64,
                        start: [element.start.x, element.start.y, element.start.z],
                        end: [end.x, end.y, end.z],
                    });
                }
                end = element.end.clone();
                let mut element = PathElement::try_from(element).map_err(content)?;
                element.source.call = call;
                path.elements.push(element);
            }
            let rows = row_of_each("event_calls", of_events, chunk.events.len(), &path.calls);
            for (event, call) in chunk.events.iter().zip(rows.map_err(content)?) {
                let mut event = PathEvent::try_from(event).map_err(content)?;
                event.source.call = call;
                path.events.push(event);
            }
        }
        check_count("elements", path.elements.len(), manifest.element_count)?;
        check_count("events", path.events.len(), manifest.event_count)?;
        check_count("calls", path.calls.rows().len(), manifest.call_count)?;
        let mut least = 0;
        for event in &path.events {
            if event.at_element < least || event.at_element > path.elements.len() {
                return Err(ChunkError::Manifest(WireError::Number {
                    field: "at_element",
                    value: event.at_element as f64,
                }));
            }
            least = event.at_element;
        }
        Ok(path)
    }
}
