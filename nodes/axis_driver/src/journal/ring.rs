//! Entries of the journal in as little memory as they need, for readers that missed some.
//!
//! Bounded in bytes, bookkeeping included: the oldest entries are dropped first.

use super::{Entry, EntryKind, kind_from_wire, kind_to_wire};
use std::collections::VecDeque;

/// What the ring may hold, bytes: some half a million lines with their answers.
const BYTES_MAX: usize = 24 << 20;
/// Entries that follow each other lie together, in about so many bytes.
const BLOCK_BYTES: usize = 64 << 10;
/// What is written before the data of an entry: its kind, its time, its length.
const HEADER_BYTES: usize = 1 + 8 + 4;

/// The newest entries.
#[derive(Debug, Default)]
pub struct Ring {
    blocks: VecDeque<Block>,
    /// What the blocks have taken, used or not.
    bytes: usize,
    /// Number of the newest checkpoint.
    checkpoint: u64,
}

/// Entries whose numbers follow each other.
#[derive(Debug)]
struct Block {
    first: u64,
    count: u64,
    bytes: Vec<u8>,
}

impl Block {
    /// The number that the next entry has.
    fn end(&self) -> u64 {
        self.first + self.count
    }

    fn entries(&self) -> impl Iterator<Item = Entry> {
        let mut rest = self.bytes.as_slice();
        (self.first..self.end()).map_while(move |sequence| {
            let (kind, after) = rest.split_first()?;
            let (time, after) = after.split_first_chunk()?;
            let (length, after) = after.split_first_chunk()?;
            let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
            let (data, after) = after.split_at_checked(length)?;
            rest = after;
            Some(Entry {
                sequence,
                monotonic_ns: u64::from_le_bytes(*time),
                kind: kind_from_wire(*kind)?,
                data: data.to_vec(),
            })
        })
    }
}

impl Ring {
    /// Keeps an entry, whose number is larger than those before.
    pub fn push(&mut self, entry: &Entry) {
        if entry.kind == EntryKind::Checkpoint {
            self.checkpoint = entry.sequence;
        }
        let size = HEADER_BYTES + entry.data.len();
        // A block begins after a gap, too: in one the numbers are counted.
        let goes_on = |block: &Block| {
            block.end() == entry.sequence && block.bytes.len() + size <= block.bytes.capacity()
        };
        if !self.blocks.back().is_some_and(goes_on) {
            let bytes = Vec::with_capacity(size.max(BLOCK_BYTES));
            self.bytes += bytes.capacity();
            self.blocks.push_back(Block { first: entry.sequence, count: 0, bytes });
        }
        // There is one: it may have been made just now.
        let Some(block) = self.blocks.back_mut() else { return };
        block.count += 1;
        block.bytes.push(kind_to_wire(entry.kind));
        block.bytes.extend_from_slice(&entry.monotonic_ns.to_le_bytes());
        // Data of 4 GB is none of a serial line.
        let length = u32::try_from(entry.data.len()).unwrap_or(u32::MAX);
        block.bytes.extend_from_slice(&length.to_le_bytes());
        block.bytes.extend_from_slice(&entry.data);
        while self.bytes > BYTES_MAX && self.blocks.len() > 1 {
            let Some(oldest) = self.blocks.pop_front() else { break };
            self.bytes -= oldest.bytes.capacity();
        }
    }

    /// Number of the newest checkpoint; 0 when there was none.
    pub fn checkpoint(&self) -> u64 {
        self.checkpoint
    }

    /// Number of the oldest entry; 0 when there is none.
    pub fn oldest(&self) -> u64 {
        self.blocks.front().map_or(0, |block| block.first)
    }

    /// Number of the newest entry; 0 when there is none.
    pub fn newest(&self) -> u64 {
        self.blocks.back().map_or(0, |block| block.end() - 1)
    }

    /// The entries from a number on, as far as they are there.
    pub fn from(&self, first: u64) -> impl Iterator<Item = Entry> {
        let skipped = self.blocks.partition_point(|block| block.end() <= first);
        let blocks = self.blocks.iter().skip(skipped);
        blocks.flat_map(Block::entries).skip_while(move |entry| entry.sequence < first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(sequence: u64, length: usize) -> Entry {
        let kind = if sequence.is_multiple_of(2) { EntryKind::Rx } else { EntryKind::Tx };
        Entry { sequence, monotonic_ns: sequence * 1_000, kind, data: vec![b'x'; length] }
    }

    #[test]
    fn entries_come_back_as_they_were_from_any_number_on() {
        let mut ring = Ring::default();
        assert_eq!((ring.oldest(), ring.newest(), ring.from(0).count()), (0, 0, 0));
        let entries: Vec<Entry> = (1..=10_000).map(|number| entry(number, 20)).collect();
        entries.iter().for_each(|entry| ring.push(entry));
        assert_eq!((ring.oldest(), ring.newest()), (1, 10_000));
        for first in [0, 1, 2, 1_985, 1_986, 1_987, 5_000, 10_000, 10_001] {
            let skipped = usize::try_from(first).unwrap().saturating_sub(1);
            let found: Vec<Entry> = ring.from(first).collect();
            assert_eq!(found, entries[skipped..], "from {first}");
        }
    }

    #[test]
    fn numbers_after_a_gap_are_right_and_the_newest_checkpoint_is_known() {
        let mut ring = Ring::default();
        let checkpoint = Entry { kind: EntryKind::Checkpoint, ..entry(7, BLOCK_BYTES * 2) };
        let entries = [entry(1, 3), entry(2, 0), checkpoint, entry(8, 5), entry(20, 1)];
        entries.iter().for_each(|entry| ring.push(entry));
        assert!(ring.from(1).eq(entries.iter().cloned()));
        assert!(ring.from(3).eq(entries[2..].iter().cloned()));
        assert!(ring.from(9).eq(entries[4..].iter().cloned()));
        assert_eq!((ring.checkpoint(), ring.newest()), (7, 20));
    }

    #[test]
    fn it_takes_no_more_memory_however_much_is_pushed() {
        let mut ring = Ring::default();
        let mut most = 0;
        for number in 1..=1_500_000 {
            ring.push(&entry(number, 12));
            most = most.max(ring.bytes);
        }
        assert!(most <= BYTES_MAX + BLOCK_BYTES, "{most} bytes");
        let taken: usize = ring.blocks.iter().map(|block| block.bytes.capacity()).sum();
        assert_eq!(taken, ring.bytes);
        assert_eq!(ring.newest(), 1_500_000);
        let kept = ring.newest() - ring.oldest() + 1;
        assert!(kept > 900_000, "{kept} entries");
        assert_eq!(ring.from(ring.oldest()).count() as u64, kept);
    }
}
