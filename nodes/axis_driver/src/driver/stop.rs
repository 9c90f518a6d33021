//! Bringing the machine to a stop, and watching that it does.
//!
//! Hold, wait for standstill, reset: nothing is lost and nothing more is run. After a
//! refused line or a lost count the reset is left to the operator. A byte
//! can be lost on the wire, so a hold that does not show in the reports is sent again.

use super::config::{ANSWER, HOLDS_MAX, REPORTS_PER_HOLD, STANDSTILL};
use super::run::{Run, Stage};
use super::{Driver, LogLevel, Output, Phase, Refusal, RunOutcome};
use crate::codes::error_code;
use crate::link::realtime;
use crate::report::ControllerState;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// A report that was under way when the hold was written may still show an older hold.
const OLD_REPORTS: Duration = Duration::from_millis(30);

/// How the run will have ended when the machine stands.
#[derive(Debug, Clone)]
pub(super) struct Verdict {
    pub(super) outcome: RunOutcome,
    pub(super) error_code: u16,
    pub(super) message: String,
}

impl Verdict {
    /// What the controller has still to answer, and what it made of the lines behind a
    /// refused one, is not known: it is held, and a reset is the operator's.
    fn needs_operator(&self) -> bool {
        matches!(
            self.error_code,
            error_code::CONTROLLER_ERROR
                | error_code::PROTOCOL
                | error_code::NO_ANSWER
                | error_code::RESTARTED
        )
    }
}

/// A run that is being stopped.
#[derive(Debug)]
pub(super) struct Stopping {
    pub(super) verdict: Verdict,
    step: Step,
    /// The soft reset that asked for it.
    pub(super) reply: Option<u64>,
}

#[derive(Debug)]
enum Step {
    Holding {
        since: Duration,
        reports: u32,
        idle_reports: u32,
    },
    Resetting {
        until: Duration,
    },
    /// It has started anew; whoever waits for the end can rely on the state then.
    Reporting {
        until: Duration,
    },
}

/// A hold outside a stop that has not shown in the reports yet.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct HoldWatch {
    /// Of an opened door, not of a feed hold.
    #[serde(default)]
    is_door: bool,
    reports: u32,
    sent_again: u32,
}

impl HoldWatch {
    pub(super) fn door() -> Self {
        Self { is_door: true, ..Self::default() }
    }
}

impl Stopping {
    pub(super) fn until(&self) -> Duration {
        match self.step {
            Step::Holding { since, .. } => since + STANDSTILL,
            Step::Resetting { until } | Step::Reporting { until } => until,
        }
    }

    pub(super) fn describe(&self) -> String {
        match self.step {
            Step::Holding { .. } => format!("STOPPING: {}", self.verdict.message),
            Step::Resetting { .. } | Step::Reporting { .. } => {
                format!("RESETTING: {}", self.verdict.message)
            }
        }
    }
}

impl Run {
    pub(super) fn is_resetting(&self) -> bool {
        let Stage::Stopping(Stopping { step, .. }) = &self.stage else { return false };
        matches!(step, Step::Resetting { .. } | Step::Reporting { .. })
    }

    /// Whether it is being stopped for something that the operator has to settle.
    pub(super) fn waits_for_operator(&self) -> bool {
        matches!(&self.stage, Stage::Stopping(stopping) if stopping.verdict.needs_operator())
    }

    pub(super) fn add_to_verdict(&mut self, text: &str) {
        if let Stage::Stopping(stopping) = &mut self.stage {
            stopping.verdict.message += "; ";
            stopping.verdict.message += text;
        }
    }
}

impl Driver {
    /// Sends a feed hold, and again when it does not show.
    pub(super) fn send_hold(&mut self) {
        self.link.send_realtime(realtime::FEED_HOLD);
        self.hold = Some(HoldWatch::default());
    }

    /// Holds the run that is under way, and says why.
    pub(super) fn hold_run(&mut self, reason: &str) {
        if let Phase::Running(run) = &mut self.phase {
            run.set_held(true);
            run.hold_reason = Some(format!("{reason}; resume goes on"));
            self.send_hold();
        }
    }

    /// Stops sending and brings the machine to a standstill; the run ends when it stands.
    pub(super) fn stop_run(&mut self, outcome: RunOutcome, error_code: u16, message: String) {
        let verdict = Verdict { outcome, error_code, message };
        let Phase::Running(run) = &mut self.phase else { return };
        match &run.stage {
            // What stops it first is the reason.
            Stage::Stopping(_) => return,
            // Nothing is under way.
            Stage::Proving(_) | Stage::AwaitingRecorder { .. } => {
                return self.end_run(outcome, error_code, verdict.message, Phase::Ready);
            }
            // Homing does not listen to a hold, and in check mode nothing moves.
            _ if run.is_check() || run.is_homing() && self.link.unanswered() > 0 => {
                let step = Step::Resetting { until: self.now + ANSWER };
                run.stage = Stage::Stopping(Stopping { verdict, step, reply: None });
                self.hold = None;
                return self.link.send_reset(self.now);
            }
            _ => {}
        }
        self.link.send_realtime(realtime::FEED_HOLD);
        self.hold = None;
        let step = Step::Holding { since: self.now, reports: 0, idle_reports: 0 };
        run.stage = Stage::Stopping(Stopping { verdict, step, reply: None });
    }

    /// Resets at once, in the middle of a run.
    pub(super) fn reset_run(&mut self, id: u64) {
        let stands = [ControllerState::Idle, ControllerState::Check, ControllerState::Tool];
        let stands = stands.iter().any(|state| self.machine.is_state(state));
        let is_moving = !self.machine.is_held() && !stands;
        let Phase::Running(run) = &mut self.phase else { return };
        let message = "stopped by a soft reset".to_owned();
        let (outcome, error_code) = (RunOutcome::Aborted, error_code::SOFT_RESET);
        let step = Step::Resetting { until: self.now + ANSWER };
        match &mut run.stage {
            Stage::Stopping(stopping) => {
                stopping.step = step;
                if let Some(earlier) = stopping.reply.replace(id) {
                    let text = "interrupted by a soft reset";
                    let result = Err(Refusal::new(error_code, text));
                    self.outputs.push_back(Output::Reply { id: earlier, result });
                }
            }
            stage => {
                let verdict = Verdict { outcome, error_code, message };
                *stage = Stage::Stopping(Stopping { verdict, step, reply: Some(id) });
            }
        }
        if is_moving {
            self.machine.is_homed = false;
        }
        self.hold = None;
        self.link.send_reset(self.now);
    }

    pub(super) fn on_stop_status(&mut self) {
        let Some(state) = self.machine.status.as_ref().map(|status| status.state.clone()) else {
            return;
        };
        let (is_held, is_moving) = (self.machine.is_held(), self.machine.is_moving());
        let Phase::Running(run) = &mut self.phase else { return };
        let Stage::Stopping(stopping) = &mut run.stage else { return };
        let (since, reports, idle_reports) = match &mut stopping.step {
            Step::Holding { since, reports, idle_reports } => (since, reports, idle_reports),
            Step::Resetting { .. } => return,
            Step::Reporting { .. } if self.link.unanswered() > 0 => return,
            Step::Reporting { .. } => return self.finish_stop(),
        };
        if self.now < *since + OLD_REPORTS {
            return;
        }
        let stands = match state {
            ControllerState::Alarm | ControllerState::Sleep => {
                let reason = "the controller is locked; soft_reset to go on".into();
                return self.end_with_verdict(Phase::Adrift { reason });
            }
            // Some builds do not hold when nothing moves.
            // A controller that waits for a tool stands, and hears nothing but a reset.
            ControllerState::Idle | ControllerState::Tool => {
                *idle_reports += 1;
                *idle_reports >= REPORTS_PER_HOLD
            }
            _ => is_held,
        };
        if stands && stopping.verdict.needs_operator() {
            let reason = format!("{}; soft_reset to go on", stopping.verdict.message);
            return self.end_with_verdict(Phase::Adrift { reason });
        }
        if stands {
            stopping.step = Step::Resetting { until: self.now + ANSWER };
            return self.link.send_reset(self.now);
        }
        // Decelerating is what was asked for.
        let is_obeying = is_moving && state == ControllerState::Hold;
        let is_idle = matches!(state, ControllerState::Idle | ControllerState::Tool);
        if !is_idle && !is_obeying {
            *idle_reports = 0;
            *reports += 1;
            if *reports % REPORTS_PER_HOLD == 0 {
                self.link.send_realtime(realtime::FEED_HOLD);
            }
        }
    }

    /// The banner came: the machine stands and has forgotten the program.
    pub(super) fn on_stop_banner(&mut self) {
        if let Phase::Running(run) = &mut self.phase
            && let Stage::Stopping(stopping) = &mut run.stage
        {
            stopping.step = Step::Reporting { until: self.now + ANSWER };
        }
        // Which offsets it has kept is its own business.
        self.ask_again();
    }

    /// And the first report behind it.
    fn finish_stop(&mut self) {
        if self.machine.has_moved_since_start() {
            self.machine.is_homed = false;
        }
        let Phase::Running(run) = &mut self.phase else { return };
        if let Stage::Stopping(stopping) = &mut run.stage
            && let Some(id) = stopping.reply.take()
        {
            self.reply(id, Ok("the controller was reset".into()));
        }
        self.end_with_verdict(Phase::Ready);
    }

    pub(super) fn on_stop_timeout(&mut self) {
        let Phase::Running(run) = &mut self.phase else { return };
        let (code, text) = match run.is_resetting() {
            true => (error_code::NO_ANSWER, "the controller did not start anew after the reset"),
            false => (
                error_code::LINK_LOST,
                "the controller did not come to a standstill; motion may continue",
            ),
        };
        run.add_to_verdict(text);
        if let Stage::Stopping(stopping) = &mut run.stage {
            stopping.verdict.outcome = RunOutcome::Aborted;
            stopping.verdict.error_code = code;
            // The reset was not confirmed.
            if let Some(id) = stopping.reply.take() {
                let refusal = Refusal::new(code, text);
                self.outputs.push_back(Output::Reply { id, result: Err(refusal) });
            }
        }
        self.log(LogLevel::Error, text.into());
        self.end_with_verdict(Phase::Adrift { reason: format!("{text}; soft_reset to go on") });
    }

    /// Looks for a hold that was asked for in each report.
    pub(super) fn watch_hold(&mut self) {
        let Some(status) = &self.machine.status else { return };
        let is_running = matches!(self.phase, Phase::Running(_));
        let Some(hold) = &mut self.hold else { return };
        hold.reports += 1;
        match status.state {
            ControllerState::Run | ControllerState::Jog | ControllerState::Home => {}
            ControllerState::Idle if is_running || hold.reports < REPORTS_PER_HOLD => {}
            _ => {
                self.hold = None;
                return;
            }
        }
        if hold.reports % REPORTS_PER_HOLD != 0 {
            return;
        }
        hold.sent_again += 1;
        if hold.sent_again > HOLDS_MAX {
            self.hold = None;
            let text = "the controller does not hold; use soft_reset or the emergency stop";
            return self.log(LogLevel::Error, text.into());
        }
        let byte = if hold.is_door { realtime::SAFETY_DOOR } else { realtime::FEED_HOLD };
        self.link.send_realtime(byte);
    }
}
