//! What the controller reports of its receive buffer, compared with what was sent.
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
//! The second needs a controller that reports the size of its buffer and reads line by line
//! out of it, as grbl and grblHAL do; FluidNC reads ahead and reports no size. And it needs
//! requests and reports in step: each report is taken for the answer to the oldest request
//! that has none. Where a request was lost that is one too old, which proves less and
//! nothing wrong; where reports come unasked, there is soon one more of them than
//! requests. They come into step when nothing has been under way for a few requests, on a
//! line on which a report comes long before the next request.

use super::LinkFault;
use crate::report::{ControllerState, StatusReport};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// One byte of a ring stays free, and one driver counts the request itself.
const SPARE_BYTES: usize = 1;
/// Reports in a row that must disagree with the count.
const DISAGREEING_REPORTS: u32 = 3;
/// Reports that are not compared with a request, after one that nobody asked for.
const UNASKED_REPORTS: u32 = 10;
/// Requests without a report that are remembered.
const REQUESTS_MAX: usize = 4;
/// Consecutive idle status requests after which no older one can be outstanding.
const QUIET_REQUESTS: u32 = 3;

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
    /// The size that `[OPT:]` reports, bytes.
    #[serde(rename = "told")]
    reported: Option<u16>,
    /// Free bytes while nothing was under way, as two reports in a row agreed.
    free_at_rest: Option<u16>,
    /// The same of one report.
    free_seen: Option<u16>,
    /// Of every request without a report, the oldest first: bytes that were sent before it
    /// and are not answered yet.
    requests: VecDeque<usize>,
    /// Whether each report answers the oldest of them, or one before it.
    is_in_step: bool,
    has_sent_since_request: bool,
    quiet_requests: u32,
    overfilled: u32,
    underfilled: u32,
    /// Reports to come that are not compared with a request.
    distrusted: u32,
}

impl Buffer {
    /// The controller starts over; its buffer is as large as it was, and nobody knows which
    /// requests it will answer.
    pub(super) fn restart(&mut self) {
        let Self { reported, free_at_rest, .. } = *self;
        *self = Self { reported, free_at_rest, ..Self::default() };
    }

    pub(super) fn set_size(&mut self, bytes: Option<u16>) {
        *self = Self { reported: bytes, ..Self::default() };
    }

    /// The most that was ever free, where reports agree on it.
    pub(super) fn free_at_rest(&self) -> Option<u16> {
        self.free_at_rest
    }

    /// Whether the controller has reported a size: only then is a lost answer looked for.
    pub(super) fn has_size(&self) -> bool {
        self.reported.is_some()
    }

    /// A request goes out after so many unanswered bytes, and before so many. `is_alone`
    /// when the report to the last one has come, and so soon that it can be no other.
    pub(super) fn on_request(&mut self, sent_before: usize, sent_after: usize, is_alone: bool) {
        let is_quiet = sent_before + sent_after == 0 && !self.has_sent_since_request && is_alone;
        self.quiet_requests = if is_quiet { self.quiet_requests.saturating_add(1) } else { 0 };
        if self.quiet_requests >= QUIET_REQUESTS {
            self.requests.clear();
            self.is_in_step = true;
        }
        if self.requests.len() >= REQUESTS_MAX {
            self.requests.clear();
            self.is_in_step = false;
        }
        self.requests.push_back(sent_before);
        self.has_sent_since_request = sent_after > 0;
    }

    pub(super) fn on_line_sent(&mut self) {
        self.has_sent_since_request = true;
    }

    /// Lines are answered in the order in which they were sent.
    pub(super) fn on_answer(&mut self, bytes: usize) {
        for sent_before in &mut self.requests {
            *sent_before = sent_before.saturating_sub(bytes);
        }
    }

    /// Compares; `size` is what is believed of the buffer, bytes.
    pub(super) fn on_status(
        &mut self,
        status: &StatusReport,
        counted: Counted,
        size: u16,
    ) -> Option<LinkFault> {
        let request = self.requests.pop_front();
        self.distrusted = match request {
            Some(_) => self.distrusted.saturating_sub(1),
            None => UNASKED_REPORTS,
        };
        let (_, free) = status.free?;
        // All answers came before it: there was nothing left to hold.
        let is_at_rest = counted.bytes == 0 && status.state == ControllerState::Idle;
        if is_at_rest && self.free_seen.replace(free) == Some(free) {
            self.free_at_rest = self.free_at_rest.max(Some(free));
        }
        let held = usize::from(self.free_at_rest.unwrap_or(size).saturating_sub(free));
        self.is_overfilled(held, counted.bytes)
            .then_some(LinkFault::Overfilled { held, sent: counted.bytes })
            .or_else(|| self.underfilled(status, held, counted, request?))
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
        sent_before: usize,
    ) -> Option<LinkFault> {
        let is_comparable = self.reported.is_some()
            && self.free_at_rest.is_some()
            && self.distrusted == 0
            && self.is_in_step
            // While a tool is changed grblHAL puts its buffer aside.
            && status.state == ControllerState::Run;
        if !is_comparable {
            return None;
        }
        let sent = sent_before.saturating_sub(counted.oldest_bytes);
        self.underfilled = if held + SPARE_BYTES < sent { self.underfilled + 1 } else { 0 };
        (self.underfilled >= DISAGREEING_REPORTS).then_some(LinkFault::Underfilled { held, sent })
    }
}
