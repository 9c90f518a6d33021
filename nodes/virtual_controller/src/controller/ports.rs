//! Outputs that programs switch, and inputs that they read: M62 to M68.

use super::{Action, Controller, ControllerState};
use crate::gcode::{InputWait, Output, PortCommand};
use std::collections::{BTreeMap, VecDeque};

/// So many switched outputs are remembered.
const SWITCHED_MAX: usize = 10_000;

/// A port: whether it is analog, and its number.
type Port = (bool, u8);

/// The state of all ports.
#[derive(Debug, Clone, Default)]
pub(super) struct Ports {
    /// For the next motion that is planned.
    with_next_motion: Vec<Output>,
    /// Each with the number of the block at whose beginning it is switched, counted from 1.
    planned: VecDeque<(u64, Output)>,
    inputs: BTreeMap<Port, Input>,
    /// What the last M66 has read: -1 where it has waited in vain.
    result: Option<i32>,
    is_reported: bool,
    switched: Vec<Switched>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Input {
    value: i32,
    rises: u32,
    falls: u32,
}

/// An M66 that has not ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Waiting {
    port: Port,
    wait: InputWait,
    /// The input when it began.
    from: Input,
    pub(super) left_s: f64,
}

/// An output that was switched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switched {
    pub is_analog: bool,
    pub port: u8,
    pub value: f64,
    /// Where the axes X, Y and Z were, machine coordinates, mm.
    pub at: crate::Vector,
}

impl Waiting {
    /// What the input says now, if that ends the wait.
    fn result(&self, now: Input) -> Option<i32> {
        let is_met = match self.wait {
            InputWait::No => true,
            InputWait::Rise => now.rises != self.from.rises,
            InputWait::Fall => now.falls != self.from.falls,
            InputWait::High => now.value != 0,
            InputWait::Low => now.value == 0,
        };
        is_met.then_some(now.value)
    }
}

impl Controller {
    /// Sets an input that programs read.
    pub fn set_input(&mut self, is_analog: bool, port: u8, value: i32) {
        let input = self.ports.inputs.entry((is_analog, port)).or_default();
        input.rises += u32::from(input.value == 0 && value != 0);
        input.falls += u32::from(input.value != 0 && value == 0);
        input.value = value;
        self.work();
    }

    /// The first outputs that were switched since it was switched on.
    pub fn switched(&self) -> &[Switched] {
        &self.ports.switched
    }

    pub(super) fn queue_port(&mut self, command: PortCommand) {
        match command {
            PortCommand::Switch { output, with_motion: true } => {
                self.ports.with_next_motion.push(output);
            }
            // It does not wait for the motion before.
            PortCommand::Switch { output, with_motion: false } => self.switch(output),
            PortCommand::Read { is_analog, port, wait, seconds } => {
                let port = (is_analog, port);
                let from = self.ports.inputs.get(&port).copied().unwrap_or_default();
                let waiting = Waiting { port, wait, from, left_s: seconds };
                self.script.push_back(Action::AwaitInput(waiting));
            }
        }
    }

    /// M66; returns what is left of it.
    pub(super) fn await_input(&mut self, waiting: Waiting) -> Option<Action> {
        let now = self.ports.inputs.get(&waiting.port).copied().unwrap_or_default();
        let result = match waiting.result(now) {
            Some(value) => value,
            None if waiting.left_s > 0.0 && self.state != ControllerState::Check => {
                return Some(Action::AwaitInput(waiting));
            }
            None => -1,
        };
        (self.ports.result, self.ports.is_reported) = (Some(result), false);
        None
    }

    /// What M66 has read, once, and in each report of everything. A number below -1 is in none.
    pub(super) fn take_input_result(&mut self, everything: bool) -> Option<i32> {
        let is_reported = std::mem::replace(&mut self.ports.is_reported, true);
        self.ports.result.filter(|result| *result >= -1 && (everything || !is_reported))
    }

    /// A block was planned: what waits for a motion is switched when this one begins.
    pub(super) fn plan_outputs(&mut self) {
        let block = self.counts.blocks_planned;
        self.ports.planned.extend(self.ports.with_next_motion.drain(..).map(|it| (block, it)));
    }

    /// Switches what belongs to blocks that have begun.
    pub(super) fn switch_planned(&mut self) {
        let begun = self.counts.blocks_planned.saturating_sub(self.planner.len() as u64) + 1;
        while self.ports.planned.front().is_some_and(|(block, _)| *block <= begun) {
            if let Some((_, output)) = self.ports.planned.pop_front() {
                self.switch(output);
            }
        }
    }

    /// What was to be switched is not, and what was read is not reported any more: a reset.
    pub(super) fn forget_ports(&mut self) {
        self.ports.with_next_motion.clear();
        self.ports.result = None;
        self.forget_planned_outputs();
    }

    /// The motion is dropped.
    pub(super) fn forget_planned_outputs(&mut self) {
        self.ports.planned.clear();
    }

    fn switch(&mut self, output: Output) {
        let Output { is_analog, port, value } = output;
        let at = self.position();
        if self.ports.switched.len() < SWITCHED_MAX {
            self.ports.switched.push(Switched { is_analog, port, value, at });
        }
    }
}
