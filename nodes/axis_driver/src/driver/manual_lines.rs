//! Which lines homing, jogs, probes and offsets are, and when they may be sent.

use super::command::{Answer, refused};
use super::manual_operation::{OFFSETS, Task};
use super::{Driver, Phase, Refusal};
use crate::codes::error_code;
use crate::encoder::words::{to_grid, write_word};
use crate::link::LineKind;
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet, Position};
use cnc_msgs::machine::Mode;
use serde::{Deserialize, Serialize};

/// Where a jog goes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct JogRequest {
    pub frame: JogFrame,
    pub axes: AxisSet,
    /// mm; only of the axes that move.
    pub target: Position,
    pub feed_mm_per_min: f64,
}

/// What the numbers of a jog count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JogFrame {
    /// From where the axes are.
    Relative,
    Work,
    Machine,
}

/// How a probe looks for the workpiece.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ProbeRequest {
    pub axes: AxisSet,
    /// How far at most, from where the tool is, mm.
    pub distance: Position,
    pub feed_mm_per_min: f64,
    /// Until it lets go instead of touching.
    pub away: bool,
    /// That nothing was found is no alarm.
    pub may_miss: bool,
}

/// What a place is called.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OffsetRequest {
    /// 1 to 6 are G54 to G59, 92 is G92.
    pub system: u8,
    pub axes: AxisSet,
    /// mm: what the place of the tool shall be called, or where the origin lies.
    pub position: Position,
    pub is_origin: bool,
}

/// The number of the shift on top of all work systems.
const G92: u8 = 92;

impl Driver {
    /// Why nothing can be done by hand now.
    pub(super) fn hand_obstacle(&self) -> Option<Refusal> {
        match self.check {
            Some(_) => Some(Refusal::new(error_code::BUSY, "a program is being checked")),
            None if self.is_tool_awaited() => None,
            None => self.obstacle(),
        }
    }

    pub(super) fn jog(&mut self, id: u64, request: JogRequest) -> Answer {
        if let Some(refusal) = self.hand_obstacle() {
            return Some(Err(refusal));
        }
        let frame = match request.frame {
            JogFrame::Relative => "G91",
            JogFrame::Work => "G90",
            JogFrame::Machine => "G90G53",
        };
        // The way back of a tool change stays right while its zero, whichever, is the same.
        if request.frame == JogFrame::Machine
            && !self.is_tool_awaited()
            && let Some(refusal) = self.machine.home_obstacle("a jog in the machine frame")
        {
            return Some(Err(refusal));
        }
        let words = match self.move_words(request.axes, request.target, request.feed_mm_per_min) {
            Ok(words) => words,
            Err(refusal) => return Some(Err(refusal)),
        };
        let place = self.machine.machine_position().zip(self.machine.work_position());
        let Some((machine, work)) = place else {
            return refused(error_code::CONNECTING, self.machine.unknown_place());
        };
        let mut target = machine;
        for axis in (0..3).filter(|axis| request.axes.contains(*axis)) {
            let from = match request.frame {
                JogFrame::Relative => machine[axis],
                JogFrame::Work => machine[axis] - work[axis],
                JogFrame::Machine => 0.0,
            };
            target[axis] = from + request.target[axis];
        }
        let line = format!("$J=G21{frame}{words}");
        self.begin_manual(id, Task::Jog { target }, LineKind::Motion, [line]);
        Some(Ok("the jog has begun".into()))
    }

    pub(super) fn probe(&mut self, id: u64, request: ProbeRequest) -> Answer {
        if let Some(refusal) = self.hand_obstacle() {
            return Some(Err(refusal));
        }
        let words = match self.move_words(request.axes, request.distance, request.feed_mm_per_min) {
            Ok(words) => words,
            Err(refusal) => return Some(Err(refusal)),
        };
        let word = match (request.away, request.may_miss) {
            (false, false) => "G38.2",
            (false, true) => "G38.3",
            (true, false) => "G38.4",
            (true, true) => "G38.5",
        };
        let task = Task::Probe { may_miss: request.may_miss, heard: None };
        self.begin_manual(id, task, LineKind::Slow, [format!("G21G91G94{word}{words}")]);
        Some(Ok("the probe has begun".into()))
    }

    pub(super) fn set_work_offset(&mut self, id: u64, request: OffsetRequest) -> Answer {
        if let Some(refusal) = self.hand_obstacle() {
            return Some(Err(refusal));
        }
        let OffsetRequest { system, axes, position, is_origin } = request;
        let words = match self.axis_words(axes, position) {
            Ok(words) => words,
            Err(refusal) => return Some(Err(refusal)),
        };
        let (line, name) = match (system, is_origin) {
            (1..=6, true) => (format!("G21G10L2P{system}{words}"), format!("G{}", 53 + system)),
            (1..=6, false) => (format!("G21G10L20P{system}{words}"), format!("G{}", 53 + system)),
            (G92, false) => (format!("G21G92{words}"), "G92".into()),
            (G92, true) => {
                return invalid(
                    "G92 shifts to where the tool is; it has no origin in the machine frame",
                );
            }
            _ => {
                return invalid(format!(
                    "work system {system} does not exist: 1 to 6 are G54 to G59, 92 is G92"
                ));
            }
        };
        let done = match is_origin {
            true => format!("the origin of {name} is {words} in the machine frame"),
            false => format!("the place of the tool is {words} in {name}"),
        };
        let lines = [line, OFFSETS.to_owned()];
        self.begin_manual(id, Task::SetWorkOffset { done }, LineKind::Slow, lines);
        if let Some(paused) = &mut self.paused {
            paused.frame = axes;
        }
        None
    }

    pub(super) fn unlock(&mut self, id: u64) -> Answer {
        match (&self.phase, self.machine.mode()) {
            (Phase::Ready, Mode::Alarm) => {
                self.begin_manual(id, Task::Unlock, LineKind::Slow, ["$X".to_owned()]);
                None
            }
            (Phase::Ready, mode) => {
                let text = format!("the machine is not in alarm but in {}", mode.name());
                refused(error_code::NOTHING_TO_DO, text)
            }
            _ => self.obstacle().map(Err),
        }
    }

    pub(super) fn home(&mut self, id: u64) -> Answer {
        match (&self.phase, self.machine.mode()) {
            (Phase::Ready, Mode::Idle | Mode::Alarm) => {}
            _ => return self.obstacle().map(Err),
        }
        if !self.machine.has_homing() {
            let text = "homing is switched off in the controller ($22=0)";
            return refused(error_code::NO_HOMING, text);
        }
        self.machine.is_homed = false;
        self.begin_manual(id, Task::Home, LineKind::Silent, ["$H".to_owned()]);
        None
    }

    pub(super) fn sleep(&mut self, id: u64) -> Answer {
        match (&self.phase, self.machine.mode()) {
            (Phase::Ready, Mode::Idle | Mode::Alarm) => {
                self.begin_manual(id, Task::Sleep, LineKind::Slow, ["$SLP".to_owned()]);
                None
            }
            _ => self.obstacle().map(Err),
        }
    }

    /// The words of a move by hand, with its feed rate.
    fn move_words(
        &self,
        axes: AxisSet,
        position: Position,
        feed_mm_per_min: f64,
    ) -> Result<String, Refusal> {
        let mut words = self.axis_words(axes, position)?;
        let max = self.config.encoder.feed_mm_per_min_max;
        if !(feed_mm_per_min <= max && to_grid(feed_mm_per_min) > 0) {
            let text = format!(
                "the feed rate {feed_mm_per_min} mm/min is not above 0.0001 and within {max} mm/min"
            );
            return Err(Refusal::new(error_code::INVALID_REQUEST, text));
        }
        write_word(&mut words, 'F', to_grid(feed_mm_per_min));
        Ok(words)
    }

    /// `X10Y-.5`
    fn axis_words(&self, axes: AxisSet, position: Position) -> Result<String, Refusal> {
        let invalid = |text: String| Err(Refusal::new(error_code::INVALID_REQUEST, text));
        let max = self.config.encoder.position_mm_max;
        let mut words = String::new();
        for axis in (0..3).filter(|axis| axes.contains(*axis)) {
            let (letter, value) = (AXIS_LETTERS[axis], position[axis]);
            if value.is_nan() || value.abs() > max {
                return invalid(format!(
                    "{letter}{value} is not within {max} mm either side of zero"
                ));
            }
            write_word(&mut words, letter, to_grid(value));
        }
        if words.is_empty() {
            return invalid(
                "no axis is named: axes has bit 0 for X, bit 1 for Y, bit 2 for Z".into(),
            );
        }
        Ok(words)
    }
}

fn invalid(text: impl Into<String>) -> Answer {
    refused(error_code::INVALID_REQUEST, text)
}
