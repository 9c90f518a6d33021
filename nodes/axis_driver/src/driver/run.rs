//! The phase `Running`: one run, from the proof to the last line cut.
//!
//! Each handler takes an event and gives an [`Exit`](exit::Exit) when the run leaves the phase:
//! because it is over, or because the machine has to be stopped. `progress` has the
//! handlers of time, answers and reports, `stream` sends the lines, `tool_change` and
//! `replan` are what happens while the machine stands in the middle of a run.

pub(super) mod beginning;
mod block;
pub(super) mod exit;
mod input;
pub(super) mod job;
mod messages;
mod override_lock;
mod probe;
pub(super) mod progress;
pub(super) mod proof;
pub(super) mod replan;
pub(super) mod request;
mod start;
mod stream;
mod time_left;
pub(super) mod tool_change;
mod user_function;
mod watch;
pub(super) mod workplace;

use super::context::Context;
use super::context::machine::Machine;
use crate::cycle_time::CycleTime;
use crate::encoder::{
    AllowedOverrides, EncodedLine, Encoder, EncoderStep, StartFurther, UserFunction,
};
use crate::envelope::Beginning;
use crate::machine_limits::StoredOffsets;
use crate::tracker::Tracker;
use crate::turns::Turns;
use block::BlockOfLine;
use cnc_msgs::contour::{Probe, Source};
use cnc_msgs::geometry::{AxisSet, Position};
use cnc_msgs::machine::{MachineState, Mode, WAITING_FOR_RECORDER};
use cnc_msgs::probing::Measured;
use input::Reading;
use job::Job;
use override_lock::OverrideLock;
use probe::Probing;
use proof::Proof;
use replan::Replan;
use request::RunRequest;
use std::time::Duration;
use time_left::TimeLeft;
use tool_change::ToolChange;
use user_function::Calling;
use watch::RunWatch;
use workplace::WorkplaceCheck;

/// Owns a path on its way to the machine: the encoder, the line that waits for room, and
/// the stage that the run is in.
#[derive(Debug)]
pub(super) struct ProgramRun {
    pub(super) job: Job,
    first_element: usize,
    pub(super) encoder: Encoder,
    /// Encoded and not yet sent, because there is no room.
    next: Option<Pending>,
    /// A line that must be answered before anything else is sent.
    is_alone: bool,
    stage: Stage,
    /// The operator has asked for a hold; nothing is sent until a resume.
    is_held: bool,
    /// Why it holds, if no operator asked for it.
    hold_reason: Option<String>,
    /// In a row: reports of empty buffers with lines that were never answered.
    pub(super) empty_buffers: Option<(Duration, u32)>,
    /// The block of the line that was sent last.
    block: Option<BlockOfLine>,
    /// Another path for what is left, which is being proved.
    pub(super) rest: Option<Box<Replan>>,
    /// What comes first of the next block, which waits for a resume.
    next_block: Option<EncoderStep>,
    /// Events of the path whose messages have been shown.
    shown: usize,
    time: TimeLeft,
    /// Line, fraction and seconds left that were given last.
    progress: Option<(u32, f64, f64)>,
    /// The stored positions that the path was judged by.
    judged_by: Option<StoredOffsets>,
    /// Where it was judged from.
    beginning: Beginning,
    /// It is judged by others, before the first words are sent.
    judged_again: Option<Box<WorkplaceCheck>>,
    watch: RunWatch,
    measured: Measured,
    /// Functions of the user that it has called.
    calls: u32,
    override_lock: OverrideLock,
    /// What its end says besides.
    remark: String,
}

/// What is encoded and waits for room.
#[derive(Debug)]
enum Pending {
    Line(EncodedLine),
    Sync,
}

/// What a run is doing.
#[derive(Debug)]
enum Stage {
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
    /// The last line and a dwell after it are under way.
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
        source: Source,
        is_homed_after: bool,
    },
    /// The axes move until the probe touches.
    Probing(Probing),
    /// It has ended, and the machine stands: elements up to this one are judged from there.
    Probed {
        until: usize,
    },
    /// Motion has ended before this block; what the controller has stored is asked first.
    Stretch {
        source: Source,
    },
    /// What follows this block is being planned from what the probes have found.
    AwaitingPlan {
        source: Source,
        until: Duration,
        /// The program with it, once the loader has said.
        program_id: Option<String>,
        /// Why the run does not go on with it.
        refused: Option<String>,
    },
    /// A node of the cell does something.
    Calling(Calling),
    /// The controller waits for an input.
    Reading(Reading),
    /// The overrides are on their way to what the program allows.
    Overriding,
    /// A block has ended in single block mode.
    BlockEnd(BlockOfLine),
}

/// What follows when all motion has ended.
#[derive(Debug, Clone)]
enum Then {
    End,
    ToolChange {
        tool: u32,
        source: Source,
    },
    Home {
        text: String,
        axes: AxisSet,
        source: Source,
    },
    /// The controller changes the tool, or waits until it is changed, and answers then.
    ControllerChange {
        tool: u32,
        source: Source,
    },
    Probe {
        line: EncodedLine,
        probe: Probe,
    },
    /// The probe has ended.
    Probed(Probing),
    /// Plan what follows this block from the results of the probes before.
    Stretch {
        source: Source,
    },
    /// Wait for an input with this line.
    ReadInput {
        line: EncodedLine,
    },
    /// Have a node of the cell do this.
    UserFunction {
        function: UserFunction,
        source: Source,
    },
    /// Let the operator override no more than this.
    AllowOverrides {
        allowed: AllowedOverrides,
        source: Source,
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

impl ProgramRun {
    pub(super) fn new(
        id: u64,
        request: RunRequest,
        encoder: Encoder,
        first_element: usize,
        proof: Proof,
        time: CycleTime,
        machine: &Machine,
    ) -> Self {
        let tracker = Tracker::new(first_element, machine.planner_blocks());
        let job = Job {
            id,
            path_of: request.program_id.clone(),
            request,
            tracker,
            turns: Turns::new(encoder.events_begun(), encoder.further_place().at),
            first_element,
            has_sent: false,
            blamed_line: 0,
            is_in_tool_change: false,
        };
        Self {
            job,
            first_element,
            shown: encoder.events_begun(),
            encoder,
            next: None,
            is_alone: false,
            stage: Stage::Proving(Box::new(proof)),
            is_held: false,
            hold_reason: None,
            empty_buffers: None,
            block: None,
            next_block: None,
            rest: None,
            time: TimeLeft::new(time),
            progress: None,
            judged_by: None,
            beginning: Beginning::default(),
            judged_again: None,
            watch: RunWatch::default(),
            measured: Measured::default(),
            calls: 0,
            override_lock: OverrideLock::default(),
            remark: String::new(),
        }
    }

    /// Where the first element starts, work frame, mm.
    pub(super) fn start(&self) -> Position {
        let path = &self.job.request.path;
        path.start_of(self.first_element.min(path.elements.len()))
    }

    /// The axes that must be there: those the path relies on, or all in the middle.
    pub(super) fn assumed_axes(&self) -> AxisSet {
        match self.first_element {
            0 if !self.encoder.is_lifted() => self.job.request.path.assumed_axes,
            _ => self.encoder.start_axes(),
        }
    }

    /// Where A to W must be then.
    pub(super) fn start_further(&self) -> StartFurther {
        self.encoder.start_further()
    }

    /// Whether the run may begin wherever the axes are.
    pub(super) fn relies_on_no_place(&self) -> bool {
        self.assumed_axes().is_empty() && self.start_further().at.is_empty()
    }

    /// Whether slices of the path wait to be judged.
    pub(super) fn is_judging(&self) -> bool {
        self.judged_again.is_some()
    }

    pub(super) fn is_proving(&self) -> bool {
        matches!(self.stage, Stage::Proving(_))
    }

    /// Whether slices of the path wait to be encoded.
    pub(super) fn is_encoding(&self) -> bool {
        matches!(&self.stage, Stage::Proving(proof) if proof.waits_until().is_none())
    }

    /// Whether anything of it was sent.
    pub(super) fn has_begun(&self) -> bool {
        !matches!(self.stage, Stage::Proving(_) | Stage::AwaitingRecorder { .. })
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

    /// Sends nothing until a resume. What is under way is not held by this.
    pub(super) fn set_held(&mut self) {
        self.is_held = true;
    }

    /// Takes a resume: lines are sent again.
    pub(super) fn release(&mut self) {
        self.is_held = false;
        self.hold_reason = None;
        self.forgive_deviation();
    }

    /// Holds, and says why.
    pub(super) fn hold(&mut self, context: &mut Context, reason: &str) {
        self.set_hold_reason(reason);
        context.send_hold();
    }

    /// Holds for a reason that says itself what may be done.
    fn hold_for(&mut self, context: &mut Context, reason: String) {
        self.is_held = true;
        self.hold_reason = Some(reason);
        context.send_hold();
    }

    /// Does the same while nothing moves, so that no feed hold is sent.
    pub(super) fn set_hold_reason(&mut self, reason: &str) {
        self.is_held = true;
        self.hold_reason = Some(format!("{reason}; resume to go on"));
    }

    pub(super) fn go_on(&mut self) {
        self.stage = Stage::Streaming;
    }

    pub(super) fn deadline(&self) -> Option<Duration> {
        match &self.stage {
            Stage::Proving(proof) => proof.waits_until(),
            Stage::AwaitingRecorder { until }
            | Stage::Preparing { until }
            | Stage::Positioning { until }
            | Stage::Homing { until, .. }
            | Stage::AwaitingPlan { until, .. }
            | Stage::Calling(Calling { until, .. }) => Some(*until),
            _ => None,
        }
    }

    /// Why it waits, where that is for something else than the machine.
    fn waits_for_others(&self) -> Option<String> {
        match &self.stage {
            Stage::Calling(calling) => Some(self.calling_reason(calling)),
            Stage::Reading(reading) => Some(reading.reason(&self.job)),
            _ => None,
        }
    }

    /// Adds to the state what the run knows.
    pub(super) fn compose_mode(&self, state: &mut MachineState, is_machine_held: bool) {
        state.compensation = self.job.compensation();
        state.path_revision = self.job.request.revision;
        state.settled_elements = self.settled(is_machine_held).unwrap_or(0);
        match &self.stage {
            Stage::ToolChange(ToolChange { tool, source, .. }) if state.mode == Mode::Idle => {
                state.mode = Mode::ToolChange;
                state.tool_wanted = *tool;
                let line = self.job.line_of(*source);
                state.reason = format!("TOOL_CHANGE: put in T{tool} ({line})");
                if let Some(text) = self.message_before(self.encoder.events_begun()) {
                    state.reason += &format!(": {text}");
                }
            }
            Stage::Draining(Then::ControllerChange { tool, source })
                if state.mode == Mode::ToolChange =>
            {
                state.tool_wanted = *tool;
                let line = self.job.line_of(*source);
                state.reason = format!("TOOL_CHANGE: the controller waits for T{tool} ({line})");
            }
            Stage::BlockEnd(block) if state.mode == Mode::Idle => {
                state.mode = Mode::Hold;
                state.reason = format!("SINGLE_BLOCK: resume to go on ({})", block.text(&self.job));
            }
            Stage::Homing { source, .. } => {
                state.mode = Mode::Home;
                state.reason = format!("HOME: asked for in {}", self.job.line_of(*source));
            }
            Stage::Stretch { source } | Stage::AwaitingPlan { source, .. }
                if state.mode == Mode::Idle =>
            {
                state.mode = Mode::Run;
                let line = self.job.line_of(*source);
                let word = if self.measured.probes.is_empty() { "INPUT" } else { "PROBE" };
                state.reason =
                    format!("{word}: what follows is being planned from its result ({line})");
            }
            Stage::Overriding if state.mode == Mode::Idle => state.mode = Mode::Run,
            Stage::Calling(_) | Stage::Reading(_) if state.mode == Mode::Idle => {
                state.mode = Mode::Run;
                state.reason = self.waits_for_others().unwrap_or_default();
            }
            Stage::Probing(probing) if matches!(state.mode, Mode::Idle | Mode::Run) => {
                state.mode = Mode::Run;
                state.reason = probing.reason(&self.job);
            }
            // Between two lines, or in a dwell, the controller calls itself idle.
            Stage::Streaming
            | Stage::Draining(_)
            | Stage::Settling { .. }
            | Stage::Probed { .. }
                if state.mode == Mode::Idle =>
            {
                state.mode = Mode::Run;
            }
            Stage::AwaitingRecorder { .. } => {
                state.reason =
                    format!("{WAITING_FOR_RECORDER}: the run begins when it is recorded");
            }
            _ => {}
        }
        if let (Mode::Hold, true, Some(reason)) =
            (state.mode, state.reason.is_empty(), &self.hold_reason)
        {
            state.reason.clone_from(reason);
        }
        let waits =
            self.waits_for_others().filter(|_| matches!(state.mode, Mode::Hold | Mode::Door));
        if let Some(reason) = waits {
            let before = if state.reason.is_empty() { "" } else { "; " };
            state.reason += &format!("{before}{reason}");
        }
    }
}
