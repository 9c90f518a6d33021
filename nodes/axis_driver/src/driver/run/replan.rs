//! Another path for what is left of a run, while the machine stands (S46, S48).
//!
//! Nothing that was sent, or made to be sent, is taken back: the new path must be
//! the old one up to there, element for element, and is encoded to its end before
//! it counts. Anything else leaves the run as it is.

use super::proof::{Proof, Proven};
use super::request::RunRequest;
use super::time_left::TimeLeft;
use super::workplace::WorkplaceCheck;
use super::{Pending, ProgramRun, Stage};
use crate::codes::error_code;
use crate::cycle_time::CycleTime;
use crate::driver::answer::{Answer, Refusal, refused};
use crate::driver::context::Context;
use crate::driver::context::config::RETURN_TOLERANCE_MM;
use crate::driver::context::machine::Machine;
use crate::encoder::{Encoder, EncoderStep};
use cnc_msgs::geometry::{AXIS_LETTERS, AxisSet};
use cnc_msgs::path::CompensatedPath;
use std::sync::Arc;

/// A request to go on with another path.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplanRequest {
    pub program_id: String,
    /// The revision that runs.
    pub of: u64,
    /// The revision that is to go on.
    pub revision: u64,
    pub path: Arc<CompensatedPath>,
}

/// A rest that is being encoded for its errors.
#[derive(Debug)]
pub(in crate::driver) struct Replan {
    pub(in crate::driver) id: u64,
    request: ReplanRequest,
    encoder: Encoder,
    /// Axes that it relies on, and the path before it did not.
    new_assumed: AxisSet,
    proof: Proof,
}

impl ProgramRun {
    /// Elements that have been sent or made to be sent; the first that has not, with
    /// its event, is where another path may begin. `None` unless all stands still.
    pub(in crate::driver) fn settled(&self, is_machine_held: bool) -> Option<u64> {
        let stands = match self.stage {
            Stage::Streaming => is_machine_held,
            Stage::BlockEnd(_) | Stage::ToolChange(_) | Stage::AwaitingPlan { .. } => true,
            _ => false,
        };
        // Where what follows it is in the machine is known when it has been answered.
        let stands = stands && !self.awaits_offset();
        // Before the first element only what an input says makes another path.
        let counts = |count: &u64| *count > 0 || self.stretch().is_some();
        stands.then(|| self.encoder.next_element() as u64).filter(counts)
    }

    /// The program that what follows is planned from, where it waits for that; empty until the loader has said.
    fn stretch(&self) -> Option<&str> {
        match &self.stage {
            Stage::AwaitingPlan { program_id, .. } => {
                Some(program_id.as_deref().unwrap_or_default())
            }
            _ => None,
        }
    }

    /// Whether a line that sets a work offset by the position waits to be sent.
    fn awaits_offset(&self) -> bool {
        let next = match &self.next {
            Some(Pending::Line(line)) => Some(line),
            _ => self.next_block.as_ref().and_then(EncoderStep::line),
        };
        next.is_some_and(|line| line.text.starts_with("G10L20"))
    }

    /// Takes another path for what is left; the answer comes when it is proved.
    pub(in crate::driver) fn replan(
        &mut self,
        context: &mut Context,
        id: u64,
        request: ReplanRequest,
    ) -> Answer {
        let stretch = self.stretch();
        let program = stretch.unwrap_or(&self.job.path_of);
        if let Err(refusal) = request.check(program, self.job.request.revision) {
            return Some(Err(refusal));
        }
        if let Some(reason) = self.waits_for_others() {
            return refused(error_code::BUSY, format!("{reason}: try again after it"));
        }
        if self.settled(context.machine.is_held()).is_none() || self.rest.is_some() {
            return refused(error_code::BUSY, NOT_IN_A_HOLD);
        }
        if self.encoder.counts_from_unknown() {
            let text = "what follows counts from a place that the path does not say, as after a probe: try again after it";
            return refused(error_code::BUSY, text);
        }
        let is_stretch = stretch.is_some();
        let relies_on_same = request.path.assumed_axes == self.job.request.path.assumed_axes;
        let encoder = self.encoder.going_on_with(Arc::clone(&request.path));
        let Some(mut encoder) = encoder.filter(|_| is_stretch || relies_on_same) else {
            let text = "the new path differs in blocks that were sent already";
            self.refuse_rest(context, id, Refusal::new(error_code::START_POSITION, text));
            return None;
        };
        let run = RunRequest { path: Arc::clone(&request.path), ..self.job.request.clone() };
        if is_stretch {
            encoder.begin_stretch();
            if let Some(refusal) = run.frame_obstacle(&context.machine) {
                self.refuse_rest(context, id, refusal);
                return None;
            }
        }
        let first = encoder.next_element();
        let limits = context.machine.limits_for_time();
        let time = CycleTime::new(&limits, &request.path, first, None);
        let workplace = match is_stretch {
            true => WorkplaceCheck::begin_stretch(context, &run, &encoder, self.judged_by),
            false => WorkplaceCheck::begin_rest(context, &run, &encoder, self.judged_by),
        };
        let proof = Proof::new(encoder.clone(), time, workplace);
        let new_assumed = request.path.assumed_axes.without(self.job.request.path.assumed_axes);
        self.rest = Some(Box::new(Replan { id, request, encoder, new_assumed, proof }));
        None
    }

    /// Answers a request for another path. What is planned from the results of probes does not come again:
    /// the run ends with the reason.
    fn refuse_rest(&mut self, context: &mut Context, id: u64, refusal: Refusal) {
        if let Stage::AwaitingPlan { refused, .. } = &mut self.stage {
            *refused = Some(refusal.message.clone());
        }
        context.reply(id, Err(refusal));
    }

    /// Encodes a slice of the rest that waits, and runs it when it is whole.
    pub(in crate::driver) fn step_rest(&mut self, context: &mut Context) {
        let stands = self.settled(context.machine.is_held()).is_some();
        let Some(rest) = &mut self.rest else { return };
        let proven = rest.proof.step(&rest.request.path);
        let id = rest.id;
        if !stands {
            self.rest = None;
            return context.reply(id, Err(no_longer_stands()));
        }
        let seconds = match proven {
            Proven::NotYet => return,
            Proven::Not(problem) => {
                self.rest = None;
                let refusal = Refusal::new(error_code::NOT_ENCODABLE, problem.to_string());
                return self.refuse_rest(context, id, refusal);
            }
            Proven::Whole { seconds, .. } => seconds,
        };
        let Some(rest) = self.rest.take() else { return };
        if self.stretch().is_some()
            && let Err(refusal) = rest.stands(&context.machine)
        {
            return self.refuse_rest(context, id, refusal);
        }
        let workplace = rest.proof.workplace.as_ref();
        if let Some(refusal) = workplace.and_then(|it| it.refusal(context)) {
            return self.refuse_rest(context, id, refusal);
        }
        let Replan { request: ReplanRequest { program_id, revision, path, .. }, encoder, .. } =
            *rest;
        let limits = context.machine.limits_for_time();
        let start = CycleTime::new(&limits, &path, self.first_element, None);
        let done_before = start.clone().advance_to(&path, encoder.next_element());
        self.time = TimeLeft::new(start);
        self.time.set_total(done_before + seconds);
        self.encoder = encoder;
        if self.stretch().is_some() {
            self.go_on();
        }
        self.job.path_of = program_id;
        self.job.request.path = path;
        self.job.request.revision = revision;
        context.reply(id, Ok(format!("the program goes on with revision {revision}")));
    }
}

impl Replan {
    /// Whether the tool stands where a stretch begins, as far as the path says where that is.
    fn stands(&self, machine: &Machine) -> Result<(), Refusal> {
        let Some(at) = machine.work_position() else { return Err(no_longer_stands()) };
        let start = self.request.path.start_of(self.encoder.next_element());
        let steps_per_mm = machine.limits_for_time().steps_per_mm;
        // New axes that the path relies on have not moved since the run began.
        let axes = self.encoder.known_axes().union(self.new_assumed);
        for axis in (0..3).filter(|&axis| axes.contains(axis)) {
            let off = (at[axis] - start[axis]).abs();
            // It stands on a step, and says so to a micrometre.
            let half_a_step = 0.5 / steps_per_mm[axis];
            if off > RETURN_TOLERANCE_MM + half_a_step {
                let letter = AXIS_LETTERS[axis];
                let text = format!("{letter} is {off:.3} mm from where what follows begins");
                return Err(Refusal::new(error_code::START_POSITION, text));
            }
        }
        Ok(())
    }
}

impl ReplanRequest {
    /// Whether it is for the run that is under way.
    pub(in crate::driver) fn check(&self, program_id: &str, revision: u64) -> Result<(), Refusal> {
        let running = (program_id, revision);
        if running == (self.program_id.as_str(), self.of) {
            return Ok(());
        }
        let text = format!("revision {} of {} is running", running.1, running.0);
        Err(Refusal::new(error_code::NOTHING_TO_DO, text))
    }
}

/// Why another path is refused for the moment.
pub(in crate::driver) const NOT_IN_A_HOLD: &str = "the machine is not in a hold";

/// For a rest that was still being proved when the machine went on or was stopped.
pub(in crate::driver) fn no_longer_stands() -> Refusal {
    Refusal::new(error_code::BUSY, "the machine is no longer in a hold")
}
