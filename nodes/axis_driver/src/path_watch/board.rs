//! What the board has said of itself, and how closely its reports can be judged.

use super::moves::Way;
use super::speed::Rates;
use super::tolerances::{
    ARC_DRAWN_MM, ARC_TOLERANCES, LAST_PLACES, PATH_MM, REPORT_INCH_MM, REPORT_MM, ROUNDED_NUMBERS,
    STEP_MM_UNKNOWN, STEPS,
};
use crate::report::ReportUnits;
use cnc_msgs::geometry::Position;

/// What the board has said of itself, as far as positions depend on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Board {
    /// Lines that the planner holds, where it says so.
    pub planner_blocks: Option<u16>,
    /// `$12`, mm.
    pub arc_tolerance_mm: f64,
    /// `$100` to `$102`.
    pub steps_per_mm: [Option<f64>; 3],
    /// How far a step moves each of the further axes, degrees or mm.
    pub further_steps: [f64; 6],
    /// The unit that reports are printed in.
    pub units: ReportUnits,
    pub rates: Rates,
    /// The least and the most that the spindle turns at (`$31`, `$30`), 1/min.
    pub speeds: [f64; 2],
}

impl Board {
    /// The largest step of an axis, mm.
    pub(super) fn step_mm(&self) -> f64 {
        self.steps_mm().into_iter().fold(0.0, f64::max)
    }

    fn steps_mm(&self) -> [f64; 3] {
        self.steps_per_mm.map(|steps| match steps {
            Some(steps) if steps > 0.0 => 1.0 / steps,
            _ => STEP_MM_UNKNOWN,
        })
    }

    pub(super) fn rounding_mm(&self) -> f64 {
        ROUNDED_NUMBERS
            * match self.units {
                ReportUnits::Millimetres => REPORT_MM,
                ReportUnits::Inches => REPORT_INCH_MM,
            }
    }

    /// How far a position may be off a way, mm.
    pub(super) fn tolerance_mm(&self, way: &Way, position: Position) -> f64 {
        let [x, y, z] = self.steps_mm();
        let steps = STEPS * x.hypot(y).hypot(z);
        let largest = position.iter().fold(0f64, |most, value| most.max(value.abs()));
        let places = LAST_PLACES * largest * f64::from(f32::EPSILON);
        let drawn = match way {
            Way::Arc(_) => ARC_DRAWN_MM + ARC_TOLERANCES * self.arc_tolerance_mm,
            Way::Line { .. } | Way::Anywhere => 0.0,
        };
        PATH_MM + self.rounding_mm() + steps + places + drawn
    }
}
