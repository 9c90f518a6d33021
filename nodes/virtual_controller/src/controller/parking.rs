//! Parking: one axis takes the tool out of the way while the door is open, and back.
//!
//! Slowly out of the work with the spindle turning, fast to the parking place
//! without it; fast back, spindle and coolant on, slowly to where the
//! program stopped. Knows one axis and its way; what the door does is told to it.

use super::{Controller, Door, State};
use crate::axes::Vector;
use crate::motion::{Ramp, braking_ramp, next_ramp};

/// A tool on its way out, or back, or away.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parking {
    axis: usize,
    /// Where the program stopped, machine coordinates, mm.
    held_at: Vector,
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
    /// The door has opened again on the way back.
    Braking,
    PullOut,
    Away,
    Parked,
    Back,
    PowerUp {
        left_s: f64,
    },
    Plunge,
    /// Where the program stopped.
    Home,
}

impl Parking {
    /// Where the axes are, machine coordinates, mm.
    pub(super) fn position(&self) -> Vector {
        let mut position = self.held_at;
        position[self.axis] = self.at;
        position
    }

    pub(super) fn speed_mm_per_min(&self) -> f64 {
        self.speed * 60.0
    }

    /// Spindle and coolant are off from the end of the pull-out to the end of the way back.
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

    /// Lets at most `seconds` pass; `power_up_s` is what spindle and coolant take.
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
        let (way, speed) = match used < ramp.duration_s {
            true => ramp.after(self.speed, used),
            false => (ramp.distance_mm, ramp.end_speed_mm_per_s),
        };
        self.at += if self.is_upward { way } else { -way };
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
    /// The door has brought everything to rest: the tool goes away, if it may.
    pub(super) fn retract(&mut self) {
        self.state = State::Door(Door::Stopped);
        let settings = &self.memory.settings;
        if !settings.parks() || !self.is_homed || self.parking.is_some() {
            return;
        }
        let way = settings.parking();
        let held_at = self.position();
        let at = held_at[way.axis];
        if at >= way.target_mm {
            return;
        }
        let rate_max = settings.max_rate_mm_per_min()[way.axis];
        self.parking = Some(Parking {
            axis: way.axis,
            held_at,
            waypoint: (at + way.pull_out_mm).min(way.target_mm),
            target: way.target_mm,
            at,
            speed: 0.0,
            is_upward: true,
            slow: way.pull_out_mm_per_min.min(rate_max) / 60.0,
            fast: way.fast_mm_per_min.min(rate_max) / 60.0,
            acceleration: settings.acceleration_mm_per_s2()[way.axis],
            leg: Leg::PullOut,
        });
        self.state = State::Door(Door::Retracting);
    }

    /// `~` with the door closed: the tool comes back, spindle and coolant, and motion.
    pub(super) fn leave_door(&mut self) {
        let power_up_s = self.power_up_s();
        self.state = State::Door(match &mut self.parking {
            Some(parking) => {
                parking.set_leg(Leg::Back);
                Door::Returning
            }
            None => Door::Resuming { left_s: power_up_s },
        });
    }

    /// The door has opened on the way back.
    pub(super) fn retract_again(&mut self) {
        if let Some(parking) = &mut self.parking {
            parking.set_leg(Leg::Braking);
            self.state = State::Door(Door::Retracting);
        }
    }

    /// Lets at most `seconds` of parking pass; returns the seconds used.
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
            Leg::Parked => self.state = State::Door(Door::Stopped),
            Leg::Home => {
                self.parking = None;
                self.resume();
            }
            _ => {}
        }
        used
    }
}
