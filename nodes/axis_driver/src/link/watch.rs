//! How well it is noticed that a line or an answer was lost or came twice.

use cnc_msgs::machine::LinkWatch;

/// What the watch rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Means {
    /// A check goes among the lines from time to time.
    pub(super) has_checks: bool,
    /// Reports say how full the receive buffer is, and what they say can be compared.
    pub(super) has_buffer: bool,
}

/// What these are good for.
pub(super) const fn watch(means: Means) -> LinkWatch {
    match (means.has_checks, means.has_buffer) {
        (true, true) => LinkWatch::LinesAndBuffer,
        (true, false) => LinkWatch::Lines,
        (false, true) => LinkWatch::Buffer,
        (false, false) => LinkWatch::Standstill,
    }
}
