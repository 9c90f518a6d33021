//! What the controller says of its receive buffer, beside what was sent.
//!
//! The line keeps its order both ways, which is all that the comparison needs:
//!
//! - What a report calls held was sent, and was not answered before the report. So it is
//!   never more than what is unanswered when the report comes: more means that an answer
//!   was counted that was none, or came twice.
//! - What was sent before the request for the report had arrived when it was made. Of
//!   that, all is held but what the controller had read, and it reads no further than the
//!   end of the line that it answers next. Less means that an answer was lost, or a line.
//!
//! The second needs a controller that tells the size of its buffer and reads line by line
//! out of it, as grbl and grblHAL do; FluidNC reads ahead and tells no size. And a report
//! that was asked for: with automatic reports nobody knows what had arrived.

use super::LinkFault;
use crate::report::{ControllerState, StatusReport};
use serde::{Deserialize, Serialize};

/// One byte of a ring stays free, and one driver counts the request itself.
const SPARE_BYTES: usize = 1;
/// Reports in a row that must disagree with the count.
const DISAGREEING_REPORTS: u32 = 3;
/// Reports after one that nobody asked for that are not compared with a request.
const UNASKED_REPORTS: u32 = 10;

/// What is unanswered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Counted {
    /// Bytes of all lines, with their ends.
    pub(super) bytes: usize,
    /// Bytes of the oldest.
    pub(super) oldest_bytes: usize,
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct Buffer {
    /// The size that `[OPT:]` told, bytes.
    told: Option<u16>,
    /// Free bytes while nothing was under way, as two reports in a row agreed.
    free_at_rest: Option<u16>,
    /// The same of one report.
    free_seen: Option<u16>,
    /// Bytes that were sent before the last request and are not answered yet.
    before_request: usize,
    has_sent_since_request: bool,
    overfilled: u32,
    underfilled: u32,
    /// Reports to come that are not compared with a request.
    distrusted: u32,
}

impl Buffer {
    /// The controller starts over; what it told of its size holds.
    pub(super) fn restart(&mut self) {
        *self = Self { told: self.told, ..Self::default() };
    }

    pub(super) fn set_told(&mut self, bytes: Option<u16>) {
        *self = Self { told: bytes, ..Self::default() };
    }

    /// The most that was ever free, where reports agree on it.
    pub(super) fn free_at_rest(&self) -> Option<u16> {
        self.free_at_rest
    }

    /// A request goes out behind so many unanswered bytes; `is_repeated` when the last one
    /// was not answered: the report may still be the answer to that.
    pub(super) fn on_request(
        &mut self,
        sent_bytes: usize,
        waiting_bytes: usize,
        is_repeated: bool,
    ) {
        if is_repeated {
            self.has_sent_since_request |= waiting_bytes > 0;
        } else {
            self.before_request = sent_bytes;
            self.has_sent_since_request = waiting_bytes > 0;
        }
    }

    pub(super) fn on_line_sent(&mut self) {
        self.has_sent_since_request = true;
    }

    /// Lines are answered in the order in which they were sent.
    pub(super) fn on_answer(&mut self, bytes: usize) {
        self.before_request = self.before_request.saturating_sub(bytes);
    }

    /// Compares; `size` is what is believed of the buffer, bytes.
    pub(super) fn on_status(
        &mut self,
        status: &StatusReport,
        counted: Counted,
        is_asked: bool,
        size: u16,
    ) -> Option<LinkFault> {
        self.distrusted =
            if is_asked { self.distrusted.saturating_sub(1) } else { UNASKED_REPORTS };
        let (_, free) = status.free?;
        let is_at_rest = is_asked
            && counted.bytes == 0
            && !self.has_sent_since_request
            && status.state == ControllerState::Idle;
        if is_at_rest && self.free_seen.replace(free) == Some(free) {
            self.free_at_rest = self.free_at_rest.max(Some(free));
        }
        let held = usize::from(self.free_at_rest.unwrap_or(size).saturating_sub(free));
        self.is_overfilled(held, counted.bytes)
            .then_some(LinkFault::Overfilled { held, sent: counted.bytes })
            .or_else(|| self.underfilled(status, held, counted))
    }

    fn is_overfilled(&mut self, held: usize, sent: usize) -> bool {
        self.overfilled = if held > sent + SPARE_BYTES { self.overfilled + 1 } else { 0 };
        self.overfilled >= DISAGREEING_REPORTS
    }

    fn underfilled(
        &mut self,
        status: &StatusReport,
        held: usize,
        counted: Counted,
    ) -> Option<LinkFault> {
        let is_comparable = self.told.is_some()
            && self.free_at_rest.is_some()
            && self.distrusted == 0
            // While a tool is changed grblHAL puts its buffer aside.
            && status.state == ControllerState::Run;
        if !is_comparable {
            return None;
        }
        let sent = self.before_request.saturating_sub(counted.oldest_bytes);
        self.underfilled = if held + SPARE_BYTES < sent { self.underfilled + 1 } else { 0 };
        (self.underfilled >= DISAGREEING_REPORTS).then_some(LinkFault::Underfilled { held, sent })
    }
}
