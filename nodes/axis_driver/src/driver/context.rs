//! What outlives every phase: the link, the machine model, the outputs.
//!
//! Each phase is handed this with every event. It knows no phase: a method here needs
//! only what is here.

pub(super) mod board;
pub(super) mod commander;
pub(super) mod config;
pub(super) mod further;
pub(super) mod hold;
pub(super) mod limits;
pub(super) mod machine;
pub(super) mod obstacles;
pub(super) mod offsets;
pub(super) mod overrides;
mod parameters;
pub(super) mod path_deviation;
pub(super) mod place;
pub(super) mod queries;
pub(super) mod ros_loss;

use super::answer::Refusal;
use super::output::{ControllerSettings, LogLevel, Output};
use crate::link::{LineKind, Link};
use cnc_msgs::contour::Source;
use cnc_msgs::machine::Mode;
use config::DriverConfig;
use hold::HoldWatch;
use machine::Machine;
use overrides::OverrideWatch;
use queries::{OFFSETS_QUERY, QUERIES, SETTINGS_QUERY};
use ros_loss::RosLoss;
use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

/// Where a line that is under way comes from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Origin {
    Query(usize),
    /// From a manual operation.
    Manual,
    /// Homes the axes for a program.
    Home,
    /// Switches the controller's check mode on.
    CheckMode,
    /// Asks for the offsets before a run, and in one.
    Offsets,
    /// Asks for the offsets, whatever the driver is doing.
    OffsetsAnew,
    /// Asks for the settings, before those.
    SettingsAnew,
    Preamble,
    /// From the program, with its text for messages.
    Program {
        text: String,
        source: Source,
        element: Option<usize>,
        /// The events of the path before it, its own included.
        events: usize,
    },
    Sync,
}

/// Owns what no phase owns.
#[derive(Debug)]
pub(super) struct Context {
    pub(super) config: DriverConfig,
    /// The time of the present input.
    pub(super) now: Duration,
    pub(super) link: Link<Origin>,
    pub(super) machine: Machine,
    /// A feed hold that has not shown in a report yet.
    pub(super) hold: Option<HoldWatch>,
    /// Overrides that have not shown in a report yet.
    pub(super) overrides: Option<OverrideWatch>,
    /// When a commander gave its last sign of life.
    pub(super) commander_seen: Option<Duration>,
    /// No peer can reach the driver over ROS.
    pub(super) ros_loss: Option<RosLoss>,
    /// The machine stops after every block and waits for a resume.
    pub(super) is_single_block: bool,
    /// What cannot be checked of the run, as it was said.
    pub(super) not_checked: BTreeSet<String>,
    /// What the process around the driver has not taken yet.
    pub(super) outputs: VecDeque<Output>,
}

impl Context {
    pub(super) fn new(config: DriverConfig) -> Self {
        Self {
            link: Link::new(config.link(), Duration::ZERO),
            config,
            now: Duration::ZERO,
            machine: Machine::default(),
            hold: None,
            overrides: None,
            commander_seen: None,
            ros_loss: None,
            is_single_block: false,
            not_checked: BTreeSet::new(),
            outputs: VecDeque::new(),
        }
    }

    pub(super) fn reply(&mut self, id: u64, result: Result<String, Refusal>) {
        self.outputs.push_back(Output::Reply { id, result });
    }

    pub(super) fn log(&mut self, level: LogLevel, message: impl Into<String>) {
        self.outputs.push_back(Output::Log { level, message: message.into() });
    }

    /// Says once in a run what cannot be checked of it, although it is judged in several parts.
    pub(super) fn log_not_checked(&mut self, level: LogLevel, message: String) {
        if self.not_checked.insert(message.clone()) {
            self.log(level, message);
        }
    }

    /// Asks for the stored offsets: those that the driver has may be old.
    pub(super) fn ask_offsets(&mut self) {
        self.link.send_line(OFFSETS_QUERY, LineKind::Slow, Origin::OffsetsAnew);
    }

    /// Asks for the settings: those that came are not readable. The answer is not waited for; ask for
    /// the offsets after it.
    pub(super) fn ask_settings(&mut self) {
        self.link.send_line(QUERIES[SETTINGS_QUERY], LineKind::Slow, Origin::SettingsAnew);
    }

    /// Whether the controller reads such a question, and answers it soon.
    pub(super) fn can_ask_offsets(&self) -> bool {
        self.machine.mode() == Mode::Idle && self.link.unanswered() == 0
    }

    /// Takes that it has answered.
    pub(super) fn on_offsets_anew(&mut self, error: Option<u16>) {
        self.machine.offset_answers += 1;
        if error.is_none() {
            self.publish_settings();
        }
    }

    /// Asks for the stored offsets when a report of a machine at rest has a work offset that none of
    /// them explains: a pendant or another sender has set one.
    pub(super) fn ask_about_new_offset(&mut self) {
        let Some(offset) = self.machine.work_offset else { return };
        let is_new = self.machine.asked_about != Some(offset) && !self.machine.is_stored(offset);
        if is_new && self.can_ask_offsets() {
            self.machine.asked_about = Some(offset);
            self.ask_offsets();
        }
    }

    /// Gives what the controller reported about itself.
    pub(super) fn publish_settings(&mut self) {
        let machine = &self.machine;
        let settings = ControllerSettings {
            firmware: machine.firmware,
            version: machine.version.clone(),
            options: machine.options.clone(),
            planner_blocks: machine.planner_blocks(),
            axes: machine.axis_letters(),
            receive_bytes: self.link.receive_bytes(),
            window: self.link.window(),
            settings: machine.reported.iter().map(|(n, value)| (*n, value.clone())).collect(),
            offsets: machine.stored_offsets(),
            ..ControllerSettings::default()
        };
        self.outputs.push_back(Output::Settings(settings));
    }
}
