//! The path of a single block, in the record itself.
//!
//! A program's path is in the bag under its program and revision; a block of
//! manual data input has neither. It is written as messages, hexadecimal: they
//! keep every bit of its numbers.

use super::CommandError;
use crate::driver::MDI;
use cnc_msgs::cdr;
use cnc_msgs::chunk::{Collector, PathChunks, hex};
use cnc_msgs::interface::Message;
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::wire::cnc_msgs::msg as wire;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct PathRecord {
    manifest: String,
    chunks: Vec<String>,
}

impl PathRecord {
    pub(super) fn of(path: &Arc<CompensatedPath>) -> Self {
        let chunks = PathChunks::new(MDI.to_owned(), 0, Arc::clone(path));
        let manifest = wire::CompensatedPath { program_id: MDI.to_owned(), ..chunks.manifest() };
        let written = (0..chunks.count()).filter_map(|index| chunks.chunk(index));
        Self {
            manifest: hex(&cdr::encapsulated(&manifest)),
            chunks: written.map(|chunk| hex(&cdr::encapsulated(&chunk))).collect(),
        }
    }

    pub(super) fn path(&self) -> Result<CompensatedPath, CommandError> {
        let manifest: wire::CompensatedPath = read(&self.manifest)?;
        let mut collector = Collector::for_path(&manifest).map_err(broken)?;
        for chunk in &self.chunks {
            collector.add(read(chunk)?).map_err(broken)?;
        }
        collector.finish(&manifest).map_err(broken)
    }
}

fn broken(error: impl std::fmt::Display) -> CommandError {
    CommandError::Path(error.to_string())
}

fn read<M: Message>(digits: &str) -> Result<M, CommandError> {
    let pairs = digits.as_bytes().chunks(2).map(|pair| {
        let text = std::str::from_utf8(pair).ok()?;
        u8::from_str_radix(text, 16).ok()
    });
    let bytes: Option<Vec<u8>> = pairs.collect();
    cdr::decode(&bytes.ok_or_else(|| broken("not hexadecimal"))?).map_err(broken)
}
