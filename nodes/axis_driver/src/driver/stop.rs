//! The phase `Stopping`: bringing a run to a standstill, and watching that it stands.
//!
//! Hold, wait for standstill, reset: nothing is lost and nothing more is run. After a
//! refused line or a lost count the reset is left to the operator. A byte can be lost on
//! the wire, so a hold that does not show in the reports is sent again.

mod recovery;

use super::answer::{Answer, Refusal, refused};
use super::context::config::{ANSWER, REPORTS_PER_HOLD, STANDSTILL};
use super::context::offsets::Shift;
use super::context::{Context, Origin};
use super::next::Next;
use super::output::{LogLevel, RunOutcome};
use super::run::ProgramRun;
use super::run::exit::RunVerdict;
use super::run::job::Job;
use super::run::replan::{self, ReplanRequest};
use crate::codes::error_code;
use crate::link::realtime;
use crate::report::ControllerState;
use cnc_msgs::geometry::Position;
use cnc_msgs::machine::MachineState;
use std::time::Duration;

/// A report that was under way when the hold was written may still show an older hold.
const OLD_REPORTS: Duration = Duration::from_millis(30);

/// Owns a run that is being stopped: what is left of it, how it will have ended, and how
/// far the stop has come.
#[derive(Debug)]
pub(super) struct Stopping {
    pub(super) job: Job,
    verdict: RunVerdict,
    step: StopStep,
    /// The soft reset that asked for it.
    reply: Option<u64>,
    /// A request for another path, which can no longer be followed and is still to be
    /// answered.
    rest: Option<u64>,
    /// The shift of G92 before the reset.
    shift_before: Shift,
}

/// The end of a stop.
#[derive(Debug)]
pub(super) struct Ended {
    pub(super) job: Job,
    /// The soft reset that was not confirmed.
    pub(super) reply: Option<u64>,
    /// The request for another path that was not answered.
    pub(super) rest: Option<u64>,
}

#[derive(Debug)]
enum StopStep {
    Holding {
        since: Duration,
        reports: u32,
        idle_reports: u32,
        /// Where the axes were when the controller last said that it will hold.
        moved_to: Option<Position>,
    },
    Resetting {
        until: Duration,
    },
    /// It has restarted; whoever waits for the end can rely on the state then.
    Reporting {
        until: Duration,
    },
}

impl Stopping {
    /// Stops a run that has begun: with a hold, or with a reset where a hold has no effect.
    pub(super) fn begin(context: &mut Context, run: ProgramRun, verdict: RunVerdict) -> Self {
        // Homing does not react to a hold, and in check mode nothing moves.
        // A hold waits for the end of a thread, which is not where it should be.
        let is_wrong_thread =
            verdict.error_code == error_code::PATH_DEVIATION && context.link.is_threading();
        let is_reset = run.job.is_check()
            || run.is_homing() && context.link.unanswered() > 0
            || is_wrong_thread;
        context.hold = None;
        let step = if is_reset {
            context.link.send_reset(context.now);
            StopStep::Resetting { until: context.now + ANSWER }
        } else {
            context.link.send_realtime(realtime::FEED_HOLD);
            StopStep::Holding { since: context.now, reports: 0, idle_reports: 0, moved_to: None }
        };
        Self::new(run, verdict, step, None)
    }

    /// Resets at once, in the middle of a run.
    pub(super) fn reset(context: &mut Context, run: ProgramRun, reply: u64) -> Self {
        let verdict = RunVerdict::aborted(error_code::SOFT_RESET, "stopped by a soft reset");
        let step = StopStep::Resetting { until: context.now + ANSWER };
        send_reset(context);
        Self::new(run, verdict, step, Some(reply))
    }

    fn new(run: ProgramRun, verdict: RunVerdict, step: StopStep, reply: Option<u64>) -> Self {
        let ProgramRun { job, rest, .. } = run;
        let rest = rest.map(|rest| rest.id);
        Self { job, verdict, step, reply, rest, shift_before: Shift::default() }
    }

    /// Resets at once, in the middle of the stop.
    pub(super) fn reset_now(&mut self, context: &mut Context, reply: u64) {
        self.step = StopStep::Resetting { until: context.now + ANSWER };
        if let Some(earlier) = self.reply.replace(reply) {
            let text = "interrupted by a soft reset";
            context.reply(earlier, Err(Refusal::new(error_code::SOFT_RESET, text)));
        }
        send_reset(context);
    }

    pub(super) fn until(&self) -> Duration {
        match self.step {
            StopStep::Holding { since, .. } => since + STANDSTILL,
            StopStep::Resetting { until } | StopStep::Reporting { until } => until,
        }
    }

    /// Adds to the state what the stop knows.
    pub(super) fn compose_mode(&self, state: &mut MachineState) {
        state.compensation = self.job.compensation();
        state.path_revision = self.job.request.revision;
        state.settled_elements = 0;
        state.reason = match self.step {
            StopStep::Holding { .. } => format!("STOPPING: {}", self.verdict.message),
            StopStep::Resetting { .. } | StopStep::Reporting { .. } => {
                format!("RESETTING: {}", self.verdict.message)
            }
        };
    }

    pub(super) fn is_resetting(&self) -> bool {
        matches!(self.step, StopStep::Resetting { .. } | StopStep::Reporting { .. })
    }

    /// Whether it is being stopped for something that the operator has to settle.
    pub(super) fn waits_for_operator(&self) -> bool {
        self.verdict.needs_operator()
    }

    pub(super) fn verdict(&self) -> &RunVerdict {
        &self.verdict
    }

    pub(super) fn add_to_verdict(&mut self, text: &str) {
        self.verdict.message += "; ";
        self.verdict.message += text;
    }

    /// Another path: refused, because the machine is being stopped.
    pub(super) fn replan(&self, request: &ReplanRequest) -> Answer {
        match request.check(&self.job.path_of, self.job.request.revision) {
            Ok(()) => refused(error_code::BUSY, replan::NOT_IN_A_HOLD),
            Err(refusal) => Some(Err(refusal)),
        }
    }

    /// Refuses the request for another path that was being proved when the stop began.
    pub(super) fn refuse_rest(&mut self, context: &mut Context) {
        if let Some(id) = self.rest.take() {
            context.reply(id, Err(replan::no_longer_stands()));
        }
    }

    /// A line was answered. Nothing is judged any more, but what is cut is still followed.
    pub(super) fn on_answer(&mut self, context: &mut Context, origin: &Origin) {
        match origin {
            Origin::Program { element, events, .. } => self.job.on_answer(*element, *events),
            Origin::Query(query) => self.on_query_answer(context, *query),
            _ => {}
        }
    }

    /// Takes a status report, which is in the machine model already. Gives what follows
    /// when the stop is over.
    pub(super) fn on_status(&mut self, context: &mut Context) -> Option<Next> {
        // A reset empties the planner without cutting what it held.
        if !self.is_resetting() {
            self.job.track(context);
        }
        let machine = &context.machine;
        let state = machine.status.as_ref().map(|status| status.state.clone())?;
        let (is_held, is_moving) = (machine.is_held(), machine.is_moving());
        let will_hold = machine.status.as_ref().filter(|status| status.will_hold());
        let threads_at = will_hold.and_then(|status| status.machine_position);
        let (since, reports, idle_reports) = match &mut self.step {
            // It will hold at the end of the thread, as long as that goes on.
            StopStep::Holding { since, moved_to, .. }
                if threads_at.is_some() && *moved_to != threads_at =>
            {
                (*since, *moved_to) = (context.now, threads_at);
                return None;
            }
            StopStep::Holding { since, reports, idle_reports, .. } => {
                (*since, reports, idle_reports)
            }
            StopStep::Resetting { .. } => return None,
            StopStep::Reporting { .. } if context.link.unanswered() > 0 => return None,
            StopStep::Reporting { .. } => return Some(self.finish(context)),
        };
        if context.now < since + OLD_REPORTS {
            return None;
        }
        let stands = match state {
            ControllerState::Alarm | ControllerState::Sleep => {
                return Some(Next::adrift("the controller is locked; soft_reset to go on"));
            }
            // Some builds do not hold when nothing moves.
            // A controller that waits for a tool stands, and hears nothing but a reset.
            ControllerState::Idle | ControllerState::Tool => {
                *idle_reports += 1;
                *idle_reports >= REPORTS_PER_HOLD
            }
            _ => is_held,
        };
        if stands && self.verdict.needs_operator() {
            return Some(Next::adrift(format!("{}; soft_reset to go on", self.verdict.message)));
        }
        if stands {
            self.step = StopStep::Resetting { until: context.now + ANSWER };
            context.link.send_reset(context.now);
            return None;
        }
        // Decelerating is what was asked for.
        let is_obeying = is_moving && state == ControllerState::Hold;
        let is_idle = matches!(state, ControllerState::Idle | ControllerState::Tool);
        if !is_idle && !is_obeying {
            *idle_reports = 0;
            *reports += 1;
            if *reports % REPORTS_PER_HOLD == 0 {
                context.link.send_realtime(realtime::FEED_HOLD);
            }
        }
        None
    }

    /// The machine does not stand in time, or the controller does not restart.
    pub(super) fn on_timeout(&mut self, context: &mut Context) -> Next {
        let (code, text) = match self.is_resetting() {
            true => (error_code::NO_ANSWER, "the controller did not restart after the reset"),
            false => (
                error_code::LINK_LOST,
                "the controller did not come to a standstill; motion may continue",
            ),
        };
        self.add_to_verdict(text);
        self.verdict.outcome = RunOutcome::Aborted;
        self.verdict.error_code = code;
        // The reset was not confirmed.
        if let Some(id) = self.reply.take() {
            context.reply(id, Err(Refusal::new(code, text)));
        }
        context.log(LogLevel::Error, text);
        Next::adrift(format!("{text}; soft_reset to go on"))
    }

    pub(super) fn end(self) -> Ended {
        let Self { job, reply, rest, .. } = self;
        Ended { job, reply, rest }
    }
}

/// Resets the controller in the middle of motion or at a standstill.
fn send_reset(context: &mut Context) {
    let stands = [ControllerState::Idle, ControllerState::Check, ControllerState::Tool];
    let stands = stands.iter().any(|state| context.machine.is_state(state));
    if !context.machine.is_held() && !stands {
        context.machine.is_homed = false;
    }
    context.hold = None;
    context.link.send_reset(context.now);
}
