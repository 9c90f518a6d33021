//! How a run goes on: with time, with answers, with reports, to its end.

use super::command::{Answer, check_start};
use super::config::{ANSWER, RECORDER, SETTLED, WORK_POSITION};
use super::place::PlaceWatch;
use super::proof::Proven;
use super::run::{Stage, Then};
use super::stop::{Stopping, Verdict};
use super::tool_change::ToolChange;
use super::{Driver, LogLevel, Origin, Output, Phase, Refusal, RunOutcome, RunResult};
use crate::codes::{self, error_code};
use crate::encoder::{PREAMBLE, PREAMBLE_IN_FRAME, SYNC};
use crate::link::LineKind;
use crate::report::ControllerState;
use cnc_msgs::contour::Action;
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::PathEvent;
use std::time::Duration;

/// How the reason of a hold begins that is due to the record.
pub(super) const RECORD_NOT_WHOLE: &str = "RECORD_NOT_WHOLE";

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
            Stage::AwaitingRecorder { until } if self.now >= *until => {
                let text = format!("no recorder opened a bag within {} s", RECORDER.as_secs());
                self.refuse_unrecorded(&text);
            }
            Stage::Preparing { until } if self.now >= *until => {
                let text = "the controller did not answer the first line".to_owned();
                self.stop_run(RunOutcome::Aborted, error_code::NO_ANSWER, text);
            }
            Stage::Positioning { until } if self.now >= *until => {
                let text = "the controller did not report a work position".to_owned();
                self.stop_run(RunOutcome::Aborted, error_code::NO_ANSWER, text);
            }
            Stage::Homing { until, .. } if self.now >= *until => {
                let text = "the axes did not find their switches in time".to_owned();
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
        if self.paused.is_none() {
            self.machine.program_id.clone_from(&run.request.program_id);
            self.machine.line = 0;
        }
        let (id, is_check) = (run.id, run.is_check());
        if is_check {
            run.stage = Stage::Preparing { until: self.now + ANSWER };
            self.link.send_line("$C", LineKind::Slow, Origin::CheckMode);
        } else if self.config.require_recording && run.request.is_recorded() {
            run.stage = Stage::AwaitingRecorder { until: self.now + RECORDER };
        } else {
            self.send_preamble();
        }
        self.reply(id, Ok(format!("{lines} lines, about {seconds:.0} s")));
        let time_left_s = seconds / self.machine.feed_override();
        if self.paused.is_none() {
            self.outputs.push_back(Output::Progress { line: 0, fraction: 0.0, time_left_s });
        }
    }

    /// Sends the first words of a run.
    fn send_preamble(&mut self) {
        let Phase::Running(run) = &mut self.phase else { return };
        run.stage = Stage::Preparing { until: self.now + ANSWER };
        self.link.begin_stream(self.now, self.machine.firmware.traits().error_lasts);
        // A block during a tool change moves in the frame of the program that waits.
        if self.paused.is_some() {
            return self.link.send_line(PREAMBLE_IN_FRAME, LineKind::Slow, Origin::Preamble);
        }
        self.machine.work_system = None;
        self.machine.has_tool_length = None;
        self.link.send_line(PREAMBLE, LineKind::Slow, Origin::Preamble);
    }

    /// What the recorder says of the run that is waiting for it, or under way.
    pub(super) fn hear_recorder(&mut self, is_whole: bool, reason: &str) -> Answer {
        if !is_whole && self.paused.is_some() {
            self.miss_record_of_paused(reason);
            return Some(Ok("heard".into()));
        }
        match &self.phase {
            Phase::Running(run) if matches!(run.stage, Stage::AwaitingRecorder { .. }) => {
                match is_whole {
                    true => self.send_preamble(),
                    false => self.refuse_unrecorded(reason),
                }
            }
            Phase::Running(run) if !is_whole && run.request.is_recorded() => {
                self.miss_record(reason);
            }
            _ => {}
        }
        Some(Ok("heard".into()))
    }

    /// The record misses something in mid-run. Where it is required the machine holds, and
    /// whoever resumes goes on without; else the part is worth more than its record.
    fn miss_record(&mut self, reason: &str) {
        let text = format!("the record of this run is not whole: {reason}");
        self.log(LogLevel::Warn, text.clone());
        let Phase::Running(run) = &self.phase else { return };
        if self.config.require_recording && run.has_begun() && !run.is_stopping() {
            self.hold_run(&format!("{RECORD_NOT_WHOLE}: {text}"));
        }
    }

    fn refuse_unrecorded(&mut self, reason: &str) {
        let text = format!("this run is not recorded, and require_recording is set: {reason}");
        self.end_run(RunOutcome::Aborted, error_code::NOT_RECORDING, text, Phase::Ready);
    }

    pub(super) fn on_run_answer(&mut self, origin: Origin, error: Option<u16>) {
        let firmware = self.machine.firmware;
        let is_all_answered = self.link.unanswered() == 0;
        let Phase::Running(run) = &mut self.phase else { return };
        run.empty_reports = 0;
        if run.is_stopping() {
            // Nothing is judged any more, but what is cut is still followed.
            match origin {
                Origin::Program { element: Some(element), .. } => run.tracker.on_answer(element),
                Origin::Query(query) => self.on_again_answer(query),
                _ => {}
            }
            return;
        }
        if is_all_answered {
            run.is_alone = false;
        }
        if let Some(code) = error {
            let text = codes::describe_error(firmware, code);
            let message = match &origin {
                Origin::Program { text: line, source_line, element } => {
                    run.blamed_line = *source_line;
                    let place = run.place_of_line(*source_line, *element);
                    format!("{place}: the controller refused {line:?}: {text}")
                }
                _ => format!("the controller refused {}: {text}", own_line(&origin)),
            };
            self.log(LogLevel::Error, message.clone());
            return self.stop_run(RunOutcome::Aborted, error_code::CONTROLLER_ERROR, message);
        }
        let said = match &origin {
            Origin::Preamble if self.paused.is_none() => Some(PREAMBLE),
            Origin::Program { text, .. } => Some(text.as_str()),
            _ => None,
        };
        self.machine.work_system = said.and_then(selected_system).or(self.machine.work_system);
        match (origin, &run.stage) {
            (Origin::CheckMode, Stage::Preparing { .. }) => self.send_preamble(),
            (Origin::Preamble, Stage::Preparing { .. }) => {
                let is_checked_later = run.encoder.checks_start() || run.is_check();
                run.stage = match is_checked_later || run.assumed_axes().is_empty() {
                    true => Stage::Streaming,
                    false => Stage::Positioning { until: self.now + WORK_POSITION },
                };
                self.link.ask_status(self.now);
            }
            (Origin::Program { element: Some(element), .. }, _) => {
                run.tracker.on_answer(element);
                if run.is_check() {
                    // Nothing moves: what is read is done.
                    run.tracker.on_all_done();
                }
            }
            (Origin::Sync, Stage::Draining(then)) => {
                let from = self.now + SETTLED;
                run.stage = Stage::Settling { then: then.clone(), from };
                self.link.ask_status(from);
            }
            (Origin::Home, Stage::Homing { is_homed_after, .. }) => {
                self.machine.is_homed = *is_homed_after;
                // The axes are somewhere else than they were, and count from another zero.
                self.machine.place = PlaceWatch::default();
                run.stage = Stage::Settling { then: Then::GoOn, from: self.now };
                self.link.ask_status(self.now);
            }
            _ => {}
        }
    }

    pub(super) fn on_run_status(&mut self) {
        let is_check = self.machine.is_state(&ControllerState::Check);
        let is_idle = is_check || self.machine.is_state(&ControllerState::Idle);
        let is_alarm = self.machine.is_state(&ControllerState::Alarm);
        let is_moving = self.machine.is_state(&ControllerState::Run);
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
            Stage::Settling { then: Then::GoOn | Then::ControllerChange { .. }, .. }
                if !is_idle => {}
            Stage::Settling { .. } if is_moving => {
                let text = "the controller has answered every line and still moves: an answer \
                            came twice";
                self.log(LogLevel::Error, text.into());
                return self.stop_run(RunOutcome::Aborted, error_code::PROTOCOL, text.into());
            }
            Stage::Settling { then, from } if is_idle && self.now >= *from => {
                let then = then.clone();
                run.tracker.on_all_done();
                self.machine.line = run.line();
                match then {
                    Then::ToolChange { tool, source_line } => {
                        let stood_at = self.machine.machine_position();
                        let change = ToolChange { tool, source_line, stood_at, is_touched: false };
                        run.stage = Stage::ToolChange(change);
                    }
                    Then::CheckReturn { stood } => {
                        self.check_return(stood);
                        if !matches!(self.phase, Phase::Running(_)) {
                            return;
                        }
                    }
                    Then::CheckStart => {
                        run.stage = Stage::Positioning { until: self.now + WORK_POSITION };
                        self.link.ask_status(self.now);
                    }
                    Then::BlockEnd(block) => run.stage = Stage::BlockEnd(block),
                    Then::GoOn | Then::ControllerChange { .. } => run.stage = Stage::Streaming,
                    Then::Home { text, axes, source_line } => {
                        let is_homed_after = axes == AxisSet::ALL || self.machine.is_homed;
                        let limit = Duration::from_secs(u64::from(self.config.homing_s_max));
                        let until = self.now + limit;
                        run.stage = Stage::Homing { until, source_line, is_homed_after };
                        // Where the axes are is not known again before they are home.
                        self.machine.is_homed = false;
                        self.link.send_line(&text, LineKind::Silent, Origin::Home);
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
        if run.is_check() {
            // The mode is left by a reset.
            let text = "the controller has read every line; nothing moved".to_owned();
            return self.stop_run(RunOutcome::Succeeded, 0, text);
        }
        let events = &run.request.path.events;
        // The end of the program selects the first work system; tool lengths stay.
        if matches!(events.last().map(|event| event.action), Some(Action::ProgramEnd { .. })) {
            self.machine.work_system = Some(1);
        }
        let sets_length = |event: &PathEvent| matches!(event.action, Action::ToolLength { .. });
        if self.paused.is_none() && !events.iter().any(sets_length) {
            self.machine.has_tool_length = Some(false);
        }
        if self.paused.is_none() {
            let last = Output::Progress { line: run.line(), fraction: 1.0, time_left_s: 0.0 };
            self.outputs.push_back(last);
        }
        self.end_run(RunOutcome::Succeeded, 0, "done".into(), Phase::Ready);
    }

    fn track(&mut self) {
        let position = self.machine.work_position();
        let blocks = self.machine.blocks_in_use();
        let oldest = match self.link.oldest() {
            Some(Origin::Program { element, .. }) => *element,
            _ => None,
        };
        // In idle it is the last one of whatever ran before.
        let status = self.machine.status.as_ref();
        let told = status.filter(|status| status.state != ControllerState::Idle);
        let told = told.and_then(|status| status.line);
        let Phase::Running(run) = &mut self.phase else { return };
        // A reset empties the planner without cutting what it held.
        if run.is_resetting() {
            return;
        }
        if run.is_check() {
            self.machine.line = run.line();
            return;
        }
        // The way to the first element is none of its own.
        if run.has_sent && (oldest.is_some() || run.tracker.has_begun()) {
            let told = told.filter(|_| self.config.encoder.line_numbers);
            if let Some(position) = position {
                run.tracker.begin_at(&run.request.path, position);
            }
            if let Some(number) = told {
                run.tracker.on_line_number(number, oldest);
            }
            run.tracker.on_position(&run.request.path, position, blocks, oldest);
            self.machine.line = run.line();
        }
    }

    fn report_progress(&mut self) {
        let faster = self.machine.feed_override();
        let Phase::Running(run) = &mut self.phase else { return };
        // The progress of a run that stands aside is its own.
        if !run.has_sent || self.paused.is_some() {
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
        let (id, last_line, blamed_line) = (run.id, run.line(), run.blamed_line);
        match outcome {
            RunOutcome::Succeeded => {
                if let Some(paused) = &mut self.paused {
                    paused.run.encoder.take_tool_length(&run.request.path);
                }
            }
            _ => self.end_paused_with(Some((error_code, &message))),
        }
        if let Some(rest) = &run.rest {
            self.reply(rest.id, Err(Refusal::new(error_code, message.clone())));
        }
        if let Stage::Stopping(Stopping { reply: Some(reply), .. }) = run.stage {
            // No start message was heard: whether the reset arrived is not known.
            self.reply(reply, Err(Refusal::new(error_code, message.clone())));
        }
        self.hold = None;
        if self.machine.status.is_some() {
            // Whoever hears of the end finds the state of it.
            self.publish();
        }
        let result = RunResult { id, outcome, error_code, message, last_line, blamed_line };
        self.outputs.push_back(Output::RunFinished(result));
    }

    pub(super) fn end_with_verdict(&mut self, next: Phase) {
        let Phase::Running(run) = &mut self.phase else { return };
        let Stage::Stopping(stopping) = &mut run.stage else { return };
        let Verdict { outcome, error_code, message } = stopping.verdict.clone();
        self.end_run(outcome, error_code, message, next);
    }
}

/// The work system that a line of ours selects.
fn selected_system(line: &str) -> Option<u8> {
    const WORDS: [&str; 6] = ["G54", "G55", "G56", "G57", "G58", "G59"];
    let word = line.rfind("G5").and_then(|at| line.get(at..))?;
    WORDS.iter().zip(1..).find(|(known, _)| word == **known).map(|(_, system)| system)
}

fn own_line(origin: &Origin) -> &'static str {
    match origin {
        Origin::Preamble => PREAMBLE,
        Origin::Sync => SYNC,
        Origin::Home => "to home",
        Origin::CheckMode => "$C",
        _ => "a line",
    }
}
