//! The status report.

use crate::axes::{AXES, Axes, subtract};
use crate::controller::{Controller, ControllerState, Door};
use crate::firmware::Fields;
use crate::gcode::{Coolant, Spindle, system_name};

impl Controller {
    fn state_name(&self, fields: Fields, everything: bool) -> String {
        let traits = self.traits();
        match &self.state {
            ControllerState::Off => String::new(),
            ControllerState::Starting { .. } => "Starting".into(),
            ControllerState::Idle => "Idle".into(),
            ControllerState::Alarm { .. } => match self.alarm {
                Some(alarm) if fields.alarm_substate || everything => format!("Alarm:{}", alarm.0),
                _ => "Alarm".into(),
            },
            ControllerState::Check => "Check".into(),
            ControllerState::Homing(_) => "Home".into(),
            ControllerState::Run if self.is_threading && self.has_pending_hold => "Run:1".into(),
            ControllerState::Run if fields.run_substate && self.probing.is_some() => "Run:2".into(),
            ControllerState::Run | ControllerState::Stopping => "Run".into(),
            ControllerState::Hold { is_stopped } => format!("Hold:{}", u8::from(!is_stopped)),
            ControllerState::SoftLimit => "Hold:1".into(),
            ControllerState::Jog { .. } => "Jog".into(),
            ControllerState::Sleep => "Sleep".into(),
            ControllerState::Tool => "Tool".into(),
            ControllerState::Door(Door::Stopping { is_jog: false } | Door::Retracting) => {
                "Door:2".into()
            }
            ControllerState::Door(Door::Stopping { is_jog: true }) => {
                format!("Door:{}", traits.door_jog)
            }
            ControllerState::Door(Door::Stopped) => {
                format!("Door:{}", u8::from(self.plant.is_door_open))
            }
            ControllerState::Door(Door::Resuming { .. } | Door::Returning) => {
                format!("Door:{}", traits.door_resuming)
            }
        }
    }

    /// `?`: reports at once, or later when there is room and homing has ended.
    pub(in crate::controller) fn report_status(&mut self) {
        let is_silent = self.awaits_index()
            || matches!(self.state, ControllerState::Homing(_))
                && !(self.traits().reports_while_homing)(&self.memory.settings);
        if is_silent || self.is_transmit_full() {
            self.has_pending_report = true;
        } else {
            self.report_status_now();
        }
    }

    /// Sends a status report without a request.
    pub(in crate::controller) fn report_status_now(&mut self) {
        self.status(false);
    }

    /// grblHAL's 0x87: every field.
    pub(in crate::controller) fn report_everything(&mut self) {
        if !matches!(self.state, ControllerState::Homing(_)) {
            self.status(true);
        }
    }

    fn status(&mut self, everything: bool) {
        let settings = &self.memory.settings;
        let fields = (self.traits().fields)(settings, self.build.has_line_numbers);
        let machine = self.axes();
        let offset = self.parser.work_offset(&self.memory.systems);
        let mut text = format!("<{}", self.state_name(fields, everything));
        let read = self.read_counters(machine);
        text += &match fields.machine_position {
            true => format!("|MPos:{}", self.vector(read)),
            false => format!("|WPos:{}", self.vector(subtract(read, offset))),
        };
        if fields.buffers {
            let free = match self.traits().reads_ahead {
                true => self.receive_buffer.capacity(),
                false => self.receive_buffer.free(),
            };
            text += &format!("|Bf:{},{free}", self.planner.free());
        }
        let line_number = match self.traits().line_number_lingers {
            true => self.planner.last_line_number(),
            false => self.planner.line_number(),
        };
        if fields.line_number && line_number > 0 {
            text += &format!("|Ln:{line_number}");
        }
        if fields.feed {
            let rate = self.rate(self.shown_feed());
            text += &format!("|FS:{rate},{:.0}", self.spindle_output_rpm());
        }
        let pins = self.pins(machine);
        if fields.pins && !pins.is_empty() {
            text += &format!("|Pn:{pins}");
        }
        if fields.distance_to_go {
            text += &format!("|DTG:{}", self.vector(self.planner.way_to_go()));
        }
        text += &self.occasional(fields, everything, offset);
        self.counts.reports += 1;
        self.line_out(&format!("{text}>"));
        self.report_changed_parser_state(fields);
    }

    /// What a report reads of the position, which may be torn.
    fn read_counters(&mut self, machine: Axes) -> Axes {
        /// One more in the second byte of a counter.
        const TORN_STEPS: f64 = 256.0;
        let ahead = self.planner.way_to_go();
        let Some(axis) = (0..AXES).filter(|_| self.is_torn).find(|axis| ahead[*axis] != 0.0) else {
            return machine;
        };
        self.is_torn = false;
        self.counts.torn_reports += 1;
        let mut read = machine;
        read[axis] += ahead[axis].signum() * TORN_STEPS / self.memory.settings.steps_per_mm()[axis];
        read
    }

    /// The fields that not every report has.
    fn occasional(&mut self, fields: Fields, everything: bool, offset: Axes) -> String {
        let is_busy = !matches!(
            self.state,
            ControllerState::Idle
                | ControllerState::Alarm { .. }
                | ControllerState::Check
                | ControllerState::Sleep
        );
        let due = self.cadence.next(fields, is_busy, everything);
        let mut text = String::new();
        if due.offsets {
            text += &format!("|WCO:{}", self.vector(offset));
        }
        if due.system {
            text += &format!("|WCS:{}", system_name(self.parser.modal.coordinate_system));
        }
        if due.overrides {
            let overrides = self.planner.overrides();
            text += &format!(
                "|Ov:{},{},{}",
                overrides.feed_percent, overrides.rapid_percent, self.spindle_percent
            );
        }
        let accessories = self.accessories();
        let says_none = self.traits().reports_accessories_alone;
        if due.accessories && (says_none || !accessories.is_empty()) {
            text += &format!("|A:{accessories}");
        }
        if due.rest {
            text += "|Sc:|MPG:0";
        }
        if due.homed {
            text += &format!("|H:{}", u8::from(self.is_homed));
            if self.memory.settings.homes_single_axes() {
                text += if self.is_homed { ",7" } else { ",0" };
            }
        }
        if due.tool {
            text += &format!("|T:{}", self.parser.tool);
        }
        if due.rest {
            text += &format!("|P:{}", u8::from(self.plant.touches_probe(self.axes())));
        }
        if due.tool_reference {
            text += "|TLR:0";
        }
        if let Some(result) = self.take_input_result(everything) {
            text += &format!("|In:{result}");
        }
        if due.rest {
            text += "|FW:grblHAL";
            if self.state == (ControllerState::Alarm { is_critical: true }) {
                text += "|$C:1";
            }
            if let Some(interval) = self.report_interval {
                text += &match self.report_due {
                    Some(_) => format!("|AR:{}", interval.as_millis()),
                    None => "|AR".into(),
                };
            }
        }
        text
    }

    /// Speed along the path as it is reported, mm/min.
    fn shown_feed(&self) -> f64 {
        match self.state {
            ControllerState::Hold { is_stopped: true } if self.traits().hold_shows_feed => {
                self.held_feed
            }
            _ => self.speed_mm_per_min(),
        }
    }

    fn is_spindle_turning(&self) -> bool {
        let is_off_for_door = match &self.parking {
            Some(parking) => !parking.is_powered(),
            None => matches!(self.state, ControllerState::Door(Door::Stopped)),
        };
        self.spindle != Spindle::Off && !self.is_spindle_stopped && !is_off_for_door
    }

    /// The commanded spindle speed, rpm.
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
        let Coolant { flood, mist } = self.coolant;
        let is_tool_awaited = self.state == ControllerState::Tool;
        let rest = [(flood, 'F'), (mist, 'M'), (is_tool_awaited, 'T')];
        text.extend(rest.into_iter().filter(|(is_on, _)| *is_on).map(|(_, letter)| letter));
        text
    }

    fn pins(&self, machine: Axes) -> String {
        let mut text = String::new();
        if self.plant.touches_probe(machine) {
            text.push('P');
        }
        let pressed = self.plant.pressed(machine, &self.memory.settings);
        let letters = self.memory.settings.letters();
        text.extend(
            letters
                .all()
                .iter()
                .zip(pressed)
                .filter(|(_, is_pressed)| *is_pressed)
                .map(|(letter, _)| *letter),
        );
        if self.plant.is_door_open {
            text.push('D');
        }
        text
    }
}
