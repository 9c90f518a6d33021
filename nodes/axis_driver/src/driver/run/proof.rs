//! Encoding a whole path before a byte of it is sent.
//!
//! What cannot be encoded moves nothing. It is done in slices, so that a status report
//! or a hold never waits for a long program.

use crate::codes::error_code;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::config::LINES_PER_SLICE;
use crate::driver::output::{Output, RunOutcome, RunResult};
use crate::encoder::{EncodeError, Encoder, EncoderStep};
use crate::estimate::{Estimate, Rates};
use cnc_msgs::path::CompensatedPath;
use std::sync::Arc;

/// A path that is being encoded for nothing but its errors.
#[derive(Debug)]
pub(in crate::driver) struct Proof {
    encoder: Encoder,
    estimate: Estimate,
    lines: usize,
}

/// How far a proof is.
pub(in crate::driver) enum Proven {
    NotYet,
    /// All of it: the number of lines and how long they take.
    Whole {
        lines: usize,
        seconds: f64,
    },
    Not(EncodeError),
}

impl Proof {
    pub(in crate::driver) fn new(
        encoder: Encoder,
        rates: Rates,
        path: &CompensatedPath,
        first_element: usize,
    ) -> Self {
        Self { encoder, estimate: Estimate::new(rates, path, first_element), lines: 0 }
    }

    pub(in crate::driver) fn step(&mut self, path: &CompensatedPath) -> Proven {
        for _ in 0..LINES_PER_SLICE {
            match self.encoder.next_step() {
                Some(Ok(EncoderStep::Line(_))) => self.lines += 1,
                Some(Ok(
                    EncoderStep::ToolChange { .. }
                    | EncoderStep::Home { .. }
                    | EncoderStep::ControllerChange { .. }
                    | EncoderStep::CheckStart
                    | EncoderStep::CheckReturn { .. },
                )) => {}
                Some(Err(problem)) => return Proven::Not(problem),
                None => {
                    let seconds = self.estimate.advance_to(path, path.elements.len());
                    return Proven::Whole { lines: self.lines, seconds };
                }
            }
        }
        self.estimate.advance_to(path, self.encoder.next_element());
        Proven::NotYet
    }
}

/// Owns a request that only asks whether a path can be encoded. No run comes of it, so
/// that it goes on in every phase.
#[derive(Debug)]
pub(in crate::driver) struct Check {
    pub(in crate::driver) id: u64,
    pub(in crate::driver) path: Arc<CompensatedPath>,
    pub(in crate::driver) proof: Proof,
}

impl Check {
    /// Encodes a slice. True when the check is over and answered.
    pub(in crate::driver) fn step(&mut self, context: &mut Context) -> bool {
        let id = self.id;
        match self.proof.step(&self.path) {
            Proven::NotYet => return false,
            Proven::Not(problem) => {
                let refusal = Refusal::new(error_code::NOT_ENCODABLE, problem.to_string());
                context.reply(id, Err(refusal));
            }
            Proven::Whole { lines, seconds } => {
                let message = format!("{lines} lines, about {seconds:.0} s; nothing was sent");
                context.reply(id, Ok(message.clone()));
                let outcome = RunOutcome::Succeeded;
                let result =
                    RunResult { id, outcome, error_code: 0, message, last_line: 0, blamed_line: 0 };
                context.outputs.push_back(Output::RunFinished(result));
            }
        }
        true
    }
}
