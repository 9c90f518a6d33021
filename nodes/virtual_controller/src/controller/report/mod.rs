//! Everything that the controller prints: answers, messages, listings.
//!
//! `status` writes the status report; `cadence` decides which fields it has.

mod cadence;
mod status;

use super::Controller;
use crate::axes::{AXES, Axes};
use crate::codes::{Alarm, ErrorCode};
use crate::firmware::{BuildFacts, Feedback, Fields};
use crate::gcode::{Distance, FeedMode, Motion, Plane, Spindle, Units, system_name};
use crate::line::Line;
use crate::motion::mm_from_steps;

pub(super) use cadence::Cadence;

const MM_PER_INCH: f64 = 25.4;

impl Controller {
    pub(super) fn print(&mut self, text: &str) {
        self.transmit.extend_from_slice(text.as_bytes());
    }

    pub(super) fn line_out(&mut self, text: &str) {
        self.print(text);
        self.print("\r\n");
    }

    pub(super) fn answer(&mut self, result: Result<(), ErrorCode>) {
        match result {
            Ok(()) => self.line_out("ok"),
            Err(code) => self.line_out(&code.to_string()),
        }
    }

    /// Repeats a line as it was read.
    pub(super) fn echo(&mut self, line: &Line) {
        let text = match line {
            Line::Text(text) => text.as_str(),
            Line::Remark | Line::TooLong => "",
        };
        self.line_out(&format!("[echo: {text}]"));
    }

    pub(super) fn feedback(&mut self, feedback: Feedback) {
        self.line_out((self.traits().feedback)(feedback));
    }

    pub(super) fn alarm(&mut self, alarm: Alarm) {
        self.alarm = Some(alarm);
        self.counts.alarms += 1;
        self.line_out(&format!("ALARM:{}", alarm.0));
    }

    /// A length in the units of `$13`.
    fn length(&self, mm: f64) -> String {
        // Zero is never printed with a sign.
        let text = if self.memory.settings.reports_inches() {
            format!("{:.4}", mm / MM_PER_INCH)
        } else {
            format!("{mm:.3}")
        };
        match text.strip_prefix('-') {
            Some(digits) if digits.bytes().all(|b| matches!(b, b'0' | b'.')) => digits.to_string(),
            _ => text,
        }
    }

    fn rate(&self, mm_per_min: f64) -> String {
        if self.memory.settings.reports_inches() {
            format!("{:.1}", mm_per_min / MM_PER_INCH)
        } else {
            format!("{mm_per_min:.0}")
        }
    }

    /// All axes; those that turn are in degrees in both units.
    fn vector(&self, mm: Axes) -> String {
        let letters = self.memory.settings.letters();
        let shown = |axis: usize| match letters.is_rotary(axis) && self.reports_inches() {
            true => self.length(mm[axis] * MM_PER_INCH),
            false => self.length(mm[axis]),
        };
        (0..letters.count()).map(shown).collect::<Vec<_>>().join(",")
    }

    fn reports_inches(&self) -> bool {
        self.memory.settings.reports_inches()
    }

    pub(super) fn report_help(&mut self) {
        self.line_out("[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]");
    }

    pub(super) fn report_settings(&mut self) {
        let lines: Vec<String> = self.memory.settings.listing().collect();
        lines.iter().for_each(|line| self.line_out(line));
    }

    pub(super) fn report_build(&mut self) {
        let lines = (self.traits().build_info)(&BuildFacts {
            note: &self.memory.build_info,
            has_line_numbers: self.build.has_line_numbers,
            has_mist: self.vocabulary().has_mist,
            has_spindle_sync: self.vocabulary().has_spindle_sync,
            ports: self.vocabulary().ports,
            blocks_max: self.planner.blocks_max(),
            receive_buffer_bytes: self.build.receive_buffer_bytes(),
            settings: &self.memory.settings,
        });
        lines.iter().for_each(|line| self.line_out(line));
    }

    pub(super) fn report_startup_lines(&mut self) {
        for (index, line) in self.memory.startup.clone().iter().enumerate() {
            self.line_out(&format!("$N{index}={line}"));
        }
    }

    pub(super) fn report_offsets(&mut self) {
        let systems = self.memory.systems.clone();
        for (index, offset) in systems.work.iter().enumerate().take(self.vocabulary().systems) {
            let text = self.vector(*offset);
            self.line_out(&format!("[{}:{text}]", system_name(index)));
        }
        for (name, at) in [("G28", systems.g28), ("G30", systems.g30), ("G92", self.parser.g92)] {
            let text = self.vector(at);
            self.line_out(&format!("[{name}:{text}]"));
        }
        let settings = &self.memory.settings;
        if self.traits().has_long_listings && settings.homing_enabled() {
            let at = self.vector(crate::homing::position_after_homing([0.0; AXES], settings));
            let homed = if self.is_homed { 7 } else { 0 };
            self.line_out(&format!("[HOME:{at}:{homed}]"));
        }
        let text = self.length(self.parser.tool_length);
        self.line_out(&format!("[TLO:{text}]"));
        self.report_probe();
    }

    pub(super) fn report_probe(&mut self) {
        let (steps, success) = self.probed;
        let text = self.vector(mm_from_steps(steps, &self.memory.settings));
        self.line_out(&format!("[PRB:{text}:{}]", u8::from(success)));
    }

    /// `$G`.
    pub(super) fn report_parser_state(&mut self) {
        let text = self.parser_state();
        self.line_out(&text);
    }

    /// The parser state after a status report, if the settings ask for it and it has changed.
    fn report_changed_parser_state(&mut self, fields: Fields) {
        let text = self.parser_state();
        if fields.parser_state && text != self.reported_parser_state {
            self.line_out(&text);
            self.reported_parser_state = text;
        }
    }

    fn parser_state(&self) -> String {
        let modal = self.parser.modal;
        let motion = match modal.motion {
            Motion::Rapid => "G0",
            Motion::Line => "G1",
            Motion::ArcClockwise => "G2",
            Motion::ArcCounterclockwise => "G3",
            Motion::Probe { away: false, miss_is_fine: false } => "G38.2",
            Motion::Probe { away: false, miss_is_fine: true } => "G38.3",
            Motion::Probe { away: true, miss_is_fine: false } => "G38.4",
            Motion::Probe { away: true, miss_is_fine: true } => "G38.5",
            Motion::Thread => "G33",
            Motion::None => "G80",
        };
        let plane = match modal.plane {
            Plane::Xy => "G17",
            Plane::Zx => "G18",
            Plane::Yz => "G19",
        };
        let units = if modal.units == Units::Inches { "G20" } else { "G21" };
        let distance = if modal.distance == Distance::Absolute { "G90" } else { "G91" };
        let feed_mode = if modal.feed_mode == FeedMode::InverseTime { "G93" } else { "G94" };
        let spindle = match modal.spindle {
            Spindle::Clockwise => "M3",
            Spindle::Counterclockwise => "M4",
            Spindle::Off => "M5",
        };
        let coolant = match (modal.coolant.mist, modal.coolant.flood) {
            (false, false) => "M9",
            (true, false) => "M7",
            (false, true) => "M8",
            (true, true) => "M7 M8",
        };
        let system = system_name(modal.coordinate_system);
        let more = match (self.traits().has_long_listings, self.parser.tool_length != 0.0) {
            (false, _) => "",
            (true, false) => " G49 G98 G50",
            (true, true) => " G43.1 G98 G50",
        };
        let (tool, rpm) = (self.parser.tool, self.parser.spindle_rpm);
        let feed = self.rate(self.parser.feed);
        format!(
            "[GC:{motion} {system} {plane} {units} {distance} {feed_mode}{more} {spindle} \
             {coolant} T{tool} F{feed} S{rpm:.0}]"
        )
    }
}
