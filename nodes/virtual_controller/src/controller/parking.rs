//! Parking: one axis moves the tool away while the door is open, and back.
//!
//! Away: slowly out of the work with the spindle on, then fast to the parking position with the
//! spindle off. Back: fast, then spindle and coolant on, then slowly to where the program
//! stopped. This file knows the one axis and its path; `door` events come from its callers.

use super::{Controller, ControllerState, Door};
use crate::axes::Axes;
use crate::motion::{Ramp, braking_ramp, next_ramp};

/// A tool that is moving away, away, or moving back.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parking {
    axis: usize,
    /// Where the program stopped, machine coordinates, mm.
    held_at: Axes,
    /// Along the axis, machine coordinates, mm.
    waypoint: f64,
    target: f64,
    at: f64,
    /// mm/s, never negative.
    speed: f64,
    is_upward: bool,
    slow: f64,
    fast: f64,
    acceleration: f64,
    leg: Leg,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Leg {
    /// The door opened again on the way back.
    Braking,
    PullOut,
    Away,
    Parked,
    Back,
    PowerUp {
        left_s: f64,
    },
    Plunge,
    /// Back where the program stopped.
    Home,
}

impl Parking {
    /// Position of the axes, machine coordinates, mm.
    pub(super) fn position(&self) -> Axes {
        let mut position = self.held_at;
        position[self.axis] = self.at;
        position
    }

    pub(super) fn speed_mm_per_min(&self) -> f64 {
        self.speed * 60.0
    }

    /// Spindle and coolant are off from the end of the pull-out until the tool is back above it.
    pub(super) fn is_powered(&self) -> bool {
        matches!(self.leg, Leg::PullOut | Leg::PowerUp { .. } | Leg::Plunge | Leg::Home)
    }

    fn ramp(&self) -> Option<Ramp> {
        let (goal, rate) = match self.leg {
            Leg::PullOut => (self.waypoint.max(self.at), self.slow),
            Leg::Away => (self.target, self.fast),
            Leg::Back => (self.waypoint, self.fast),
            Leg::Plunge => (self.held_at[self.axis], self.slow),
            Leg::Braking => {
                return Some(braking_ramp(f64::INFINITY, self.speed, self.acceleration));
            }
            Leg::Parked | Leg::PowerUp { .. } | Leg::Home => return None,
        };
        Some(next_ramp((goal - self.at).abs(), self.speed, rate, 0.0, self.acceleration))
    }

    pub(super) fn seconds_to_next(&self) -> Option<f64> {
        match self.leg {
            Leg::PowerUp { left_s } => Some(left_s),
            _ => self.ramp().map(|ramp| ramp.duration_s),
        }
    }

    /// Advances by at most `seconds`; `power_up_s` is the time that spindle and coolant need.
    fn advance(&mut self, seconds: f64, power_up_s: f64) -> f64 {
        if let Leg::PowerUp { left_s } = &mut self.leg {
            let used = seconds.min(*left_s);
            *left_s -= used;
            if *left_s <= 0.0 {
                self.set_leg(Leg::Plunge);
            }
            return used;
        }
        let Some(ramp) = self.ramp() else { return seconds };
        let used = seconds.min(ramp.duration_s);
        let (distance, speed) = match used < ramp.duration_s {
            true => ramp.after(self.speed, used),
            false => (ramp.distance_mm, ramp.end_speed_mm_per_s),
        };
        self.at += if self.is_upward { distance } else { -distance };
        self.speed = speed;
        if used >= ramp.duration_s && (ramp.finishes || self.speed <= 0.0) {
            self.speed = 0.0;
            self.set_leg(match self.leg {
                Leg::Braking => Leg::PullOut,
                Leg::PullOut => Leg::Away,
                Leg::Away => Leg::Parked,
                Leg::Back => Leg::PowerUp { left_s: power_up_s },
                Leg::Plunge => Leg::Home,
                leg => leg,
            });
        }
        used
    }

    fn set_leg(&mut self, leg: Leg) {
        self.leg = leg;
        if leg != Leg::Braking {
            self.is_upward = matches!(leg, Leg::PullOut | Leg::Away);
        }
    }
}

impl Controller {
    /// The door stopped all motion: moves the tool away, if parking is possible.
    pub(super) fn retract(&mut self) {
        self.state = ControllerState::Door(Door::Stopped);
        let settings = &self.memory.settings;
        if !settings.parks() || !self.is_homed || self.parking.is_some() {
            return;
        }
        let parking = settings.parking();
        let held_at = self.axes();
        let at = held_at[parking.axis];
        if at >= parking.target_mm {
            return;
        }
        let rate_max = settings.max_rate_mm_per_min()[parking.axis];
        self.parking = Some(Parking {
            axis: parking.axis,
            held_at,
            waypoint: (at + parking.pull_out_mm).min(parking.target_mm),
            target: parking.target_mm,
            at,
            speed: 0.0,
            is_upward: true,
            slow: parking.pull_out_mm_per_min.min(rate_max) / 60.0,
            fast: parking.fast_mm_per_min.min(rate_max) / 60.0,
            acceleration: settings.acceleration_mm_per_s2()[parking.axis],
            leg: Leg::PullOut,
        });
        self.state = ControllerState::Door(Door::Retracting);
    }

    /// `~` with the door closed: brings back the tool, then spindle and coolant, then motion.
    pub(super) fn leave_door(&mut self) {
        let power_up_s = self.power_up_s();
        self.state = ControllerState::Door(match &mut self.parking {
            Some(parking) => {
                parking.set_leg(Leg::Back);
                Door::Returning
            }
            None => Door::Resuming { left_s: power_up_s },
        });
    }

    /// The door opened again while the tool was coming back.
    pub(super) fn retract_again(&mut self) {
        if let Some(parking) = &mut self.parking {
            parking.set_leg(Leg::Braking);
            self.state = ControllerState::Door(Door::Retracting);
        }
    }

    /// Advances parking by at most `seconds`; returns the seconds used.
    pub(super) fn step_parking(&mut self, seconds: f64) -> f64 {
        let power_up_s = self.power_up_s();
        let Some(parking) = &mut self.parking else { return seconds };
        let was_powered = parking.is_powered();
        let used = parking.advance(seconds, power_up_s);
        let (leg, is_powered) = (parking.leg, parking.is_powered());
        if was_powered != is_powered {
            self.cadence.accessories_changed();
        }
        match leg {
            Leg::Parked => self.state = ControllerState::Door(Door::Stopped),
            Leg::Home => {
                self.parking = None;
                self.resume();
            }
            _ => {}
        }
        used
    }
}
