//! Watches that the tool is on the path: what the run says to the path watch, and what it does
//! about what the watch finds.

use super::exit::{Exit, RunVerdict};
use super::{ProgramRun, Stage, Then};
use crate::codes::error_code;
use crate::driver::context::Context;
use crate::driver::context::path_deviation::{OnPathDeviation, PATH_DEVIATION};
use crate::driver::output::LogLevel;
use crate::path_watch::{Culprit, Deviation, PathWatch, Seen};
use crate::report::{ControllerState, StatusReport};
use cnc_msgs::contour::{Source, work_system};
use cnc_msgs::further::FurtherAxes;
use std::time::Duration;

/// The path watch of one run.
#[derive(Debug, Default)]
pub(super) struct RunWatch {
    /// `None` where nothing is watched: the parameter says so, or nothing moves.
    watch: Option<Box<PathWatch>>,
    /// Something did not fit, and nobody has resumed since.
    is_deviated: bool,
    /// A thread is not where it should be: the run ends.
    wrong_thread: Option<RunVerdict>,
    /// The newest report did not fit; another one was asked for.
    doubt: Option<Doubt>,
    /// The controller has reported its offsets just before the first line.
    has_fresh_offsets: bool,
}

/// A report that may be wrong itself: a byte of it was damaged, or the firmware has read its
/// counters while they changed.
#[derive(Debug, Clone, Copy)]
struct Doubt {
    at: Duration,
    /// Reports without a work offset do not decide it.
    is_of_offset: bool,
    reports: u32,
}

/// Reports that do not fit, where none is known to be the answer to the request after the first.
const MISFITS_MAX: u32 = 3;
/// Time to the next request where the work offset is in doubt, which not every report has.
const PAUSE: Duration = Duration::from_millis(10);

impl ProgramRun {
    /// Whether the reports of this run are compared with its lines.
    pub(super) fn is_watched(&self, context: &Context) -> bool {
        context.config.on_path_deviation != OnPathDeviation::Off && !self.job.is_check()
    }

    /// The controller was asked for its offsets; `has_reported` is whether it has sent them.
    pub(super) fn has_asked_offsets(&mut self, has_reported: bool) {
        self.watch.has_fresh_offsets = has_reported;
    }

    /// The first line is about to be sent; the machine stands.
    pub(super) fn begin_watch(&mut self, context: &mut Context) {
        if !self.is_watched(context) {
            return;
        }
        let is_hold = context.config.on_path_deviation == OnPathDeviation::Hold;
        if let Some(name) = context.machine.other_kinematics().filter(|_| is_hold) {
            let text = format!(
                "with {name} kinematics the tool is off the straight lines that were sent: \
                 on_path_deviation is log in this run"
            );
            context.log(LogLevel::Warn, text);
        }
        let units = context.link.units();
        let mut watch = context.machine.path_watch(units, self.watch.has_fresh_offsets);
        if !self.watch.has_fresh_offsets {
            watch.take_next_offset();
        }
        self.watch.watch = Some(Box::new(watch));
    }

    /// A line of the run is sent now.
    pub(super) fn watch_line(&mut self, text: &str, source: Source) {
        if let Some(watch) = &mut self.watch.watch {
            let Source { line: source_line, block, call, .. } = source;
            watch.on_sent(text, Culprit { source_line, block, call });
        }
    }

    /// A line of the run was answered.
    pub(super) fn watch_answer(&mut self, context: &mut Context, text: &str) {
        let Some(watch) = &mut self.watch.watch else { return };
        watch.on_answer();
        // The next run has to know what this one has stored. Nothing was sent after it.
        let stored = text.strip_prefix("G10L").and_then(|rest| rest.split_once('P'));
        let digit = stored.and_then(|(_, after)| after.chars().next()?.to_digit(10));
        if let Some(system) = digit.and_then(|digit| u8::try_from(digit).ok())
            && let Some(place) = watch.stored(system)
        {
            context.machine.remember(&work_system(system), place);
        }
    }

    /// Judges a report, which is in the machine model already; the machine was looked at for it
    /// since `since`.
    pub(super) fn watch_report(&mut self, context: &mut Context, since: Duration) {
        let is_judged = match &self.stage {
            Stage::Streaming
            | Stage::Probing(_)
            | Stage::Calling(_)
            | Stage::Reading(_)
            | Stage::Overriding => true,
            Stage::Draining(then) | Stage::Settling { then, .. } => {
                !matches!(then, Then::GoOn | Then::Probed(_) | Then::ControllerChange { .. })
            }
            _ => false,
        };
        let machine = &context.machine;
        let state = machine.status.as_ref().map(|status| &status.state);
        // At an open door the axes may be parked.
        let is_on_path = matches!(
            state,
            Some(
                ControllerState::Run
                    | ControllerState::Hold
                    | ControllerState::Idle
                    | ControllerState::Jog
            )
        );
        let RunWatch { watch: Some(watch), is_deviated: false, doubt, .. } = &mut self.watch else {
            return;
        };
        if !is_judged || !is_on_path {
            return;
        }
        let seen = Seen {
            position: machine.machine_position(),
            is_by_offset: !machine.shown.has_machine_position,
            further: machine.further_machine(),
            further_offset: machine.further_offset_shown(),
            work_offset: machine.shown.work_offset,
            feed_mm_per_min: machine.status.as_ref().and_then(StatusReport::speed_mm_per_min),
            feed_override: context.feed_override_most(),
            blocks_in_use: machine.blocks_in_use(),
        };
        match watch.judge(&seen) {
            Some(deviation) if Doubt::is_over(doubt, context, since, &deviation) => {
                self.on_deviation(context, &deviation);
            }
            Some(_) => {}
            None if doubt.is_some_and(|it| it.is_of_offset) && seen.work_offset.is_none() => {
                context.link.ask_status(context.now + PAUSE);
            }
            None => *doubt = None,
        }
    }

    /// Judges the words in force, which come among the answers.
    pub(in crate::driver) fn watch_words(&mut self, context: &mut Context, words: &str) {
        let RunWatch { watch: Some(watch), is_deviated: false, .. } = &self.watch else { return };
        if !matches!(self.stage, Stage::Streaming | Stage::Draining(_)) {
            return;
        }
        if let Some(deviation) = watch.judge_words(words, context.link.units()) {
            self.on_deviation(context, &deviation);
        }
    }

    /// All lines are answered and the machine stands: is it where they end?
    pub(super) fn watch_end(
        &mut self,
        context: &mut Context,
        then: &Then,
        since: Duration,
    ) -> EndOfLines {
        if self.watch.is_deviated {
            return EndOfLines::Waits;
        }
        let at = context.machine.machine_position();
        let further = context.machine.further_machine();
        if let Then::Probed(probing) = then
            && probing.has_touched()
        {
            // It has ended before the end of its line; all else is in force.
            if let Some(watch) = &mut self.watch.watch {
                watch.begin_again(None, at, further);
            }
            return EndOfLines::There;
        }
        if matches!(then, Then::GoOn | Then::ControllerChange { .. }) {
            let frame = context.machine.frame();
            if let Some(watch) = &mut self.watch.watch {
                watch.begin_again(Some(frame), at, further);
            }
            return EndOfLines::There;
        }
        let RunWatch { watch: Some(watch), doubt, .. } = &mut self.watch else {
            return EndOfLines::There;
        };
        // A work position is one in the machine frame only with the offset in force.
        let has_place = context.machine.shown.has_machine_position;
        let believed = if has_place { further } else { FurtherAxes::NONE };
        let Some(deviation) = watch.judge_end(at, believed) else {
            if matches!(then, Then::Home { .. }) {
                watch.forget_words();
            }
            return EndOfLines::There;
        };
        if !Doubt::is_over(doubt, context, since, &deviation) {
            return EndOfLines::Waits;
        }
        if matches!(then, Then::End) && policy(context) == OnPathDeviation::Hold {
            let text = self.in_words(&deviation);
            context.log(LogLevel::Error, text.clone());
            self.job.blamed_line = deviation.culprit().source_line;
            let verdict = RunVerdict::aborted(error_code::PATH_DEVIATION, text);
            return EndOfLines::Over(Exit::over(verdict));
        }
        self.on_deviation(context, &deviation);
        if self.watch.is_deviated { EndOfLines::Waits } else { EndOfLines::There }
    }

    /// The tool change is over; the tool stands here.
    pub(super) fn watch_from(&mut self, context: &Context, is_touched: bool) {
        let machine = &context.machine;
        let at = machine.machine_position();
        // A work position is one in the machine frame only with the offset in force.
        let further = match machine.shown.has_machine_position {
            true => machine.further_standing(),
            false => FurtherAxes::NONE,
        };
        // The words that follow say what is in force then.
        let frame = is_touched.then(|| machine.frame());
        if let Some(watch) = &mut self.watch.watch {
            watch.begin_again(frame.map(|frame| frame.without_offset()), at, further);
        }
    }

    /// A thread is not where it should be, and no hold stops it.
    pub(super) fn take_wrong_thread(&mut self) -> Option<Exit> {
        self.watch.wrong_thread.take().map(Exit::Stop)
    }

    /// The operator goes on.
    pub(super) fn forgive_deviation(&mut self) {
        self.watch.doubt = None;
        if std::mem::take(&mut self.watch.is_deviated)
            && let Some(watch) = &mut self.watch.watch
        {
            watch.forgive();
        }
    }

    fn in_words(&self, deviation: &Deviation) -> String {
        format!("{PATH_DEVIATION}: {}", deviation.text(&self.job.request.path.calls))
    }

    fn on_deviation(&mut self, context: &mut Context, deviation: &Deviation) {
        let text = self.in_words(deviation);
        match policy(context) {
            OnPathDeviation::Off => {}
            OnPathDeviation::Log => {
                context.log(LogLevel::Warn, text);
                if let Some(watch) = &mut self.watch.watch {
                    watch.forgive();
                }
            }
            OnPathDeviation::Hold => {
                context.log(LogLevel::Error, text.clone());
                self.watch.is_deviated = true;
                if context.link.is_threading() {
                    self.job.blamed_line = deviation.culprit().source_line;
                    let verdict = RunVerdict::aborted(error_code::PATH_DEVIATION, text);
                    self.watch.wrong_thread = Some(verdict);
                    return;
                }
                self.hold_for(context, format!("{text}; cancel, or resume to go on all the same"));
            }
        }
    }
}

/// What is done about a deviation on this board.
fn policy(context: &Context) -> OnPathDeviation {
    match context.config.on_path_deviation {
        OnPathDeviation::Hold if context.machine.other_kinematics().is_some() => {
            OnPathDeviation::Log
        }
        wanted => wanted,
    }
}

impl Doubt {
    /// Takes a report that does not fit. True where it is not the first, and an answer to what
    /// was asked after the first; else the next one is asked for at once.
    fn is_over(
        doubt: &mut Option<Self>,
        context: &mut Context,
        since: Duration,
        deviation: &Deviation,
    ) -> bool {
        // It has counted its reports already.
        if matches!(deviation, Deviation::Feed { .. }) {
            return true;
        }
        let is_of_offset =
            matches!(deviation, Deviation::Offset { .. } | Deviation::FurtherOffset { .. });
        let first = doubt.get_or_insert(Self { at: context.now, is_of_offset, reports: 0 });
        first.reports += 1;
        first.is_of_offset &= is_of_offset;
        let is_later = first.reports > 1 && since >= first.at;
        if is_later || first.reports >= MISFITS_MAX {
            *doubt = None;
            return true;
        }
        let pause = if is_of_offset { PAUSE } else { Duration::ZERO };
        context.link.ask_status(context.now + pause);
        false
    }
}

/// What the end of all lines shows.
pub(super) enum EndOfLines {
    There,
    /// The run waits for a resume.
    Waits,
    Over(Exit),
}
