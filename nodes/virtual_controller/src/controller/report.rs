//! Everything the controller prints.

use super::{Controller, Door, State};
use crate::axes::{AXES, AXIS_LETTERS, Vector, subtract};
use crate::codes::{Alarm, ErrorCode};
use crate::gcode::{Distance, FeedMode, Motion, Plane, Spindle, Units};
use crate::motion::{BLOCKS_MAX, mm_from_steps};
use crate::receive::RECEIVE_BUFFER_BYTES;

const MM_PER_INCH: f64 = 25.4;

/// Counts reports until `WCO` and `Ov` are due again.
#[derive(Debug, Clone, Default)]
pub(super) struct Cadence {
    until_offsets: u8,
    until_overrides: u8,
}

impl Cadence {
    pub(super) fn offsets_changed(&mut self) {
        self.until_offsets = 0;
    }

    pub(super) fn overrides_changed(&mut self) {
        self.until_overrides = 0;
    }

    /// Every 10 reports at rest, 30 in motion.
    fn offsets_due(&mut self, is_busy: bool) -> bool {
        if self.until_offsets > 0 {
            self.until_offsets -= 1;
            return false;
        }
        self.until_offsets = if is_busy { 29 } else { 9 };
        // Never both in one report.
        self.until_overrides = self.until_overrides.max(1);
        true
    }

    /// Every 10 reports at rest, 20 in motion.
    fn overrides_due(&mut self, is_busy: bool) -> bool {
        if self.until_overrides > 0 {
            self.until_overrides -= 1;
            return false;
        }
        self.until_overrides = if is_busy { 19 } else { 9 };
        true
    }
}

impl Controller {
    pub(super) fn print(&mut self, text: &str) {
        self.transmit.extend_from_slice(text.as_bytes());
    }

    fn line_out(&mut self, text: &str) {
        self.print(text);
        self.print("\r\n");
    }

    pub(super) fn answer(&mut self, result: Result<(), ErrorCode>) {
        match result {
            Ok(()) => self.line_out("ok"),
            Err(code) => self.line_out(&code.to_string()),
        }
    }

    pub(super) fn message(&mut self, text: &str) {
        self.line_out(&format!("[MSG:{text}]"));
    }

    pub(super) fn alarm(&mut self, alarm: Alarm) {
        self.line_out(&format!("ALARM:{}", alarm as u8));
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

    fn vector(&self, mm: Vector) -> String {
        mm.map(|component| self.length(component)).join(",")
    }

    fn state_name(&self) -> String {
        match &self.state {
            State::Idle => "Idle".into(),
            State::Alarm { .. } => "Alarm".into(),
            State::Check => "Check".into(),
            State::Homing(_) => "Home".into(),
            State::Run => "Run".into(),
            State::Hold { is_stopped } => format!("Hold:{}", u8::from(!is_stopped)),
            State::SoftLimit => "Hold:1".into(),
            State::Jog { .. } => "Jog".into(),
            State::Sleep => "Sleep".into(),
            State::Door(Door::Stopping { .. }) => "Door:2".into(),
            State::Door(Door::Stopped) => format!("Door:{}", u8::from(self.plant.is_door_open)),
            State::Door(Door::Resuming { .. }) => "Door:3".into(),
        }
    }

    /// `?`.
    pub(super) fn report_status(&mut self) {
        let settings = &self.memory.settings;
        let machine = self.position();
        let offset = self.parser.work_offset(&self.memory.systems);
        let mut text = format!("<{}", self.state_name());
        text += &match settings.reports_machine_position() {
            true => format!("|MPos:{}", self.vector(machine)),
            false => format!("|WPos:{}", self.vector(subtract(machine, offset))),
        };
        if settings.reports_buffers() {
            text += &format!("|Bf:{},{}", self.planner.free(), self.receive_buffer.free());
        }
        let line_number = self.planner.line_number();
        if self.build.has_line_numbers && line_number > 0 {
            text += &format!("|Ln:{line_number}");
        }
        let rate = self.rate(self.planner.speed_mm_per_min());
        text += &format!("|FS:{rate},{:.0}", self.spindle_output_rpm());
        let pins = self.pins(machine);
        if !pins.is_empty() {
            text += &format!("|Pn:{pins}");
        }
        let is_busy =
            !matches!(self.state, State::Idle | State::Alarm { .. } | State::Check | State::Sleep);
        if self.cadence.offsets_due(is_busy) {
            text += &format!("|WCO:{}", self.vector(offset));
        }
        if self.cadence.overrides_due(is_busy) {
            let overrides = self.planner.overrides();
            text += &format!(
                "|Ov:{},{},{}",
                overrides.feed_percent, overrides.rapid_percent, self.spindle_percent
            );
            let accessories = self.accessories();
            if !accessories.is_empty() {
                text += &format!("|A:{accessories}");
            }
        }
        self.line_out(&format!("{text}>"));
    }

    fn is_spindle_turning(&self) -> bool {
        let is_off_for_door = matches!(self.state, State::Door(Door::Stopped));
        self.spindle != Spindle::Off && !self.is_spindle_stopped && !is_off_for_door
    }

    /// What the spindle is told to turn, rpm.
    fn spindle_output_rpm(&self) -> f64 {
        if !self.is_spindle_turning() || self.spindle_rpm <= 0.0 {
            return 0.0;
        }
        let settings = &self.memory.settings;
        let wanted = self.spindle_rpm * f64::from(self.spindle_percent) / 100.0;
        wanted.max(settings.spindle_min_rpm()).min(settings.spindle_max_rpm())
    }

    fn accessories(&self) -> String {
        let mut text = String::new();
        if self.is_spindle_turning() {
            text.push(if self.spindle == Spindle::Clockwise { 'S' } else { 'C' });
        }
        if self.coolant.flood {
            text.push('F');
        }
        if self.coolant.mist {
            text.push('M');
        }
        text
    }

    fn pins(&self, machine: Vector) -> String {
        let mut text = String::new();
        if self.plant.touches_probe(machine) {
            text.push('P');
        }
        let pressed = self.plant.pressed(machine, &self.memory.settings);
        text.extend((0..AXES).filter(|&i| pressed[i]).map(|i| AXIS_LETTERS[i]));
        if self.plant.is_door_open {
            text.push('D');
        }
        text
    }

    pub(super) fn report_help(&mut self) {
        self.line_out("[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]");
    }

    pub(super) fn report_settings(&mut self) {
        let lines: Vec<String> = self.memory.settings.listing().collect();
        lines.iter().for_each(|line| self.line_out(line));
    }

    pub(super) fn report_build(&mut self) {
        self.line_out(&format!("[VER:1.1h.20190830:{}]", self.memory.build_info));
        let line_numbers = if self.build.has_line_numbers { "N" } else { "" };
        let mist = if self.build.has_mist { "M" } else { "" };
        self.line_out(&format!("[OPT:V{line_numbers}{mist},{BLOCKS_MAX},{RECEIVE_BUFFER_BYTES}]"));
    }

    pub(super) fn report_startup_lines(&mut self) {
        for (index, line) in self.memory.startup.clone().iter().enumerate() {
            self.line_out(&format!("$N{index}={line}"));
        }
    }

    pub(super) fn report_offsets(&mut self) {
        let systems = self.memory.systems.clone();
        for (index, offset) in systems.work.iter().enumerate() {
            let text = self.vector(*offset);
            self.line_out(&format!("[G{}:{text}]", 54 + index));
        }
        for (name, at) in [("G28", systems.g28), ("G30", systems.g30), ("G92", self.parser.g92)] {
            let text = self.vector(at);
            self.line_out(&format!("[{name}:{text}]"));
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
        let system = 54 + modal.coordinate_system;
        let (tool, rpm) = (self.parser.tool, self.parser.spindle_rpm);
        let feed = self.rate(self.parser.feed);
        self.line_out(&format!(
            "[GC:{motion} G{system} {plane} {units} {distance} {feed_mode} {spindle} {coolant} \
             T{tool} F{feed} S{rpm:.0}]"
        ));
    }
}
