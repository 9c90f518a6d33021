//! How a run goes on: with time, with answers, with reports, to its end.

use super::exit::{Exit, RunVerdict};
use super::proof::{Judged, Proven};
use super::time_left::UnderWay;
use super::tool_change::ToolChange;
use super::watch::EndOfLines;
use super::{ProgramRun, Stage, Then};
use crate::codes::{self, error_code};
use crate::cycle_time::duration;
use crate::driver::context::config::{ANSWER, PLANNED, RECORDER, SETTLED, WORK_POSITION};
use crate::driver::context::place::PlaceWatch;
use crate::driver::context::queries::OFFSETS_QUERY;
use crate::driver::context::{Context, Origin};
use crate::driver::next::Next;
use crate::driver::output::{LogLevel, Output};
use crate::encoder::{PREAMBLE, PREAMBLE_IN_FRAME, SYNC};
use crate::link::LineKind;
use crate::report::ControllerState;
use cnc_msgs::contour::{Action, Source, work_system};
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::machine::Mode;
use cnc_msgs::path::PathEvent;
use std::time::Duration;

/// The first word of the reason when an incomplete record has caused the hold.
const RECORD_NOT_WHOLE: &str = "RECORD_NOT_WHOLE";

impl ProgramRun {
    pub(in crate::driver) fn on_time(&mut self, context: &mut Context) -> Option<Exit> {
        if self.judged_again.is_some() {
            return self.step_judgement(context);
        }
        let now = context.now;
        let is_machine_held = context.machine.is_state(&ControllerState::Hold)
            || context.machine.is_state(&ControllerState::Door);
        match &mut self.stage {
            // A controller that holds reads nothing; the time counts from the resume.
            Stage::Preparing { until } if self.is_held || is_machine_held => {
                *until = now + ANSWER;
                None
            }
            Stage::Proving(proof) => match proof.step(&self.job.request.path) {
                Proven::NotYet => None,
                Proven::Not(problem) => {
                    let (code, text) = (error_code::NOT_ENCODABLE, problem.to_string());
                    Some(Exit::over(RunVerdict::aborted(code, text)))
                }
                Proven::Whole { lines, seconds } => match proof.judge(context, &self.job.request) {
                    Judged::NotYet => None,
                    Judged::Refused(refusal) => Some(Exit::over(refusal.into())),
                    Judged::Fits => {
                        if let Some(workplace) = &proof.workplace {
                            self.judged_by = Some(workplace.offsets);
                            self.beginning = workplace.beginning;
                            self.remark = workplace.remark();
                        }
                        self.begin(context, lines, seconds)
                    }
                },
            },
            Stage::AwaitingRecorder { until } if now >= *until => {
                let text = format!("no recorder opened a bag within {} s", RECORDER.as_secs());
                Some(refuse_unrecorded(&text))
            }
            Stage::Preparing { until } if now >= *until => {
                let text = "the controller did not answer the first line";
                Some(Exit::abort(error_code::NO_ANSWER, text))
            }
            Stage::Positioning { until } if now >= *until => {
                let text = "the controller did not report a work position";
                Some(Exit::abort(error_code::NO_ANSWER, text))
            }
            Stage::Homing { until, .. } if now >= *until => {
                let text = "the axes did not find their switches in time";
                Some(Exit::abort(error_code::NO_ANSWER, text))
            }
            Stage::AwaitingPlan { until, .. }
                if self.is_held || is_machine_held || self.rest.is_some() =>
            {
                *until = now + PLANNED;
                None
            }
            Stage::AwaitingPlan { source, until, program_id, refused }
                if refused.is_some() || now >= *until =>
            {
                let node = if program_id.is_some() { "planner" } else { "loader" };
                let late = || format!("the {node} has not answered within {} s", PLANNED.as_secs());
                let (source, why) = (*source, refused.take().unwrap_or_else(late));
                Some(self.end_without_plan(source, &why))
            }
            Stage::Calling(calling) if self.is_held || is_machine_held => {
                calling.extend(context);
                None
            }
            Stage::Calling(calling) if now >= calling.until => {
                let most = context.config.user_function_s_max;
                let calling = calling.clone();
                let why = format!("no answer within {most} s (user_function_s_max)");
                Some(self.end_without_function(&calling, &why))
            }
            _ => None,
        }
    }

    /// The whole path is proved: the command is answered, and the first line sent.
    fn begin(&mut self, context: &mut Context, lines: usize, seconds: f64) -> Option<Exit> {
        let mode = context.machine.mode();
        if mode != Mode::Idle {
            let text = format!("the machine is no longer idle; it is in {}", mode.name());
            return Some(Exit::over(RunVerdict::aborted(error_code::BUSY, text)));
        }
        self.time.set_total(seconds);
        if !self.job.is_in_tool_change {
            context.machine.program_id.clone_from(&self.job.request.program_id);
            context.machine.line = 0;
        }
        if self.job.is_check() {
            self.stage = Stage::Preparing { until: context.now + ANSWER };
            context.link.send_line("$C", LineKind::Slow, Origin::CheckMode);
        } else if context.config.require_recording && self.job.request.is_recorded() {
            self.stage = Stage::AwaitingRecorder { until: context.now + RECORDER };
        } else {
            self.ask_offsets(context);
        }
        context.reply(self.job.id, Ok(format!("{lines} lines, about {}", duration(seconds))));
        self.time.follow(&self.job.request.path, context.machine.speeds());
        let time_left_s = self.time.total_s();
        if !self.job.is_in_tool_change {
            context.outputs.push_back(Output::Progress { line: 0, fraction: 0.0, time_left_s });
        }
        None
    }

    /// Where places are compared or were judged, asks for the offsets before the first line: what
    /// the driver has may be old, since a pendant or another program sets them too.
    fn ask_offsets(&mut self, context: &mut Context) {
        let counts = self.is_watched(context) || self.judged_by.is_some();
        if !counts || self.job.is_in_tool_change {
            return self.send_preamble(context);
        }
        self.stage = Stage::Preparing { until: context.now + ANSWER };
        context.link.send_line(OFFSETS_QUERY, LineKind::Slow, Origin::Offsets);
    }

    /// Sends the first words of a run.
    pub(super) fn send_preamble(&mut self, context: &mut Context) {
        self.stage = Stage::Preparing { until: context.now + ANSWER };
        self.begin_watch(context);
        context.link.begin_stream(context.now, context.machine.firmware.traits().error_lasts);
        // A block during a tool change moves in the frame of the program that waits.
        if self.job.is_in_tool_change {
            self.watch_line(PREAMBLE_IN_FRAME, Source::default());
            return context.link.send_line(PREAMBLE_IN_FRAME, LineKind::Slow, Origin::Preamble);
        }
        context.machine.work_system = None;
        context.machine.has_tool_length = None;
        self.watch_line(PREAMBLE, Source::default());
        context.link.send_line(PREAMBLE, LineKind::Slow, Origin::Preamble);
    }

    /// Takes what the recorder says of the run that is waiting for it, or under way.
    pub(in crate::driver) fn on_recorder(
        &mut self,
        context: &mut Context,
        is_whole: bool,
        reason: &str,
    ) -> Option<Exit> {
        match self.stage {
            Stage::AwaitingRecorder { .. } if is_whole => self.ask_offsets(context),
            Stage::AwaitingRecorder { .. } => return Some(refuse_unrecorded(reason)),
            _ if !is_whole && self.job.request.is_recorded() => {
                if let Some(reason) = miss_record(context, reason)
                    && self.has_begun()
                {
                    self.hold(context, &reason);
                }
            }
            _ => {}
        }
        None
    }

    /// Takes that a line was answered.
    pub(in crate::driver) fn on_answer(
        &mut self,
        context: &mut Context,
        origin: Origin,
        error: Option<u16>,
    ) -> Option<Exit> {
        self.empty_buffers = None;
        if context.link.unanswered() == 0 {
            self.is_alone = false;
        }
        if matches!(
            (&origin, &self.stage),
            (Origin::Offsets, Stage::Probed { .. } | Stage::Stretch { .. })
        ) && error.is_some()
        {
            let text =
                "the controller did not say its offsets: what follows is judged by those before it";
            context.log(LogLevel::Warn, text);
        }
        match (&origin, &self.stage) {
            (Origin::Offsets, Stage::Probing(_)) => return self.end_probe(context),
            (Origin::Offsets, Stage::Probed { .. }) => {
                self.judge_from_probe(context);
                return None;
            }
            (Origin::Offsets, Stage::Stretch { .. }) => {
                self.await_plan(context);
                return None;
            }
            _ => {}
        }
        if matches!(origin, Origin::Offsets) {
            self.has_asked_offsets(error.is_none());
            if !self.judge_again(context) {
                self.send_preamble(context);
            }
            return None;
        }
        if let Some(code) = error {
            let text = codes::describe_error(context.machine.firmware, code);
            let message = match &origin {
                Origin::Program { text: line, source, .. } => {
                    self.job.blamed_line = source.line;
                    let place = self.job.place_of(*source);
                    format!("{place}: the controller refused {line:?}: {text}")
                }
                _ => format!("the controller refused {}: {text}", own_line(&origin)),
            };
            context.log(LogLevel::Error, message.clone());
            return Some(Exit::abort(error_code::CONTROLLER_ERROR, message));
        }
        let said = match &origin {
            Origin::Preamble if !self.job.is_in_tool_change => Some(PREAMBLE),
            Origin::Program { text, .. } => Some(text.as_str()),
            _ => None,
        };
        let work_system = said.and_then(selected_system);
        context.machine.work_system = work_system.or(context.machine.work_system);
        context.machine.on_line(said.unwrap_or_default());
        match &origin {
            Origin::Preamble => self.watch_answer(context, PREAMBLE),
            Origin::Program { text, .. } => self.watch_answer(context, text),
            _ => {}
        }
        match (origin, &self.stage) {
            (Origin::CheckMode, Stage::Preparing { .. }) => self.send_preamble(context),
            (Origin::Preamble, Stage::Preparing { .. }) => {
                let is_checked_later = self.encoder.checks_start() || self.job.is_check();
                self.stage = match is_checked_later || self.relies_on_no_place() {
                    true => Stage::Streaming,
                    false => Stage::Positioning { until: context.now + WORK_POSITION },
                };
                context.link.ask_status(context.now);
            }
            (Origin::Program { element, events, .. }, Stage::Probing(_)) => {
                self.job.on_answer(element, events);
                return self.end_probe(context);
            }
            (Origin::Program { .. }, Stage::Reading(_)) => self.end_waiting(context),
            (Origin::Program { element, events, .. }, _) => {
                self.job.on_answer(element, events);
                if self.job.is_check() {
                    // Nothing moves: what is read is done.
                    self.job.on_all_done();
                }
            }
            (Origin::Sync, Stage::Draining(then)) => {
                let from = context.now + SETTLED;
                self.stage = Stage::Settling { then: then.clone(), from };
                context.link.ask_status(from);
            }
            (Origin::Home, Stage::Homing { is_homed_after, .. }) => {
                context.machine.is_homed = *is_homed_after;
                // The axes are somewhere else than they were, and count from another zero.
                context.machine.place = PlaceWatch::default();
                self.stage = Stage::Settling { then: Then::GoOn, from: context.now };
                context.link.ask_status(context.now);
            }
            _ => {}
        }
        None
    }

    /// Takes a status report, which is in the machine model already; the machine was looked at for
    /// it since `since`.
    pub(in crate::driver) fn on_status(
        &mut self,
        context: &mut Context,
        since: Duration,
    ) -> Option<Exit> {
        let is_check = context.machine.is_state(&ControllerState::Check);
        let is_idle = is_check || context.machine.is_state(&ControllerState::Idle);
        self.job.track(context);
        self.show_messages(context);
        match &self.stage {
            _ if context.machine.is_state(&ControllerState::Alarm) => {
                let text = "the controller is in alarm";
                let next = Next::adrift(format!("{text}; soft_reset to go on"));
                return Some(Exit::Over {
                    verdict: RunVerdict::aborted(error_code::ALARM, text),
                    next,
                });
            }
            Stage::Reading(_) => {
                if let Some(exit) = self.read_input(context, since) {
                    return Some(exit);
                }
            }
            Stage::Positioning { .. } => {
                let at = context.machine.work_position()?;
                if let Err(refusal) = self.check_start(&context.machine, at) {
                    return Some(Exit::over(refusal.into()));
                }
                self.stage = Stage::Streaming;
            }
            Stage::Settling {
                then: Then::GoOn | Then::Probed(_) | Then::ControllerChange { .. },
                ..
            } if !is_idle => {}
            Stage::Settling { .. } if context.machine.is_state(&ControllerState::Run) => {
                let text = "the controller has answered every line and still moves: an answer \
                            came twice, or another sender wrote a line";
                context.log(LogLevel::Error, text);
                return Some(Exit::abort(error_code::PROTOCOL, text));
            }
            // No controller holds what the cell does.
            Stage::Settling { then: Then::UserFunction { .. }, .. } if self.is_held => {}
            Stage::Settling { then, from } if is_idle && context.now >= *from => {
                let then = then.clone();
                match self.watch_end(context, &then, since) {
                    EndOfLines::There => {}
                    EndOfLines::Waits => return None,
                    EndOfLines::Over(exit) => return Some(exit),
                }
                self.job.on_all_done();
                context.machine.line = self.job.line();
                self.show_messages(context);
                if let Some(exit) = self.follow(context, then) {
                    return Some(exit);
                }
            }
            _ => {}
        }
        self.watch_report(context, since);
        if let Some(exit) = self.take_wrong_thread() {
            return Some(exit);
        }
        if let Some(exit) = self.keep_overrides(context) {
            return Some(exit);
        }
        self.report_progress(context);
        None
    }

    /// All motion has ended: does what follows.
    fn follow(&mut self, context: &mut Context, then: Then) -> Option<Exit> {
        match then {
            Then::ToolChange { tool, source } => {
                let stood_at = context.machine.machine_position();
                let change = ToolChange { tool, source, stood_at, is_touched: false };
                context.machine.spindle_tool = None;
                self.stage = Stage::ToolChange(change);
            }
            Then::CheckReturn { stood } => return self.check_return(&context.machine, stood),
            Then::CheckStart => {
                self.stage = Stage::Positioning { until: context.now + WORK_POSITION };
                context.link.ask_status(context.now);
            }
            Then::BlockEnd(block) => self.stage = Stage::BlockEnd(block),
            Then::Probe { line, probe } => self.begin_probe(context, line, probe),
            Then::Probed(probing) => return self.after_probe(context, &probing),
            Then::Stretch { source } => self.begin_stretch(context, source),
            Then::ReadInput { line } => self.begin_reading(context, line),
            Then::UserFunction { function, source } => {
                return self.call_function(context, function, source);
            }
            Then::AllowOverrides { allowed, source } => {
                self.allow_overrides(context, allowed, source);
            }
            Then::GoOn => self.judge_from_here(context),
            Then::ControllerChange { tool, .. } => {
                context.machine.spindle_tool = Some(tool);
                self.judge_from_here(context);
            }
            Then::Home { text, axes, source } => {
                let is_homed_after = axes == AxisSet::ALL || context.machine.is_homed;
                let limit = Duration::from_secs(u64::from(context.config.homing_s_max));
                let until = context.now + limit;
                self.stage = Stage::Homing { until, source, is_homed_after };
                // Where the axes are is not known again before they are home.
                context.machine.is_homed = false;
                context.link.send_line(&text, LineKind::Silent, Origin::Home);
            }
            Then::End => return Some(self.succeed(context)),
        }
        None
    }

    fn succeed(&mut self, context: &mut Context) -> Exit {
        if self.job.is_check() {
            // The mode is left by a reset.
            let text = "the controller has read every line; nothing moved";
            return Exit::Stop(RunVerdict::succeeded(text));
        }
        self.show_last_messages(context);
        let events = &self.job.request.path.events;
        // The end of the program selects the first work system; tool lengths stay.
        if matches!(events.last().map(|event| event.action), Some(Action::ProgramEnd { .. })) {
            context.machine.work_system = Some(1);
        }
        let sets_length = |event: &PathEvent| matches!(event.action, Action::ToolLength { .. });
        if !self.job.is_in_tool_change {
            if !events.iter().any(sets_length) {
                context.machine.has_tool_length = Some(false);
            }
            let line = self.job.line();
            let last = Output::Progress { line, fraction: 1.0, time_left_s: 0.0 };
            context.outputs.push_back(last);
        }
        Exit::over(RunVerdict::succeeded(format!("done{}", self.remark)))
    }

    fn report_progress(&mut self, context: &mut Context) {
        // The progress of a run that waits for its tool is its own.
        if !self.job.has_sent || self.job.is_in_tool_change {
            return;
        }
        let path = &self.job.request.path;
        self.time.follow(path, context.machine.speeds());
        let tracker = &self.job.tracker;
        let (at, part) = match self.job.turns.under_way() {
            Some((event, part)) => {
                (UnderWay::Turn { before: path.events[event].at_element, event }, part)
            }
            None => (UnderWay::Element(tracker.element()), tracker.part()),
        };
        let (fraction, time_left_s) = self.time.at(path, at, part);
        let line = self.job.line();
        let progress = Some((line, fraction, time_left_s));
        if self.progress != progress {
            self.progress = progress;
            context.outputs.push_back(Output::Progress { line, fraction, time_left_s });
        }
    }

    /// Takes a report of empty buffers at `now`, while lines have no answer; the machine was looked
    /// at since `since`. True when it can be believed: the controller has had the lines before it
    /// was asked, and has shown it twice more. One that was held up answers what it was asked
    /// before the lines came.
    pub(in crate::driver) fn on_empty_buffers(
        &mut self,
        is_empty: bool,
        since: Duration,
        now: Duration,
    ) -> bool {
        /// Reports in a row that show it.
        const EMPTY_REPORTS: u32 = 2;
        if !is_empty {
            self.empty_buffers = None;
            return false;
        }
        let (first, later) = self.empty_buffers.get_or_insert((now, 0));
        *later += u32::from(since >= *first && now > *first);
        *later >= EMPTY_REPORTS
    }
}

/// The record misses something in mid-run. Where it is required the machine holds for the
/// reason that this gives, and whoever resumes goes on without; else the part is worth more
/// than its record.
pub(in crate::driver) fn miss_record(context: &mut Context, reason: &str) -> Option<String> {
    let text = format!("the recording of this run is not complete: {reason}");
    let is_required = context.config.require_recording;
    let hold_reason = is_required.then(|| format!("{RECORD_NOT_WHOLE}: {text}"));
    context.log(LogLevel::Warn, text);
    hold_reason
}

fn refuse_unrecorded(reason: &str) -> Exit {
    let text = format!("this run is not recorded, and require_recording is set: {reason}");
    Exit::over(RunVerdict::aborted(error_code::NOT_RECORDING, text))
}

/// The work system that a line of ours selects.
fn selected_system(line: &str) -> Option<u8> {
    let word = line.rfind("G5").and_then(|at| line.get(at..))?;
    (1..=9).find(|system| word == work_system(*system))
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
