//! The planner queue: junction speeds, look-ahead, and execution in time.
//!
//! Invariants: the planned entry speed of a block never exceeds what the junction, the speeds on
//! both sides and the braking distance to a stop at the end of the queue allow; positions at
//! rest are whole steps.

use std::collections::VecDeque;

use crate::axes::{self, AXES, Axes};
use crate::gcode::single::times;
use crate::motion::junction::junction_speed;
use crate::motion::ramp::{Ramp, braking_ramp, next_ramp};
use crate::settings::Settings;

/// No block is slower than this, mm/min.
const FEED_MIN_MM_PER_MIN: f64 = 1.0;

/// The programmed speed of a move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ProgrammedSpeed {
    Rapid,
    /// G94, mm/min.
    Feed(f64),
    /// G93, moves per minute.
    InverseTime(f64),
}

/// A straight move to be queued.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Move {
    pub(crate) target_in_machine: Axes,
    pub(crate) speed: ProgrammedSpeed,
    pub(crate) line_number: u32,
    /// The feed override does not slow jogs and probing.
    pub(crate) ignores_overrides: bool,
    /// Is this the last move of its line?
    pub(crate) ends_motion: bool,
}

/// The result of queuing a move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pushed {
    /// The move was shorter than a step and was dropped.
    LeftOut,
    Queued {
        /// The previous block had to end at rest only because this one came too late.
        comes_late: bool,
    },
}

/// Feed and rapid override, percent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Overrides {
    pub(crate) feed_percent: u8,
    pub(crate) rapid_percent: u8,
}

impl Default for Overrides {
    fn default() -> Self {
        Self { feed_percent: 100, rapid_percent: 100 }
    }
}

#[derive(Debug, Clone)]
struct Block {
    start_mm: Axes,
    unit: Axes,
    length_mm: f64,
    end_steps: [i64; AXES],
    acceleration: f64,
    /// What the axes can do along this block, mm/s.
    rapid_rate: f64,
    /// `None`: rapid.
    feed_rate: Option<f64>,
    ignores_overrides: bool,
    ends_motion: bool,
    junction_speed: f64,
    entry_speed: f64,
    line_number: u32,
}

impl Block {
    fn nominal(&self, overrides: Overrides) -> f64 {
        let of = |rate: f64, percent: u8| match self.ignores_overrides {
            true => rate,
            false => rate * f64::from(percent) / 100.0,
        };
        let wanted = match self.feed_rate {
            None => of(self.rapid_rate, overrides.rapid_percent),
            Some(rate) => of(rate, overrides.feed_percent).min(self.rapid_rate),
        };
        wanted.max(FEED_MIN_MM_PER_MIN / 60.0)
    }
}

/// What ended a step of [`Planner::advance`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MotionEvent {
    /// The time was used up, or a ramp changed into the next.
    Nothing,
    /// A block is done and left the queue.
    BlockDone { ends_motion: bool },
    /// Braking came to rest.
    Stopped,
    /// The requested distance was reached.
    Tripped,
}

/// The queue and the block in motion.
#[derive(Debug, Clone)]
pub(crate) struct Planner {
    blocks_max: usize,
    queue: VecDeque<Block>,
    /// Speed of the block in motion.
    done_mm: f64,
    speed: f64,
    /// Position at rest when the queue is empty, else the start of the last block.
    rest_steps: [i64; AXES],
    overrides: Overrides,
    /// N of the last executed block that had one, since the queue was cleared.
    last_line_number: u32,
    /// Direction of the last executed block, until another is queued.
    last_unit: Option<Axes>,
}

impl Planner {
    /// An empty queue for this many blocks, at rest.
    pub(crate) fn new(position_steps: [i64; AXES], blocks_max: usize) -> Self {
        Self {
            blocks_max,
            queue: VecDeque::new(),
            done_mm: 0.0,
            speed: 0.0,
            rest_steps: position_steps,
            overrides: Overrides::default(),
            last_line_number: 0,
            last_unit: None,
        }
    }

    pub(crate) fn is_full(&self) -> bool {
        self.queue.len() >= self.blocks_max
    }

    pub(crate) fn len(&self) -> usize {
        self.queue.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.queue.is_empty()
    }

    pub(crate) fn free(&self) -> usize {
        self.blocks_max.saturating_sub(self.queue.len())
    }

    /// Speed along the path, mm/min.
    pub(crate) fn speed_mm_per_min(&self) -> f64 {
        self.speed * 60.0
    }

    /// N of the block in motion, 0 when it has none.
    pub(crate) fn line_number(&self) -> u32 {
        self.queue.front().map_or(0, |block| block.line_number)
    }

    /// N of the block in motion, or of the last one before that had one; 0: none.
    pub(crate) fn last_line_number(&self) -> u32 {
        match self.line_number() {
            0 => self.last_line_number,
            number => number,
        }
    }

    /// The blocks the queue holds.
    pub(crate) fn blocks_max(&self) -> usize {
        self.blocks_max
    }

    /// The rest of the block in motion, mm.
    pub(crate) fn way_to_go(&self) -> Axes {
        self.heading().map_or([0.0; AXES], |(unit, remaining)| axes::scale(unit, remaining))
    }

    /// Machine position now, in steps.
    pub(crate) fn position_steps(&self, settings: &Settings) -> [i64; AXES] {
        match self.queue.front() {
            None => self.rest_steps,
            Some(block) => {
                let at = axes::add(block.start_mm, axes::scale(block.unit, self.done_mm));
                steps_from_mm(at, settings)
            }
        }
    }

    /// Direction of the block in motion, and the distance to its end, mm.
    pub(crate) fn heading(&self) -> Option<(Axes, f64)> {
        self.queue.front().map(|block| (block.unit, block.length_mm - self.done_mm))
    }

    pub(crate) fn overrides(&self) -> Overrides {
        self.overrides
    }

    pub(crate) fn set_overrides(&mut self, overrides: Overrides) {
        self.overrides = overrides;
        self.replan();
    }

    /// Drops everything queued; the axes rest where they are.
    pub(crate) fn clear(&mut self, settings: &Settings) {
        let position = self.position_steps(settings);
        *self = Self { overrides: self.overrides, ..Self::new(position, self.blocks_max) };
    }

    /// Sets the position of the axes; the queue must be empty.
    pub(crate) fn set_position_steps(&mut self, steps: [i64; AXES]) {
        assert!(self.queue.is_empty(), "the position is only set at rest");
        self.rest_steps = steps;
    }

    /// Appends a move; drops one that is shorter than a step.
    pub(crate) fn push(&mut self, motion: &Move, settings: &Settings) -> Pushed {
        let start_steps = self.queue.back().map_or(self.rest_steps, |block| block.end_steps);
        let steps_per_mm = settings.steps_per_mm();
        // In 32 bits, as the firmware rounds to steps.
        let end_steps = std::array::from_fn(|i| {
            times(motion.target_in_machine[i], steps_per_mm[i]).round() as i64
        });
        if start_steps == end_steps {
            return Pushed::LeftOut;
        }
        let start_mm = mm_from_steps(start_steps, settings);
        let travel = axes::subtract(mm_from_steps(end_steps, settings), start_mm);
        let length_mm = axes::length(travel);
        if length_mm <= 0.0 {
            // So many steps per millimetre that a double cannot resolve them.
            return Pushed::LeftOut;
        }
        let unit = axes::scale(travel, 1.0 / length_mm);
        let rates = settings.max_rate_mm_per_min();
        let feed_rate = match motion.speed {
            ProgrammedSpeed::Rapid => None,
            ProgrammedSpeed::Feed(mm_per_min) => Some(mm_per_min / 60.0),
            ProgrammedSpeed::InverseTime(per_min) => Some(per_min * length_mm / 60.0),
        };
        let speed_after = |last: Axes| junction_speed(last, unit, settings);
        let junction_speed = self.queue.back().map_or(0.0, |last| speed_after(last.unit));
        let last_unit = self.last_unit.take().filter(|_| self.queue.is_empty());
        let comes_late = last_unit.is_some_and(|last| speed_after(last) > 0.0);
        self.queue.push_back(Block {
            start_mm,
            unit,
            length_mm,
            end_steps,
            acceleration: axes::limit_along(unit, settings.acceleration_mm_per_s2()),
            rapid_rate: axes::limit_along(unit, rates) / 60.0,
            feed_rate,
            ignores_overrides: motion.ignores_overrides,
            ends_motion: motion.ends_motion,
            junction_speed,
            entry_speed: 0.0,
            line_number: motion.line_number,
        });
        self.replan();
        Pushed::Queued { comes_late }
    }

    /// Finds the entry speeds: backwards what can be braked, forwards what can be reached.
    fn replan(&mut self) {
        let nominal: Vec<f64> = self.queue.iter().map(|b| b.nominal(self.overrides)).collect();
        let reach = |v: f64, a: f64, travel: f64| (v * v + 2.0 * a * travel).sqrt();
        let mut next_entry = 0.0;
        for i in (1..self.queue.len()).rev() {
            let block = &mut self.queue[i];
            let most = block.junction_speed.min(nominal[i - 1]).min(nominal[i]);
            block.entry_speed = most.min(reach(next_entry, block.acceleration, block.length_mm));
            next_entry = block.entry_speed;
        }
        let mut entry = self.speed;
        let mut done = self.done_mm;
        for i in 1..self.queue.len() {
            let before = &self.queue[i - 1];
            let most = reach(entry, before.acceleration, before.length_mm - done);
            let block = &mut self.queue[i];
            block.entry_speed = block.entry_speed.min(most);
            entry = block.entry_speed;
            done = 0.0;
        }
    }

    fn ramp(&self, braking: bool) -> Option<Ramp> {
        let block = self.queue.front()?;
        let remaining = block.length_mm - self.done_mm;
        Some(if braking {
            braking_ramp(remaining, self.speed, block.acceleration)
        } else {
            let exit = self.queue.get(1).map_or(0.0, |next| next.entry_speed);
            let nominal = block.nominal(self.overrides);
            next_ramp(remaining, self.speed, nominal, exit, block.acceleration)
        })
    }

    /// Moves for at most `seconds`, up to the next event; returns the seconds used.
    ///
    /// `trip_mm` is a distance from here within the block in motion at which to stop.
    pub(crate) fn advance(
        &mut self,
        seconds: f64,
        braking: bool,
        trip_mm: Option<f64>,
    ) -> (f64, MotionEvent) {
        let Some(ramp) = self.ramp(braking) else {
            return (seconds, if braking { MotionEvent::Stopped } else { MotionEvent::Nothing });
        };
        if let Some(trip) = trip_mm.filter(|&trip| trip <= ramp.distance_mm) {
            let at = ramp.time_to(self.speed, trip);
            if at <= seconds {
                self.speed = ramp.after(self.speed, at).1;
                self.done_mm += trip;
                return (at, MotionEvent::Tripped);
            }
        }
        if seconds < ramp.duration_s {
            let (distance, speed) = ramp.after(self.speed, seconds);
            self.done_mm += distance.min(ramp.distance_mm);
            self.speed = speed;
            return (seconds, MotionEvent::Nothing);
        }
        self.speed = ramp.end_speed_mm_per_s;
        self.done_mm += ramp.distance_mm;
        if ramp.finishes {
            let block = self.queue.pop_front().expect("a ramp belongs to a block");
            self.done_mm = 0.0;
            self.rest_steps = block.end_steps;
            if block.line_number > 0 {
                self.last_line_number = block.line_number;
            }
            if self.queue.is_empty() {
                self.speed = 0.0;
            }
            self.last_unit = Some(block.unit);
            return (ramp.duration_s, MotionEvent::BlockDone { ends_motion: block.ends_motion });
        }
        let stopped = braking && self.speed <= 0.0;
        if stopped {
            self.replan();
        }
        (ramp.duration_s, if stopped { MotionEvent::Stopped } else { MotionEvent::Nothing })
    }

    /// Returns the seconds until the ramp in motion ends or the trip is reached.
    pub(crate) fn seconds_to_next(&self, braking: bool, trip_mm: Option<f64>) -> Option<f64> {
        let ramp = self.ramp(braking)?;
        Some(match trip_mm.filter(|&trip| trip <= ramp.distance_mm) {
            Some(trip) => ramp.time_to(self.speed, trip),
            None => ramp.duration_s,
        })
    }
}

pub(crate) fn steps_from_mm(mm: Axes, settings: &Settings) -> [i64; AXES] {
    let steps_per_mm = settings.steps_per_mm();
    std::array::from_fn(|i| (mm[i] * steps_per_mm[i]).round() as i64)
}

pub(crate) fn mm_from_steps(steps: [i64; AXES], settings: &Settings) -> Axes {
    let steps_per_mm = settings.steps_per_mm();
    std::array::from_fn(|i| steps[i] as f64 / steps_per_mm[i])
}
