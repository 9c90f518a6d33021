//! Restarts of the controller that were not announced, or whose announcement was damaged.
//!
//! A controller that starts anew counts from another zero, and says so in one line that can
//! be lost. Every other sign counts as well: from then on the machine is not homed, and all
//! that is known of the controller is asked for again. Not homed it stays until it is homed
//! or says itself that it is; an unlock does not change that.

use super::place::{Belief, Circumstances, show};
use super::{Driver, LogLevel, Origin, Phase, RunOutcome};
use crate::codes::error_code;
use crate::link::LineKind;
use crate::report::{ControllerState, ModalWords, StatusReport};
use std::time::Duration;

/// Lines without an answer while planner and receive buffer are empty: fewer may be answers
/// that were lost.
const LINES_LOST_MIN: usize = 3;
/// Time to the next request while a work offset is in doubt.
const PAUSE: Duration = Duration::from_millis(10);
/// Reports in a row that show it.
const EMPTY_REPORTS: u32 = 2;

impl Driver {
    /// Takes a report, unless its position cannot be true; then another is asked for.
    pub(super) fn hear_status(&mut self, mut report: StatusReport, since: Duration) {
        self.machine.has_just_started = false;
        if !self.takes_units(&report) {
            return self.link.ask_status(self.now);
        }
        let belief = self.judge_place(&report, since);
        if belief == Belief::Doubted {
            return self.link.ask_status(self.now);
        }
        match self.phase {
            Phase::Ready => self.machine.doubt_offset(&mut report),
            // A program sets offsets of its own.
            _ => self.machine.doubted_offset = None,
        }
        if self.machine.doubted_offset.is_some() {
            // It comes every tenth time.
            self.link.ask_status(self.now + PAUSE);
        }
        let alarm = self.unannounced_alarm(&report);
        let emptied = self.emptied_buffers(&report);
        let jump = match belief {
            Belief::Jumped { from, to } => Some(format!(
                "the machine position went from {} to {}, where the axes cannot have gone",
                show(from),
                show(to)
            )),
            _ => None,
        };
        if let Some(sign) = jump.clone().or(alarm).or(emptied) {
            let moves_on = jump.is_some() && report.is_moving();
            if self.hear_sign(sign, moves_on) {
                return;
            }
        }
        let overrides = report.overrides_percent;
        self.machine.on_status(report);
        self.watch_overrides(overrides);
        self.watch_hold();
        self.on_status();
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

    fn judge_place(&mut self, report: &StatusReport, since: Duration) -> Belief {
        let is_homing = match &self.phase {
            Phase::Running(run) => run.is_homing(),
            Phase::Manual(operation) => operation.is_homing(),
            _ => false,
        };
        if is_homing {
            // Homing says where the axes are.
            self.machine.place = Default::default();
        }
        let stands = matches!(report.state, ControllerState::Idle | ControllerState::Alarm);
        let is_at_rest =
            stands && matches!(self.phase, Phase::Ready) && self.link.unanswered() == 0;
        let fastest = self.machine.fastest_mm_per_min();
        let rates_mm_per_min = fastest.map(|rate| rate * self.config.rate_margin);
        let of = Circumstances { since, now: self.now, rates_mm_per_min, is_at_rest };
        self.machine.place.judge(report, of)
    }

    /// An alarm that no `ALARM:N` came before: the controller locked itself when it started.
    fn unannounced_alarm(&self, report: &StatusReport) -> Option<String> {
        let before = self.machine.status.as_ref()?;
        let is_news = report.state == ControllerState::Alarm
            && !matches!(before.state, ControllerState::Alarm | ControllerState::Sleep);
        is_news.then(|| "it is in alarm and has announced none".to_owned())
    }

    /// Planner and receive buffer are empty, and lines were never answered.
    fn emptied_buffers(&mut self, report: &StatusReport) -> Option<String> {
        let is_empty =
            report.state == ControllerState::Idle && self.machine.is_as_free_as_ever(report.free);
        // FluidNC takes lines out of what it reports while it dwells.
        let is_program = matches!(self.link.oldest(), Some(Origin::Program { .. }))
            && self.link.oldest_kind() == Some(LineKind::Motion)
            && self.link.tells_its_size();
        let lines = self.link.unanswered();
        let Phase::Running(run) = &mut self.phase else { return None };
        if run.is_stopping() || !is_program || !is_empty || lines < LINES_LOST_MIN {
            run.empty_reports = 0;
            return None;
        }
        run.empty_reports += 1;
        let is_sure = run.empty_reports >= EMPTY_REPORTS;
        is_sure.then(|| format!("its buffers are empty and {lines} lines have no answer"))
    }

    /// The words in force have fallen back: F is zero only after a start.
    pub(super) fn hear_words(&mut self, words: &str) {
        let words = ModalWords::read(words);
        let before = self.machine.words.replace(words);
        let is_asking = match &self.phase {
            Phase::Running(run) => run.is_resetting(),
            Phase::Ready | Phase::Manual(_) => false,
            _ => true,
        };
        if is_asking {
            return;
        }
        let fell_back = before.is_some_and(|before| {
            !before.is_inverse_time
                && words.is_rapid
                && !words.is_inverse_time
                && before.feed_per_min.is_some_and(|feed| feed > 0.0)
                && words.feed_per_min == Some(0.0)
        });
        if !fell_back {
            return;
        }
        let sign = "the words in force are those of a start".to_owned();
        match self.phase {
            // One damaged line says it too. What still moves is held.
            Phase::Running(_) => drop(self.hear_sign(sign, self.machine.is_moving())),
            _ => self.on_hidden_restart(sign),
        }
    }

    /// A notice that only a start gives, right after its start message.
    pub(super) fn hear_lock_notice(&mut self, text: &str) {
        if !std::mem::take(&mut self.machine.has_just_started) {
            self.on_hidden_restart(format!("its start message was not heard, but [MSG:{text}]"));
        }
    }

    /// The controller has started anew, by a sign other than its start message.
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
            self.machine.is_homed = false;
            self.machine.lost_its_place = true;
            return self.log(LogLevel::Warn, format!("the controller restarted by itself: {sign}"));
        }
        self.link.believe_in_restart(self.now);
        self.machine.on_restart(self.machine.firmware);
        self.machine.has_just_started = is_announced;
        self.drop_overrides("the controller has restarted");
        self.on_banner(&sign);
    }

    /// A report shows that the controller has started anew. True where all is asked for again,
    /// and the report counts no more.
    fn hear_sign(&mut self, sign: String, moves_on: bool) -> bool {
        match &self.phase {
            Phase::Closed { .. } | Phase::Connecting(_) => return false,
            Phase::Running(run) if run.is_resetting() => return false,
            // It goes on moving, from a wrong zero, or is being stopped already.
            Phase::Running(run) if moves_on || run.is_stopping() => {
                let is_stopping = run.is_stopping();
                self.machine.is_homed = false;
                self.machine.lost_its_place |= is_stopping;
                let text =
                    format!("{sign}: the controller has started anew or lost its place; home");
                self.log(LogLevel::Error, text.clone());
                if !is_stopping {
                    self.stop_run(RunOutcome::Aborted, error_code::RESTARTED, text);
                }
                return false;
            }
            _ => {}
        }
        self.machine.lost_its_place = true;
        let is_asked_again = !matches!(self.phase, Phase::Adrift { .. });
        self.on_hidden_restart(sign);
        is_asked_again
    }
}
