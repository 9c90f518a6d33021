//! The `$n=v` settings: their numbers, defaults, checks and print form.
//!
//! Knows one value per setting and what it may be; what a value does belongs
//! to whoever reads it. Units are grbl's: millimetres, mm/min, mm/s², ms.

use crate::axes::{AXES, Vector};
use crate::codes::ErrorCode;
use crate::tolerances::CHORD_MM_MIN;

/// How a setting is stored and printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// 0 to 255, or a mask.
    Integer,
    /// 0 or 1.
    Boolean,
    /// Three decimals.
    Float,
    /// A float printed without decimals.
    Rpm,
}

use Kind::{Boolean, Float, Integer, Rpm};

/// Number, kind, default of a bare grbl, default of the small router.
const TABLE: &[(u8, Kind, f64, f64)] = &[
    (0, Integer, 10.0, 10.0),
    (1, Integer, 25.0, 255.0),
    (2, Integer, 0.0, 0.0),
    (3, Integer, 0.0, 0.0),
    (4, Boolean, 0.0, 0.0),
    (5, Boolean, 0.0, 0.0),
    (6, Boolean, 0.0, 0.0),
    (10, Integer, 1.0, 3.0),
    (11, Float, 0.010, 0.010),
    (12, Float, 0.002, 0.002),
    (13, Boolean, 0.0, 0.0),
    (20, Boolean, 0.0, 0.0),
    (21, Boolean, 0.0, 0.0),
    (22, Boolean, 0.0, 0.0),
    (23, Integer, 0.0, 0.0),
    (24, Float, 25.0, 100.0),
    (25, Float, 500.0, 2000.0),
    (26, Integer, 250.0, 100.0),
    (27, Float, 1.0, 2.0),
    (30, Rpm, 1000.0, 24000.0),
    (31, Rpm, 0.0, 0.0),
    (32, Boolean, 0.0, 0.0),
    (100, Float, 250.0, 250.0),
    (101, Float, 250.0, 250.0),
    (102, Float, 250.0, 250.0),
    (110, Float, 500.0, 5000.0),
    (111, Float, 500.0, 5000.0),
    (112, Float, 500.0, 2000.0),
    (120, Float, 10.0, 500.0),
    (121, Float, 10.0, 500.0),
    (122, Float, 10.0, 200.0),
    (130, Float, 200.0, 600.0),
    (131, Float, 200.0, 400.0),
    (132, Float, 200.0, 100.0),
];

/// All settings of a controller. Every value is finite, not negative and storable.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    values: Vec<f64>,
}

impl Default for Settings {
    /// The generic defaults a freshly flashed grbl 1.1 comes with.
    fn default() -> Self {
        Self { values: TABLE.iter().map(|row| row.2).collect() }
    }
}

impl Settings {
    /// A small router: 600 x 400 x 100 mm, 5 m/min, 0.5 m/s², 24 000 rpm, `Bf` in its reports.
    pub fn small_router() -> Self {
        Self { values: TABLE.iter().map(|row| row.3).collect() }
    }

    /// Returns the value of `$number`, `None` when there is no such setting.
    pub fn get(&self, number: u8) -> Option<f64> {
        row(number).map(|at| self.values[at])
    }

    /// Stores `$number=value` as `grbl` would, or says why not.
    ///
    /// `$22=0` also clears `$20`. Rates, accelerations and steps of zero are
    /// refused as [`ErrorCode::NegativeValue`]: grbl stores them and then
    /// divides by them.
    pub fn set(&mut self, number: u8, value: f64) -> Result<(), ErrorCode> {
        if !value.is_finite() {
            return Err(ErrorCode::BadNumber);
        }
        if value < 0.0 {
            return Err(ErrorCode::NegativeValue);
        }
        let at = row(number).ok_or(ErrorCode::InvalidStatement)?;
        let value = match TABLE[at].1 {
            // The debounce delay is the one setting of 16 bits.
            Integer if number == 26 => value.trunc().min(65535.0),
            Integer => value.trunc().min(255.0),
            Boolean => f64::from(u8::from(value.trunc() != 0.0)),
            Float | Rpm => value,
        };
        match number {
            0 if value < 3.0 => return Err(ErrorCode::StepPulseTooShort),
            20 if value != 0.0 && !self.homing_enabled() => {
                return Err(ErrorCode::SoftLimitNeedsHoming);
            }
            24 | 25 | 100..=122 if value <= 0.0 => return Err(ErrorCode::NegativeValue),
            _ => {}
        }
        self.values[at] = value;
        if number == 22 && value == 0.0 {
            self.values[row(20).expect("$20 is in the table")] = 0.0;
        }
        Ok(())
    }

    /// Returns the `$$` listing, one `$n=v` a line, without line ends.
    pub fn listing(&self) -> impl Iterator<Item = String> + '_ {
        TABLE.iter().zip(&self.values).map(|((number, kind, ..), value)| match kind {
            Float => format!("${number}={value:.3}"),
            Integer | Boolean | Rpm => format!("${number}={value:.0}"),
        })
    }

    fn value(&self, number: u8) -> f64 {
        self.get(number).expect("only settings of the table are asked for")
    }

    fn axes(&self, first: u8) -> Vector {
        [self.value(first), self.value(first + 1), self.value(first + 2)]
    }

    fn flag(&self, number: u8) -> bool {
        self.value(number) != 0.0
    }

    /// `$10` bit 0: reports carry `MPos`, else `WPos`.
    pub fn reports_machine_position(&self) -> bool {
        self.value(10) as u8 & 1 != 0
    }

    /// `$10` bit 1: reports carry `Bf`.
    pub fn reports_buffers(&self) -> bool {
        self.value(10) as u8 & 2 != 0
    }

    /// `$11`, millimetres.
    pub fn junction_deviation_mm(&self) -> f64 {
        self.value(11)
    }

    /// `$12`, millimetres, not below the finest chord there is.
    pub fn arc_tolerance_mm(&self) -> f64 {
        self.value(12).max(CHORD_MM_MIN)
    }

    /// `$13`.
    pub fn reports_inches(&self) -> bool {
        self.flag(13)
    }

    /// `$20`.
    pub fn soft_limits(&self) -> bool {
        self.flag(20)
    }

    /// `$21`.
    pub fn hard_limits(&self) -> bool {
        self.flag(21)
    }

    /// `$22`.
    pub fn homing_enabled(&self) -> bool {
        self.flag(22)
    }

    /// `$23`: does this axis home towards negative machine coordinates?
    pub fn homes_negative(&self, axis: usize) -> bool {
        axis < AXES && self.value(23) as u8 & (1 << axis) != 0
    }

    /// `$24`, mm/min.
    pub fn homing_locate_mm_per_min(&self) -> f64 {
        self.value(24)
    }

    /// `$25`, mm/min.
    pub fn homing_seek_mm_per_min(&self) -> f64 {
        self.value(25)
    }

    /// `$26`, seconds.
    pub fn homing_debounce_s(&self) -> f64 {
        self.value(26) / 1000.0
    }

    /// `$27`, millimetres.
    pub fn homing_pull_off_mm(&self) -> f64 {
        self.value(27)
    }

    /// `$30`, rpm.
    pub fn spindle_max_rpm(&self) -> f64 {
        self.value(30)
    }

    /// `$31`, rpm.
    pub fn spindle_min_rpm(&self) -> f64 {
        self.value(31)
    }

    /// `$100` to `$102`, steps per millimetre.
    pub fn steps_per_mm(&self) -> Vector {
        self.axes(100)
    }

    /// `$110` to `$112`, mm/min.
    pub fn max_rate_mm_per_min(&self) -> Vector {
        self.axes(110)
    }

    /// `$120` to `$122`, mm/s².
    pub fn acceleration_mm_per_s2(&self) -> Vector {
        self.axes(120)
    }

    /// `$130` to `$132`, millimetres; an axis runs from minus this to zero.
    pub fn max_travel_mm(&self) -> Vector {
        self.axes(130)
    }

    /// Is this machine point within the travel of all axes?
    pub fn within_travel(&self, point_in_machine: Vector) -> bool {
        let travel = self.max_travel_mm();
        (0..AXES).all(|i| point_in_machine[i] <= 0.0 && point_in_machine[i] >= -travel[i])
    }
}

fn row(number: u8) -> Option<usize> {
    TABLE.iter().position(|row| row.0 == number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_refuse_with_the_codes_of_grbl() {
        let cases = [
            (0, 2.0, ErrorCode::StepPulseTooShort),
            (20, 1.0, ErrorCode::SoftLimitNeedsHoming),
            (11, -0.1, ErrorCode::NegativeValue),
            (110, 0.0, ErrorCode::NegativeValue),
            (99, 1.0, ErrorCode::InvalidStatement),
            (110, f64::NAN, ErrorCode::BadNumber),
        ];
        for (number, value, expected) in cases {
            let mut settings = Settings::default();
            assert_eq!(settings.set(number, value), Err(expected), "${number}={value}");
            assert_eq!(settings, Settings::default(), "a refused setting changes nothing");
        }
    }

    #[test]
    fn switching_homing_off_switches_soft_limits_off() {
        let mut settings = Settings::default();
        settings.set(22, 1.0).unwrap();
        settings.set(20, 1.0).unwrap();
        settings.set(22, 0.0).unwrap();
        assert!(!settings.soft_limits());
    }
}
