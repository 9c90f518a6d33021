//! The controller: receives bytes, moves axes in time, answers.
//!
//! Sans-IO: bytes and the time go in; bytes and the time of the next event come out. Received
//! bytes arrive at once here: `paced` adds the byte rate of the line, `fault` its faults.
//!
//! - `state`: what the controller is doing
//! - `realtime`: what single bytes do
//! - `overrides`: how override bytes add up
//! - `reset`: resets, alarms and switching on
//! - `foreground`: reads lines and decides who answers them
//! - `action`: executes the actions of lines
//! - `block`: turns a checked block into actions
//! - `system`: the `$` commands
//! - `ports`: outputs and inputs for programs
//! - `parking`: moves the tool away while the door is open
//! - `report`: everything printed
//! - `advance`: advances time

mod action;
mod advance;
mod block;
mod foreground;
mod overrides;
mod parking;
mod ports;
mod realtime;
mod report;
mod reset;
mod state;
mod system;

use std::collections::VecDeque;
use std::time::Duration;

use crate::axes::{AXES, Axes, Vector, scale, with_others_at_zero, without_others};
use crate::codes::{Alarm, ErrorCode};
use crate::counts::Counts;
use crate::firmware::{Firmware, Traits, Vocabulary};
use crate::gcode::{Coolant, CoordinateSystems, ParserState, Spindle};
use crate::line::LineReader;
use crate::motion::{Planner, mm_from_steps, steps_from_mm};
use crate::plant::Plant;
use crate::receive::{ReceiveBuffer, TRANSMIT_BUFFER_BYTES};
use crate::settings::Settings;

use action::Action;
use overrides::OverrideFlags;
use parking::Parking;
use ports::Ports;
pub use ports::Switched;
use report::Cadence;
use state::{ControllerState, Door, Probing};

/// How a controller is built and wired.
#[derive(Debug, Clone, PartialEq)]
pub struct Build {
    /// Settings at first power-up, and those that `$RST=$` restores. They name the firmware.
    pub settings: Settings,
    /// Bytes of the receive buffer as `$I` reports them; `None`: the firmware's usual number.
    pub receive_buffer_bytes: Option<usize>,
    /// Physical position of the axes at power-up, which the controller then knows, mm.
    ///
    /// `Some`: the controller knows where the axes are, as after homing in an earlier session.
    /// `None`: the axes are in the middle of their travel and the controller assumes zero, as after
    /// switching on.
    pub start_in_machine: Option<Vector>,
    /// Physical height of the surface that a probe finds, mm; `None`: no probe is wired.
    pub probe_surface_z_mm: Option<f64>,
    /// Physical place of the fourth axis from which on the probe touches, mm or degrees.
    pub probe_stop_fourth: Option<f64>,
    /// Compile option: `Ln` in reports. grblHAL always has it, by `$10`.
    pub has_line_numbers: bool,
    /// Compile option: M7 and 0xA1. grblHAL and FluidNC always have it.
    pub has_mist: bool,
    /// The spindle has an encoder, which grblHAL can thread with.
    pub has_spindle_encoder: bool,
    /// Digital inputs and outputs, then analog ones, that programs of grblHAL can use.
    pub ports: [u8; 4],
    /// Compile option: `[echo: ]` with each line, before it is executed.
    pub echoes_lines: bool,
}

impl Build {
    /// A standard build with these settings.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            receive_buffer_bytes: None,
            start_in_machine: None,
            probe_surface_z_mm: None,
            probe_stop_fourth: None,
            has_line_numbers: false,
            has_mist: false,
            has_spindle_encoder: false,
            ports: [0; 4],
            echoes_lines: false,
        }
    }

    /// The firmware that it runs.
    pub fn firmware(&self) -> Firmware {
        self.settings.firmware()
    }

    fn receive_buffer_bytes(&self) -> usize {
        self.receive_buffer_bytes.unwrap_or(self.firmware().traits().receive_buffer_bytes)
    }

    /// Bytes of the receive buffer that can be filled.
    fn receive_capacity(&self) -> usize {
        self.receive_buffer_bytes().saturating_sub(self.firmware().traits().receive_buffer_spare)
    }
}

/// A straight piece of the programmed path, as it goes to the planner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    /// Its end, mm; 32 bit numbers.
    pub end_in_machine: Vector,
    /// S in force.
    pub spindle_rpm: f64,
    /// M in force: 3, 4 or 5.
    pub spindle: u8,
}

/// What survives a reset and a power cycle.
#[derive(Debug, Clone)]
struct Memory {
    settings: Settings,
    systems: CoordinateSystems,
    startup: [String; 2],
    build_info: String,
}

/// A controller with three to six axes.
#[derive(Debug, Clone)]
pub struct Controller {
    build: Build,
    memory: Memory,
    plant: Plant,
    state: ControllerState,
    /// The alarm in force, or the last one.
    alarm: Option<Alarm>,
    /// Have the axes been homed, and has the position been known since?
    is_homed: bool,
    receive_buffer: ReceiveBuffer,
    reader: LineReader,
    transmit: Vec<u8>,
    parser: ParserState,
    planner: Planner,
    script: VecDeque<Action>,
    /// The answer to every program line until the error is cleared.
    sticky_error: Option<ErrorCode>,
    /// Feed at the start of a hold, mm/min.
    held_feed: f64,
    /// Does M1 not stop?
    skips_optional_stops: bool,
    probing: Option<Probing>,
    /// Set while the tool is away, or moving away or back.
    parking: Option<Parking>,
    /// Last probe result, steps and success.
    probed: ([i64; AXES], bool),
    spindle: Spindle,
    spindle_rpm: f64,
    /// 0x9E in a hold stopped the spindle.
    is_spindle_stopped: bool,
    spindle_percent: u8,
    override_flags: OverrideFlags,
    coolant: Coolant,
    cadence: Cadence,
    /// The parser state as it was last reported after a status report.
    reported_parser_state: String,
    /// `?` came while homing, or when there was no room for the report.
    has_pending_report: bool,
    /// The next report of moving axes is torn.
    is_torn: bool,
    /// `!` came while homing.
    has_pending_hold: bool,
    /// The axes keep pace with the spindle.
    is_threading: bool,
    ports: Ports,
    /// The interval of automatic reports, as it was at power-up, and when the next one is due.
    report_interval: Option<Duration>,
    report_due: Option<Duration>,
    now: Duration,
    /// The time that is being simulated, s; earlier than `now` while the controller catches up.
    instant_s: f64,
    /// When the planner ran empty without a programmed stop, s.
    ran_empty_at_s: Option<f64>,
    counts: Counts,
    /// What was drawn, if `keep_drawn` was called.
    drawn: Option<Vec<Drawn>>,
}

impl Controller {
    /// Switches a controller on; its banner waits to be transmitted.
    pub fn new(settings: Settings) -> Self {
        Self::with_build(Build::new(settings))
    }

    /// Switches on a controller that is built and wired like this.
    pub fn with_build(build: Build) -> Self {
        let traits = build.firmware().traits();
        let settings = build.settings.clone();
        let (steps, offset) = match build.start_in_machine {
            Some(start) => (steps_from_mm(with_others_at_zero(start), &settings), [0.0; AXES]),
            None => ([0; AXES], scale(settings.max_travel_mm(), -0.5)),
        };
        let mut controller = Self {
            plant: Plant {
                offset,
                held: [false; AXES],
                dead: [false; AXES],
                is_door_open: false,
                probe_surface_z: build.probe_surface_z_mm,
                probe_stop_fourth: build.probe_stop_fourth,
            },
            memory: Memory {
                settings,
                systems: CoordinateSystems::default(),
                startup: [String::new(), String::new()],
                build_info: String::new(),
            },
            state: ControllerState::Idle,
            alarm: None,
            is_homed: false,
            receive_buffer: ReceiveBuffer::new(build.receive_capacity()),
            reader: LineReader::new(traits.line),
            build,
            transmit: Vec::new(),
            parser: ParserState::default(),
            planner: Planner::new(steps, traits.blocks_max),
            script: VecDeque::new(),
            sticky_error: None,
            held_feed: 0.0,
            skips_optional_stops: false,
            probing: None,
            parking: None,
            probed: ([0; AXES], false),
            spindle: Spindle::Off,
            spindle_rpm: 0.0,
            is_spindle_stopped: false,
            spindle_percent: 100,
            override_flags: OverrideFlags::default(),
            coolant: Coolant::default(),
            cadence: Cadence::new(traits),
            reported_parser_state: String::new(),
            has_pending_report: false,
            is_torn: false,
            has_pending_hold: false,
            is_threading: false,
            ports: Ports::default(),
            report_interval: None,
            report_due: None,
            now: Duration::ZERO,
            instant_s: 0.0,
            ran_empty_at_s: None,
            counts: Counts::default(),
            drawn: None,
        };
        controller.boot();
        controller
    }

    fn traits(&self) -> &'static Traits {
        self.build.firmware().traits()
    }

    /// The G-code that it knows with its build and settings.
    fn vocabulary(&self) -> Vocabulary {
        let vocabulary = self.traits().vocabulary;
        let axes = self.memory.settings.letters();
        Vocabulary {
            axes,
            has_mist: vocabulary.has_mist || self.build.has_mist,
            has_spindle_sync: vocabulary.has_spindle_sync && self.build.has_spindle_encoder,
            ports: std::array::from_fn(|kind| vocabulary.ports[kind].min(self.build.ports[kind])),
            ..vocabulary
        }
    }

    /// Receives bytes that arrived at `now`.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.advance(now);
        self.counts.bytes_received += bytes.len() as u64;
        for &byte in bytes {
            if self.state == ControllerState::Off {
                break;
            }
            match (self.traits().realtime)(byte) {
                Some(command) if !self.is_literal(byte) => self.act(command),
                _ => self.receive_buffer.push(byte),
            }
            // The firmware empties its buffer much faster than bytes arrive.
            self.work();
        }
    }

    /// Is this `!`, `?` or `~` part of a command or comment?
    fn is_literal(&self, byte: u8) -> bool {
        matches!(byte, b'!' | b'?' | b'~')
            && !self.memory.settings.legacy_realtime()
            && self.reader.is_literal()
    }

    /// Appends the bytes to be sent to `to`.
    ///
    /// The controller reads no lines while [`TRANSMIT_BUFFER_BYTES`] wait here. It continues after
    /// this call, so there may be more to transmit at once.
    pub fn transmit(&mut self, to: &mut Vec<u8>) {
        to.append(&mut self.transmit);
        let is_silent = matches!(self.state, ControllerState::Homing(_)) || self.awaits_index();
        if self.has_pending_report && !is_silent {
            self.has_pending_report = false;
            self.report_status();
        }
        self.work();
    }

    fn is_transmit_full(&self) -> bool {
        self.transmit.len() >= TRANSMIT_BUFFER_BYTES
    }

    /// Position of X, Y and Z in machine coordinates, mm, as the controller counts it.
    pub fn position(&self) -> Vector {
        without_others(self.axes())
    }

    /// Position of all axes in machine coordinates, mm and degrees, as the controller counts it.
    pub fn axes(&self) -> Axes {
        match (&self.state, &self.parking) {
            (ControllerState::Homing(homing), _) => {
                homing.position(&self.plant, &self.memory.settings)
            }
            (_, Some(parking)) => {
                let settings = &self.memory.settings;
                mm_from_steps(steps_from_mm(parking.position(), settings), settings)
            }
            _ => {
                let steps = self.planner.position_steps(&self.memory.settings);
                mm_from_steps(steps, &self.memory.settings)
            }
        }
    }

    /// Speed along the path, mm/min.
    pub fn speed_mm_per_min(&self) -> f64 {
        match &self.parking {
            Some(parking) => parking.speed_mm_per_min(),
            None => self.planner.speed_mm_per_min(),
        }
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.memory.settings
    }

    /// What it has done since it was first switched on.
    pub fn counts(&self) -> Counts {
        Counts {
            bytes_lost: self.receive_buffer.overrun_bytes,
            receive_buffer_bytes_max: self.receive_buffer.bytes_max,
            machine_time: self.now,
            ..self.counts
        }
    }

    /// From now on, keeps what programs draw; also in check mode (`$C`), where nothing moves.
    pub fn keep_drawn(&mut self) {
        self.drawn = Some(Vec::new());
    }

    /// Returns what was drawn since the last call.
    pub fn take_drawn(&mut self) -> Vec<Drawn> {
        self.drawn.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Received bytes lost to a full receive buffer since power-up.
    pub fn overrun_bytes(&self) -> u64 {
        self.receive_buffer.overrun_bytes
    }

    /// Tears the next report of moving axes: grbl on 8 bit boards copies its counters while steps
    /// are counted, so that one may be 256 steps ahead.
    pub fn tear_report(&mut self) {
        self.is_torn = true;
    }

    /// Holds the limit switch of an axis closed, or releases it.
    pub fn hold_limit(&mut self, axis: usize, is_closed: bool) {
        if axis >= AXES {
            return;
        }
        self.plant.held[axis] = is_closed;
        if is_closed && self.memory.settings.hard_limits() {
            self.hit_limit();
        }
    }

    /// Cuts the wire of the limit switches of an axis, or repairs it.
    pub fn cut_limit(&mut self, axis: usize, is_dead: bool) {
        if axis < AXES {
            self.plant.dead[axis] = is_dead;
        }
    }

    /// Opens or closes the safety door.
    pub fn set_door(&mut self, is_open: bool) {
        self.plant.is_door_open = is_open;
        if is_open {
            self.open_door();
            self.work();
        }
    }

    /// Switches the supply off: the axes stop where they are; nothing is received or sent.
    pub fn power_off(&mut self) {
        let physical = crate::axes::add(self.axes(), self.plant.offset);
        self.plant.offset = physical;
        self.forget_motion();
        let blocks_max = self.memory.settings.planner_blocks();
        self.planner = Planner::new([0; AXES], blocks_max.unwrap_or(self.traits().blocks_max));
        self.forget_input();
        self.switch_off();
        self.transmit.clear();
        self.probing = None;
        self.report_due = None;
        self.alarm = None;
        self.is_homed = false;
        self.state = ControllerState::Off;
    }

    /// Switches the supply off and on: motion, position and unsaved state are gone.
    ///
    /// The axes stay where they are; the controller assumes zero.
    pub fn power_cycle(&mut self) {
        self.power_off();
        self.reader = LineReader::new(self.traits().line);
        self.state = ControllerState::Idle;
        self.boot();
    }
}
