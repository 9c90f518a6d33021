//! The homing cycle: Z first, then X and Y; seek, pull off, locate, pull off.
//!
//! Knows the passes and how far each axis gets in them, but no states and no answers. Axes stop
//! dead at their switch, as steppers do.

use std::collections::VecDeque;

use crate::axes::{AXES, Axes, limit_along};
use crate::codes::Alarm;
use crate::motion::{Ramp, next_ramp};
use crate::plant::{Plant, SWITCHED_AXES};
use crate::settings::Settings;

/// The seek covers at most this many times the travel.
const SEEK_TRAVELS: f64 = 1.5;
/// The locating pass covers at most this many times the pull-off.
const LOCATE_PULL_OFFS: f64 = 5.0;

/// How a step of homing ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum HomingStep {
    Going,
    Finished,
    Failed(Alarm),
}

/// A homing cycle in progress.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Homing {
    /// The passes that are left; the first is in motion.
    passes: VecDeque<Pass>,
    /// Machine position at the start of the pass, mm.
    from: Axes,
    /// Along the pass, per axis, mm and mm/s.
    done: f64,
    speed: f64,
    pause_left_s: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Pass {
    axes: [bool; AXES],
    is_approach: bool,
    /// Per axis, mm.
    distance: f64,
    /// Per axis, mm/s and mm/s².
    rate: f64,
    acceleration: f64,
}

impl Homing {
    pub(crate) fn new(from: Axes, settings: &Settings) -> Self {
        let mut passes = VecDeque::new();
        for axes in
            [[false, false, true, false, false, false], [true, true, false, false, false, false]]
        {
            let travel = settings.max_travel_mm();
            let longest = (0..AXES).filter(|&i| axes[i]).map(|i| travel[i]).fold(0.0, f64::max);
            let unit = axes.map(|active| if active { 1.0 } else { 0.0 });
            let rate_max = limit_along(unit, settings.max_rate_mm_per_min());
            let acceleration = limit_along(unit, settings.acceleration_mm_per_s2());
            let seek = settings.homing_seek_mm_per_min().min(rate_max) / 60.0;
            let locate = settings.homing_locate_mm_per_min().min(rate_max) / 60.0;
            let pull_off = settings.homing_pull_off_mm();
            for (is_approach, distance, rate) in [
                (true, SEEK_TRAVELS * longest, seek),
                (false, pull_off, seek),
                (true, LOCATE_PULL_OFFS * pull_off, locate),
                (false, pull_off, seek),
            ] {
                passes.push_back(Pass { axes, is_approach, distance, rate, acceleration });
            }
        }
        Self { passes, from, done: 0.0, speed: 0.0, pause_left_s: None }
    }

    /// Machine position as counted since the start of the cycle, mm.
    pub(crate) fn position(&self, plant: &Plant, settings: &Settings) -> Axes {
        let Some(pass) = self.passes.front() else { return self.from };
        std::array::from_fn(|i| {
            if !pass.axes[i] {
                return self.from[i];
            }
            let negative = settings.homes_negative(i) == pass.is_approach;
            let stop = match pass.is_approach {
                true => plant.distance_home(i, self.from[i], negative, settings),
                false => None,
            };
            let distance = stop.map_or(self.done, |stop| self.done.min(stop));
            self.from[i] + if negative { -distance } else { distance }
        })
    }

    /// Returns the distance until the last switch closes; `None` when one never does.
    fn trip(&self, pass: &Pass, plant: &Plant, settings: &Settings) -> Option<f64> {
        (0..AXES).filter(|&i| pass.axes[i]).try_fold(0.0, |most: f64, i| {
            let negative = settings.homes_negative(i);
            Some(most.max(plant.distance_home(i, self.from[i], negative, settings)?))
        })
    }

    fn ramp(&self, pass: &Pass) -> Ramp {
        next_ramp(pass.distance - self.done, self.speed, pass.rate, 0.0, pass.acceleration)
    }

    /// Returns the seconds until something changes.
    pub(crate) fn seconds_to_next(&self, plant: &Plant, settings: &Settings) -> f64 {
        match (self.pause_left_s, self.passes.front()) {
            (Some(left), _) => left,
            (None, None) => 0.0,
            (None, Some(pass)) => {
                let ramp = self.ramp(pass);
                match self.trip(pass, plant, settings).filter(|_| pass.is_approach) {
                    Some(trip) if trip - self.done <= ramp.distance_mm => {
                        ramp.time_to(self.speed, (trip - self.done).max(0.0))
                    }
                    _ => ramp.duration_s,
                }
            }
        }
    }

    /// Advances by at most `seconds`; returns the seconds used.
    pub(crate) fn advance(
        &mut self,
        seconds: f64,
        plant: &Plant,
        settings: &Settings,
    ) -> (f64, HomingStep) {
        let Some(&pass) = self.passes.front() else { return (0.0, HomingStep::Finished) };
        if let Some(left) = self.pause_left_s {
            if seconds < left {
                self.pause_left_s = Some(left - seconds);
                return (seconds, HomingStep::Going);
            }
            self.pause_left_s = None;
            return (left, self.next_pass(plant, settings));
        }
        let ramp = self.ramp(&pass);
        let trip = self.trip(&pass, plant, settings).filter(|_| pass.is_approach);
        if let Some(trip) = trip.filter(|trip| trip - self.done <= ramp.distance_mm) {
            let at = ramp.time_to(self.speed, (trip - self.done).max(0.0));
            if at <= seconds {
                self.done = trip;
                self.pause_left_s = Some(settings.homing_debounce_s());
                return (at, HomingStep::Going);
            }
        }
        if seconds < ramp.duration_s {
            let (distance, speed) = ramp.after(self.speed, seconds);
            self.done += distance;
            self.speed = speed;
            return (seconds, HomingStep::Going);
        }
        self.done += ramp.distance_mm;
        self.speed = ramp.end_speed_mm_per_s;
        if ramp.finishes {
            if pass.is_approach {
                return (ramp.duration_s, HomingStep::Failed(Alarm::HOMING_APPROACH));
            }
            self.pause_left_s = Some(settings.homing_debounce_s());
        }
        (ramp.duration_s, HomingStep::Going)
    }

    fn next_pass(&mut self, plant: &Plant, settings: &Settings) -> HomingStep {
        self.from = self.position(plant, settings);
        let Some(pass) = self.passes.pop_front() else { return HomingStep::Finished };
        self.done = 0.0;
        self.speed = 0.0;
        let pressed = plant.pressed(self.from, settings);
        if !pass.is_approach && (0..AXES).any(|i| pass.axes[i] && pressed[i]) {
            return HomingStep::Failed(Alarm::HOMING_PULL_OFF);
        }
        if self.passes.is_empty() { HomingStep::Finished } else { HomingStep::Going }
    }
}

/// Returns the position after homing, in machine coordinates, mm; axes without switches stay where
/// they are `before`.
pub(crate) fn position_after_homing(before: Axes, settings: &Settings) -> Axes {
    let travel = settings.max_travel_mm();
    let pull_off = settings.homing_pull_off_mm();
    std::array::from_fn(|i| match settings.homes_negative(i) {
        _ if i >= SWITCHED_AXES => before[i],
        true => pull_off - travel[i],
        false => -pull_off,
    })
}
