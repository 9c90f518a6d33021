//! Where a contour or a path is cut, with its table of calls.

use super::BODY_BYTES_MAX;
use crate::calls::Calls;

/// Upper bound of a row of the table without its name, bytes.
const CALL_BYTES: usize = 28;

/// Puts items into chunks, and each row of the table of calls before the first item that uses it.
pub(super) struct Cutter<'a, const N: usize> {
    calls: &'a Calls,
    /// Rows that are in a chunk.
    rows: usize,
    /// Bytes of the chunk that is being filled.
    bytes: usize,
    cuts: Vec<Cut<N>>,
}

/// The first item of each kind in a chunk, and its first row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Cut<const N: usize> {
    pub(super) items: [usize; N],
    pub(super) rows: usize,
}

impl<'a, const N: usize> Cutter<'a, N> {
    pub(super) fn new(calls: &'a Calls) -> Self {
        Self { calls, rows: 0, bytes: 0, cuts: vec![Cut { items: [0; N], rows: 0 }] }
    }

    /// Takes the item at `items`, of so many bytes, which was run in this row.
    pub(super) fn take(&mut self, items: [usize; N], bytes: usize, row: u32) {
        if self.calls.is_empty() {
            return self.put(items, bytes);
        }
        self.rows_to(items, row as usize);
        self.put(items, bytes + size_of::<u32>());
    }

    /// The cuts, and the end.
    pub(super) fn finish(mut self, items: [usize; N]) -> Vec<Cut<N>> {
        self.rows_to(items, usize::MAX);
        self.cuts.push(Cut { items, rows: self.rows });
        self.cuts
    }

    fn rows_to(&mut self, items: [usize; N], row: usize) {
        let calls = self.calls;
        for call in &calls.rows()[self.rows..row.clamp(self.rows, calls.rows().len())] {
            self.put(items, CALL_BYTES + call.name.as_deref().map_or(0, str::len));
            self.rows += 1;
        }
    }

    fn put(&mut self, items: [usize; N], bytes: usize) {
        if self.bytes + bytes > BODY_BYTES_MAX {
            self.cuts.push(Cut { items, rows: self.rows });
            self.bytes = 0;
        }
        self.bytes += bytes;
    }
}
