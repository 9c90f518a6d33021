//! The transitions between the phases.
//!
//! Every change of the phase is here, in `paused.rs` and in `start.rs`.

use super::answer::Refusal;
use super::connect::Connecting;
use super::manual::{ManualEnd, ManualOperation, ManualOrder};
use super::next::Next;
use super::output::{LogLevel, Output, RunOutcome, RunResult};
use super::run::exit::{Exit, RunVerdict};
use super::stop::{Ended, Stopping};
use super::{Driver, Phase};
use crate::codes::error_code;
use crate::link::Link;

impl Driver {
    /// Goes to a phase in which nothing is under way, if there is one to go to.
    pub(super) fn go(&mut self, next: Option<Next>) {
        if let Some(next) = next {
            self.phase = next.into();
        }
    }

    pub(super) fn on_port_opened(&mut self) {
        if self.is_open() {
            self.on_port_closed("the port was opened again");
        }
        self.context.link = Link::new(self.context.config.link(), self.context.now);
        self.context.machine.on_port();
        self.context.hold = None;
        self.phase = Phase::Connecting(Connecting::listen(&self.context));
    }

    pub(super) fn on_port_closed(&mut self, reason: &str) {
        let machine = &mut self.context.machine;
        let was_active = self.phase.is_at_work() || machine.is_moving() || machine.is_silent;
        let is_open = !matches!(self.phase, Phase::Closed { .. });
        if is_open && was_active {
            machine.is_lost = true;
            machine.needs_acknowledgement = true;
        }
        let reason = match machine.is_lost {
            true => format!("LINK_LOST: {reason}; motion may continue"),
            false => reason.to_owned(),
        };
        self.context.hold = None;
        self.context.machine.is_homed = false;
        self.context.machine.status = None;
        self.context.drop_overrides("the line is gone");
        let code = error_code::LINK_LOST;
        let next = Next::Closed { reason: reason.clone() };
        match &self.phase {
            Phase::Running(_) | Phase::Stopping(_) => {
                self.end_run(RunVerdict::aborted(code, reason.clone()), next);
            }
            Phase::Manual(_) => {
                self.end_manual(ManualEnd::refused(Refusal::new(code, reason.clone()), next));
            }
            Phase::Connecting(connecting) => {
                if let Some(id) = connecting.reply_to() {
                    self.context.reply(id, Err(Refusal::new(code, reason.clone())));
                }
                self.phase = next.into();
            }
            Phase::Closed { .. } | Phase::Adrift { .. } | Phase::Ready => self.phase = next.into(),
        }
        self.context.log(LogLevel::Warn, reason);
    }

    /// Resets the controller and identifies it again.
    pub(super) fn begin_reset(&mut self, reply: Option<u64>) {
        self.phase = Phase::Connecting(Connecting::reset(&mut self.context, reply));
    }

    /// Identifies again a controller that has restarted by itself.
    pub(super) fn begin_after_restart(&mut self) {
        self.phase = Phase::Connecting(Connecting::after_restart(&mut self.context));
    }

    pub(super) fn begin_manual(&mut self, id: u64, order: ManualOrder) {
        self.pause_run();
        let operation = ManualOperation::begin(&mut self.context, id, order);
        self.phase = Phase::Manual(Box::new(operation));
    }

    /// Ends a manual operation, and reports the end to whoever asked for it.
    pub(super) fn end_manual(&mut self, end: ManualEnd) {
        let ManualEnd { result, next, is_reset } = end;
        let Phase::Manual(operation) = std::mem::replace(&mut self.phase, next.into()) else {
            panic!("only a manual operation can end");
        };
        if let Err(refusal) = &result {
            self.end_paused_with(refusal);
        }
        if self.context.machine.status.is_some() {
            // Whoever hears of the end finds the state of it.
            self.publish();
        }
        let output = operation.report(&self.context.machine, result);
        self.context.outputs.push_back(output);
        if is_reset {
            self.begin_reset(None);
        }
    }

    /// Does what a handler of the run asks for.
    pub(super) fn leave_run(&mut self, exit: Option<Exit>) {
        match exit {
            None => {}
            Some(Exit::Over { verdict, next }) => self.end_run(verdict, next),
            Some(Exit::Stop(verdict)) => self.stop_run(verdict),
        }
    }

    /// Stops sending and brings the machine to a standstill; the run ends when it stands.
    /// What stops it first is the reason.
    pub(super) fn stop_run(&mut self, verdict: RunVerdict) {
        self.say_what_goes_on();
        match std::mem::replace(&mut self.phase, Phase::Ready) {
            Phase::Running(run) if run.has_begun() => {
                let stopping = Stopping::begin(&mut self.context, *run, verdict);
                self.phase = Phase::Stopping(Box::new(stopping));
            }
            phase => {
                let is_running = matches!(phase, Phase::Running(_));
                self.phase = phase;
                if is_running {
                    // Nothing is under way.
                    self.end_run(verdict, Next::Ready);
                }
            }
        }
    }

    /// What a node of the cell does is not stopped with the run.
    pub(super) fn say_what_goes_on(&mut self) {
        let Phase::Running(run) = &self.phase else { return };
        if let Some(text) = run.goes_on_without() {
            self.context.log(LogLevel::Warn, text);
        }
    }

    /// Resets the controller in the middle of a run or of a stop.
    pub(super) fn reset_run(&mut self, id: u64) {
        self.say_what_goes_on();
        self.phase = match std::mem::replace(&mut self.phase, Phase::Ready) {
            Phase::Running(run) => {
                Phase::Stopping(Box::new(Stopping::reset(&mut self.context, *run, id)))
            }
            Phase::Stopping(mut stopping) => {
                stopping.reset_now(&mut self.context, id);
                Phase::Stopping(stopping)
            }
            phase => phase,
        };
    }

    /// Ends a stop with its verdict, if it is over.
    pub(super) fn end_stop(&mut self, next: Option<Next>) {
        if let (Some(next), Phase::Stopping(stopping)) = (next, &self.phase) {
            let verdict = stopping.verdict().clone();
            self.end_run(verdict, next);
        }
    }

    /// Ends the run and reports it: to the command itself when it was not accepted yet.
    pub(super) fn end_run(&mut self, verdict: RunVerdict, next: Next) {
        let Ended { job, reply, rest } = match std::mem::replace(&mut self.phase, next.into()) {
            Phase::Running(run) if run.is_proving() => {
                return self.context.reply(run.job.id, Err(verdict.refusal()));
            }
            Phase::Running(run) => {
                Ended { rest: run.rest.map(|rest| rest.id), job: run.job, reply: None }
            }
            Phase::Stopping(stopping) => stopping.end(),
            _ => panic!("only a run can end"),
        };
        let (last_line, blamed_line) = (job.line(), job.blamed_line);
        let last_occurrence = job.occurrence();
        match verdict.outcome {
            RunOutcome::Succeeded => {
                if let Some(paused) = &mut self.paused {
                    paused.run.encoder.take_tool_length(&job.request.path);
                }
            }
            _ => self.end_paused_with(&verdict.refusal()),
        }
        // After a reset no start message was heard: whether it arrived is not known.
        for id in rest.into_iter().chain(reply) {
            self.context.reply(id, Err(verdict.refusal()));
        }
        self.context.hold = None;
        if self.context.machine.status.is_some() {
            // Whoever hears of the end finds the state of it.
            self.publish();
        }
        let RunVerdict { outcome, error_code, message } = verdict;
        let id = job.id;
        let result =
            RunResult { id, outcome, error_code, message, last_line, blamed_line, last_occurrence };
        self.context.outputs.push_back(Output::RunFinished(result));
    }
}
