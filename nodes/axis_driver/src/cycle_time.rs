//! How long a path takes on this controller: its planner, block by block.
//!
//! grbl, grblHAL and FluidNC plan alike: straight blocks in a ring of limited length whose last one
//! ends at rest, corners by junction deviation, constant acceleration in each block. [`ring`] is that
//! planner, `chords` are the blocks that the firmware makes of an arc. This file feeds the blocks of
//! a path into the ring, as fast as the ring takes them: a serial line that is too slow for very
//! short blocks is not in it, nor what an operator takes. Knows no clock.

mod chords;
mod ring;

use crate::encoder::{AllowedOverrides, UserFunction};
use crate::firmware::{THREAD_WAIT_S_MAX, thread_wait_s};
use crate::machine_limits::{MachineLimits, direction};
use crate::machine_path::{FurtherStep, Known, MachinePath, Step};
use crate::vectors::norm;
use chords::Chords;
use cnc_msgs::contour::{Action, CoolantMode, Source, SpindleMode};
use cnc_msgs::further::{FurtherAxes, FurtherMode, further_distance};
use cnc_msgs::geometry::{AxisSet, Position};
use cnc_msgs::path::CompensatedPath;
use cnc_msgs::port_word::PortWord;
use ring::{Block, Place, Ring};

pub use ring::Speeds;

/// Adds up the seconds of a path.
#[derive(Debug, Clone)]
pub struct CycleTime {
    limits: MachineLimits,
    walk: MachinePath,
    ring: Ring,
    /// The rest of the arc whose blocks are being made.
    arc: Option<(Chords, Option<f64>)>,
    /// How far A to W go along with the next line; no arc is sent with them.
    along: FurtherAxes,
    /// Where the last block ends, in steps.
    at_steps: [i64; 3],
    /// A block that starts from rest comes next, after so many seconds.
    pause_s: Option<f64>,
    /// The next block ends at rest: it is the way of a probe, or a thread.
    ends_at_rest: bool,
    first_element: usize,
    /// S, M3 and M7 in force: only a change stops the machine.
    rpm: f64,
    spindle: SpindleMode,
    coolant: [bool; 2],
    seconds: f64,
}

impl CycleTime {
    /// Nothing done yet; the path begins with this element. `start_in_machine` is where the axes
    /// are; `None`: where that element begins.
    pub fn new(
        limits: &MachineLimits,
        path: &CompensatedPath,
        first_element: usize,
        start_in_machine: Option<Position>,
    ) -> Self {
        // Where the work systems are does not matter, only how far the axes move.
        let mut offsets = limits.offsets;
        let known = |place: &mut Option<Position>| {
            place.get_or_insert([0.0; 3]);
        };
        offsets.systems.iter_mut().chain(&mut offsets.references).for_each(known);
        let zero: FurtherAxes = (0..6).map(|axis| (axis, 0.0)).collect();
        (offsets.further_systems, offsets.further_shift) = ([zero; 9], zero);
        let mut started = Self {
            limits: limits.clone(),
            walk: MachinePath::new(path, &offsets, [None; 3]),
            ring: Ring::new(limits.planner_blocks),
            arc: None,
            along: FurtherAxes::NONE,
            at_steps: [0; 3],
            pause_s: None,
            ends_at_rest: false,
            first_element,
            rpm: 0.0,
            spindle: SpindleMode::Off,
            coolant: [false; 2],
            seconds: 0.0,
        };
        while started.walk.next_element() < first_element && started.walk.next(path).is_some() {}
        started.walk.miss_probes();
        let start = path.start_of(first_element.min(path.elements.len()));
        let at = start_in_machine.unwrap_or_else(|| started.walk.work_place(start));
        started.walk.assume(at);
        started.at_steps = started.steps(at);
        started
    }

    /// What may make the time of this path wrong; nothing where all is known.
    pub fn doubts(limits: &MachineLimits, path: &CompensatedPath) -> Vec<String> {
        limits.time_doubts(path.further_moved())
    }

    /// Before all else the axes go from here, machine frame, to the first element: up, A to W by `turn`, over,
    /// and down at this feed. There the machine stands, and the driver looks where it is.
    pub fn come_from_above(
        &mut self,
        path: &CompensatedPath,
        (here, turn): (Position, FurtherAxes),
        (height_mm, axes): (f64, AxisSet),
        feed_mm_per_min: Option<f64>,
    ) {
        let element = self.first_element;
        let source = path.elements.get(element).map_or(Source::default(), |first| first.source);
        let way = self.walk.way_from_above(here.map(Some), height_mm, axes, source);
        let [up, over, down] =
            way.map(|it| std::array::from_fn(|axis| it.to[axis].unwrap_or(here[axis])));
        self.at_steps = self.steps(here);
        let place = (element, 0);
        let mut turn = Block::new(&self.limits, direction([0.0; 3], turn), None, place);
        for (to, feed) in [(up, None), (over, None), (down, feed_mm_per_min)] {
            if self.push(to, FurtherAxes::NONE, feed, place) {
                self.pause_s = Some(0.0);
            }
            if to == up && self.push_block(turn.take()) {
                self.pause_s = Some(0.0);
            }
        }
        self.walk.assume(down);
    }

    /// Feed and rapid speed in parts of the programmed ones, from here on.
    pub fn set_speeds(&mut self, speeds: Speeds) {
        self.ring.set_speeds(speeds);
    }

    /// Seconds of all that was done.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Seconds of all elements before this one, and of the pauses before them; it never goes back.
    /// The number of elements means the whole path.
    pub fn advance_to(&mut self, path: &CompensatedPath, element: usize) -> f64 {
        while !self.advance_within(path, element, usize::MAX) {}
        self.seconds
    }

    /// The same, but no more than so many blocks; true when it is there.
    pub fn advance_within(
        &mut self,
        path: &CompensatedPath,
        element: usize,
        blocks_max: usize,
    ) -> bool {
        let place = match element >= path.elements.len() {
            true => (usize::MAX, 0),
            false => (element, 0),
        };
        self.advance_to_place(path, place, blocks_max)
    }

    /// Seconds of all before the block of an element begins, and of the lines before it that turn A to W
    /// alone.
    pub(crate) fn advance_to_cut(&mut self, path: &CompensatedPath, element: usize) -> f64 {
        self.advance_to_place(path, (element, usize::MAX), usize::MAX);
        self.seconds
    }

    /// Seconds of all before an event, which turns A to W alone before an element.
    pub(crate) fn advance_to_turn(
        &mut self,
        path: &CompensatedPath,
        (element, event): (usize, usize),
    ) -> f64 {
        self.advance_to_place(path, (element, event), usize::MAX);
        self.seconds
    }

    fn advance_to_place(
        &mut self,
        path: &CompensatedPath,
        place: Place,
        blocks_max: usize,
    ) -> bool {
        for _ in 0..blocks_max {
            while !self.ring.is_full() && self.push_next(path) {}
            match self.ring.front_place() {
                Some(front) if front < place => self.seconds += self.ring.pop(),
                Some(_) => return true,
                None => {
                    // Pauses at the end.
                    self.seconds += self.pause_s.take().unwrap_or(0.0);
                    return true;
                }
            }
        }
        false
    }

    /// Puts the next block into the ring; false at the end of the path.
    fn push_next(&mut self, path: &CompensatedPath) -> bool {
        loop {
            let element = self.walk.next_element().saturating_sub(1).max(self.first_element);
            if let Some((chords, feed)) = &mut self.arc {
                let feed = *feed;
                let Some(next) = chords.next() else {
                    self.arc = None;
                    continue;
                };
                if self.push(next, FurtherAxes::NONE, feed, (element, usize::MAX)) {
                    return true;
                }
                continue;
            }
            match self.walk.next(path) {
                None => return false,
                Some(Step::Function(action, _)) => self.stop_for(action),
                Some(Step::Further(it)) => {
                    let way = |(axis, to)| Some((axis, to - it.from.get(axis)?));
                    let way: FurtherAxes = it.to.iter().filter_map(way).collect();
                    let FurtherStep { mode: FurtherMode::Along, .. } = it else {
                        let element = self.walk.next_element().max(self.first_element);
                        let event = self.walk.next_event() - 1;
                        if self.push_further(&it, way, (element, event)) {
                            return true;
                        }
                        continue;
                    };
                    self.along = way;
                }
                Some(Step::Move(it)) => {
                    let along = std::mem::take(&mut self.along);
                    let whole = |at: Known| at.map(|value| value.unwrap_or(0.0));
                    let (from, to) = (whole(it.from), whole(it.to));
                    let element =
                        self.walk.next_element().saturating_sub(1).max(self.first_element);
                    match it.arc {
                        Some(arc) => {
                            let chords = Chords::new(from, to, &arc, self.limits.arc_tolerance_mm);
                            self.arc = Some((chords, it.feed_mm_per_min));
                        }
                        None => {
                            let place = (element, usize::MAX);
                            if self.push(to, along, it.feed_mm_per_min, place) {
                                return true;
                            }
                        }
                    }
                }
            }
        }
    }

    /// False where the block is shorter than a step. The feed is along X, Y and Z.
    fn push(
        &mut self,
        to: Position,
        along: FurtherAxes,
        feed_mm_per_min: Option<f64>,
        place: Place,
    ) -> bool {
        let end = self.steps(to);
        let start = std::mem::replace(&mut self.at_steps, end);
        let per_mm = self.limits.steps_per_mm;
        let way: Position =
            std::array::from_fn(|axis| (end[axis] - start[axis]) as f64 / per_mm[axis]);
        let all = direction(way, along);
        let feed = match along.is_empty() {
            true => feed_mm_per_min,
            // As long as X, Y and Z take.
            false => feed_mm_per_min.map(|feed| feed * norm(all) / norm(way)),
        };
        self.push_block(Block::new(&self.limits, all, feed, place))
    }

    /// A move of A to W alone.
    fn push_further(&mut self, it: &FurtherStep, way: FurtherAxes, place: Place) -> bool {
        let all = direction([0.0; 3], way);
        let feed = match it.mode {
            FurtherMode::Feed(rate) => Some(rate * norm(all) / further_distance(it.from, it.to)),
            FurtherMode::Rapid | FurtherMode::Along => None,
        };
        self.push_block(Block::new(&self.limits, all, feed, place))
    }

    fn push_block(&mut self, block: Option<Block>) -> bool {
        let Some(block) = block else { return false };
        self.ring.push(&self.limits, block, self.pause_s.take());
        self.pause_s = std::mem::take(&mut self.ends_at_rest).then_some(0.0);
        true
    }

    fn steps(&self, at: Position) -> [i64; 3] {
        std::array::from_fn(|axis| (at[axis] * self.limits.steps_per_mm[axis]).round() as i64)
    }

    /// The firmware waits for all motion before it does these.
    fn stop_for(&mut self, action: Action) {
        let seconds = match action {
            Action::Dwell { seconds } => seconds,
            Action::SpindleSpeed { rpm } => {
                let is_new = std::mem::replace(&mut self.rpm, rpm) != rpm;
                if !is_new || self.limits.is_laser || self.spindle == SpindleMode::Off {
                    return;
                }
                0.0
            }
            Action::Spindle(mode) => {
                if std::mem::replace(&mut self.spindle, mode) == mode {
                    return;
                }
                0.0
            }
            Action::Coolant(mode) => {
                let [mist, flood] = self.coolant;
                let after = match mode {
                    CoolantMode::Mist => [true, flood],
                    CoolantMode::Flood => [mist, true],
                    CoolantMode::Off => [false; 2],
                };
                if std::mem::replace(&mut self.coolant, after) == after {
                    return;
                }
                0.0
            }
            Action::Probe(_) => {
                self.ends_at_rest = true;
                0.0
            }
            Action::SpindleSync { .. } => {
                self.ends_at_rest = true;
                thread_wait_s(self.rpm).min(THREAD_WAIT_S_MAX)
            }
            // How long an input or a function lets it wait, nobody knows.
            Action::Auxiliary { .. } if PortWord::of(&action).is_some() => 0.0,
            Action::Auxiliary { .. } if UserFunction::of(&action).is_some() => 0.0,
            Action::Auxiliary { .. } if AllowedOverrides::default().after(&action).is_some() => 0.0,
            Action::ChangeTool { .. } => {
                self.spindle = SpindleMode::Off;
                0.0
            }
            Action::Stop { optional: false }
            | Action::ExactStop
            | Action::Home { .. }
            | Action::SetWorkOffset { .. }
            | Action::StoreReference { .. }
            | Action::ProgramEnd { .. } => 0.0,
            _ => return,
        };
        self.pause_s = Some(self.pause_s.unwrap_or(0.0) + seconds);
    }
}

/// `42.3 s`, `12 min 34 s`, `2 h 03 min`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round().max(0.0) as u64;
    match whole {
        0..60 => format!("{seconds:.1} s"),
        60..3_600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3_600, whole % 3_600 / 60),
    }
}

#[cfg(test)]
mod tests;
