//! One run: what it holds and where it is, from the proof to the last line cut.
//!
//! How it goes on is in `run_progress`, what is sent in `stream`.

use super::block::BlockOfLine;
use super::command::RunRequest;
use super::machine::Machine;
use super::proof::Proof;
use super::replan::Replan;
use super::stop::Stopping;
use super::tool_change::ToolChange;
use crate::encoder::{EncodedLine, Encoder};
use crate::estimate::Estimate;
use crate::tracker::Tracker;
use cnc_msgs::contour::CutterSide;
use cnc_msgs::geometry::{AxisSet, Position};
use cnc_msgs::machine::{MachineState, Mode, WAITING_FOR_RECORDER};
use std::time::Duration;

/// A path on its way to the machine.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) id: u64,
    pub(super) request: RunRequest,
    pub(super) first_element: usize,
    pub(super) encoder: Encoder,
    /// Made and not yet sent, because there is no room.
    pub(super) next: Option<Next>,
    /// A line that must be answered before anything else is sent.
    pub(super) is_alone: bool,
    pub(super) stage: Stage,
    /// The operator has asked for a hold; nothing is sent until a resume.
    pub(super) is_held: bool,
    /// Why it holds, where nobody asked for it.
    pub(super) hold_reason: Option<String>,
    /// The line of the block that the controller refused or stopped at.
    pub(super) blamed_line: u32,
    pub(super) has_sent: bool,
    /// In a row: reports of empty buffers with lines that were never answered.
    pub(super) empty_reports: u32,
    /// The line that was sent last, where single blocks are told apart.
    pub(super) block: Option<BlockOfLine>,
    /// Another path for what is left, which is being looked at.
    pub(super) rest: Option<Box<Replan>>,
    /// A line of the next block, which waits for a resume.
    pub(super) next_block: Option<EncodedLine>,
    pub(super) tracker: Tracker,
    pub(super) estimate: Estimate,
    pub(super) total_s: f64,
    pub(super) progress: Option<(u32, f64)>,
}

/// What is made and waits for room.
#[derive(Debug)]
pub(super) enum Next {
    Line(EncodedLine),
    Sync,
}

/// Where a run is.
#[derive(Debug)]
pub(super) enum Stage {
    /// Encoded to the end for its errors; nothing is sent.
    Proving(Box<Proof>),
    /// Nothing is sent before the recorder has opened its bag.
    AwaitingRecorder {
        until: Duration,
    },
    /// The preamble is under way.
    Preparing {
        until: Duration,
    },
    /// Waiting for a report that shows where the tool is.
    Positioning {
        until: Duration,
    },
    Streaming,
    /// The last line and a dwell behind it are under way.
    Draining(Then),
    /// All is answered; waiting for a report from then on that says idle.
    Settling {
        then: Then,
        from: Duration,
    },
    ToolChange(ToolChange),
    /// The axes go to their switches.
    Homing {
        until: Duration,
        source_line: u32,
        is_homed_after: bool,
    },
    /// A block has ended in single block mode.
    BlockEnd(BlockOfLine),
    Stopping(Stopping),
}

/// What follows when all motion has ended.
#[derive(Debug, Clone)]
pub(super) enum Then {
    End,
    ToolChange {
        tool: u32,
        source_line: u32,
    },
    Home {
        text: String,
        axes: AxisSet,
        source_line: u32,
    },
    /// The controller changes the tool, or waits until it is changed, and answers then.
    ControllerChange {
        tool: u32,
        source_line: u32,
    },
    /// The axes are home.
    GoOn,
    /// Wait for a resume.
    BlockEnd(BlockOfLine),
    /// The frame of the path is in force: is the tool where it begins?
    CheckStart,
    /// Is the tool back where the run stopped for a tool change? Machine frame.
    CheckReturn {
        stood: Position,
    },
}

impl Run {
    pub(super) fn new(
        id: u64,
        request: RunRequest,
        encoder: Encoder,
        first_element: usize,
        proof: Proof,
        machine: &Machine,
    ) -> Self {
        let estimate = Estimate::new(machine.rates(), &request.path, first_element);
        let tracker = Tracker::new(first_element, machine.planner_blocks());
        Self {
            id,
            request,
            first_element,
            encoder,
            next: None,
            is_alone: false,
            stage: Stage::Proving(Box::new(proof)),
            is_held: false,
            hold_reason: None,
            blamed_line: 0,
            has_sent: false,
            empty_reports: 0,
            block: None,
            next_block: None,
            rest: None,
            tracker,
            estimate,
            total_s: 0.0,
            progress: None,
        }
    }

    /// The command that began it.
    pub(super) fn id(&self) -> u64 {
        self.id
    }

    /// Where the first element starts, work frame, mm.
    pub(super) fn start(&self) -> Position {
        self.request.path.start_of(self.first_element.min(self.request.path.elements.len()))
    }

    /// The axes that must be there: those the path relies on, or all in the middle.
    pub(super) fn assumed_axes(&self) -> AxisSet {
        match self.first_element {
            0 => self.request.path.assumed_axes,
            _ => self.encoder.start_axes(),
        }
    }

    /// `line 12 (N70)`
    pub(super) fn place_of_line(&self, source_line: u32, element: Option<usize>) -> String {
        let element = element.and_then(|index| self.request.path.elements.get(index));
        match element.and_then(|element| element.source.block) {
            Some(block) => format!("line {source_line} (N{block})"),
            None => format!("line {source_line}"),
        }
    }

    /// The block that is being cut.
    pub(super) fn place(&self) -> String {
        match self.line() {
            0 => "before the first line".into(),
            line => self.place_of_line(line, Some(self.tracker.element())),
        }
    }

    /// Whether the controller reads the program without moving.
    pub(super) fn is_check(&self) -> bool {
        self.request.check_only
    }

    pub(super) fn is_proving(&self) -> bool {
        matches!(self.stage, Stage::Proving(_))
    }

    /// Whether anything of it was sent.
    pub(super) fn has_begun(&self) -> bool {
        !matches!(self.stage, Stage::Proving(_) | Stage::AwaitingRecorder { .. })
    }

    pub(super) fn is_stopping(&self) -> bool {
        matches!(self.stage, Stage::Stopping(_))
    }

    pub(super) fn is_changing_tool(&self) -> bool {
        matches!(self.stage, Stage::ToolChange(_))
    }

    pub(super) fn is_homing(&self) -> bool {
        matches!(self.stage, Stage::Homing { .. })
    }

    pub(super) fn is_at_block_end(&self) -> bool {
        matches!(self.stage, Stage::BlockEnd(_))
    }

    pub(super) fn is_held(&self) -> bool {
        self.is_held
    }

    pub(super) fn set_held(&mut self, is_held: bool) {
        self.is_held = is_held;
    }

    pub(super) fn go_on(&mut self) {
        self.stage = Stage::Streaming;
    }

    pub(super) fn deadline(&self) -> Option<Duration> {
        match &self.stage {
            Stage::AwaitingRecorder { until }
            | Stage::Preparing { until }
            | Stage::Positioning { until }
            | Stage::Homing { until, .. } => Some(*until),
            Stage::Stopping(stopping) => Some(stopping.until()),
            _ => None,
        }
    }

    /// The source line that is being cut, 0 before the first.
    pub(super) fn line(&self) -> u32 {
        let element = self.request.path.elements.get(self.tracker.element());
        let has_begun = self.has_sent && self.tracker.is_under_way();
        element.filter(|_| has_begun).map_or(0, |element| element.source.line)
    }

    /// The side that the tool runs on in the element that is being cut: from the
    /// beginning of the lead-on, and no longer at the end of the lead-off (A18, A19).
    fn compensation(&self) -> Option<CutterSide> {
        let elements = &self.request.path.elements;
        let side = |index: usize| elements.get(index).and_then(|element| element.side);
        let element = self.tracker.element();
        let is_over = self.tracker.is_at_end() && side(element + 1).is_none();
        side(element).filter(|_| self.has_sent && !is_over)
    }

    pub(super) fn compose_mode(&self, state: &mut MachineState, is_machine_held: bool) {
        state.compensation = self.compensation();
        state.path_revision = self.request.revision;
        state.settled_elements = self.settled(is_machine_held).unwrap_or(0);
        match &self.stage {
            Stage::ToolChange(ToolChange { tool, source_line, .. }) if state.mode == Mode::Idle => {
                state.mode = Mode::ToolChange;
                state.tool_wanted = *tool;
                state.reason = format!("TOOL_CHANGE: put in T{tool} (line {source_line})");
            }
            Stage::Draining(Then::ControllerChange { tool, source_line })
                if state.mode == Mode::ToolChange =>
            {
                state.tool_wanted = *tool;
                state.reason =
                    format!("TOOL_CHANGE: the controller waits for T{tool} (line {source_line})");
            }
            Stage::BlockEnd(block) if state.mode == Mode::Idle => {
                state.mode = Mode::Hold;
                state.reason = format!("SINGLE_BLOCK: resume goes on ({block})");
            }
            Stage::Homing { source_line, .. } => {
                state.mode = Mode::Home;
                state.reason = format!("HOME: asked for in line {source_line}");
            }
            // Between two lines, or in a dwell, the controller calls itself idle.
            Stage::Streaming | Stage::Draining(_) | Stage::Settling { .. }
                if state.mode == Mode::Idle =>
            {
                state.mode = Mode::Run;
            }
            Stage::AwaitingRecorder { .. } => {
                state.reason =
                    format!("{WAITING_FOR_RECORDER}: the run begins when it is recorded");
            }
            Stage::Stopping(stopping) => state.reason = stopping.describe(),
            _ => {}
        }
        if let (Mode::Hold, true, Some(reason)) =
            (state.mode, state.reason.is_empty(), &self.hold_reason)
        {
            state.reason.clone_from(reason);
        }
    }
}
