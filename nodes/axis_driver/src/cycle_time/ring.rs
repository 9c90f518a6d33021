//! The planner ring: junction speeds, look-ahead to a stop at its end, and the time of each block.
//!
//! Source: `planner.c` of grbl 1.1h and of grblHAL, whose acceleration follows from the jerk where
//! it is built with it.

use crate::machine_limits::{Direction, MachineLimits};
use crate::vectors::{dot, minus, norm, unit};
use std::collections::VecDeque;

/// Cosines nearer to 1 or -1 than this are straight on or straight back.
const STRAIGHT: f64 = 1e-6;
/// No block is slower than this, mm/min.
const FEED_MIN_MM_PER_MIN: f64 = 1.0;

/// Feed and rapid override, in parts of 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speeds {
    pub feed: f64,
    pub rapid: f64,
}

impl Default for Speeds {
    fn default() -> Self {
        Self { feed: 1.0, rapid: 1.0 }
    }
}

/// A place in a path: an element, and the event of a line that turns A to W alone before it; `usize::MAX`
/// is the element itself.
pub(super) type Place = (usize, usize);

/// A straight block, s and mm; degrees count like mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    unit: Direction,
    length: f64,
    acceleration: f64,
    /// What the axes can do along it.
    rate: f64,
    /// `None`: rapid.
    feed: Option<f64>,
    place: Place,
    /// Before it starts.
    pause_s: f64,
    junction: f64,
    entry: f64,
}

impl Block {
    /// `None`: it has no length.
    pub(super) fn new(
        limits: &MachineLimits,
        way: Direction,
        feed_mm_per_min: Option<f64>,
        place: Place,
    ) -> Option<Self> {
        let length = norm(way);
        if length <= 0.0 {
            return None;
        }
        let unit = unit(way);
        let rate = limits.rate_along(unit) / 60.0;
        let feed = feed_mm_per_min.map(|feed| feed / 60.0);
        let most = limits.acceleration_along(unit);
        let acceleration = match limits.jerk_along(unit) {
            Some(jerk) => with_jerk(most, jerk, feed.unwrap_or(rate)),
            None => most,
        };
        let (pause_s, junction, entry) = (0.0, 0.0, 0.0);
        Some(Self { unit, length, acceleration, rate, feed, place, pause_s, junction, entry })
    }

    fn nominal(&self, speeds: Speeds) -> f64 {
        let wanted = match self.feed {
            None => self.rate * speeds.rapid,
            Some(feed) => (feed * speeds.feed).min(self.rate),
        };
        wanted.max(FEED_MIN_MM_PER_MIN / 60.0)
    }

    /// The time from one speed to another with this cruising speed.
    fn seconds(&self, entry: f64, nominal: f64, exit: f64) -> f64 {
        let (a, length) = (self.acceleration, self.length);
        let peak = (a * length + (entry * entry + exit * exit) / 2.0).sqrt();
        if peak <= nominal {
            return ((peak - entry) + (peak - exit)).max(0.0) / a;
        }
        let ramps = (2.0 * nominal * nominal - entry * entry - exit * exit) / (2.0 * a);
        ((nominal - entry).abs() + (nominal - exit).abs()) / a + (length - ramps).max(0.0) / nominal
    }
}

/// What grblHAL plans with instead of the acceleration: the mean of a ramp with this jerk.
fn with_jerk(most: f64, jerk: f64, rate: f64) -> f64 {
    let to_most = most / jerk;
    let after = 0.5 * jerk * to_most * to_most;
    let half = 0.5 * rate;
    match half > after {
        true => rate / (2.0 * (to_most + (half - after) / most)),
        false => rate / (2.0 * (rate / jerk).sqrt()),
    }
}

/// The ring.
#[derive(Debug, Clone)]
pub(super) struct Ring {
    blocks_max: usize,
    queue: VecDeque<Block>,
    /// Of the front block when it starts.
    speed: f64,
    speeds: Speeds,
}

impl Ring {
    pub(super) fn new(blocks_max: usize) -> Self {
        let queue = VecDeque::with_capacity(blocks_max);
        Self { blocks_max, queue, speed: 0.0, speeds: Speeds::default() }
    }

    pub(super) fn is_full(&self) -> bool {
        self.queue.len() >= self.blocks_max
    }

    pub(super) fn front_place(&self) -> Option<Place> {
        self.queue.front().map(|block| block.place)
    }

    pub(super) fn set_speeds(&mut self, speeds: Speeds) {
        if speeds == self.speeds {
            return;
        }
        self.speeds = speeds;
        for index in 0..self.queue.len() {
            self.queue[index].entry = 0.0;
        }
        for last in 1..=self.queue.len() {
            self.plan_back(last);
        }
    }

    /// Appends a block. With a pause it starts from rest.
    pub(super) fn push(&mut self, limits: &MachineLimits, block: Block, pause_s: Option<f64>) {
        let mut block = block;
        block.pause_s = pause_s.unwrap_or(0.0);
        block.junction = match self.queue.back() {
            Some(before) if pause_s.is_none() => junction(before.unit, block.unit, limits),
            _ => 0.0,
        };
        self.queue.push_back(block);
        self.plan_back(self.queue.len());
    }

    /// Raises the entry speeds of these first blocks, from the last one, which ends at rest,
    /// backwards until one does not change: those before it cannot either.
    fn plan_back(&mut self, count: usize) {
        let mut exit = 0.0;
        for index in (1..count).rev() {
            let before = self.queue[index - 1].nominal(self.speeds);
            let block = &self.queue[index];
            let most = block.junction.min(before).min(block.nominal(self.speeds));
            let entry = most.min(reach(exit, block));
            if index + 1 < count && entry <= block.entry {
                break;
            }
            self.queue[index].entry = entry;
            exit = entry;
        }
    }

    /// Does the front block; its seconds.
    pub(super) fn pop(&mut self) -> f64 {
        let Some(block) = self.queue.pop_front() else { return 0.0 };
        let next = self.queue.front().map_or(0.0, |next| next.entry);
        let exit = next.min(reach(self.speed, &block));
        let nominal = block.nominal(self.speeds);
        let seconds = block.pause_s + block.seconds(self.speed, nominal, exit);
        self.speed = exit;
        seconds
    }
}

/// The speed at one end of a block from which the other is reached.
fn reach(speed: f64, block: &Block) -> f64 {
    (speed * speed + 2.0 * block.acceleration * block.length).sqrt()
}

/// The speed at which a corner is taken.
fn junction(before: Direction, after: Direction, limits: &MachineLimits) -> f64 {
    let cosine = dot(before, after);
    if cosine > 1.0 - STRAIGHT {
        return f64::INFINITY;
    }
    if cosine < STRAIGHT - 1.0 {
        return 0.0;
    }
    let acceleration = limits.acceleration_along(unit(minus(after, before)));
    let sine_half = ((1.0 + cosine) / 2.0).sqrt();
    (acceleration * limits.junction_deviation_mm * sine_half / (1.0 - sine_half)).sqrt()
}
