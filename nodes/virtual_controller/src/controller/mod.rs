//! The controller: receives bytes, moves axes in time, answers.
//!
//! Sans-IO: bytes and the time go in, bytes and the time of the next event
//! come out. Bytes arrive here as fast as they are handed over; the line's
//! byte rate is `paced`'s business, trouble on the line `fault`'s.
//!
//! - `realtime`: what single bytes do, resets and alarms
//! - `foreground`: reads lines and works off what they ask for
//! - `block`: turns a checked block into actions
//! - `system`: the `$` commands
//! - `report`: everything printed
//! - `advance`: lets time pass

mod advance;
mod block;
mod foreground;
mod realtime;
mod report;
mod system;

use std::collections::VecDeque;
use std::time::Duration;

use crate::axes::{AXES, Vector, scale};
use crate::gcode::{Coolant, CoordinateSystems, ParserState, Spindle};
use crate::homing::Homing;
use crate::motion::{Planner, mm_from_steps, steps_from_mm};
use crate::plant::Plant;
use crate::receive::{LineReader, ReceiveBuffer, TRANSMIT_BUFFER_BYTES, realtime};
use crate::settings::Settings;

use foreground::Action;
use report::Cadence;

/// What a controller is built and wired like.
#[derive(Debug, Clone, PartialEq)]
pub struct Build {
    /// Settings at first power-up, and those `$RST=$` restores.
    pub settings: Settings,
    /// Where the axes stand and what the controller believes at power-up, mm.
    ///
    /// Given, the two agree, as after homing in an earlier session. `None`:
    /// the axes stand in the middle of their travel and the controller
    /// believes in zero, as after switching on.
    pub start_in_machine: Option<Vector>,
    /// Physical height of the surface that a probe finds, mm; `None`: no probe is wired.
    pub probe_surface_z_mm: Option<f64>,
    /// Compile option: `Ln` in reports.
    pub has_line_numbers: bool,
    /// Compile option: M7 and 0xA1.
    pub has_mist: bool,
}

impl Build {
    /// An ordinary build with these settings.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            start_in_machine: None,
            probe_surface_z_mm: None,
            has_line_numbers: false,
            has_mist: false,
        }
    }
}

/// What outlives a reset and a power cycle.
#[derive(Debug, Clone)]
struct Memory {
    settings: Settings,
    systems: CoordinateSystems,
    startup: [String; 2],
    build_info: String,
}

/// What the controller is doing.
#[derive(Debug, Clone, PartialEq)]
enum State {
    Idle,
    /// Locked until `$X`, `$H` or, after a critical one, a reset first.
    Alarm {
        is_deaf: bool,
    },
    Check,
    Homing(Homing),
    Run,
    Hold {
        is_stopped: bool,
    },
    Jog {
        is_cancelled: bool,
    },
    Door(Door),
    Sleep,
    /// Braking because a target is outside of the travel.
    SoftLimit,
}

/// The stages of an open door.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Door {
    /// A jog is forgotten when it has stopped, a program is not.
    Stopping {
        is_jog: bool,
    },
    Stopped,
    Resuming {
        left_s: f64,
    },
}

/// A probing move under way.
#[derive(Debug, Clone, PartialEq)]
struct Probing {
    away: bool,
    miss_is_fine: bool,
    contact_steps: Option<[i64; 3]>,
}

/// A grbl 1.1 controller with three axes.
#[derive(Debug, Clone)]
pub struct Controller {
    build: Build,
    memory: Memory,
    plant: Plant,
    state: State,
    receive_buffer: ReceiveBuffer,
    reader: LineReader,
    transmit: Vec<u8>,
    parser: ParserState,
    planner: Planner,
    script: VecDeque<Action>,
    probing: Option<Probing>,
    /// Last probe result, steps and success.
    probed: ([i64; 3], bool),
    spindle: Spindle,
    spindle_rpm: f64,
    /// 0x9E in a hold.
    is_spindle_stopped: bool,
    spindle_percent: u8,
    coolant: Coolant,
    cadence: Cadence,
    /// `?` came while homing, or while there was no room for the report.
    has_pending_report: bool,
    /// `!` came while homing.
    has_pending_hold: bool,
    now: Duration,
}

impl Controller {
    /// Switches a controller on; its banner waits to be transmitted.
    pub fn new(settings: Settings) -> Self {
        Self::with_build(Build::new(settings))
    }

    /// Switches on a controller that is built and wired like this.
    pub fn with_build(build: Build) -> Self {
        let settings = build.settings.clone();
        let (steps, offset) = match build.start_in_machine {
            Some(start) => (steps_from_mm(start, &settings), [0.0; AXES]),
            None => ([0; 3], scale(settings.max_travel_mm(), -0.5)),
        };
        let mut controller = Self {
            plant: Plant {
                offset,
                held: [false; AXES],
                dead: [false; AXES],
                is_door_open: false,
                probe_surface_z: build.probe_surface_z_mm,
            },
            memory: Memory {
                settings,
                systems: CoordinateSystems::default(),
                startup: [String::new(), String::new()],
                build_info: String::new(),
            },
            build,
            state: State::Idle,
            receive_buffer: ReceiveBuffer::default(),
            reader: LineReader::default(),
            transmit: Vec::new(),
            parser: ParserState::default(),
            planner: Planner::new(steps),
            script: VecDeque::new(),
            probing: None,
            probed: ([0; 3], false),
            spindle: Spindle::Off,
            spindle_rpm: 0.0,
            is_spindle_stopped: false,
            spindle_percent: 100,
            coolant: Coolant::default(),
            cadence: Cadence::default(),
            has_pending_report: false,
            has_pending_hold: false,
            now: Duration::ZERO,
        };
        controller.boot();
        controller
    }

    /// Takes bytes that arrived at `now`.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.advance(now);
        for &byte in bytes {
            match realtime(byte) {
                Some(command) => self.act(command),
                None => self.receive_buffer.push(byte),
            }
            // The firmware empties its buffer much faster than bytes arrive.
            self.work();
        }
    }

    /// Appends the bytes to be sent to `to`.
    ///
    /// Lines are not read while [`TRANSMIT_BUFFER_BYTES`] wait here. What was
    /// held up by that goes on now, so there may be more to transmit at once.
    pub fn transmit(&mut self, to: &mut Vec<u8>) {
        to.append(&mut self.transmit);
        if self.has_pending_report && !matches!(self.state, State::Homing(_)) {
            self.has_pending_report = false;
            self.report_status();
        }
        self.work();
    }

    fn is_transmit_full(&self) -> bool {
        self.transmit.len() >= TRANSMIT_BUFFER_BYTES
    }

    /// Where the axes are in machine coordinates, mm, as the controller counts.
    pub fn position(&self) -> Vector {
        match &self.state {
            State::Homing(homing) => homing.position(&self.plant, &self.memory.settings),
            _ => {
                let steps = self.planner.position_steps(&self.memory.settings);
                mm_from_steps(steps, &self.memory.settings)
            }
        }
    }

    /// Speed along the path, mm/min.
    pub fn speed_mm_per_min(&self) -> f64 {
        self.planner.speed_mm_per_min()
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.memory.settings
    }

    /// Received bytes lost to a full receive buffer since power-up.
    pub fn overrun_bytes(&self) -> u64 {
        self.receive_buffer.overrun_bytes
    }

    /// Holds the limit switch of an axis closed, or lets it go.
    pub fn hold_limit(&mut self, axis: usize, is_closed: bool) {
        if axis >= AXES {
            return;
        }
        self.plant.held[axis] = is_closed;
        if is_closed && self.memory.settings.hard_limits() {
            self.hit_limit();
        }
    }

    /// Cuts the wire of the limit switches of an axis, or mends it.
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

    /// Switches the supply off and on: motion, position and unsaved state are gone.
    ///
    /// The axes stay where they are; the controller believes in zero.
    pub fn power_cycle(&mut self) {
        let physical = crate::axes::add(self.position(), self.plant.offset);
        self.plant.offset = physical;
        self.planner = Planner::new([0; 3]);
        self.state = State::Idle;
        self.script.clear();
        self.transmit.clear();
        self.boot();
    }
}
