//! The `$n=v` settings: their numbers, defaults, checks and print form.
//!
//! Knows each setting and its limits; the readers of a value know its effect. Units are grbl's:
//! millimetres, mm/min, mm/s², ms.

mod grblhal;
mod table;

use crate::axes::{AXES, Axes, AxisLetters};
use crate::codes::ErrorCode;
use crate::firmware::Firmware;
use crate::plant::SWITCHED_AXES;
use crate::tolerances::CHORD_MM_MIN;
use table::{SettingRow, rows};

/// All settings of a controller. Every value is finite and storable.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    firmware: Firmware,
    letters: AxisLetters,
    /// In the order of the firmware's table, by number.
    values: Vec<(u16, f64)>,
}

impl Default for Settings {
    /// The generic defaults of a freshly flashed grbl 1.1.
    fn default() -> Self {
        Self::of(Firmware::Grbl)
    }
}

impl Settings {
    /// The defaults of freshly flashed firmware.
    pub fn of(firmware: Firmware) -> Self {
        Self::made(firmware, AxisLetters::default(), |row| row.generic)
    }

    /// A small router: 600 x 400 x 100 mm, 5 m/min, 0.5 m/s², 24 000 rpm, `Bf` in its reports.
    pub fn small_router() -> Self {
        Self::small_router_of(Firmware::Grbl)
    }

    /// The same router with other firmware.
    pub fn small_router_of(firmware: Firmware) -> Self {
        Self::made(firmware, AxisLetters::default(), |row| row.router)
    }

    fn made(firmware: Firmware, letters: AxisLetters, value: impl Fn(&SettingRow) -> f64) -> Self {
        let rows = rows(firmware, letters.count());
        Self { firmware, letters, values: rows.map(|row| (row.number, value(row))).collect() }
    }

    /// The same with these axes; settings of new axes have the values of the small router.
    #[must_use]
    pub fn with_axes(self, letters: AxisLetters) -> Self {
        let known = |row: &SettingRow| self.get(row.number).unwrap_or(row.router);
        Self::made(self.firmware, letters, known)
    }

    /// The axes that the board has.
    pub fn letters(&self) -> AxisLetters {
        self.letters
    }

    /// The firmware that has these settings.
    pub fn firmware(&self) -> Firmware {
        self.firmware
    }

    fn place(&self, number: u16) -> Option<usize> {
        self.values.binary_search_by_key(&number, |(number, _)| *number).ok()
    }

    /// Returns the value of `$number`; `None` when the firmware has no such setting.
    pub fn get(&self, number: u16) -> Option<f64> {
        self.place(number).map(|at| self.values[at].1)
    }

    /// Stores `$number=value` as the firmware would.
    ///
    /// `$22=0` also clears `$20`.
    ///
    /// # Errors
    /// The firmware rejects the value. Rates, accelerations and steps of zero are rejected as
    /// [`ErrorCode::NegativeValue`]: grbl stores them and then divides by them.
    pub fn set(&mut self, number: u16, value: f64) -> Result<(), ErrorCode> {
        if !value.is_finite() {
            return Err(ErrorCode::BadNumber);
        }
        if number > 255 && self.place(number).is_none() {
            return Err(ErrorCode::InvalidStatement);
        }
        // A parking target is a machine coordinate.
        if value < 0.0 && number != 58 {
            return Err(ErrorCode::NegativeValue);
        }
        let at = self.place(number).ok_or(ErrorCode::InvalidStatement)?;
        let row =
            rows(self.firmware, self.letters.count()).nth(at).expect("each value has its row");
        let value = row.kind.stored(value);
        match number {
            0 if value < 3.0 => return Err(ErrorCode::StepPulseTooShort),
            20 if value != 0.0 && !self.homing_enabled() => {
                return Err(ErrorCode::SoftLimitNeedsHoming);
            }
            24 | 25 | 57 | 59 | 100..=125 if value <= 0.0 => return Err(ErrorCode::NegativeValue),
            42 if value >= self.letters.count() as f64 => return Err(ErrorCode::SettingOutOfRange),
            341 if value > 4.0 => return Err(ErrorCode::SettingOutOfRange),
            398 if !(30.0..=1000.0).contains(&value) => return Err(ErrorCode::SettingOutOfRange),
            481 if value != 0.0 && !(100.0..=1000.0).contains(&value) => {
                return Err(ErrorCode::SettingOutOfRange);
            }
            _ => {}
        }
        self.values[at].1 = value;
        if number == 22 && !self.homing_enabled() {
            let soft_limits = self.place(20).expect("all firmware has $20");
            self.values[soft_limits].1 = 0.0;
        }
        Ok(())
    }

    /// Returns the `$$` listing, one `$n=v` a line, without line ends.
    pub fn listing(&self) -> impl Iterator<Item = String> + '_ {
        rows(self.firmware, self.letters.count()).zip(&self.values).map(|(row, (_, value))| {
            format!("${}={}", row.number, row.kind.printed(*value, self.firmware))
        })
    }

    /// A setting that all firmware has.
    fn value(&self, number: u16) -> f64 {
        self.get(number).expect("all firmware has this setting")
    }

    /// A setting of grblHAL; zero elsewhere.
    fn extra(&self, number: u16) -> f64 {
        self.get(number).unwrap_or(0.0)
    }

    /// A setting of each axis; 1 for axes that the board does not have, which never move.
    fn axes(&self, first: u16) -> Axes {
        // They stand one after another, as far as there are axes.
        let values = self.place(first).map_or(&[][..], |at| &self.values[at..]);
        std::array::from_fn(|axis| match values.get(axis) {
            Some((number, value)) if *number == first + axis as u16 => *value,
            _ => 1.0,
        })
    }

    fn flag(&self, number: u16) -> bool {
        self.value(number) != 0.0
    }

    /// `$10`: the fields of reports.
    pub(crate) fn report_mask(&self) -> u16 {
        self.value(10) as u16
    }

    /// `$11`, millimetres.
    pub fn junction_deviation_mm(&self) -> f64 {
        self.value(11)
    }

    /// `$12`, millimetres, at least the deviation of the finest chord.
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

    /// `$21` bit 0; grbl has no other bits.
    pub fn hard_limits(&self) -> bool {
        self.value(21) as u16 & 1 != 0
    }

    /// `$22` bit 0; grbl has no other bits.
    pub fn homing_enabled(&self) -> bool {
        self.value(22) as u16 & 1 != 0
    }

    /// `$23`: does this axis home towards negative machine coordinates?
    pub fn homes_negative(&self, axis: usize) -> bool {
        axis < AXES && self.value(23) as u16 & (1 << axis) != 0
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

    /// `$32`: is the spindle a laser?
    pub fn is_laser(&self) -> bool {
        self.value(32) == 1.0
    }

    /// `$100` to `$102`, steps per millimetre.
    pub fn steps_per_mm(&self) -> Axes {
        self.axes(100)
    }

    /// `$110` to `$112`, mm/min.
    pub fn max_rate_mm_per_min(&self) -> Axes {
        self.axes(110)
    }

    /// `$120` to `$122`, mm/s².
    pub fn acceleration_mm_per_s2(&self) -> Axes {
        self.axes(120)
    }

    /// `$130` to `$132`, millimetres; an axis runs from minus this to zero.
    pub fn max_travel_mm(&self) -> Axes {
        self.axes(130)
    }

    /// Is this machine point within the travel of X, Y and Z? The others turn without end.
    pub fn within_travel(&self, point_in_machine: Axes) -> bool {
        let travel = self.max_travel_mm();
        (0..SWITCHED_AXES).all(|i| point_in_machine[i] <= 0.0 && point_in_machine[i] >= -travel[i])
    }
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

    #[test]
    fn each_firmware_has_its_own_settings_in_order() {
        for (firmware, last, report) in [
            (Firmware::Grbl, "$132=200.000", "$10=1"),
            (Firmware::FluidNc, "$132=200.000", "$10=1"),
            (Firmware::GrblHal, "$676=3", "$10=511"),
        ] {
            let listing: Vec<String> = Settings::of(firmware).listing().collect();
            assert_eq!(listing.last().map(String::as_str), Some(last), "{firmware}");
            assert!(listing.iter().any(|line| line == report), "{firmware}: {listing:?}");
            let numbers: Vec<u16> = listing
                .iter()
                .map(|line| line[1..].split('=').next().unwrap().parse().unwrap())
                .collect();
            assert!(numbers.is_sorted_by(|a, b| a < b), "{firmware}: {numbers:?}");
        }
    }
}
