//! The subroutines and loops that are running, and their rows in the table of calls.

use super::map::{Cursor, shown};
use crate::limits::CALL_NAME_BYTES_MAX;
use crate::parameters::ARGUMENTS;
use cnc_msgs::calls::Calls;
use std::sync::Arc;

/// The main program or a subroutine.
#[derive(Debug, Default)]
pub(super) struct Frame {
    pub(super) loops: Vec<Loop>,
    /// Nothing for the main program.
    pub(super) call: Option<Call>,
}

#[derive(Debug)]
pub(super) struct Call {
    /// The statement that the subroutine begins with.
    pub(super) entry: usize,
    pub(super) return_to: Cursor,
    /// The line of the call.
    pub(super) line: u32,
    /// Its row in the table of calls.
    pub(super) row: u32,
    /// Of a subroutine with arguments: `#1` to `#30` before it.
    pub(super) saved: Option<Box<[f64; ARGUMENTS]>>,
    /// Calls after this one (M98 L), and which this one is.
    pub(super) repeats: u32,
    pub(super) pass: u32,
}

#[derive(Debug)]
pub(super) struct Loop {
    /// The statement that the loop begins with.
    pub(super) entry: usize,
    /// From 1.
    pub(super) pass: u32,
    /// The row of this pass in the table of calls.
    pub(super) row: u32,
    /// Of a `repeat`: passes after this one.
    pub(super) rest: u64,
}

impl Frame {
    /// The row of the innermost pass or call; 0 in the main program.
    pub(super) fn row(&self) -> u32 {
        let of_call = self.call.as_ref().map_or(0, |call| call.row);
        self.loops.last().map_or(of_call, |running| running.row)
    }
}

impl Loop {
    pub(super) fn next_pass(&mut self, calls: &mut Calls) {
        self.pass = self.pass.saturating_add(1);
        self.row = again(calls, self.row, self.pass);
    }
}

/// The row of another pass or repetition of what this row is of.
pub(super) fn again(calls: &mut Calls, row: u32, pass: u32) -> u32 {
    let (parent, name, line) =
        calls.get(row).map(|call| (call.parent, call.name.clone(), call.line)).unwrap_or_default();
    calls.push(parent, name, line, pass)
}

/// What is called, as programs write it: `o<pocket>`, `O100`. The end of a long name is left out.
pub(super) fn name(letter: char, name: &str) -> Arc<str> {
    let whole = format!("{letter}{}", shown(name));
    match whole.char_indices().map(|(at, _)| at).find(|&at| at >= CALL_NAME_BYTES_MAX) {
        Some(end) => format!("{}...", &whole[..end]).into(),
        None => whole.into(),
    }
}
