//! The axes besides X, Y and Z: which the board has, and where they are.
//!
//! `[AXS:4:XYZA]` gives their letters. A board that prints none of it has as many as its reports
//! have values, and calls them A, B and C.

use super::machine::Machine;
use crate::path_watch::FurtherFrame;
use crate::report::{ReportUnits, StatusReport};
use cnc_msgs::contour::work_system;
use cnc_msgs::further::{FURTHER_LETTERS, FurtherAxes};
use cnc_msgs::machine::FurtherPlaces;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What the board has said of its further axes.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(in crate::driver) struct FurtherState {
    /// `XYZA`, where the board names its axes.
    letters: Option<String>,
    /// The most values after X, Y and Z that a report has had.
    count: usize,
    /// The last work offset of each of them, as it was printed.
    offset: Vec<f64>,
    machine: FurtherAxes,
    work: FurtherAxes,
    /// The machine places of the report before.
    #[serde(default, skip_serializing_if = "FurtherAxes::is_empty")]
    before: FurtherAxes,
    /// The stored offsets by their names, as they were printed, where they have values after X, Y
    /// and Z.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    stored: BTreeMap<String, Vec<f64>>,
}

impl FurtherState {
    /// The index of each value after X, Y and Z in [`FurtherAxes`]; `None` for a letter that is
    /// not known.
    fn axes(&self) -> Vec<Option<usize>> {
        match &self.letters {
            Some(letters) => letters.chars().skip(3).map(FurtherAxes::index_of).collect(),
            None => (0..self.count.min(3)).map(Some).collect(),
        }
    }

    /// The axes that the board has, as the bits of [`FurtherAxes`].
    fn bits(&self) -> u8 {
        self.axes().into_iter().flatten().fold(0, |bits, axis| bits | 1 << axis)
    }

    fn on_letters(&mut self, letters: &str) {
        self.letters = Some(letters.to_owned());
    }

    fn keep_offset(&mut self, report: &StatusReport) {
        if report.work_offset.is_some() {
            self.offset.clone_from(&report.further_offset);
        }
    }

    /// Values after X, Y and Z, as they are printed: degrees, and lengths in these units.
    fn read(&self, values: &[f64], units: ReportUnits) -> FurtherAxes {
        self.axes().iter().zip(values).fold(FurtherAxes::NONE, |all, (axis, value)| match axis {
            Some(axis) if FurtherAxes::is_rotary(*axis) => all.with(*axis, *value),
            Some(axis) => all.with(*axis, value * units.millimetres()),
            None => all,
        })
    }

    /// Takes what a report says of them.
    fn on_status(&mut self, report: &StatusReport, units: ReportUnits) {
        self.count = self.count.max(report.further.len()).min(FURTHER_LETTERS.len());
        self.keep_offset(report);
        let (is, offset) = (self.read(&report.further, units), self.read(&self.offset, units));
        let shifted = |sign: f64| match offset.bits() == is.bits() {
            true => is.map(|axis, value| value + sign * offset.get(axis).unwrap_or(0.0)),
            false => FurtherAxes::NONE,
        };
        self.before = self.machine;
        (self.machine, self.work) = match report.machine_position.is_some() {
            true => (is, shifted(-1.0)),
            false => (shifted(1.0), is),
        };
    }
}

impl Machine {
    pub(in crate::driver) fn on_further_letters(&mut self, letters: &str) {
        self.further.on_letters(letters);
    }

    /// The values of a stored offset after X, Y and Z.
    pub(in crate::driver) fn on_further_offset(&mut self, name: &str, values: &[f64]) {
        if !values.is_empty() {
            self.further.stored.insert(name.to_owned(), values.to_vec());
        }
    }

    fn report_units(&self) -> ReportUnits {
        match self.reports_in_inches() {
            true => ReportUnits::Inches,
            false => ReportUnits::Millimetres,
        }
    }

    /// Before the other position is worked out from the offset.
    pub(in crate::driver) fn on_further_status(&mut self, report: &StatusReport) {
        let units = self.report_units();
        self.further.on_status(report, units);
    }

    /// The offset of these axes in the newest report, as far as it can be compared with the machine
    /// frame; none where it has no work offset.
    pub(in crate::driver) fn further_offset_shown(&self) -> FurtherAxes {
        let report = self.status.as_ref().filter(|_| self.shown.work_offset.is_some());
        report.map_or(FurtherAxes::NONE, |report| {
            self.comparable(self.further.read(&report.further_offset, self.report_units()))
        })
    }

    /// Values after X, Y and Z, as they are printed.
    pub(in crate::driver) fn read_further(&self, values: &[f64]) -> FurtherAxes {
        self.further.read(values, self.report_units())
    }

    /// A stored offset of these axes by its name; none where it was not reported.
    pub(in crate::driver) fn further_stored(&self, name: &str) -> FurtherAxes {
        let values = self.further.stored.get(name);
        values.map_or(FurtherAxes::NONE, |values| self.read_further(values))
    }

    /// The letter of each axis of the board, in the order of its settings: `XYZA`.
    pub(in crate::driver) fn axis_letters(&self) -> String {
        match &self.further.letters {
            Some(letters) => letters.clone(),
            None => "XYZABC".chars().take(3 + self.further.count).collect(),
        }
    }

    /// The offsets of these axes as they are known now.
    pub(in crate::driver) fn further_frame(&self) -> FurtherFrame {
        let shift = self.further_stored("G92");
        let system = |index: usize| {
            let zero = self.further_stored(&work_system(index as u8 + 1));
            let known =
                zero.iter().filter_map(|(axis, zero)| Some((axis, zero + shift.get(axis)?)));
            known.collect()
        };
        let FurtherState { machine, work, .. } = self.further;
        let both = machine.iter().filter_map(|(axis, at)| Some((axis, at - work.get(axis)?)));
        let in_force = both.collect();
        FurtherFrame { systems: std::array::from_fn(system), shift, in_force }
    }

    /// The axes that the board has besides X, Y and Z, as the bits of [`FurtherAxes`].
    pub(in crate::driver) fn further_axes(&self) -> u8 {
        self.further.bits()
    }

    /// How far a step of one moves it, mm or degrees (`$103` and up); where the controller does not
    /// say so, more than that of most.
    pub(in crate::driver) fn further_step(&self, axis: usize) -> f64 {
        let index = self.further.axes().into_iter().position(|is| is == Some(axis));
        let number = index.and_then(|index| u16::try_from(103 + index).ok());
        let steps = number.and_then(|number| self.settings.get(&number)).copied();
        steps.filter(|steps| *steps > 0.0).map_or(0.2, f64::recip)
    }

    /// A reset may have changed it.
    pub(super) fn forget_further_offset(&mut self) {
        self.further.offset.clear();
    }

    /// Where they stand, as far as two reports in a row have said it: one may be damaged.
    pub(in crate::driver) fn further_standing(&self) -> FurtherAxes {
        let before = self.further.before;
        self.further_machine().iter().filter(|&(axis, at)| before.get(axis) == Some(at)).collect()
    }

    /// A report that is not believed has an offset all the same.
    pub(in crate::driver) fn keep_further_offset(&mut self, report: &StatusReport) {
        self.further.keep_offset(report);
    }

    /// Where they are in the machine frame, as far as reports can be compared with it.
    pub(in crate::driver) fn further_machine(&self) -> FurtherAxes {
        self.comparable(self.further.machine)
    }

    /// Where they are in the work frame, as far as it is known.
    pub(in crate::driver) fn further_work(&self) -> FurtherAxes {
        self.comparable(self.further.work)
    }

    /// Those of these axes that homing leaves out, and where they say they are, work frame. What they
    /// have lost in an alarm stays lost.
    pub(in crate::driver) fn not_homed(&self, moved: u8) -> FurtherAxes {
        let order = self.further.axes();
        let is_homed = |axis: usize| {
            let bit = order.iter().position(|it| *it == Some(axis)).map(|index| index + 3);
            let mask = |pass: &String| pass.parse::<f64>().unwrap_or(0.0) as u32;
            // Only grblHAL says which axes home; the others home X, Y and Z.
            let mut passes = (44..=49).filter_map(|setting| self.reported.get(&setting)).map(mask);
            bit.is_some_and(|bit| passes.any(|mask| mask >> bit & 1 == 1))
        };
        let is_left = |axis: usize| moved >> axis & 1 == 1 && !is_homed(axis);
        self.further_work().iter().filter(|(axis, _)| is_left(*axis)).collect()
    }

    /// In inches builds of grblHAL print angles like lengths, and others as degrees.
    fn comparable(&self, axes: FurtherAxes) -> FurtherAxes {
        let is_printed = |axis: usize| !self.reports_in_inches() || !FurtherAxes::is_rotary(axis);
        axes.iter().filter(|(axis, _)| is_printed(*axis)).collect()
    }

    /// Where they are, as far as it is known; `None` where the board has none.
    pub(in crate::driver) fn further_places(&self) -> Option<Box<FurtherPlaces>> {
        let FurtherState { machine, work, .. } = self.further;
        let places = FurtherPlaces { machine, work };
        (places != FurtherPlaces::default()).then(|| Box::new(places))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Message, Report, parse};

    fn report(text: &str, units: ReportUnits) -> StatusReport {
        match parse(text.as_bytes(), units) {
            Report::Status(report) => *report,
            other => panic!("{text} is {other:?}"),
        }
    }

    #[test]
    fn a_board_has_the_axes_that_it_names_or_as_many_as_it_reports() {
        for (letters, text, bits, machine, work) in [
            (None, "<Idle|MPos:1.000,2.000,3.000|WCO:1.000,0.000,0.000>", 0, "", ""),
            (None, "<Idle|MPos:1.000,2.000,3.000,90.000>", 0b1, " A90", ""),
            (
                None,
                "<Idle|MPos:0.000,0.000,0.000,90.000,-5.000|WCO:0.000,0.000,0.000,30.000,1.000>",
                0b11,
                " A90 B-5",
                " A60 B-6",
            ),
            (
                Some("XYZU"),
                "<Idle|WPos:0.000,0.000,0.000,2.500|WCO:0.000,0.000,0.000,1.000>",
                0b1000,
                " U3.5",
                " U2.5",
            ),
            (Some("XYZCM"), "<Idle|MPos:0.000,0.000,0.000,7.000,8.000>", 0b100, " C7", ""),
        ] {
            let mut machine_model = Machine::default();
            if let Some(letters) = letters {
                machine_model.on_message(&Message::Axes(letters.to_owned()));
            }
            machine_model.on_status(report(text, ReportUnits::Millimetres));
            assert_eq!(machine_model.further_axes(), bits, "{text}");
            let places = machine_model.further_places().unwrap_or_default();
            let shown = (places.machine.words(), places.work.words());
            assert_eq!((shown.0.as_str(), shown.1.as_str()), (machine, work), "{text}");
        }
    }

    #[test]
    fn degrees_are_degrees_in_a_report_in_inches() {
        let mut machine = Machine::default();
        machine.on_setting(13, "1");
        machine.on_message(&Message::Axes("XYZAU".to_owned()));
        let text = "<Idle|MPos:1.0000,0.0000,0.0000,90.000,1.0000>";
        let report = report(text, ReportUnits::Inches);
        assert_eq!(report.machine_position, Some([25.4, 0.0, 0.0]));
        assert_eq!(report.shown_in, Some(ReportUnits::Inches));
        machine.on_status(report);
        assert_eq!(machine.further_places().unwrap().machine.words(), " A90 U25.4");
    }
}
