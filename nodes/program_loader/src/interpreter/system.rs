//! The parameters that the state of the interpreter gives: `#5420`, `#<_feed>`.
//!
//! Positions are in the units in force, offsets in millimetres. A value that only the machine has while it runs is an error
//! that says so: a plan must not depend on it.

use super::axes::Reliance;
use super::further::FURTHER_WORDS;
use super::turn::is_rotation;
use super::{Interpreter, moves::AXIS_WORDS};
use crate::dialect::{Distance, Mode, Units};
use crate::expression::Trouble;
use cnc_msgs::contour::{CutterSide, SpindleMode};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AxisSet, Plane};

type Value = Option<Result<f64, Trouble>>;

/// Parameters of the machine, by their numbers, that a plan cannot know.
const ON_THE_MACHINE: [(std::ops::RangeInclusive<u32>, &str); 4] = [
    (5021..=5029, "a position in machine coordinates, which is known only while the machine runs"),
    (5081..=5089, "a tool length, which the loader does not know"),
    (
        5161..=5199,
        "a stored position of the machine, which is known only there or from a parameter file",
    ),
    (
        5221..=5390,
        "a work offset of the machine, which is known only there or from a parameter file",
    ),
];

impl Interpreter<'_> {
    /// The value of a numbered parameter that the program does not set; `None` for all others.
    pub(crate) fn system_number(&self, number: u32) -> Value {
        if number < 5000 {
            return None;
        }
        if (5061..=5070).contains(&number) {
            return self.probe_value(number);
        }
        if let Some(&value) = self.stored.get(&number) {
            return Some(Ok(value));
        }
        if is_rotation(number) {
            return Some(Ok(0.0));
        }
        if let Some((_, what)) = ON_THE_MACHINE.iter().find(|(range, _)| range.contains(&number)) {
            return Some(Err(Trouble::NotHere { what: (*what).to_owned() }));
        }
        match number {
            5210 => Some(Ok(truth(self.is_shifted()))),
            5211..=5213 => Some(Ok(self.modal.kept_shift[(number - 5211) as usize])),
            5214..=5219 => {
                let kept = self.further.kept_shift.get((number - 5214) as usize);
                Some(Ok(kept.unwrap_or(0.0)))
            }
            5220 => Some(Ok(f64::from(self.modal.work_offset))),
            5399 => Some(self.input_value()),
            5400 => Some(self.current_tool()),
            5401..=5413 => Some(self.tool_value(number)),
            5420..=5422 => Some(self.position_of((number - 5420) as usize)),
            5423..=5428 => Some(self.position_of_further((number - 5423) as usize)),
            _ => None,
        }
    }

    /// The value of a predefined name; `None` for all others.
    pub(crate) fn system_name(&self, name: &str) -> Value {
        let modal = &self.modal;
        let is = |is_true: bool| Some(Ok(truth(is_true)));
        let side = modal.compensation.side();
        match name {
            "_vmajor" => Some(Ok(2.9)),
            "_vminor" | "_remap_level" => Some(Ok(0.0)),
            "_a" => Some(self.position_of_further(0)),
            "_b" => Some(self.position_of_further(1)),
            "_c" => Some(self.position_of_further(2)),
            "_u" => Some(self.position_of_further(3)),
            "_v" => Some(self.position_of_further(4)),
            "_w" => Some(self.position_of_further(5)),
            "_task" => is(false),
            "_motion_mode" => Some(Ok(self.motion_mode())),
            "_plane" => Some(Ok(match modal.plane {
                Plane::Xy => 170.0,
                Plane::Zx => 180.0,
                Plane::Yz => 190.0,
            })),
            "_ccomp" => Some(Ok(match side {
                None => 400.0,
                Some(CutterSide::Left) => 410.0,
                Some(CutterSide::Right) => 420.0,
            })),
            "_metric_machine" => is(true),
            "_metric" => is(modal.units == Units::Millimetre),
            "_imperial" => is(modal.units == Units::Inch),
            "_absolute" => is(modal.distance == Distance::Absolute),
            "_incremental" => is(modal.distance == Distance::Incremental),
            "_inverse_time" => is(modal.feed_mode == super::FeedMode::InverseTime),
            "_units_per_minute" => is(modal.feed_mode == super::FeedMode::PerMinute),
            "_units_per_rev" => is(modal.feed_mode == super::FeedMode::PerRevolution),
            "_coord_system" => Some(Ok(f64::from(530 + 10 * u32::from(modal.work_offset)))),
            "_tool_offset" => is(modal.length.is_some()),
            "_retract_r_plane" | "_retract_old_z" => {
                self.has_returned.set(true);
                is(modal.cycle.returns_to_r == (name == "_retract_old_z"))
            }
            "_spindle_rpm_mode" => is(modal.surface.is_none()),
            "_spindle_css_mode" => is(modal.surface.is_some()),
            "_ijk_absolute_mode" => is(modal.centers == Distance::Absolute),
            "_lathe_diameter_mode" => is(modal.x_is_diameter),
            "_lathe_radius_mode" => is(!modal.x_is_diameter),
            "_spindle_on" => is(modal.spindle != SpindleMode::Off),
            "_spindle_cw" => is(modal.spindle == SpindleMode::Clockwise),
            "_mist" => is(modal.mist),
            "_flood" => is(modal.flood),
            "_speed_override" => is(modal.overrides.speed),
            "_feed_override" => is(modal.overrides.feed),
            "_adaptive_feed" => is(modal.overrides.adapts),
            "_feed_hold" => is(modal.overrides.may_hold),
            "_feed" => Some(Ok(modal.programmed_feed)),
            "_rpm" => Some(Ok(modal.surface.map_or(modal.rpm, |it| it.programmed))),
            "_x" => Some(self.position_of(0)),
            "_y" => Some(self.position_of(1)),
            "_z" => Some(self.position_of(2)),
            "_current_tool" => Some(self.current_tool()),
            "_selected_tool" => Some(Ok(modal.selected_tool.map_or(-1.0, f64::from))),
            "_current_pocket" | "_selected_pocket" => Some(Err(Trouble::NotHere {
                what: "a pocket of the tool changer, which the loader does not know".to_owned(),
            })),
            _ if name.starts_with("_abs_") => Some(Err(Trouble::NotHere {
                what: "a position in machine coordinates, which is known only while the machine \
                       runs"
                    .to_owned(),
            })),
            _ if name.starts_with("_ini[") || name.starts_with("_hal[") => {
                Some(Err(Trouble::NotHere {
                    what: "a setting of LinuxCNC, which this machine does not have".to_owned(),
                }))
            }
            _ => None,
        }
    }

    /// The position of an axis as the program would write it.
    fn position_of(&self, axis: usize) -> Result<f64, Trouble> {
        if self.modal.compensation.is_selected() {
            return Err(Trouble::CompensatedPosition);
        }
        match self.axes.rely_on(self.turned_axes(AxisSet::NONE.with(axis))) {
            Reliance::Unknown(_) if self.axes.is_drifting(axis) => {
                let place = self
                    .measured(axis)
                    .map(|place| (place - self.modal.shift[axis]) / self.scale());
                place.ok_or(Trouble::UnknownPosition { axis: char::from(AXIS_WORDS[axis]) })
            }
            Reliance::Unknown(_) => {
                let unknown = Trouble::UnknownPosition { axis: char::from(AXIS_WORDS[axis]) };
                let place = if axis == 2 { self.z_by_length() } else { None };
                Ok((place.ok_or(unknown)?? - self.modal.shift[axis]) / self.scale())
            }
            Reliance::Poisoned => Ok(f64::NAN),
            reliance => {
                if let Reliance::Assumed(axes) = reliance {
                    // The program is good for this start only.
                    self.read_axes.set(self.read_axes.get().union(axes));
                }
                Ok((self.axes.position[axis] - self.modal.shift[axis]) / self.scale())
            }
        }
    }

    /// The place of A, B, C, U, V or W: degrees, or lengths in the unit in force.
    fn position_of_further(&self, axis: usize) -> Result<f64, Trouble> {
        let unknown = Trouble::UnknownPosition { axis: char::from(FURTHER_WORDS[axis]) };
        let scale = if FurtherAxes::is_rotary(axis) { 1.0 } else { self.scale() };
        self.further.programmed(axis).map(|place| place / scale).ok_or(unknown)
    }

    /// The number of the tool in the spindle.
    fn current_tool(&self) -> Result<f64, Trouble> {
        let what = "the tool in the spindle, which is known only after M6";
        let unknown = || Trouble::NotHere { what: what.to_owned() };
        self.modal.spindle_tool.map(f64::from).ok_or_else(unknown)
    }

    /// The G number of the motion in force, times ten.
    fn motion_mode(&self) -> f64 {
        match self.modal.mode {
            None => 800.0,
            Some(Mode::Rapid) => 0.0,
            Some(Mode::Feed | Mode::Polar { .. }) => 10.0,
            Some(Mode::Arc { clockwise: true }) => 20.0,
            Some(Mode::Arc { clockwise: false }) => 30.0,
            Some(Mode::Cycle(cycle)) => f64::from(cycle.number()) * 10.0,
            Some(Mode::Spline(spline)) => spline.number(),
            Some(Mode::Thread) => 330.0,
            Some(Mode::ThreadCycle) => 760.0,
            Some(Mode::Probe(probe)) => 380.0 + f64::from(probe.number()),
        }
    }
}

fn truth(is_true: bool) -> f64 {
    f64::from(u8::from(is_true))
}
