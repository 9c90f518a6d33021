//! Encoding a whole path before a byte of it is sent.
//!
//! What cannot be encoded moves nothing. It is done in slices, so that a status report
//! or a hold never waits for a long program.

use super::config::LINES_PER_SLICE;
use super::{Driver, Output, Refusal, RunOutcome, RunResult};
use crate::codes::error_code;
use crate::encoder::{EncodeError, Encoder, Step};
use crate::estimate::{Estimate, Rates};
use cnc_msgs::path::CompensatedPath;
use std::sync::Arc;

/// A path that is being encoded for nothing but its errors.
#[derive(Debug)]
pub(super) struct Proof {
    encoder: Encoder,
    estimate: Estimate,
    lines: usize,
}

/// How far a proof is.
pub(super) enum Proven {
    NotYet,
    /// All of it: the number of lines and how long they take.
    Whole {
        lines: usize,
        seconds: f64,
    },
    Not(EncodeError),
}

impl Proof {
    pub(super) fn new(
        encoder: Encoder,
        rates: Rates,
        path: &CompensatedPath,
        first_element: usize,
    ) -> Self {
        Self { encoder, estimate: Estimate::new(rates, path, first_element), lines: 0 }
    }

    pub(super) fn step(&mut self, path: &CompensatedPath) -> Proven {
        for _ in 0..LINES_PER_SLICE {
            match self.encoder.next_step() {
                Some(Ok(Step::Line(_))) => self.lines += 1,
                Some(Ok(
                    Step::ToolChange { .. }
                    | Step::Home { .. }
                    | Step::ControllerChange { .. }
                    | Step::CheckStart
                    | Step::CheckReturn { .. },
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

/// A request that only wants to know.
#[derive(Debug)]
pub(super) struct Check {
    pub(super) id: u64,
    pub(super) path: Arc<CompensatedPath>,
    pub(super) proof: Proof,
}

impl Driver {
    pub(super) fn step_check(&mut self) {
        let Some(check) = &mut self.check else { return };
        let id = check.id;
        match check.proof.step(&check.path) {
            Proven::NotYet => return,
            Proven::Not(problem) => {
                self.reply(id, Err(Refusal::new(error_code::NOT_ENCODABLE, problem.to_string())));
            }
            Proven::Whole { lines, seconds } => {
                let message = format!("{lines} lines, about {seconds:.0} s; nothing was sent");
                self.reply(id, Ok(message.clone()));
                let outcome = RunOutcome::Succeeded;
                let result =
                    RunResult { id, outcome, error_code: 0, message, last_line: 0, blamed_line: 0 };
                self.outputs.push_back(Output::RunFinished(result));
            }
        }
        self.check = None;
    }
}
