//! The machine model: the last report, and what lasts between reports.

use super::further::FurtherState;
use super::place::PlaceWatch;
use crate::codes;
use crate::cycle_time::Speeds;
use crate::driver::output::Offset;
use crate::encoder::{Homing, Ports};
use crate::firmware::Firmware;
use crate::report::{Accessories, ControllerState, Message, ModalWords, StatusReport};
use cnc_msgs::geometry::Position;
use cnc_msgs::machine::{MachineState, Mode};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Planner blocks of grbl 1.1 where `[OPT:]` does not say.
const PLANNER_BLOCKS_DEFAULT: u16 = 15;

/// The machine model: what its reports, settings and messages have shown.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(in crate::driver) struct Machine {
    pub(in crate::driver) firmware: Firmware,
    #[serde(default)]
    pub(in crate::driver) version: String,
    #[serde(default)]
    pub(in crate::driver) options: String,
    /// The settings as they were reported.
    #[serde(default, rename = "told")]
    pub(in crate::driver) reported: BTreeMap<u16, String>,
    #[serde(default)]
    pub(in crate::driver) offsets: Vec<Offset>,
    pub(in crate::driver) settings: BTreeMap<u16, f64>,
    /// Whether `$13` was read, so that lengths can be believed.
    pub(in crate::driver) has_units: bool,
    pub(in crate::driver) has_mist: bool,
    /// Whether its axes can keep pace with the spindle.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(in crate::driver) has_spindle_sync: bool,
    /// `[AUX IO:]`; none where it says nothing.
    #[serde(default, skip_serializing_if = "Ports::are_none")]
    pub(in crate::driver) ports: Ports,
    #[serde(default)]
    homes_one_by_one: bool,
    planner_blocks: Option<u16>,
    pub(in crate::driver) status: Option<StatusReport>,
    pub(in crate::driver) work_offset: Option<Position>,
    #[serde(default)]
    accessories: Option<Accessories>,
    pub(in crate::driver) overrides_percent: [u8; 3],
    pub(in crate::driver) alarm_code: u16,
    pub(in crate::driver) is_homed: bool,
    /// 1 to 9; `None` when a program may have left any.
    pub(in crate::driver) work_system: Option<u8>,
    pub(in crate::driver) has_tool_length: Option<bool>,
    pub(in crate::driver) is_silent: bool,
    /// The port was lost while the machine moved, and no report has been received since.
    pub(in crate::driver) is_lost: bool,
    /// Nothing runs before the operator has acknowledged it with a reset.
    pub(in crate::driver) needs_acknowledgement: bool,
    /// The controller has restarted by itself in the middle of something.
    #[serde(default)]
    pub(in crate::driver) lost_its_place: bool,
    pub(in crate::driver) program_id: String,
    pub(in crate::driver) line: u32,
    /// Judges whether reported positions can be true.
    #[serde(default)]
    pub(in crate::driver) place: PlaceWatch,
    /// A work offset that no command explains, until it comes twice.
    #[serde(default)]
    pub(in crate::driver) doubted_offset: Option<Position>,
    /// The work offset that the stored ones were asked about last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(in crate::driver) asked_about: Option<Position>,
    /// How often they were, besides when it connects and in runs, and the answer has come.
    #[serde(default)]
    pub(in crate::driver) offset_answers: u32,
    /// The words in force, as they were reported last.
    #[serde(default)]
    pub(in crate::driver) words: Option<ModalWords>,
    /// A line with G93 was sent before they came, and since then.
    #[serde(default, skip_serializing_if = "is_neither")]
    inverse_times: [bool; 2],
    /// The most blocks and bytes that were ever free.
    #[serde(default)]
    most_free: (u16, u16),
    /// A start message was the last that came.
    #[serde(default)]
    pub(in crate::driver) has_just_started: bool,
    /// Where it stood before its last start, machine frame, mm.
    #[serde(default)]
    pub(in crate::driver) stood_at: Option<Position>,
    /// Its last start found it unlocked.
    #[serde(default)]
    was_unlocked: bool,
    /// What the last report had in it.
    #[serde(default)]
    pub(in crate::driver) shown: Shown,
    /// A, B, C, U, V and W.
    #[serde(default)]
    pub(in crate::driver) further: FurtherState,
    /// The T number of the tool in the spindle, as the last change has left it; 0: there is none;
    /// `None`: nobody has said, or a change was not finished.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(in crate::driver) spindle_tool: Option<u32>,
    /// The kinematics that the firmware has named when it started, or in its build (`$I`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(in crate::driver) kinematics: Option<String>,
}

/// What a report itself shows, not what was worked out or remembered.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(in crate::driver) struct Shown {
    pub(in crate::driver) work_offset: Option<Position>,
    pub(in crate::driver) has_machine_position: bool,
}

fn is_neither(both: &[bool; 2]) -> bool {
    *both == [false; 2]
}

impl Machine {
    /// Forgets what was known: the port is a new one.
    pub(in crate::driver) fn on_port(&mut self) {
        let program_id = std::mem::take(&mut self.program_id);
        let Self { line, is_lost, needs_acknowledgement, spindle_tool, .. } = *self;
        *self = Self {
            program_id,
            line,
            is_lost,
            needs_acknowledgement,
            // A plug takes no tool out.
            spindle_tool,
            ..Self::default()
        };
    }

    pub(in crate::driver) fn on_restart(&mut self, firmware: Firmware) {
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
        self.inverse_times = Default::default();
        self.status = None;
        self.work_offset = None;
        self.forget_further_offset();
        self.work_system = Some(1);
        self.has_tool_length = Some(false);
        self.overrides_percent = [100; 3];
        self.accessories = None;
        self.is_silent = false;
    }

    pub(in crate::driver) fn on_alarm(&mut self, code: u16) {
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

    pub(in crate::driver) fn on_status(&mut self, mut report: StatusReport) {
        self.is_silent = false;
        self.is_lost = false;
        self.shown = Shown {
            work_offset: report.work_offset,
            has_machine_position: report.machine_position.is_some(),
        };
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
        self.on_further_status(&report);
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
    pub(in crate::driver) fn fastest_mm_per_min(&self) -> Position {
        [110, 111, 112].map(|number| self.settings.get(&number).copied().unwrap_or(f64::INFINITY))
    }

    /// Whether planner and receive buffer have as much room as they ever had.
    pub(in crate::driver) fn is_as_free_as_ever(&mut self, free: Option<(u16, u16)>) -> bool {
        let Some((blocks, bytes)) = free else { return false };
        let most = (self.most_free.0.max(blocks), self.most_free.1.max(bytes));
        let was_known = std::mem::replace(&mut self.most_free, most) != (0, 0);
        was_known && most == (blocks, bytes)
    }

    /// Takes a line that is sent now, or answered: words that were asked for before it was sent may come
    /// in between.
    pub(in crate::driver) fn on_line(&mut self, text: &str) {
        self.inverse_times[1] |= text.contains("G93");
    }

    /// Whether the words in force that have come now may have no feed: after G93 none is in force
    /// until the next F. The line may have been read before the words or after them.
    pub(in crate::driver) fn may_lack_feed(&mut self) -> bool {
        let [before, since] = self.inverse_times;
        self.inverse_times = [since, false];
        before || since
    }

    /// Takes a message; gives the size of the receive buffer if the message has it.
    pub(in crate::driver) fn on_message(&mut self, message: &Message) -> Option<Option<u16>> {
        match message {
            Message::Options { letters, planner_blocks, receive_bytes, .. } => {
                self.options.clone_from(letters);
                self.has_mist = letters.contains('M');
                self.homes_one_by_one = letters.contains('H');
                self.planner_blocks = *planner_blocks;
                return Some(*receive_bytes);
            }
            Message::NewOptions(options) => {
                self.has_spindle_sync = options.iter().any(|option| option == "SS");
            }
            Message::AuxIo(counts) => self.ports = (*counts).into(),
            Message::Offset { name, position, further } => {
                self.remember(name, *position);
                self.on_further_offset(name, further);
            }
            Message::Axes(letters) => self.on_further_letters(letters),
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
            Message::Text(text) => {
                let named = text.split_once("Kinematic system:");
                let name = named.map(|(_, name)| name.trim().to_owned());
                self.kinematics = name.or(self.kinematics.take());
            }
            Message::Build { key, value } if key == "KINEMATICS" => {
                // A version follows the name.
                let name = value.rsplit_once(" v").map_or(value.as_str(), |(name, _)| name);
                self.kinematics = Some(name.trim().to_owned());
            }
            Message::ToolLength(length) => {
                self.has_tool_length = Some(length.abs() > 1e-9);
                self.remember("TLO", [0.0, 0.0, *length]);
            }
            _ => {}
        }
        None
    }

    pub(in crate::driver) fn on_setting(&mut self, number: u16, value: &str) {
        self.reported.insert(number, value.to_owned());
        if let Some(value) = value.parse::<f64>().ok().filter(|value| value.is_finite()) {
            self.settings.insert(number, value);
        }
    }

    /// A setting that is a mask, as it was reported.
    pub(in crate::driver) fn mask(&self, number: u16) -> Option<u32> {
        self.reported.get(&number)?.trim().parse().ok()
    }

    pub(in crate::driver) fn reports_in_inches(&self) -> bool {
        self.settings.get(&13).is_some_and(|value| *value > 0.5)
    }

    /// Whether ordinary reports lack the work offset or the overrides (`$10`), and the firmware
    /// has another request that gets them.
    pub(in crate::driver) fn reports_too_little(&self) -> bool {
        const WORK_OFFSET_AND_OVERRIDES: u32 = 0b110_0000;
        let mask = self.reported.get(&10).and_then(|value| value.parse::<u32>().ok());
        let lacks = |mask: u32| mask & WORK_OFFSET_AND_OVERRIDES != WORK_OFFSET_AND_OVERRIDES;
        self.firmware.traits().has_full_report && mask.is_some_and(lacks)
    }

    pub(in crate::driver) fn has_homing(&self) -> bool {
        self.settings.get(&22).is_none_or(|value| *value > 0.5)
    }

    /// What it homes on demand.
    pub(in crate::driver) fn homing(&self) -> Homing {
        let one_by_one = self.homes_one_by_one || self.firmware.traits().homes_one_by_one;
        match (self.has_homing(), one_by_one) {
            (false, _) => Homing::Off,
            (true, false) => Homing::Together,
            (true, true) => Homing::OneByOne,
        }
    }

    pub(in crate::driver) fn planner_blocks(&self) -> u16 {
        self.planner_blocks.unwrap_or(PLANNER_BLOCKS_DEFAULT)
    }

    /// The same, where the controller says so itself.
    pub(in crate::driver) fn reported_planner_blocks(&self) -> Option<u16> {
        self.planner_blocks
    }

    /// Planner blocks in use, if reports say so.
    pub(in crate::driver) fn blocks_in_use(&self) -> Option<usize> {
        let (free, _) = self.status.as_ref()?.free?;
        Some(usize::from(self.planner_blocks().saturating_sub(free)))
    }

    /// Whether reports say how full planner and receive buffer are.
    pub(in crate::driver) fn reports_buffer(&self) -> bool {
        self.status.as_ref().is_some_and(|status| status.free.is_some())
    }

    /// Whether it stands elsewhere than before its last start: a reset of its own keeps the
    /// position. Forgets where it stood.
    pub(in crate::driver) fn has_moved_since_start(&mut self) -> bool {
        let places = self.stood_at.take().zip(self.machine_position());
        places
            .is_some_and(|(before, now)| (0..3).any(|axis| (before[axis] - now[axis]).abs() > 0.01))
    }

    pub(in crate::driver) fn work_position(&self) -> Option<Position> {
        self.status.as_ref().filter(|_| self.has_units)?.work_position
    }

    pub(in crate::driver) fn machine_position(&self) -> Option<Position> {
        self.status.as_ref().filter(|_| self.has_units)?.machine_position
    }

    /// A place of the machine frame in the work frame.
    pub(in crate::driver) fn in_work_frame(&self, place: Position) -> Option<Position> {
        let (machine, work) = self.machine_position().zip(self.work_position())?;
        Some([0, 1, 2].map(|axis| place[axis] - (machine[axis] - work[axis])))
    }

    /// Feed and rapid override.
    pub(in crate::driver) fn speeds(&self) -> Speeds {
        let [feed, rapid] = [0, 1].map(|at| f64::from(self.overrides_percent[at].max(1)) / 100.0);
        Speeds { feed, rapid }
    }

    pub(in crate::driver) fn is_state(&self, state: &ControllerState) -> bool {
        self.status.as_ref().is_some_and(|status| status.state == *state)
    }

    pub(in crate::driver) fn is_moving(&self) -> bool {
        self.status.as_ref().is_some_and(StatusReport::is_moving)
    }

    pub(in crate::driver) fn is_held(&self) -> bool {
        self.status.as_ref().is_some_and(StatusReport::is_held)
    }

    pub(in crate::driver) fn mode(&self) -> Mode {
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

    /// The facts; `driver/state.rs` adds mode and reason.
    pub(in crate::driver) fn state(&self) -> MachineState {
        let status = self.status.as_ref();
        let places = status.filter(|_| self.has_units && !self.is_silent);
        MachineState {
            mode: self.mode(),
            machine_position: places.and_then(|status| status.machine_position),
            work_position: places.and_then(|status| status.work_position),
            feed_mm_per_min: places.and_then(StatusReport::speed_mm_per_min).unwrap_or(0.0),
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
            further: places.and_then(|_| self.further_places()),
            ..MachineState::default()
        }
    }
}
