//! What the serial interrupt does with received bytes.
//!
//! Knows the receive buffer and the real-time bytes that never enter it. `line` collects lines.

use std::collections::VecDeque;

/// Bytes that the transmit buffer holds; the firmware waits when it is full.
pub const TRANSMIT_BUFFER_BYTES: usize = 104;

/// A command that is a single byte and takes effect at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Realtime {
    /// 0x18.
    SoftReset,
    /// `?`.
    StatusReport,
    /// `~`.
    CycleStart,
    /// `!`.
    FeedHold,
    /// 0x84.
    SafetyDoor,
    /// 0x85.
    JogCancel,
    /// 0x90 to 0x9D: a change of an override.
    Override(OverrideChange),
    /// 0x9E.
    SpindleStop,
    /// 0xA0.
    FloodToggle,
    /// 0xA1.
    MistToggle,
    /// grblHAL's 0x19: stop, drop everything queued, keep the position.
    Stop,
    /// grblHAL's 0x83.
    ParserReport,
    /// grblHAL's 0x87.
    FullReport,
    /// grblHAL's 0x88: toggles whether M1 stops.
    OptionalStopToggle,
    /// grblHAL's 0x8C.
    AutoReportToggle,
    /// FluidNC's 0x87 to 0x8A.
    Macro(u8),
    /// Any other byte from 0x80 on: removed, without effect.
    Unknown,
}

/// One step of an override, in percent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OverrideChange {
    /// Feed back to 100.
    FeedReset,
    /// Feed by this many percent.
    FeedBy(i16),
    /// Rapids to 100, 50 or 25.
    Rapid(u8),
    /// Spindle back to 100.
    SpindleReset,
    /// Spindle by this many percent.
    SpindleBy(i16),
}

/// Returns the real-time meaning of a byte in all families; `None`: the byte belongs to a line.
pub(crate) fn realtime(byte: u8) -> Option<Realtime> {
    use OverrideChange::{FeedBy, FeedReset, Rapid, SpindleBy, SpindleReset};
    Some(match byte {
        0x18 => Realtime::SoftReset,
        b'?' => Realtime::StatusReport,
        b'~' => Realtime::CycleStart,
        b'!' => Realtime::FeedHold,
        0x84 => Realtime::SafetyDoor,
        0x85 => Realtime::JogCancel,
        0x90 => Realtime::Override(FeedReset),
        0x91 => Realtime::Override(FeedBy(10)),
        0x92 => Realtime::Override(FeedBy(-10)),
        0x93 => Realtime::Override(FeedBy(1)),
        0x94 => Realtime::Override(FeedBy(-1)),
        0x95 => Realtime::Override(Rapid(100)),
        0x96 => Realtime::Override(Rapid(50)),
        0x97 => Realtime::Override(Rapid(25)),
        0x99 => Realtime::Override(SpindleReset),
        0x9A => Realtime::Override(SpindleBy(10)),
        0x9B => Realtime::Override(SpindleBy(-10)),
        0x9C => Realtime::Override(SpindleBy(1)),
        0x9D => Realtime::Override(SpindleBy(-1)),
        0x9E => Realtime::SpindleStop,
        0xA0 => Realtime::FloodToggle,
        0xA1 => Realtime::MistToggle,
        0x80..=0xFF => Realtime::Unknown,
        _ => return None,
    })
}

/// The receive buffer.
#[derive(Debug, Clone)]
pub(crate) struct ReceiveBuffer {
    capacity: usize,
    bytes: VecDeque<u8>,
    /// Bytes lost to a full buffer since power-up.
    pub(crate) overrun_bytes: u64,
    /// The largest number of bytes it ever held.
    pub(crate) bytes_max: usize,
}

impl ReceiveBuffer {
    pub(crate) fn new(capacity: usize) -> Self {
        Self { capacity, bytes: VecDeque::new(), overrun_bytes: 0, bytes_max: 0 }
    }

    pub(crate) fn push(&mut self, byte: u8) {
        if self.bytes.len() < self.capacity {
            self.bytes.push_back(byte);
            self.bytes_max = self.bytes_max.max(self.bytes.len());
        } else {
            self.overrun_bytes += 1;
        }
    }

    pub(crate) fn pop(&mut self) -> Option<u8> {
        self.bytes.pop_front()
    }

    pub(crate) fn free(&self) -> usize {
        self.capacity - self.bytes.len()
    }

    pub(crate) fn capacity(&self) -> usize {
        self.capacity
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_buffer_drops_bytes_silently() {
        let mut buffer = ReceiveBuffer::new(128);
        (0..200).for_each(|byte| buffer.push(byte));
        assert_eq!((buffer.free(), buffer.overrun_bytes), (0, 72));
        assert_eq!(buffer.pop(), Some(0));
    }
}
