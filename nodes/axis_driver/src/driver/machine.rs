//! What is known of the machine: the last report, and what lasts between reports.

use super::connect::QUERIES_DONE;
use super::deactivate::INACTIVE;
use super::place::PlaceWatch;
use super::{Driver, Origin, Output, Phase};
use crate::codes;
use crate::encoder::Homing;
use crate::estimate::Rates;
use crate::firmware::Firmware;
use crate::report::{Accessories, ControllerState, Message, ModalWords, StatusReport};
use cnc_msgs::geometry::Position;
use cnc_msgs::machine::{LinkWatch, MachineState, Mode};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Planner blocks of grbl 1.1 where `[OPT:]` does not say.
const PLANNER_BLOCKS_DEFAULT: u16 = 15;

/// What a controller says of itself.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ControllerSettings {
    pub firmware: Firmware,
    /// As it words them.
    pub version: String,
    pub options: String,
    pub planner_blocks: u16,
    pub receive_bytes: u16,
    /// The most that is sent before an answer, bytes.
    pub window: usize,
    /// `$number` and what it is set to.
    pub settings: Vec<(u16, String)>,
    pub offsets: Vec<Offset>,
}

/// A stored place: G54 to G59, G28, G30, G92, TLO; machine frame, mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Offset {
    pub name: String,
    pub position: Position,
}

#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Machine {
    pub(super) firmware: Firmware,
    #[serde(default)]
    version: String,
    #[serde(default)]
    options: String,
    /// The settings as they were told.
    #[serde(default)]
    pub(super) told: BTreeMap<u16, String>,
    #[serde(default)]
    pub(super) offsets: Vec<Offset>,
    pub(super) settings: BTreeMap<u16, f64>,
    /// Whether `$13` was read, so that lengths can be believed.
    pub(super) has_units: bool,
    pub(super) has_mist: bool,
    #[serde(default)]
    homes_one_by_one: bool,
    planner_blocks: Option<u16>,
    pub(super) status: Option<StatusReport>,
    pub(super) work_offset: Option<Position>,
    #[serde(default)]
    accessories: Option<Accessories>,
    pub(super) overrides_percent: [u8; 3],
    pub(super) alarm_code: u16,
    pub(super) is_homed: bool,
    /// 1 to 6; `None` when a program may have left any.
    pub(super) work_system: Option<u8>,
    pub(super) has_tool_length: Option<bool>,
    pub(super) is_silent: bool,
    /// The port was lost while the machine moved, and no report has been received since.
    pub(super) is_lost: bool,
    /// Nothing runs before the operator has seen to it.
    pub(super) needs_acknowledgement: bool,
    /// The controller has started anew by itself in the middle of something.
    #[serde(default)]
    pub(super) lost_its_place: bool,
    pub(super) program_id: String,
    pub(super) line: u32,
    /// What was believed of the position.
    #[serde(default)]
    pub(super) place: PlaceWatch,
    /// A work offset that no command explains, until it comes twice.
    #[serde(default)]
    pub(super) doubted_offset: Option<Position>,
    /// The words in force, as they were told last.
    #[serde(default)]
    pub(super) words: Option<ModalWords>,
    /// The most blocks and bytes that were ever free.
    #[serde(default)]
    most_free: (u16, u16),
    /// A start message came, and nothing since.
    #[serde(default)]
    pub(super) has_just_started: bool,
    /// Where it stood before its last start, machine frame, mm.
    #[serde(default)]
    pub(super) stood_at: Option<Position>,
    /// Its last start found it unlocked.
    #[serde(default)]
    was_unlocked: bool,
}

impl Machine {
    /// A new port: all that was known belongs to the past.
    pub(super) fn on_port(&mut self) {
        let program_id = std::mem::take(&mut self.program_id);
        let Self { line, is_lost, needs_acknowledgement, .. } = *self;
        *self = Self { program_id, line, is_lost, needs_acknowledgement, ..Self::default() };
    }

    pub(super) fn on_restart(&mut self, firmware: Firmware) {
        self.firmware = firmware;
        let before = self.status.as_ref().map(|status| &status.state);
        let locks = [ControllerState::Alarm, ControllerState::Sleep];
        self.was_unlocked = before.is_some_and(|state| !locks.contains(state));
        if self.status.is_some() {
            let stands = !self.is_moving();
            self.stood_at = self.machine_position().filter(|_| stands);
        }
        self.place = PlaceWatch::default();
        self.doubted_offset = None;
        self.words = None;
        self.status = None;
        self.work_offset = None;
        self.work_system = Some(1);
        self.has_tool_length = Some(false);
        self.overrides_percent = [100; 3];
        self.accessories = None;
        self.is_silent = false;
    }

    pub(super) fn on_alarm(&mut self, code: u16) {
        self.alarm_code = code;
        if codes::is_position_lost(self.firmware, code) {
            self.is_homed = false;
        }
        if let Some(status) = &mut self.status {
            status.state = ControllerState::Alarm;
            status.substate = None;
            // Steps have ended; the speed in the report is from before.
            status.feed_mm_per_min = None;
        }
    }

    pub(super) fn on_status(&mut self, mut report: StatusReport) {
        self.is_silent = false;
        self.is_lost = false;
        if report.state != ControllerState::Alarm {
            self.alarm_code = 0;
        } else if self.alarm_code == 0 {
            self.alarm_code = report.substate.unwrap_or(0).into();
        }
        self.accessories = report.accessories_on(self.firmware).or(self.accessories);
        self.work_system = report.work_system.or(self.work_system);
        // What stood unlocked and is locked by a reset has lost its supply meanwhile.
        let was_unlocked = std::mem::take(&mut self.was_unlocked);
        self.is_homed &= !(was_unlocked && report.state == ControllerState::Alarm);
        self.is_homed = report.is_homed.unwrap_or(self.is_homed);
        self.work_offset = report.work_offset.or(self.work_offset);
        self.overrides_percent = report.overrides_percent.unwrap_or(self.overrides_percent);
        if let Some(offset) = self.work_offset {
            let shifted = |position: Position, sign: f64| {
                [0, 1, 2].map(|axis| position[axis] + sign * offset[axis])
            };
            report.work_position =
                report.work_position.or(report.machine_position.map(|at| shifted(at, -1.0)));
            report.machine_position =
                report.machine_position.or(report.work_position.map(|at| shifted(at, 1.0)));
        }
        self.status = Some(report);
    }

    /// The fastest of each axis, infinite where it is not known, mm/min.
    pub(super) fn fastest_mm_per_min(&self) -> Position {
        [110, 111, 112].map(|number| self.settings.get(&number).copied().unwrap_or(f64::INFINITY))
    }

    /// Whether planner and receive buffer have as much room as they ever had.
    pub(super) fn is_as_free_as_ever(&mut self, free: Option<(u16, u16)>) -> bool {
        let Some((blocks, bytes)) = free else { return false };
        let most = (self.most_free.0.max(blocks), self.most_free.1.max(bytes));
        let was_known = std::mem::replace(&mut self.most_free, most) != (0, 0);
        was_known && most == (blocks, bytes)
    }

    /// Takes a message; gives the receive buffer when it tells of it.
    pub(super) fn on_message(&mut self, message: &Message) -> Option<Option<u16>> {
        match message {
            Message::Options { letters, planner_blocks, receive_bytes, .. } => {
                self.options.clone_from(letters);
                self.has_mist = letters.contains('M');
                self.homes_one_by_one = letters.contains('H');
                self.planner_blocks = *planner_blocks;
                return Some(*receive_bytes);
            }
            Message::Offset { name, position } => {
                self.remember(name, *position);
            }
            Message::Firmware(name) => {
                self.firmware = Firmware::of_firmware_message(name).unwrap_or(self.firmware);
            }
            Message::Version(text) => {
                self.version.clone_from(text);
                self.firmware = Firmware::of_version(text).unwrap_or(self.firmware);
            }
            Message::ParserState(words) => {
                let words = ModalWords::read(words);
                if let Some(spindle) = words.spindle {
                    let ModalWords { flood, mist, .. } = words;
                    self.accessories = Some(Accessories { spindle, flood, mist });
                }
                self.work_system = words.work_system;
            }
            Message::ToolLength(length) => {
                self.has_tool_length = Some(length.abs() > 1e-9);
                self.remember("TLO", [0.0, 0.0, *length]);
            }
            _ => {}
        }
        None
    }

    pub(super) fn on_setting(&mut self, number: u16, value: &str) {
        self.told.insert(number, value.to_owned());
        if let Some(value) = value.parse::<f64>().ok().filter(|value| value.is_finite()) {
            self.settings.insert(number, value);
        }
    }

    /// A setting that is a mask, as it was reported.
    pub(super) fn mask(&self, number: u16) -> Option<u32> {
        self.told.get(&number)?.trim().parse().ok()
    }

    pub(super) fn reports_in_inches(&self) -> bool {
        self.settings.get(&13).is_some_and(|value| *value > 0.5)
    }

    /// Whether ordinary reports lack the work offset or the overrides (`$10`), and the firmware
    /// has another request that gets them.
    pub(super) fn reports_too_little(&self) -> bool {
        const WORK_OFFSET_AND_OVERRIDES: u32 = 0b110_0000;
        let mask = self.told.get(&10).and_then(|value| value.parse::<u32>().ok());
        let lacks = |mask: u32| mask & WORK_OFFSET_AND_OVERRIDES != WORK_OFFSET_AND_OVERRIDES;
        self.firmware.traits().has_full_report && mask.is_some_and(lacks)
    }

    pub(super) fn has_homing(&self) -> bool {
        self.settings.get(&22).is_none_or(|value| *value > 0.5)
    }

    /// What it homes on demand.
    pub(super) fn homing(&self) -> Homing {
        let one_by_one = self.homes_one_by_one || self.firmware.traits().homes_one_by_one;
        match (self.has_homing(), one_by_one) {
            (false, _) => Homing::Off,
            (true, false) => Homing::Together,
            (true, true) => Homing::OneByOne,
        }
    }

    pub(super) fn planner_blocks(&self) -> u16 {
        self.planner_blocks.unwrap_or(PLANNER_BLOCKS_DEFAULT)
    }

    /// Planner blocks in use, where the report tells.
    pub(super) fn blocks_in_use(&self) -> Option<usize> {
        let (free, _) = self.status.as_ref()?.free?;
        Some(usize::from(self.planner_blocks().saturating_sub(free)))
    }

    /// Whether reports say how full planner and receive buffer are.
    pub(super) fn reports_buffer(&self) -> bool {
        self.status.as_ref().is_some_and(|status| status.free.is_some())
    }

    pub(super) fn rates(&self) -> Rates {
        let mut rates = Rates::default();
        for axis in 0..3u16 {
            let read = |base: u16, slot: &mut f64| {
                if let Some(value) = self.settings.get(&(base + axis)).filter(|v| **v > 0.0) {
                    *slot = *value;
                }
            };
            read(110, &mut rates.rapid_mm_per_min[usize::from(axis)]);
            read(120, &mut rates.acceleration_mm_per_s2[usize::from(axis)]);
        }
        rates
    }

    /// Whether it stands elsewhere than before its last start: a reset of its own keeps the
    /// position. Forgets where it stood.
    pub(super) fn has_moved_since_start(&mut self) -> bool {
        let places = self.stood_at.take().zip(self.machine_position());
        places
            .is_some_and(|(before, now)| (0..3).any(|axis| (before[axis] - now[axis]).abs() > 0.01))
    }

    pub(super) fn work_position(&self) -> Option<Position> {
        self.status.as_ref().filter(|_| self.has_units)?.work_position
    }

    pub(super) fn machine_position(&self) -> Option<Position> {
        self.status.as_ref().filter(|_| self.has_units)?.machine_position
    }

    /// A place of the machine frame in the work frame.
    pub(super) fn in_work_frame(&self, place: Position) -> Option<Position> {
        let (machine, work) = self.machine_position().zip(self.work_position())?;
        Some([0, 1, 2].map(|axis| place[axis] - (machine[axis] - work[axis])))
    }

    pub(super) fn feed_override(&self) -> f64 {
        f64::from(self.overrides_percent[0].max(1)) / 100.0
    }

    pub(super) fn is_state(&self, state: &ControllerState) -> bool {
        self.status.as_ref().is_some_and(|status| status.state == *state)
    }

    pub(super) fn is_moving(&self) -> bool {
        self.status.as_ref().is_some_and(StatusReport::is_moving)
    }

    pub(super) fn is_held(&self) -> bool {
        self.status.as_ref().is_some_and(StatusReport::is_held)
    }

    pub(super) fn mode(&self) -> Mode {
        match self.status.as_ref().map(|status| &status.state) {
            Some(ControllerState::Idle) => Mode::Idle,
            Some(ControllerState::Run) => Mode::Run,
            Some(ControllerState::Hold) => Mode::Hold,
            Some(ControllerState::Jog) => Mode::Jog,
            Some(ControllerState::Alarm) => Mode::Alarm,
            Some(ControllerState::Door) => Mode::Door,
            Some(ControllerState::Check) => Mode::Check,
            Some(ControllerState::Home) => Mode::Home,
            Some(ControllerState::Sleep) => Mode::Sleep,
            Some(ControllerState::Tool) => Mode::ToolChange,
            Some(ControllerState::Unnamed | ControllerState::Other(_)) | None => Mode::Unknown,
        }
    }

    /// The facts; mode and reason are the driver's to judge.
    pub(super) fn state(&self) -> MachineState {
        let status = self.status.as_ref();
        let places = status.filter(|_| self.has_units && !self.is_silent);
        MachineState {
            mode: self.mode(),
            machine_position: places.and_then(|status| status.machine_position),
            work_position: places.and_then(|status| status.work_position),
            // What stands in a hold may still report the feed from before it.
            feed_mm_per_min: places
                .filter(|status| !status.is_held())
                .and_then(|status| status.feed_mm_per_min)
                .unwrap_or(0.0),
            spindle_rpm: status.and_then(|status| status.spindle_rpm).unwrap_or(0.0),
            program_id: self.program_id.clone(),
            line: self.line,
            alarm_code: self.alarm_code,
            is_homed: self.is_homed,
            spindle: self.accessories.map(|on| on.spindle),
            flood: self.accessories.is_some_and(|on| on.flood),
            mist: self.accessories.is_some_and(|on| on.mist),
            work_system: self.work_system.unwrap_or(0),
            overrides_percent: self.overrides_percent,
            pins: status.and_then(|status| status.pins.clone()).unwrap_or_default(),
            ..MachineState::default()
        }
    }
}

impl Driver {
    /// Tells what the controller said of itself.
    pub(super) fn publish_settings(&mut self) {
        let machine = &self.machine;
        let settings = ControllerSettings {
            firmware: machine.firmware,
            version: machine.version.clone(),
            options: machine.options.clone(),
            planner_blocks: machine.planner_blocks(),
            receive_bytes: self.link.receive_bytes(),
            window: self.link.window(),
            settings: machine.told.iter().map(|(n, value)| (*n, value.clone())).collect(),
            offsets: machine.offsets.clone(),
        };
        self.outputs.push_back(Output::Settings(settings));
    }

    /// Judges mode and reason from what the driver is about and what was heard.
    pub(super) fn compose_mode(&self, state: &mut MachineState) {
        if self.machine.is_silent {
            state.mode = Mode::Unknown;
        }
        state.motion_possible = self.machine.is_silent || self.machine.is_lost;
        state.link_watch = match &self.phase {
            Phase::Closed { .. } | Phase::Connecting(_) => LinkWatch::Unknown,
            _ => self.link.watch(self.machine.reports_buffer()),
        };
        match &self.phase {
            Phase::Closed { reason } => {
                state.mode = if self.machine.is_lost { Mode::Unknown } else { Mode::Disconnected };
                state.reason.clone_from(reason);
                (state.machine_position, state.work_position) = (None, None);
            }
            Phase::Connecting(connecting) => {
                state.mode = Mode::Unknown;
                state.reason = format!("CONNECTING: {}", connecting.describe());
                debug_assert!(connecting.query() < QUERIES_DONE);
                if !connecting.has_settings() {
                    (state.machine_position, state.work_position) = (None, None);
                }
            }
            Phase::Adrift { reason } => {
                state.reason.clone_from(reason);
                state.needs_reset = true;
            }
            Phase::Manual(operation) => state.mode = operation.mode(state.mode),
            Phase::Running(run) => run.compose_mode(state, self.machine.is_held()),
            Phase::Ready => {}
        }
        self.compose_paused(state);
        if !state.reason.is_empty() {
            return;
        }
        state.reason = match state.mode {
            Mode::Alarm if state.alarm_code > 0 => {
                codes::describe_alarm(self.machine.firmware, state.alarm_code)
            }
            Mode::Alarm => "ALARM: locked; home or unlock".into(),
            Mode::Hold => match self.link.oldest() {
                Some(Origin::Program { text, source_line, .. }) if text == "M0" => {
                    format!("PROGRAM_STOP: resume goes on (line {source_line})")
                }
                _ => "FEED_HOLD".into(),
            },
            Mode::Unknown => "no status was heard yet".into(),
            _ if !self.is_active => INACTIVE.into(),
            _ => String::new(),
        };
    }
}
