//! One run, from the proof to the last line cut.

use super::command::{RunRequest, check_start};
use super::config::{ANSWER, WORK_POSITION};
use super::machine::Machine;
use super::proof::{Proof, Proven};
use super::stop::{Stopping, Verdict};
use super::{Driver, LogLevel, Origin, Output, Phase, Refusal, RunOutcome, RunResult};
use crate::codes::{self, error_code};
use crate::encoder::{EncodedLine, Encoder, PREAMBLE, SYNC};
use crate::estimate::Estimate;
use crate::link::LineKind;
use crate::report::ControllerState;
use crate::tracker::Tracker;
use cnc_msgs::contour::{Action, CutterSide};
use cnc_msgs::geometry::{AxisSet, Position};
use cnc_msgs::machine::{MachineState, Mode};
use std::time::Duration;

/// A path on its way to the machine.
#[derive(Debug)]
pub(super) struct Run {
    id: u64,
    request: RunRequest,
    first_element: usize,
    pub(super) encoder: Encoder,
    /// Made and not yet sent, because there is no room.
    pub(super) next: Option<Next>,
    /// A line that must be answered before anything else is sent.
    pub(super) is_alone: bool,
    pub(super) stage: Stage,
    /// The operator has asked for a hold; nothing is sent until a resume.
    pub(super) is_held: bool,
    pub(super) has_sent: bool,
    tracker: Tracker,
    estimate: Estimate,
    total_s: f64,
    progress: Option<(u32, f64)>,
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
    Proving(Proof),
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
    /// All is answered; waiting for a report that says idle.
    Settling(Then),
    ToolChange {
        tool: u32,
        source_line: u32,
    },
    Stopping(Stopping),
}

/// What follows when all motion has ended.
#[derive(Debug, Clone, Copy)]
pub(super) enum Then {
    End,
    ToolChange {
        tool: u32,
        source_line: u32,
    },
    /// The frame of the path is in force: is the tool where it begins?
    CheckStart,
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
            stage: Stage::Proving(proof),
            is_held: false,
            has_sent: false,
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
        if self.first_element > 0 { AxisSet::ALL } else { self.request.path.assumed_axes }
    }

    pub(super) fn is_proving(&self) -> bool {
        matches!(self.stage, Stage::Proving(_))
    }

    pub(super) fn is_stopping(&self) -> bool {
        matches!(self.stage, Stage::Stopping(_))
    }

    pub(super) fn is_changing_tool(&self) -> bool {
        matches!(self.stage, Stage::ToolChange { .. })
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
            Stage::Preparing { until } | Stage::Positioning { until } => Some(*until),
            Stage::Stopping(stopping) => Some(stopping.until()),
            _ => None,
        }
    }

    /// The source line that is being cut, 0 before the first.
    pub(super) fn line(&self) -> u32 {
        let element = self.request.path.elements.get(self.tracker.element());
        element.filter(|_| self.has_sent).map_or(0, |element| element.source.line)
    }

    /// The side that the tool runs on in the element that is being cut.
    fn compensation(&self) -> Option<CutterSide> {
        let element = self.request.path.elements.get(self.tracker.element());
        element.filter(|_| self.has_sent).and_then(|element| element.side)
    }

    pub(super) fn compose_mode(&self, state: &mut MachineState) {
        state.compensation = self.compensation();
        match &self.stage {
            Stage::ToolChange { tool, source_line } if state.mode == Mode::Idle => {
                state.mode = Mode::ToolChange;
                state.reason = format!("TOOL_CHANGE: put in T{tool} (line {source_line})");
            }
            // Between two lines, or in a dwell, the controller calls itself idle.
            Stage::Streaming | Stage::Draining(_) | Stage::Settling(_)
                if state.mode == Mode::Idle =>
            {
                state.mode = Mode::Run;
            }
            Stage::Stopping(stopping) => state.reason = stopping.describe(),
            _ => {}
        }
    }
}

impl Driver {
    pub(super) fn on_run_time(&mut self) {
        let is_machine_held = self.machine.is_state(&ControllerState::Hold)
            || self.machine.is_state(&ControllerState::Door);
        let Phase::Running(run) = &mut self.phase else { return };
        match &mut run.stage {
            // A controller that holds reads nothing; the time counts from the resume.
            Stage::Preparing { until } if run.is_held || is_machine_held => {
                *until = self.now + ANSWER;
            }
            Stage::Proving(proof) => match proof.step(&run.request.path) {
                Proven::NotYet => {}
                Proven::Not(problem) => {
                    let (code, text) = (error_code::NOT_ENCODABLE, problem.to_string());
                    self.end_run(RunOutcome::Aborted, code, text, Phase::Ready);
                }
                Proven::Whole { lines, seconds } => self.begin_run(lines, seconds),
            },
            Stage::Preparing { until } if self.now >= *until => {
                let text = "the controller did not answer the first line".to_owned();
                self.stop_run(RunOutcome::Aborted, error_code::NO_ANSWER, text);
            }
            Stage::Positioning { until } if self.now >= *until => {
                let text = "the controller did not report a work position".to_owned();
                self.stop_run(RunOutcome::Aborted, error_code::NO_ANSWER, text);
            }
            Stage::Stopping(stopping) if self.now >= stopping.until() => self.on_stop_timeout(),
            _ => {}
        }
    }

    fn begin_run(&mut self, lines: usize, seconds: f64) {
        let mode = self.machine.mode();
        let Phase::Running(run) = &mut self.phase else { return };
        if mode != Mode::Idle {
            let text = format!("the machine is no longer idle but in {}", mode.name());
            return self.end_run(RunOutcome::Aborted, error_code::BUSY, text, Phase::Ready);
        }
        run.total_s = seconds;
        run.stage = Stage::Preparing { until: self.now + ANSWER };
        self.machine.program_id.clone_from(&run.request.program_id);
        self.machine.line = 0;
        self.machine.work_system = None;
        self.machine.has_tool_length = None;
        let id = run.id;
        self.link.send_line(PREAMBLE, LineKind::Slow, Origin::Preamble);
        self.reply(id, Ok(format!("{lines} lines, about {seconds:.0} s")));
        let time_left_s = seconds / self.machine.feed_override();
        self.outputs.push_back(Output::Progress { line: 0, fraction: 0.0, time_left_s });
    }

    pub(super) fn on_run_answer(&mut self, origin: Origin, error: Option<u16>) {
        let firmware = self.machine.firmware;
        let is_all_answered = self.link.unanswered() == 0;
        let Phase::Running(run) = &mut self.phase else { return };
        if run.is_stopping() {
            return;
        }
        if is_all_answered {
            run.is_alone = false;
        }
        if let Some(code) = error {
            let text = codes::describe_error(firmware, code);
            let message = match &origin {
                Origin::Program { text: line, source_line, .. } => {
                    format!("line {source_line}: the controller refused {line:?}: {text}")
                }
                _ => format!("the controller refused {}: {text}", own_line(&origin)),
            };
            self.log(LogLevel::Error, message.clone());
            return self.stop_run(RunOutcome::Aborted, error_code::CONTROLLER_ERROR, message);
        }
        match (origin, &run.stage) {
            (Origin::Preamble, Stage::Preparing { .. }) => {
                let is_checked_later = run.encoder.checks_start();
                run.stage = match is_checked_later || run.assumed_axes().is_empty() {
                    true => Stage::Streaming,
                    false => Stage::Positioning { until: self.now + WORK_POSITION },
                };
                self.link.ask_status(self.now);
            }
            (Origin::Program { element: Some(element), .. }, _) => run.tracker.on_answer(element),
            (Origin::Sync, Stage::Draining(then)) => {
                run.stage = Stage::Settling(*then);
                self.link.ask_status(self.now);
            }
            _ => {}
        }
    }

    pub(super) fn on_run_status(&mut self) {
        let is_idle = self.machine.is_state(&ControllerState::Idle);
        let is_alarm = self.machine.is_state(&ControllerState::Alarm);
        self.track();
        let Phase::Running(run) = &mut self.phase else { return };
        match &run.stage {
            Stage::Stopping(_) => return self.on_stop_status(),
            _ if is_alarm => {
                let text = "the controller is in alarm".to_owned();
                let next = Phase::Adrift { reason: format!("{text}; soft_reset to go on") };
                return self.end_run(RunOutcome::Aborted, error_code::ALARM, text, next);
            }
            Stage::Positioning { .. } => {
                let Some(at) = self.machine.work_position() else { return };
                match check_start(at, run.start(), run.assumed_axes()) {
                    Ok(()) => run.stage = Stage::Streaming,
                    Err(Refusal { error_code, message }) => {
                        return self.end_run(
                            RunOutcome::Aborted,
                            error_code,
                            message,
                            Phase::Ready,
                        );
                    }
                }
            }
            Stage::Settling(then) if is_idle => {
                let then = *then;
                run.tracker.on_all_done();
                self.machine.line = run.line();
                match then {
                    Then::ToolChange { tool, source_line } => {
                        run.stage = Stage::ToolChange { tool, source_line };
                    }
                    Then::CheckStart => {
                        run.stage = Stage::Positioning { until: self.now + WORK_POSITION };
                        self.link.ask_status(self.now);
                    }
                    Then::End => return self.succeed(),
                }
            }
            _ => {}
        }
        self.report_progress();
    }

    fn succeed(&mut self) {
        let Phase::Running(run) = &self.phase else { return };
        let events = &run.request.path.events;
        // The end of the program selects the first work system; tool lengths stay.
        if matches!(events.last().map(|event| event.action), Some(Action::ProgramEnd { .. })) {
            self.machine.work_system = Some(1);
        }
        if !events.iter().any(|event| matches!(event.action, Action::ToolLength { .. })) {
            self.machine.has_tool_length = Some(false);
        }
        let last = Output::Progress { line: run.line(), fraction: 1.0, time_left_s: 0.0 };
        self.outputs.push_back(last);
        self.end_run(RunOutcome::Succeeded, 0, "done".into(), Phase::Ready);
    }

    fn track(&mut self) {
        let position = self.machine.work_position();
        let blocks = self.machine.blocks_in_use();
        let oldest = match self.link.oldest() {
            Some(Origin::Program { element, .. }) => *element,
            _ => None,
        };
        let Phase::Running(run) = &mut self.phase else { return };
        if run.has_sent {
            run.tracker.on_position(&run.request.path, position, blocks, oldest);
            self.machine.line = run.line();
        }
    }

    fn report_progress(&mut self) {
        let faster = self.machine.feed_override();
        let Phase::Running(run) = &mut self.phase else { return };
        if !run.has_sent {
            return;
        }
        let done = run.estimate.advance_to(&run.request.path, run.tracker.element());
        let fraction = if run.total_s > 0.0 { (done / run.total_s).min(1.0) } else { 0.0 };
        let line = run.line();
        if run.progress != Some((line, fraction)) {
            run.progress = Some((line, fraction));
            let time_left_s = (run.total_s - done).max(0.0) / faster;
            self.outputs.push_back(Output::Progress { line, fraction, time_left_s });
        }
    }

    /// Ends the run and says so: to the command itself when it was not accepted yet.
    pub(super) fn end_run(
        &mut self,
        outcome: RunOutcome,
        error_code: u16,
        message: String,
        next: Phase,
    ) {
        let Phase::Running(run) = std::mem::replace(&mut self.phase, next) else {
            panic!("only a run can end");
        };
        if run.is_proving() {
            return self.reply(run.id, Err(Refusal { error_code, message }));
        }
        let (id, last_line) = (run.id, run.line());
        if let Stage::Stopping(Stopping { reply: Some(reply), .. }) = run.stage {
            // No start message was heard: whether the reset arrived is not known.
            self.reply(reply, Err(Refusal::new(error_code, message.clone())));
        }
        self.hold = None;
        let result = RunResult { id, outcome, error_code, message, last_line };
        self.outputs.push_back(Output::RunFinished(result));
    }

    pub(super) fn end_with_verdict(&mut self, next: Phase) {
        let Phase::Running(run) = &mut self.phase else { return };
        let Stage::Stopping(stopping) = &mut run.stage else { return };
        let Verdict { outcome, error_code, message } = stopping.verdict.clone();
        self.end_run(outcome, error_code, message, next);
    }
}

fn own_line(origin: &Origin) -> &'static str {
    match origin {
        Origin::Preamble => PREAMBLE,
        Origin::Sync => SYNC,
        _ => "a line",
    }
}
