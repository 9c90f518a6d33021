//! A serial line: bytes take time, and the device may live faster than real time.
//!
//! There are two clocks. The caller's is wall time; the device's runs `time_factor` times faster.
//! A byte takes ten bit times in each direction, of wall time unless bytes are scaled, too.
//! Results depend on when bytes were handed over, not on how often the line is polled.

use std::collections::VecDeque;
use std::time::Duration;

use crate::receive::TRANSMIT_BUFFER_BYTES;

/// Something at the far end of a line: bytes and time in, bytes and time out.
pub trait Device {
    /// Receives bytes that arrived at `now`.
    fn receive(&mut self, now: Duration, bytes: &[u8]);
    /// Advances the device to `now`.
    fn advance(&mut self, now: Duration);
    /// Appends the bytes to be sent; not called while the line still has bytes to send.
    fn transmit(&mut self, to: &mut Vec<u8>);
    /// When to call [`Device::advance`] next, not before `now`; `None`: when bytes arrive.
    fn next_event(&self, now: Duration) -> Option<Duration>;
    /// Returns what happened to the line itself after the last transmitted byte.
    fn take_line_events(&mut self) -> LineEvents {
        LineEvents::default()
    }
}

/// What can happen to a line. Times are the device's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LineEvents {
    /// Bytes to the device arrive this much later.
    pub incoming_stall: Duration,
    /// Bytes that the device sends from now on arrive this much later.
    pub outgoing_stall: Duration,
    /// Bytes in transit in either direction are lost.
    pub is_cut: bool,
}

impl Device for crate::Controller {
    fn receive(&mut self, now: Duration, bytes: &[u8]) {
        Self::receive(self, now, bytes);
    }

    fn advance(&mut self, now: Duration) {
        Self::advance(self, now);
    }

    fn transmit(&mut self, to: &mut Vec<u8>) {
        Self::transmit(self, to);
    }

    fn next_event(&self, now: Duration) -> Option<Duration> {
        Self::next_event(self, now)
    }
}

/// The rates of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineTiming {
    /// Bits per second, ten to a byte; `None`: bytes take no time.
    pub baud: Option<u32>,
    /// Seconds of the device's clock in one second of wall time; positive and finite.
    pub time_factor: f64,
    /// Are bytes sped up by the same factor?
    pub scales_bytes: bool,
}

impl Default for LineTiming {
    /// 115 200 Bd in real time.
    fn default() -> Self {
        Self { baud: Some(115_200), time_factor: 1.0, scales_bytes: false }
    }
}

/// A device at the end of a line.
#[derive(Debug)]
pub struct PacedLine<D> {
    device: D,
    time_factor: f64,
    byte_time: Duration,
    /// Bytes in transit, with the time of their arrival.
    incoming: VecDeque<(Duration, u8)>,
    outgoing: VecDeque<(Duration, u8)>,
    incoming_busy_until: Duration,
    outgoing_busy_until: Duration,
    now: Duration,
}

impl<D: Device> PacedLine<D> {
    /// Connects a device to a line. A time factor that is not a positive number counts as 1.
    pub fn new(device: D, timing: LineTiming) -> Self {
        let is_usable = timing.time_factor.is_finite() && timing.time_factor > 0.0;
        let time_factor = if is_usable { timing.time_factor } else { 1.0 };
        let byte_scale = if timing.scales_bytes { time_factor } else { 1.0 };
        let byte_time = timing.baud.map_or(Duration::ZERO, |baud| {
            Duration::from_secs_f64(10.0 / f64::from(baud.max(1)) / byte_scale)
        });
        Self {
            device,
            time_factor,
            byte_time,
            incoming: VecDeque::new(),
            outgoing: VecDeque::new(),
            incoming_busy_until: Duration::ZERO,
            outgoing_busy_until: Duration::ZERO,
            now: Duration::ZERO,
        }
    }

    /// The device at the far end.
    pub fn device(&self) -> &D {
        &self.device
    }

    /// The device at the far end, to change it; call [`Self::advance`] first.
    pub fn device_mut(&mut self) -> &mut D {
        &mut self.device
    }

    /// The device's time at a wall time.
    pub fn device_time(&self, now: Duration) -> Duration {
        now.mul_f64(self.time_factor)
    }

    /// Bytes in transit to the device; callers should limit them.
    pub fn backlog(&self) -> usize {
        self.incoming.len()
    }

    /// Sends bytes to the device; they arrive one after the other.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        for &byte in bytes {
            self.incoming_busy_until = self.incoming_busy_until.max(now) + self.byte_time;
            self.incoming.push_back((self.incoming_busy_until, byte));
        }
        self.advance(now);
    }

    /// Advances the line and the device to `now`.
    pub fn advance(&mut self, now: Duration) {
        let mut bytes = Vec::new();
        loop {
            let arrival = self.incoming.front().map(|(at, _)| *at).filter(|at| *at <= now);
            let event = self.device_event().filter(|at| *at <= now && *at > self.now);
            let Some(at) = arrival.into_iter().chain(event).min() else { break };
            let at = at.max(self.now);
            let device_now = self.device_time(at);
            match self.incoming.front() {
                Some(&(due, byte)) if due <= at => {
                    self.incoming.pop_front();
                    self.device.receive(device_now, &[byte]);
                }
                // A little past the event, so that rounding cannot leave it undone.
                _ => self.device.advance(device_now + Duration::from_nanos(1)),
            }
            self.collect(at, &mut bytes);
        }
        self.device.advance(self.device_time(now));
        self.collect(now, &mut bytes);
    }

    fn collect(&mut self, at: Duration, bytes: &mut Vec<u8>) {
        self.now = self.now.max(at);
        self.apply_line_events(at);
        if self.has_room_at().is_some_and(|room| room > at) {
            return;
        }
        loop {
            bytes.clear();
            self.device.transmit(bytes);
            for &byte in bytes.iter() {
                self.outgoing_busy_until = self.outgoing_busy_until.max(at) + self.byte_time;
                self.outgoing.push_back((self.outgoing_busy_until, byte));
            }
            // Bytes after a stall are handed over only when it ends.
            if !self.apply_line_events(at) {
                break;
            }
        }
    }

    /// Applies what happened to the line; returns whether the line from the device has stalled.
    fn apply_line_events(&mut self, at: Duration) -> bool {
        let events = self.device.take_line_events();
        if events.is_cut {
            self.incoming.clear();
            self.outgoing.clear();
            self.incoming_busy_until = at;
            self.outgoing_busy_until = at;
        }
        let incoming = events.incoming_stall.div_f64(self.time_factor);
        if !incoming.is_zero() {
            self.incoming.iter_mut().for_each(|(due, _)| *due = (*due).max(at) + incoming);
            self.incoming_busy_until = self.incoming_busy_until.max(at) + incoming;
        }
        let outgoing = events.outgoing_stall.div_f64(self.time_factor);
        self.outgoing_busy_until = match outgoing.is_zero() {
            true => self.outgoing_busy_until,
            false => self.outgoing_busy_until.max(at) + outgoing,
        };
        !outgoing.is_zero()
    }

    /// Appends the bytes that have arrived from the device by `now`.
    pub fn transmit(&mut self, now: Duration, to: &mut Vec<u8>) {
        while let Some(&(at, byte)) = self.outgoing.front() {
            if at > now {
                break;
            }
            self.outgoing.pop_front();
            to.push(byte);
        }
    }

    /// When the transmit buffer will have room; `None`: it has room now.
    fn has_room_at(&self) -> Option<Duration> {
        let excess = self.outgoing.len().checked_sub(TRANSMIT_BUFFER_BYTES)?;
        self.outgoing.get(excess).map(|(at, _)| *at)
    }

    /// The device's next event in wall time, not before its answers have room.
    fn device_event(&self) -> Option<Duration> {
        let event = self.device.next_event(self.device_time(self.now))?;
        let event = event.div_f64(self.time_factor) + Duration::from_nanos(1);
        Some(event.max(self.has_room_at().unwrap_or_default()))
    }

    /// When to call [`Self::advance`] and [`Self::transmit`] next; `None`: when there are bytes.
    ///
    /// One wake-up for each line or real-time byte is enough, not one for each byte.
    pub fn next_event(&self) -> Option<Duration> {
        let acts = |byte: u8| !matches!(byte, b' '..=b'~') || matches!(byte, b'!' | b'?' | b'~');
        let incoming = whole(&self.incoming, acts);
        let outgoing = whole(&self.outgoing, |byte| byte == b'\n');
        incoming.into_iter().chain(outgoing).chain(self.device_event()).min()
    }
}

/// When the first byte of interest has arrived, or else the last of all.
fn whole(
    queue: &VecDeque<(Duration, u8)>,
    is_of_interest: impl Fn(u8) -> bool,
) -> Option<Duration> {
    queue.iter().find(|(_, byte)| is_of_interest(*byte)).or(queue.back()).map(|(at, _)| *at)
}
