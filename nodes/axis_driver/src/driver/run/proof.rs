//! Encoding a whole path before a byte of it is sent.
//!
//! What cannot be encoded moves nothing. It is done in slices, so that a status report
//! or a hold never waits for a long program.

use super::time_left::BLOCKS_PER_SLICE;
use super::workplace::WorkplaceCheck;
use crate::codes::error_code;
use crate::cycle_time::CycleTime;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::config::LINES_PER_SLICE;
use crate::driver::output::{Output, RunOutcome, RunResult};
use crate::encoder::{EncodeError, Encoder, EncoderStep};
use cnc_msgs::path::CompensatedPath;
use std::sync::Arc;

/// A path that is being encoded for nothing but its errors.
#[derive(Debug)]
pub(in crate::driver) struct Proof {
    encoder: Encoder,
    is_encoded: bool,
    time: CycleTime,
    /// Where the machine and what is on it is compared.
    pub(in crate::driver) workplace: Option<WorkplaceCheck>,
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
    /// `time` is at the element with which the encoder begins.
    pub(in crate::driver) fn new(
        encoder: Encoder,
        time: CycleTime,
        workplace: Option<WorkplaceCheck>,
    ) -> Self {
        Self { encoder, is_encoded: false, time, workplace, lines: 0 }
    }

    pub(in crate::driver) fn step(&mut self, path: &CompensatedPath) -> Proven {
        for _ in 0..LINES_PER_SLICE {
            if self.is_encoded {
                break;
            }
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
                None => self.is_encoded = true,
            }
        }
        let element = match self.is_encoded {
            true => path.elements.len(),
            false => self.encoder.next_element(),
        };
        if let Some(workplace) = &mut self.workplace {
            workplace.advance_to(path, element);
        }
        let is_timed = self.time.advance_within(path, element, BLOCKS_PER_SLICE);
        match self.is_encoded && is_timed {
            true => Proven::Whole { lines: self.lines, seconds: self.time.seconds() },
            false => Proven::NotYet,
        }
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
                let workplace = self.proof.workplace.as_ref();
                if let Some(refusal) = workplace.and_then(|it| it.refusal(context)) {
                    context.reply(id, Err(refusal));
                    return true;
                }
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
