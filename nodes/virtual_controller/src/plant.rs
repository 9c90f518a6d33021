//! The machine around the controller: switches, door, probe.
//!
//! Knows the physical position of the axes relative to the controller's position, and which pins
//! are pressed there. Limit switches are at both ends of the travel (physical 0 and minus
//! `$130`..`$132`). They are wired only when `$21` or `$22` is on, so that a machine without
//! homing may have its zero anywhere.

use crate::axes::{AXES, Axes};
use crate::settings::Settings;
use crate::tolerances::{NEGLIGIBLE_SHARE, SWITCH_MM};

/// Distance from a limit switch to the end of travel, mm.
const END_STOP_MM: f64 = 0.5;

/// X, Y and Z have limit switches; other axes turn without end.
pub(crate) const SWITCHED_AXES: usize = 3;

/// Pins and positions.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plant {
    /// Physical = machine + this, mm.
    pub(crate) offset: Axes,
    /// Switches held closed by a fault.
    pub(crate) held: [bool; AXES],
    /// Switches that never close.
    pub(crate) dead: [bool; AXES],
    pub(crate) is_door_open: bool,
    /// Physical Z of the surface a probe finds, mm.
    pub(crate) probe_surface_z: Option<f64>,
    /// Physical place of the fourth axis from which on the probe touches, too.
    pub(crate) probe_stop_fourth: Option<f64>,
}

impl Plant {
    fn has_switches(settings: &Settings) -> bool {
        settings.hard_limits() || settings.homing_enabled()
    }

    pub(crate) fn pressed(&self, machine: Axes, settings: &Settings) -> [bool; AXES] {
        let travel = settings.max_travel_mm();
        std::array::from_fn(|i| {
            let physical = machine[i] + self.offset[i];
            let beyond =
                i < SWITCHED_AXES && (physical > SWITCH_MM || physical < -travel[i] - SWITCH_MM);
            self.held[i] || (beyond && !self.dead[i] && Self::has_switches(settings))
        })
    }

    /// Returns the distance along `unit` from `machine` to the next switch, mm.
    pub(crate) fn distance_to_switch(
        &self,
        machine: Axes,
        unit: Axes,
        settings: &Settings,
    ) -> Option<f64> {
        if !Self::has_switches(settings) {
            return None;
        }
        let travel = settings.max_travel_mm();
        (0..SWITCHED_AXES)
            .filter(|&i| unit[i].abs() > NEGLIGIBLE_SHARE && !self.dead[i])
            .filter_map(|i| {
                let physical = machine[i] + self.offset[i];
                let switch =
                    if unit[i] > 0.0 { 2.0 * SWITCH_MM } else { -travel[i] - 2.0 * SWITCH_MM };
                let distance = (switch - physical) / unit[i];
                (distance >= 0.0).then_some(distance)
            })
            .min_by(f64::total_cmp)
    }

    /// Returns the distance of an axis in a direction to its homing switch, mm; zero when on it.
    pub(crate) fn distance_home(
        &self,
        axis: usize,
        machine: f64,
        negative: bool,
        settings: &Settings,
    ) -> Option<f64> {
        if self.held[axis] {
            return Some(0.0);
        }
        if self.dead[axis] {
            return None;
        }
        let physical = machine + self.offset[axis];
        let distance = match negative {
            true => physical + settings.max_travel_mm()[axis],
            false => -physical,
        };
        Some(distance.max(0.0))
    }

    /// Undoes the steps that the controller counted while an axis was against its end stop.
    pub(crate) fn stop_at_ends(&mut self, machine: Axes, settings: &Settings) {
        if !Self::has_switches(settings) {
            return;
        }
        let travel = settings.max_travel_mm();
        for i in 0..SWITCHED_AXES {
            let physical = machine[i] + self.offset[i];
            self.offset[i] += physical.clamp(-travel[i] - END_STOP_MM, END_STOP_MM) - physical;
        }
    }

    /// What the probe touches: an axis, its physical place there, and whether it does so above.
    fn contacts(&self) -> impl Iterator<Item = (usize, f64, bool)> {
        let surface = self.probe_surface_z.map(|z| (2, z, false));
        surface.into_iter().chain(self.probe_stop_fourth.map(|stop| (3, stop, true)))
    }

    pub(crate) fn touches_probe(&self, machine: Axes) -> bool {
        self.contacts().any(|(axis, place, is_above)| {
            let physical = machine[axis] + self.offset[axis];
            if is_above { physical >= place } else { physical <= place }
        })
    }

    /// Returns the distance along `unit` to where the probe pin changes, mm.
    pub(crate) fn distance_to_probe_change(&self, machine: Axes, unit: Axes) -> Option<f64> {
        let changes = self.contacts().filter_map(|(axis, place, _)| {
            let distance = (place - machine[axis] - self.offset[axis]) / unit[axis];
            (unit[axis].abs() > NEGLIGIBLE_SHARE && distance >= 0.0).then_some(distance)
        });
        changes.min_by(f64::total_cmp)
    }
}
