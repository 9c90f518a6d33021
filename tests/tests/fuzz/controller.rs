//! A controller as small as it can be and still honest, and the wires to it.
//!
//! It reads its receive buffer byte by byte, one line at a time, answers in order, and
//! loses what does not fit. It knows nothing of G-code: a line is done when the planner
//! has room for it.

use crate::mutate::Random;
use std::collections::VecDeque;
use std::time::Duration;

const PLANNER_BLOCKS: usize = 15;
const BANNER: &[u8] = b"\r\nGrbl 1.1h ['$' for help]\r\n";

/// What this one is like.
#[derive(Debug, Clone)]
pub(crate) struct Traits {
    /// Bytes that the receive buffer holds.
    pub(crate) size: usize,
    /// What `[OPT:]` reports of it.
    pub(crate) reported_size: Option<u16>,
    /// Whether reports have the free buffer space.
    pub(crate) reports_free: bool,
    /// How long a block takes.
    pub(crate) block: Duration,
    /// It looks at its buffer this often.
    pub(crate) turn: Duration,
    /// It reports unasked, this often.
    pub(crate) reports_every: Option<Duration>,
    /// Every so-manieth line is refused.
    pub(crate) refuses: usize,
}

/// What it is doing with the line that it has read.
#[derive(Debug)]
struct Work {
    line: Vec<u8>,
    /// The planner is empty and the machine waits: a dwell, a spindle.
    waits_until: Option<Duration>,
}

#[derive(Debug)]
pub(crate) struct Controller {
    traits: Traits,
    buffer: VecDeque<u8>,
    line: Vec<u8>,
    work: Option<Work>,
    planned: usize,
    block_done_at: Duration,
    next_turn: Duration,
    next_report: Duration,
    wants_report: bool,
    is_held: bool,
    /// Accepts only a reset.
    is_deaf: bool,
    is_dead: bool,
    pub(crate) has_lost_bytes: bool,
    /// Every line that was answered, and how.
    pub(crate) done: Vec<(Vec<u8>, Option<u16>)>,
    out: Vec<u8>,
}

impl Controller {
    pub(crate) fn new(traits: Traits) -> Self {
        Self {
            traits,
            buffer: VecDeque::new(),
            line: Vec::new(),
            work: None,
            planned: 0,
            block_done_at: Duration::ZERO,
            next_turn: Duration::ZERO,
            next_report: Duration::ZERO,
            wants_report: false,
            is_held: false,
            is_deaf: false,
            is_dead: false,
            has_lost_bytes: false,
            done: Vec::new(),
            out: BANNER.to_vec(),
        }
    }

    pub(crate) fn take_output(&mut self) -> Vec<u8> {
        let out = std::mem::take(&mut self.out);
        if self.is_dead { Vec::new() } else { out }
    }

    pub(crate) fn is_quiet(&self) -> bool {
        self.is_dead || (self.buffer.is_empty() && self.work.is_none() && self.planned == 0)
    }

    pub(crate) fn die(&mut self) {
        self.is_dead = true;
    }

    pub(crate) fn raise_alarm(&mut self) {
        self.out.extend_from_slice(b"ALARM:1\r\n[MSG:Reset to continue]\r\n");
        self.is_deaf = true;
        self.planned = 0;
    }

    /// By a byte, or because the supply failed.
    pub(crate) fn restart(&mut self) {
        if self.planned > 0 && !self.is_held {
            self.out.extend_from_slice(b"ALARM:3\r\n");
            if self.work.is_some() {
                // It slips through.
                self.out.extend_from_slice(b"ok\r\n");
            }
        }
        self.buffer.clear();
        self.line.clear();
        (self.work, self.planned) = (None, 0);
        (self.is_held, self.is_deaf, self.wants_report) = (false, false, false);
        self.out.extend_from_slice(BANNER);
    }

    pub(crate) fn receive(&mut self, byte: u8) {
        match byte {
            0x18 => self.restart(),
            _ if self.is_deaf => {}
            b'?' => self.wants_report = true,
            b'!' => self.is_held = true,
            b'~' => self.is_held = false,
            0x80.. => {}
            _ if self.buffer.len() >= self.traits.size => self.has_lost_bytes = true,
            _ => self.buffer.push_back(byte),
        }
    }

    pub(crate) fn run(&mut self, now: Duration) {
        if self.planned > 0 && !self.is_held && now >= self.block_done_at {
            self.planned -= 1;
            self.block_done_at = now + self.traits.block;
        }
        if now < self.next_turn || self.is_deaf {
            return;
        }
        self.next_turn = now + self.traits.turn;
        if self.traits.reports_every.is_some_and(|_| now >= self.next_report) {
            self.next_report = now + self.traits.reports_every.unwrap_or_default();
            self.report();
        }
        // Somewhere between two lines, as the main loop comes by.
        if std::mem::take(&mut self.wants_report) {
            self.report();
        }
        while self.step(now) {}
    }

    /// Reads a byte, or continues a line; false when there is nothing to do now.
    fn step(&mut self, now: Duration) -> bool {
        let Some(work) = &mut self.work else {
            let Some(byte) = self.buffer.pop_front() else { return false };
            if matches!(byte, b'\n' | b'\r') {
                let line = std::mem::take(&mut self.line);
                self.work = Some(Work { line, waits_until: None });
            } else {
                self.line.push(byte);
            }
            return true;
        };
        if work.line.starts_with(b"G4") || work.line.starts_with(b"M3") {
            if self.planned > 0 || self.is_held {
                return false;
            }
            let until = *work.waits_until.get_or_insert(now + WAIT);
            if now < until {
                return false;
            }
        } else if self.planned >= PLANNER_BLOCKS {
            return false;
        } else if !work.line.is_empty() {
            if self.planned == 0 {
                self.block_done_at = now + self.traits.block;
            }
            self.planned += 1;
        }
        let line = self.work.take().map(|work| work.line).unwrap_or_default();
        let is_refused = (self.done.len() + 1).is_multiple_of(self.traits.refuses);
        let error = is_refused.then(|| 20 + (self.done.len() % 17) as u16);
        match error {
            Some(code) => self.out.extend_from_slice(format!("error:{code}\r\n").as_bytes()),
            None => self.out.extend_from_slice(b"ok\r\n"),
        }
        self.done.push((line, error));
        true
    }

    fn report(&mut self) {
        let state = match (self.is_held, self.planned) {
            (true, _) => "Hold:0",
            (false, 0) => "Idle",
            (false, _) => "Run",
        };
        let mut text = format!("<{state}|MPos:0.000,0.000,0.000");
        if self.traits.reports_free {
            let blocks = PLANNER_BLOCKS - self.planned;
            text += &format!("|Bf:{blocks},{}", self.traits.size - self.buffer.len());
        }
        self.out.extend_from_slice(format!("{text}|FS:0,0>\r\n").as_bytes());
    }
}

/// How long a dwell or a spindle takes here.
pub(crate) const WAIT: Duration = Duration::from_millis(900);

/// One direction of the line: bytes stay in order and take their time.
#[derive(Debug)]
pub(crate) struct Wire {
    bytes: VecDeque<(Duration, u8)>,
    byte: Duration,
    latency: Duration,
    free_at: Duration,
}

impl Wire {
    pub(crate) fn new(baud: u32, latency: Duration) -> Self {
        let byte = Duration::from_secs(10) / baud;
        Self { bytes: VecDeque::new(), byte, latency, free_at: Duration::ZERO }
    }

    pub(crate) fn push(&mut self, now: Duration, bytes: &[u8]) {
        for &byte in bytes {
            self.free_at = self.free_at.max(now) + self.byte;
            self.bytes.push_back((self.free_at + self.latency, byte));
        }
    }

    pub(crate) fn take(&mut self, now: Duration) -> Vec<u8> {
        let arrived = self.bytes.iter().take_while(|(at, _)| *at <= now).count();
        self.bytes.drain(..arrived).map(|(_, byte)| byte).collect()
    }

    /// Whether anything except a status request is in transit.
    pub(crate) fn carries_lines(&self) -> bool {
        self.bytes.iter().any(|(_, byte)| *byte != b'?')
    }
}

impl Traits {
    pub(crate) fn random(random: &mut Random) -> Self {
        let ms = Duration::from_millis;
        let size = *random.of(&[80, 127, 128, 254, 1023]);
        // grbl reports its capacity, grblHAL one more, FluidNC nothing.
        let reported_size = match random.below(3) {
            0 if size >= 127 => None,
            1 => Some(size as u16 + 1),
            _ => Some(size as u16),
        };
        Self {
            size,
            reported_size,
            reports_free: random.once_in(2),
            block: ms(*random.of(&[0, 1, 5, 20, 60])),
            turn: ms(*random.of(&[0, 0, 1, 7, 20])),
            reports_every: random.once_in(6).then(|| ms(*random.of(&[50, 200, 333]))),
            refuses: if random.once_in(3) { 2 + random.below(20) } else { usize::MAX },
        }
    }
}
