//! Encoding a whole path before a byte of it is sent.
//!
//! What cannot be encoded moves nothing. It is done in slices, so that a status report
//! or a hold never waits for a long program. What is refused for its place in the machine is looked
//! at twice: the stored positions that the driver has may be old.

use super::request::RunRequest;
use super::time_left::BLOCKS_PER_SLICE;
use super::workplace::WorkplaceCheck;
use crate::codes::error_code;
use crate::cycle_time::{CycleTime, duration};
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::config::{ANSWER, LINES_PER_SLICE};
use crate::driver::output::{Output, RunOutcome, RunResult};
use crate::encoder::{EncodeError, Encoder, EncoderStep};
use cnc_msgs::path::CompensatedPath;
use std::time::Duration;

/// A path that is being encoded for nothing but its errors.
#[derive(Debug)]
pub(in crate::driver) struct Proof {
    encoder: Encoder,
    is_encoded: bool,
    time: CycleTime,
    /// Where the machine and what is on it is compared.
    pub(in crate::driver) workplace: Option<WorkplaceCheck>,
    look: Look,
    lines: usize,
}

/// By which stored positions the path is judged.
#[derive(Debug, Clone, Copy)]
enum Look {
    /// By those that the driver had.
    First,
    /// It would be refused: the controller is asked for them, and for settings that are not readable.
    Asking { answers: u32, until: Duration },
    /// By those that the controller has reported since.
    Second,
}

/// Whether a path stays within the machine.
pub(in crate::driver) enum Judged {
    NotYet,
    Fits,
    Refused(Refusal),
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
        Self { encoder, is_encoded: false, time, workplace, look: Look::First, lines: 0 }
    }

    /// While it waits for an answer of the controller, until when it does.
    pub(in crate::driver) fn waits_until(&self) -> Option<Duration> {
        match self.look {
            Look::Asking { until, .. } => Some(until),
            Look::First | Look::Second => None,
        }
    }

    /// All of it is encoded: whether it stays within the machine.
    pub(in crate::driver) fn judge(
        &mut self,
        context: &mut Context,
        request: &RunRequest,
    ) -> Judged {
        let Some(workplace) = &mut self.workplace else { return Judged::Fits };
        match self.look {
            Look::First if workplace.refuses() && context.can_ask_offsets() => {
                let answers = context.machine.offset_answers;
                self.look = Look::Asking { answers, until: context.now + ANSWER };
                if workplace.is_unreadable() {
                    context.ask_settings();
                }
                context.ask_offsets();
                return Judged::NotYet;
            }
            Look::First => {}
            Look::Asking { answers, until } => {
                if context.machine.offset_answers == answers && context.now < until {
                    return Judged::NotYet;
                }
                self.look = Look::Second;
                let is_other = !context.machine.known_offsets().is_near(&workplace.offsets);
                if is_other || workplace.is_unreadable() {
                    let beginning = workplace.beginning;
                    self.workplace = WorkplaceCheck::begin(context, request, beginning, None);
                    return Judged::NotYet;
                }
            }
            Look::Second if !workplace.step(&request.path) => return Judged::NotYet,
            Look::Second => {}
        }
        workplace.refusal(context).map_or(Judged::Fits, Judged::Refused)
    }

    pub(in crate::driver) fn step(&mut self, path: &CompensatedPath) -> Proven {
        for _ in 0..LINES_PER_SLICE {
            if self.is_encoded {
                break;
            }
            match self.encoder.next_step() {
                Some(Ok(
                    EncoderStep::Line(_)
                    | EncoderStep::Probe { .. }
                    | EncoderStep::ReadInput { .. },
                )) => self.lines += 1,
                Some(Ok(
                    EncoderStep::ToolChange { .. }
                    | EncoderStep::Home { .. }
                    | EncoderStep::ControllerChange { .. }
                    | EncoderStep::Stretch { .. }
                    | EncoderStep::UserFunction { .. }
                    | EncoderStep::AllowOverrides { .. }
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
    pub(in crate::driver) request: RunRequest,
    pub(in crate::driver) proof: Proof,
    /// What a run from the middle does before its first element, for people; else empty.
    pub(in crate::driver) beginning: Vec<String>,
}

impl Check {
    /// Encodes a slice. True when the check is over and answered.
    pub(in crate::driver) fn step(&mut self, context: &mut Context) -> bool {
        let id = self.id;
        match self.proof.step(&self.request.path) {
            Proven::NotYet => return false,
            Proven::Not(problem) => {
                let refusal = Refusal::new(error_code::NOT_ENCODABLE, problem.to_string());
                context.reply(id, Err(refusal));
            }
            Proven::Whole { lines, seconds } => {
                match self.proof.judge(context, &self.request) {
                    Judged::NotYet => return false,
                    Judged::Fits => {}
                    Judged::Refused(refusal) => {
                        context.reply(id, Err(refusal));
                        return true;
                    }
                }
                let parts = &self.beginning;
                let to_the_end = if parts.is_empty() { "" } else { " to the end" };
                let time = duration(seconds);
                let mut message =
                    format!("{lines} lines, about {time}{to_the_end}; nothing was sent");
                parts.iter().for_each(|part| message += &format!("; {part}"));
                context.reply(id, Ok(message.clone()));
                let outcome = RunOutcome::Succeeded;
                let result = RunResult {
                    id,
                    outcome,
                    error_code: 0,
                    message,
                    last_line: 0,
                    blamed_line: 0,
                    last_occurrence: 0,
                };
                context.outputs.push_back(Output::RunFinished(result));
            }
        }
        true
    }
}
