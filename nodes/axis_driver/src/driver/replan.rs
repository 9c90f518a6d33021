//! Another path for what is left of a run, while the machine stands (S46, S48).
//!
//! Nothing that was sent, or made to be sent, is taken back: the new path must be
//! the old one up to there, element for element, and is encoded to its end before
//! it counts. Anything else leaves the run as it is.

use super::command::{Answer, refused};
use super::proof::{Proof, Proven};
use super::run::{Run, Stage};
use super::{Driver, Phase, Refusal};
use crate::codes::error_code;
use crate::encoder::Encoder;
use crate::estimate::Estimate;
use cnc_msgs::path::CompensatedPath;
use std::sync::Arc;

/// What is to be run from here on.
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
pub(super) struct Replan {
    pub(super) id: u64,
    request: ReplanRequest,
    encoder: Encoder,
    proof: Proof,
}

impl Run {
    /// Elements that have been sent or made to be sent; the first that has not, with
    /// its event, is where another path may begin. `None` unless all stands still.
    pub(super) fn settled(&self, is_machine_held: bool) -> Option<u64> {
        let stands = match self.stage {
            Stage::Streaming => is_machine_held,
            Stage::BlockEnd(_) | Stage::ToolChange(_) => true,
            _ => false,
        };
        stands.then(|| self.encoder.next_element() as u64).filter(|count| *count > 0)
    }
}

impl Driver {
    pub(super) fn replan(&mut self, id: u64, request: ReplanRequest) -> Answer {
        let is_held = self.machine.is_held();
        let rates = self.machine.rates();
        let Phase::Running(run) = &mut self.phase else {
            return refused(error_code::NOTHING_TO_DO, "no program is running");
        };
        let running = (run.request.program_id.as_str(), run.request.revision);
        if running != (request.program_id.as_str(), request.of) {
            let text = format!("revision {} of {} is running", running.1, running.0);
            return refused(error_code::NOTHING_TO_DO, text);
        }
        if run.settled(is_held).is_none() || run.rest.is_some() {
            return refused(error_code::BUSY, "the machine does not stand in a hold");
        }
        let Some(encoder) = run.encoder.going_on_with(Arc::clone(&request.path)) else {
            let text = "the new path differs from what has been sent";
            return refused(error_code::START_POSITION, text);
        };
        let first = encoder.next_element();
        let proof = Proof::new(encoder.clone(), rates, &request.path, first);
        run.rest = Some(Box::new(Replan { id, request, encoder, proof }));
        None
    }

    /// Encodes a slice of the rest that waits, and runs it when it is whole.
    pub(super) fn step_rest(&mut self) {
        let rates = self.machine.rates();
        let is_held = self.machine.is_held();
        let Phase::Running(run) = &mut self.phase else { return };
        let stands = run.settled(is_held).is_some();
        let Some(rest) = &mut run.rest else { return };
        let proven = rest.proof.step(&rest.request.path);
        if !stands {
            let id = rest.id;
            run.rest = None;
            let text = "the machine no longer stands in a hold";
            return self.reply(id, Err(Refusal::new(error_code::BUSY, text)));
        }
        let (id, seconds) = match proven {
            Proven::NotYet => return,
            Proven::Not(problem) => {
                let id = rest.id;
                run.rest = None;
                let refusal = Refusal::new(error_code::NOT_ENCODABLE, problem.to_string());
                return self.reply(id, Err(refusal));
            }
            Proven::Whole { seconds, .. } => (rest.id, seconds),
        };
        let Some(rest) = run.rest.take() else { return };
        let Replan { request: ReplanRequest { revision, path, .. }, encoder, .. } = *rest;
        let mut done_before = Estimate::new(rates, &path, run.first_element);
        run.total_s = done_before.advance_to(&path, encoder.next_element()) + seconds;
        run.estimate = Estimate::new(rates, &path, run.first_element);
        run.encoder = encoder;
        run.request.path = path;
        run.request.revision = revision;
        self.reply(id, Ok(format!("the program goes on with revision {revision}")));
    }
}
