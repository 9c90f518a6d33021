//! What a serial line is like, and how often a controller is asked over it.

use std::time::Duration;

/// A long status report.
const REPORT_BYTES_MAX: u64 = 100;
/// What a controller and the systems between take for one, ms.
const REPORT_LATENCY_MS: u64 = 40;
/// A start, eight data and a stop bit.
pub(super) const BITS_PER_BYTE: u64 = 10;
/// Reports take this part of what the line carries, one in so many bytes; more where the line is so
/// slow that they would come less often than at rest.
const REPORT_SHARE: u64 = 10;
/// The same where they are compared with the path; they are asked for so often only while the line
/// has little else to carry.
const WATCHED_REPORT_SHARE: u64 = 5;
/// And while it carries many answers, which a report delays.
const CROWDED_REPORT_SHARE: u64 = 20;

/// What the line is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkConfig {
    /// Bits per second.
    pub baud: u32,
    /// What is queued before a real-time byte takes at most this long on the wire, ms.
    pub hold_latency_ms_max: u32,
    /// The size of the receive buffer where the controller does not report it, bytes; where
    /// it does, the smaller of the two holds.
    pub receive_buffer_bytes: Option<u16>,
    /// Time between two status requests, ms.
    pub poll_interval_ms: u32,
    /// The same while lines are under way, ms; 0: the same.
    pub busy_poll_interval_ms: u32,
    /// Time between two checks among the lines of a stream, ms; 0: there are none.
    pub line_check_interval_ms: u32,
    /// Whether every report is compared with the path: what is wrong is seen in the next one.
    pub watches_path: bool,
}

impl LinkConfig {
    /// Time between two status requests while lines are under way: as configured, as the line
    /// carries it, and never longer than at rest.
    pub(super) fn busy_poll_interval(&self) -> Duration {
        let at_rest = u64::from(self.poll_interval_ms);
        let wanted = match self.busy_poll_interval_ms {
            0 => at_rest,
            ms => u64::from(ms),
        };
        let report_ms = REPORT_BYTES_MAX * BITS_PER_BYTE * 1000 / u64::from(self.baud.max(1));
        let share = if self.watches_path { WATCHED_REPORT_SHARE } else { REPORT_SHARE };
        Duration::from_millis(wanted.max(report_ms * share).min(at_rest))
    }

    /// The same while the line has much else to carry: as at rest, or where reports are compared
    /// with the path as often as it carries them.
    pub(super) fn crowded_poll_interval(&self) -> Duration {
        let at_rest = u64::from(self.poll_interval_ms);
        let report_ms = REPORT_BYTES_MAX * BITS_PER_BYTE * 1000 / u64::from(self.baud.max(1));
        let shared = Duration::from_millis((report_ms * CROWDED_REPORT_SHARE).min(at_rest));
        match self.watches_path {
            true => shared.max(self.busy_poll_interval()),
            false => Duration::from_millis(at_rest),
        }
    }

    /// Whether the report to a request comes long before the next request, where nothing
    /// else is under way.
    pub(super) fn is_prompt(&self) -> bool {
        let bits = REPORT_BYTES_MAX * BITS_PER_BYTE;
        let on_the_wire_ms = bits * 1000 / u64::from(self.baud.max(1));
        2 * (on_the_wire_ms + REPORT_LATENCY_MS) <= u64::from(self.poll_interval_ms)
    }
}
