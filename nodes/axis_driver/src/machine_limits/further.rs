//! A, B, C, U, V and W of a controller, and what all axes allow along a direction.
//!
//! Their settings stand after those of X, Y and Z, in the order in which the controller names its
//! axes: in `XYZA` the travel of A is `$133`.

use super::{HOMING_ON, STEPS_PER_MM_DEFAULT, TRAVEL_AS_DELIVERED_MM};
use super::{LimitsProblem, MachineLimits, Range, Table};
use crate::driver::ControllerSettings;
use crate::firmware::TravelRule;
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::geometry::Position;

/// X, Y, Z, A, B, C, U, V and W, mm and degrees.
pub(crate) type Direction = [f64; 9];

/// One of A, B, C, U, V and W: degrees for the first three, mm for the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FurtherLimits {
    /// Its place among the settings: 3 where its travel is `$133`.
    pub place: u16,
    /// `$113`, per minute; infinite where it is not reported.
    pub rate_per_min: f64,
    /// `$123`, per s²; infinite where it is not reported.
    pub acceleration_per_s2: f64,
    /// `$803`, per s³; infinite where it is not reported.
    pub jerk_per_s3: f64,
    /// `$103`.
    pub steps: f64,
    /// `$133`; `None` where nobody has entered it.
    pub travel: Option<f64>,
    /// Least and greatest coordinate; `None` for an axis that is not homed.
    pub bounds: Option<[f64; 2]>,
}

/// A direction of all axes: that of X, Y and Z, and how far the others go.
pub(crate) fn direction(way: Position, further: FurtherAxes) -> Direction {
    let mut all = [0.0; 9];
    all[..3].copy_from_slice(&way);
    further.iter().for_each(|(axis, value)| all[3 + axis] = value);
    all
}

impl Table<'_> {
    /// What is reported of the further axes.
    pub(super) fn further(
        &self,
        settings: &ControllerSettings,
    ) -> Result<[Option<FurtherLimits>; 6], LimitsProblem> {
        let mut all = [None; 6];
        for (place, letter) in settings.axes.chars().enumerate().skip(3) {
            let (Some(axis), Ok(number)) = (FurtherAxes::index_of(letter), u16::try_from(place))
            else {
                continue;
            };
            let most =
                |base: u16| Ok(self.optional(base + number, Range::More)?.unwrap_or(f64::INFINITY));
            let travel = self.optional(130 + number, Range::ZeroOrMore)?;
            let is_as_delivered =
                |it: f64| !self.flag(20) && (it - TRAVEL_AS_DELIVERED_MM).abs() < 1e-9;
            let travel = travel.filter(|it| *it > 0.0 && !is_as_delivered(*it));
            let is_placed = self.mask(22) & HOMING_ON != 0
                && !matches!(settings.firmware.traits().travel, TravelRule::Unreported { .. })
                && self.is_axis_homed(place);
            all[axis] = Some(FurtherLimits {
                place: number,
                rate_per_min: most(110)?,
                acceleration_per_s2: most(120)?,
                jerk_per_s3: most(800)?,
                steps: self.optional(100 + number, Range::More)?.unwrap_or(STEPS_PER_MM_DEFAULT),
                travel,
                bounds: travel.filter(|_| is_placed).map(|it| self.bounds(settings, place, it)),
            });
        }
        Ok(all)
    }
}

impl MachineLimits {
    /// The greatest rate along a direction at which no axis exceeds its own, mm/min.
    pub(crate) fn rate_along(&self, unit: Direction) -> f64 {
        self.along(unit, self.rate_mm_per_min, |it| it.rate_per_min)
    }

    /// The same for the acceleration, mm/s².
    pub(crate) fn acceleration_along(&self, unit: Direction) -> f64 {
        self.along(unit, self.acceleration_mm_per_s2, |it| it.acceleration_per_s2)
    }

    /// The same for the jerk, mm/s³, where the firmware limits it.
    pub(crate) fn jerk_along(&self, unit: Direction) -> Option<f64> {
        self.jerk_mm_per_s3.map(|jerk| self.along(unit, jerk, |it| it.jerk_per_s3))
    }

    /// Why the time of a path that moves these axes may be wrong on this machine; nothing where it is known.
    pub(crate) fn time_doubts(&self, moved: FurtherAxes) -> Vec<String> {
        let of_axes = moved.iter().filter_map(|(axis, _)| self.further_doubt(axis));
        self.jerk_doubt().map(str::to_owned).into_iter().chain(of_axes).collect()
    }

    /// Which settings of an axis that a path moves are not reported: it counts as if nothing bounded it.
    fn further_doubt(&self, axis: usize) -> Option<String> {
        let FurtherLimits { place, rate_per_min, acceleration_per_s2, .. } = self.further[axis]?;
        let missing = [(110, rate_per_min), (120, acceleration_per_s2)];
        let missing = missing.into_iter().filter(|(_, value)| value.is_infinite());
        let missing: Vec<_> = missing.map(|(base, _)| format!("${}", base + place)).collect();
        let letter = FURTHER_LETTERS[axis];
        (!missing.is_empty()).then(|| {
            format!(
                "the time of moves of {letter}: {} not among the settings of the controller; the run takes longer than this",
                match missing.as_slice() {
                    [one] => format!("{one} is"),
                    all => format!("{} are", all.join(" and ")),
                }
            )
        })
    }

    /// grblHAL plans with a mean acceleration where it limits jerk. Its ramps follow other rules, and depend
    /// on `ACCELERATION_TICKS_PER_SECOND`, which no board reports (docs/machine.md, Time).
    fn jerk_doubt(&self) -> Option<&'static str> {
        self.jerk_mm_per_s3.map(|_| {
            "the time: the controller limits jerk ($800 and up); its ramps take longer than it plans, \
             some of them several times as long. The run takes longer than this; grblHAL \
             without ENABLE_JERK_ACCELERATION keeps to it"
        })
    }

    /// The most along a direction at which no axis exceeds its own.
    fn along(&self, unit: Direction, limits: Position, of: impl Fn(&FurtherLimits) -> f64) -> f64 {
        let share = |axis: usize| unit[axis].abs() / limits[axis];
        let mut worst = share(0).max(share(1)).max(share(2));
        for (axis, it) in self.further.iter().enumerate() {
            if let Some(it) = it {
                worst = worst.max(unit[3 + axis].abs() / of(it));
            }
        }
        match worst > 0.0 {
            true => 1.0 / worst,
            // Nothing moves, or nothing bounds what does.
            false => limits.into_iter().find(|it| it.is_infinite()).unwrap_or(limits[0]),
        }
    }
}
