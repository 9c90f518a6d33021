//! Advances time event by event: motion, dwells, homing and doors.

use std::time::Duration;

use super::action::Action;
use super::ports::Waiting;
use super::{Controller, ControllerState, Door};
use crate::homing::{HomingStep, position_after_homing};
use crate::motion::{MotionEvent, steps_from_mm};

/// What the axes meet after a distance.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Obstacle {
    Probe,
    Switch,
}

impl Controller {
    /// Advances the controller to `now`; a time in the past has no effect.
    pub fn advance(&mut self, now: Duration) {
        while let Some(due) = self.clock_due().filter(|due| *due <= now) {
            self.advance_to(due);
            if self.override_flags.due == Some(due) {
                self.look_at_overrides();
            }
            if self.report_due == Some(due) {
                self.report_due = self.report_interval.map(|interval| due + interval);
                self.report_status();
            }
        }
        self.advance_to(now);
    }

    /// When the next event is due that depends on the clock alone.
    fn clock_due(&self) -> Option<Duration> {
        self.report_due.into_iter().chain(self.override_flags.due).min()
    }

    fn advance_to(&mut self, now: Duration) {
        self.work();
        let mut left_s = now.saturating_sub(self.now).as_secs_f64();
        self.now = self.now.max(now);
        while left_s > 0.0 && self.is_busy() {
            left_s -= self.step(left_s);
            self.work();
        }
        self.instant_s = self.now.as_secs_f64();
        // Events that are due at this very instant, such as the end of a block.
        while self.is_busy() && self.seconds_to_next().is_some_and(|s| s <= 0.0) {
            self.step(0.0);
            self.work();
        }
    }

    /// Returns when [`Self::advance`] should be called next; `None`: when bytes arrive.
    ///
    /// On the clock of `now`, never before `now`. Motion alone is no event unless something waits
    /// for its end: positions are computed on request.
    pub fn next_event(&self, now: Duration) -> Option<Duration> {
        if !self.transmit.is_empty() {
            return Some(now);
        }
        let is_awaited = !self.script.is_empty()
            || !self.receive_buffer.is_empty()
            || self.probing.is_some()
            || self.obstacle().is_some()
            || matches!(
                self.state,
                ControllerState::Homing(_)
                    | ControllerState::SoftLimit
                    | ControllerState::Stopping
                    | ControllerState::Starting { .. }
            );
        let clock = self.clock_due().map(|due| due.max(now));
        if !is_awaited || !self.is_busy() {
            return clock;
        }
        // Rounded up, so that the event is really due at that time.
        let event = self.seconds_to_next().map(|seconds| {
            let seconds = Duration::from_secs_f64(seconds.min(1e6)) + Duration::from_nanos(1);
            (self.now + seconds).max(now)
        });
        event.into_iter().chain(clock).min()
    }

    /// Is something in progress that takes time?
    fn is_busy(&self) -> bool {
        self.is_moving() || self.dwell_left_s().is_some() || self.is_waiting_without_motion()
    }

    fn is_waiting_without_motion(&self) -> bool {
        matches!(
            self.state,
            ControllerState::Homing(_)
                | ControllerState::Door(Door::Resuming { .. } | Door::Retracting | Door::Returning)
                | ControllerState::Starting { .. }
        )
    }

    fn is_braking(&self) -> bool {
        match &self.state {
            ControllerState::Hold { is_stopped: false }
            | ControllerState::Jog { is_cancelled: true }
            | ControllerState::Door(Door::Stopping { .. })
            | ControllerState::SoftLimit
            | ControllerState::Stopping => true,
            ControllerState::Run => {
                self.probing.as_ref().is_some_and(|p| p.contact_steps.is_some())
            }
            _ => false,
        }
    }

    fn is_moving(&self) -> bool {
        let is_under_way = matches!(self.state, ControllerState::Run | ControllerState::Jog { .. });
        is_under_way && !self.awaits_index() || self.is_braking()
    }

    fn dwell_left_s(&self) -> Option<f64> {
        let is_running = matches!(self.state, ControllerState::Idle | ControllerState::Run);
        match self.script.front() {
            Some(
                Action::Dwell { left_s }
                | Action::AwaitIndex { left_s, .. }
                | Action::AwaitInput(Waiting { left_s, .. }),
            ) if is_running => Some(*left_s),
            _ => None,
        }
    }

    /// Does a thread wait for its spindle?
    pub(super) fn awaits_index(&self) -> bool {
        matches!(self.script.front(), Some(Action::AwaitIndex { .. }))
    }

    /// The nearest switch or probe contact on the block in motion, mm ahead.
    fn obstacle(&self) -> Option<(f64, Obstacle)> {
        if !self.is_moving() {
            return None;
        }
        let (unit, remaining) = self.planner.heading()?;
        let at = self.axes();
        let settings = &self.memory.settings;
        let switch = match settings.hard_limits() {
            true => self.plant.distance_to_switch(at, unit, settings),
            false => None,
        };
        let probe = match &self.probing {
            Some(probing) if probing.contact_steps.is_none() => {
                self.plant.distance_to_probe_change(at, unit)
            }
            _ => None,
        };
        let switch = switch.map(|distance| (distance, Obstacle::Switch));
        let probe = probe.map(|distance| (distance, Obstacle::Probe));
        switch
            .into_iter()
            .chain(probe)
            .filter(|(distance, _)| *distance <= remaining)
            .min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn seconds_to_next(&self) -> Option<f64> {
        let motion = match &self.state {
            ControllerState::Homing(homing) => {
                Some(homing.seconds_to_next(&self.plant, &self.memory.settings))
            }
            ControllerState::Door(Door::Resuming { left_s })
            | ControllerState::Starting { left_s } => Some(*left_s),
            ControllerState::Door(Door::Retracting | Door::Returning) => {
                self.parking.as_ref().and_then(|parking| parking.seconds_to_next())
            }
            _ if self.is_moving() => {
                let trip = self.obstacle().map(|(distance, _)| distance);
                self.planner.seconds_to_next(self.is_braking(), trip).or(Some(0.0))
            }
            _ => None,
        };
        [motion, self.dwell_left_s()].into_iter().flatten().min_by(f64::total_cmp)
    }

    /// Advances by at most `seconds`, up to the next event; returns the seconds used.
    fn step(&mut self, seconds: f64) -> f64 {
        let started_s = self.instant_s;
        let dwell = self.dwell_left_s();
        let limit = dwell.map_or(seconds, |left| seconds.min(left));
        let used = if let ControllerState::Homing(homing) = &mut self.state {
            let (used, step) = homing.advance(limit, &self.plant, &self.memory.settings);
            self.after_homing_step(step);
            used
        } else if let ControllerState::Door(Door::Resuming { left_s }) = &mut self.state {
            let used = limit.min(*left_s);
            *left_s -= used;
            if *left_s <= 0.0 {
                self.resume();
            }
            used
        } else if let ControllerState::Door(Door::Retracting | Door::Returning) = self.state {
            self.step_parking(limit)
        } else if let ControllerState::Starting { left_s } = &mut self.state {
            let used = limit.min(*left_s);
            *left_s -= used;
            if *left_s <= 0.0 {
                self.finish_boot();
            }
            used
        } else if self.is_moving() {
            let obstacle = self.obstacle();
            let trip = obstacle.map(|(distance, _)| distance);
            let (used, event) = self.planner.advance(limit, self.is_braking(), trip);
            self.instant_s += used;
            self.after_motion(event, obstacle.map(|(_, what)| what));
            used
        } else {
            limit
        };
        if let Some(
            Action::Dwell { left_s }
            | Action::AwaitIndex { left_s, .. }
            | Action::AwaitInput(Waiting { left_s, .. }),
        ) = self.script.front_mut()
            && dwell.is_some()
        {
            *left_s = (*left_s - used).max(0.0);
        }
        self.instant_s = started_s + used;
        used
    }

    fn after_motion(&mut self, event: MotionEvent, obstacle: Option<Obstacle>) {
        if let MotionEvent::BlockDone { ends_motion } = event {
            self.counts.blocks_executed += 1;
            self.counts.motions_finished += u64::from(ends_motion);
        }
        match (event, obstacle) {
            (MotionEvent::Tripped, Some(Obstacle::Switch)) => self.hit_limit(),
            (MotionEvent::Tripped, Some(Obstacle::Probe)) => {
                let steps = self.planner.position_steps(&self.memory.settings);
                if let Some(probing) = &mut self.probing {
                    probing.contact_steps = Some(steps);
                }
            }
            _ => {}
        }
        let is_at_rest = self.planner.is_empty() || event == MotionEvent::Stopped;
        if !self.is_moving() || !is_at_rest {
            return;
        }
        match self.state {
            ControllerState::Run if self.probing.is_some() => self.finish_probe(),
            ControllerState::Run => {
                self.ran_empty_at_s = Some(self.instant_s);
                self.state = ControllerState::Idle;
            }
            ControllerState::Jog { .. } => {
                self.forget_motion();
                self.sync_parser();
                self.state = ControllerState::Idle;
            }
            ControllerState::Hold { .. } => self.state = ControllerState::Hold { is_stopped: true },
            ControllerState::Door(Door::Stopping { is_jog }) => {
                if is_jog {
                    self.forget_motion();
                    self.sync_parser();
                }
                self.retract();
            }
            ControllerState::SoftLimit => self.critical(crate::codes::Alarm::SOFT_LIMIT),
            ControllerState::Stopping => self.finish_stop(),
            _ => {}
        }
    }

    fn after_homing_step(&mut self, step: HomingStep) {
        match step {
            HomingStep::Going => {}
            HomingStep::Failed(alarm) => self.fail_homing(alarm),
            HomingStep::Finished => {
                self.forget_motion();
                let settings = &self.memory.settings;
                let before = self.axes();
                let physical = crate::axes::add(before, self.plant.offset);
                let machine = position_after_homing(before, settings);
                self.plant.offset = crate::axes::subtract(physical, machine);
                self.planner.set_position_steps(steps_from_mm(machine, settings));
                self.sync_parser();
                self.state = ControllerState::Idle;
                self.alarm = None;
                self.is_homed = true;
                self.cadence.homed_changed();
                if let Some(feedback) = self.traits().resume_feedback {
                    self.feedback(feedback);
                }
                self.work();
                if std::mem::take(&mut self.has_pending_report) {
                    self.report_status_now();
                }
                if std::mem::take(&mut self.has_pending_hold) {
                    self.feed_hold();
                }
            }
        }
    }
}
