//! Restarts of the controller that were not announced, or whose announcement was damaged.
//!
//! A controller that restarts counts from another zero, and says so in one line that can
//! be lost. Every other sign counts as well: from then on the machine is not homed, and all
//! that is known of the controller is asked for again. Not homed it stays until it is homed
//! or says itself that it is; an unlock does not change that.

use super::context::path_deviation::OnPathDeviation;
use super::context::place::{Belief, Circumstances, show};
use super::context::{Context, Origin};
use super::output::LogLevel;
use super::run::exit::RunVerdict;
use super::{Driver, Phase};
use crate::codes::error_code;
use crate::link::LineKind;
use crate::report::{ControllerState, ModalWords, StatusReport};
use std::time::Duration;

/// Lines without an answer while planner and receive buffer are empty: fewer may be answers
/// that were lost.
const LINES_LOST_MIN: usize = 3;
/// Time to the next request while a work offset is in doubt.
const PAUSE: Duration = Duration::from_millis(10);

impl Driver {
    /// Takes a report, unless its position cannot be true; then another is asked for.
    pub(super) fn take_report(&mut self, mut report: StatusReport, since: Duration) {
        self.context.machine.has_just_started = false;
        if !self.context.takes_units(&report) {
            return self.context.link.ask_status(self.context.now);
        }
        let belief = self.judge_place(&report, since);
        if belief == Belief::Doubted {
            self.context.keep_offset(&report);
            return self.context.link.ask_status(self.context.now);
        }
        match self.phase {
            Phase::Ready => self.context.machine.doubt_offset(&mut report),
            // A program sets offsets of its own.
            _ => self.context.machine.doubted_offset = None,
        }
        if self.context.machine.doubted_offset.is_some() {
            // It comes every tenth time.
            self.context.link.ask_status(self.context.now + PAUSE);
        }
        let alarm = self.context.unannounced_alarm(&report);
        let emptied = self.emptied_buffers(&report, since);
        let jump = match belief {
            Belief::Jumped { from, to } => Some(format!(
                "the machine position went from {} to {}, farther than the axes can have moved",
                show(from),
                show(to)
            )),
            _ => None,
        };
        if let Some(sign) = jump.clone().or(alarm).or(emptied) {
            let moves_on = jump.is_some() && report.is_moving();
            if self.on_sign(sign, moves_on) {
                return;
            }
        }
        let overrides = report.overrides_percent;
        self.context.machine.on_status(report);
        if self.phase.is_unsettled() {
            let why = "the controller was stopped or reset before a report showed it";
            self.context.drop_overrides(why);
        }
        self.context.watch_overrides(overrides);
        self.context.watch_hold(self.phase.is_run());
        self.on_status(since);
    }

    fn judge_place(&mut self, report: &StatusReport, since: Duration) -> Belief {
        if self.phase.is_homing() {
            // Homing says where the axes are.
            self.context.machine.place = Default::default();
        }
        let stands = matches!(report.state, ControllerState::Idle | ControllerState::Alarm);
        let is_at_rest =
            stands && matches!(self.phase, Phase::Ready) && self.context.link.unanswered() == 0;
        let fastest = self.context.machine.fastest_mm_per_min();
        let rates_mm_per_min = fastest.map(|rate| rate * self.context.config.rate_margin);
        let of = Circumstances { since, now: self.context.now, rates_mm_per_min, is_at_rest };
        self.context.machine.place.judge(report, of)
    }

    /// Planner and receive buffer are empty, and lines were never answered.
    fn emptied_buffers(&mut self, report: &StatusReport, since: Duration) -> Option<String> {
        let is_empty = report.state == ControllerState::Idle
            && self.context.machine.is_as_free_as_ever(report.free);
        // FluidNC takes lines out of what it reports while it dwells.
        let is_program = matches!(self.context.link.oldest(), Some(Origin::Program { .. }))
            && self.context.link.oldest_kind() == Some(LineKind::Motion)
            && self.context.link.knows_its_size();
        let lines = self.context.link.unanswered();
        let now = self.context.now;
        let Phase::Running(run) = &mut self.phase else { return None };
        let is_lost = is_program && is_empty && lines >= LINES_LOST_MIN;
        let is_sure = run.on_empty_buffers(is_lost, since, now);
        is_sure.then(|| format!("its buffers are empty and {lines} lines have no answer"))
    }

    /// The words in force have fallen back: F is zero only after a start, and after G93.
    pub(super) fn on_parser_state(&mut self, text: &str) {
        let words = ModalWords::read(text);
        if let Phase::Running(run) = &mut self.phase {
            run.watch_words(&mut self.context, text);
        }
        let may_lack_feed = self.context.machine.may_lack_feed();
        let before = self.context.machine.words.replace(words);
        if self.phase.is_unsettled() {
            return;
        }
        let fell_back = before.is_some_and(|before| {
            !may_lack_feed
                && !before.is_inverse_time
                && words.is_rapid
                && !words.is_inverse_time
                && before.feed_per_min.is_some_and(|feed| feed > 0.0)
                && words.feed_per_min == Some(0.0)
        });
        if !fell_back {
            return;
        }
        let sign = "the G words in force are those after a start".to_owned();
        match self.phase {
            // One damaged line says it too. What still moves is held.
            Phase::Running(_) | Phase::Stopping(_) => {
                let moves_on = self.context.machine.is_moving();
                self.on_sign(sign, moves_on);
            }
            _ => self.on_hidden_restart(sign),
        }
    }

    /// A notice that only a start gives, right after its start message.
    pub(super) fn on_lock_notice(&mut self, text: &str) {
        if !std::mem::take(&mut self.context.machine.has_just_started) {
            self.on_hidden_restart(format!("its start message was not heard, but [MSG:{text}]"));
        }
    }

    /// The controller has restarted: a sign other than its start message shows it.
    pub(super) fn on_hidden_restart(&mut self, sign: String) {
        self.on_restart_by(sign, false);
    }

    /// The start message was damaged.
    pub(super) fn on_damaged_banner(&mut self, text: &str) {
        self.on_restart_by(format!("its start message was damaged: {text:?}"), true);
    }

    fn on_restart_by(&mut self, sign: String, is_announced: bool) {
        if let Phase::Adrift { .. } = self.phase {
            // Whatever is wrong comes first, and ends with a reset.
            self.context.machine.is_homed = false;
            self.context.machine.lost_its_place = true;
            return self
                .context
                .log(LogLevel::Warn, format!("the controller restarted by itself: {sign}"));
        }
        self.context.link.believe_in_restart(self.context.now);
        self.context.machine.on_restart(self.context.machine.firmware);
        self.context.machine.has_just_started = is_announced;
        self.context.drop_overrides("the controller has restarted");
        self.on_banner(&sign);
    }

    /// A report shows that the controller has restarted. True if everything is asked for
    /// again, so that the report no longer counts.
    fn on_sign(&mut self, sign: String, moves_on: bool) -> bool {
        match &self.phase {
            Phase::Closed { .. } | Phase::Connecting(_) => return false,
            Phase::Stopping(stopping) if stopping.is_resetting() => return false,
            Phase::Stopping(_) => {
                self.context.machine.lost_its_place = true;
                self.doubt_place(sign);
                return false;
            }
            // It goes on moving, from a wrong zero.
            Phase::Running(_) if moves_on => {
                let text = self.doubt_place(sign);
                self.stop_run(RunVerdict::aborted(error_code::RESTARTED, text));
                return false;
            }
            Phase::Running(_) | Phase::Manual(_) | Phase::Adrift { .. } | Phase::Ready => {}
        }
        self.context.machine.lost_its_place = true;
        let is_asked_again = !matches!(self.phase, Phase::Adrift { .. });
        self.on_hidden_restart(sign);
        is_asked_again
    }

    /// Takes the position for wrong while a run is under way; gives the reason.
    fn doubt_place(&mut self, sign: String) -> String {
        self.context.machine.is_homed = false;
        let text = format!("{sign}: the controller has restarted or lost its position; home");
        self.context.log(LogLevel::Error, text.clone());
        text
    }
}

impl Context {
    /// A work position is farther away than the axes can have gone where its frame was
    /// changed: the new offset comes in the same report, and in no other for a while.
    fn keep_offset(&mut self, report: &StatusReport) {
        let is_watched = self.config.on_path_deviation != OnPathDeviation::Off;
        if is_watched && report.machine_position.is_none() {
            self.machine.work_offset = report.work_offset.or(self.machine.work_offset);
            self.machine.keep_further_offset(report);
        }
    }

    /// Before the settings are read, decimals show the unit. False for a report that was read
    /// in another.
    fn takes_units(&mut self, report: &StatusReport) -> bool {
        if self.machine.has_units {
            return true;
        }
        let Some(units) = report.shown_in else { return true };
        self.machine.has_units = true;
        let is_as_read = units == self.link.units();
        self.link.set_units(units);
        is_as_read
    }

    /// An alarm that no `ALARM:N` came before: the controller locked itself when it started.
    fn unannounced_alarm(&self, report: &StatusReport) -> Option<String> {
        let before = self.machine.status.as_ref()?;
        let is_news = report.state == ControllerState::Alarm
            && !matches!(before.state, ControllerState::Alarm | ControllerState::Sleep);
        is_news.then(|| "it is in alarm without an ALARM message".to_owned())
    }
}
