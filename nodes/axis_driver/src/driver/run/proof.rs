//! Encoding a whole path before a byte of it is sent.
//!
//! What cannot be encoded moves nothing. It is done in slices, so that a status report
//! or a hold never waits for a long program. What is refused for its place in the machine is looked
//! at twice: the stored positions that the driver has may be old.

use super::request::RunRequest;
use super::time_left::BLOCKS_PER_SLICE;
use super::workplace::WorkplaceCheck;
use crate::codes::error_code;
use crate::cycle_time::CycleTime;
use crate::driver::answer::Refusal;
use crate::driver::context::Context;
use crate::driver::context::config::{ANSWER, LINES_PER_SLICE};
use crate::driver::output::{Output, RunOutcome, RunResult};
use crate::encoder::{EncodeError, EncodedLine, Encoder, EncoderStep};
use cnc_msgs::path::{CompensatedPath, StartInSpan};
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

/// Lines before the first element that a check shows.
const SHOWN_MAX: usize = 10;

/// How the tool gets to the first element of a run from the middle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::driver) enum Descent {
    /// It is lifted, goes over the place and comes down.
    FromAbove,
    /// Nothing is known of heights, or nothing is to be approached.
    NotLifted,
    /// Coming down would cut: Z is in the plane of compensation.
    Cuts,
}

impl Descent {
    pub(in crate::driver) fn of(is_lifted: bool, is_in_span: bool, in_span: StartInSpan) -> Self {
        match () {
            () if is_in_span && in_span != StartInSpan::FromAbove => Self::Cuts,
            () if is_lifted => Self::FromAbove,
            () => Self::NotLifted,
        }
    }

    /// What has to be done before the run, for people.
    fn before(self) -> &'static str {
        match self {
            Self::FromAbove => "",
            Self::NotLifted => {
                "; the tool has to stand there: it comes from above only on a homed machine, with the parameter \
                 approach: lift"
            }
            Self::Cuts => {
                "; the tool has to stand there: Z is in the plane of compensation, so coming down would cut"
            }
        }
    }
}

/// `; first come G53G0Z-5, S8000M3, G0X8Y20`: what is sent before the first element, and whether the tool gets
/// there by it.
pub(in crate::driver) fn beginning_of(mut encoder: Encoder, descent: Descent) -> String {
    let further = encoder.awaited_further().map_or(String::new(), |(letters, line)| {
        format!(
            "; {letters} {} moved from line {line} on only: put {} where the program begins",
            if letters.len() == 1 { "is" } else { "are" },
            if letters.len() == 1 { "it" } else { "them" }
        )
    });
    let mut lines = Vec::new();
    let mut more = 0;
    while let Some(Ok(step)) = encoder.next_step() {
        let line = match step {
            EncoderStep::Line(EncodedLine { element: Some(_), .. }) | EncoderStep::Probe { .. } => {
                break;
            }
            EncoderStep::Line(line) | EncoderStep::ReadInput { line } => line.text,
            EncoderStep::Home { text, .. } => text,
            EncoderStep::ToolChange { tool, .. } => format!("the change to T{tool}"),
            EncoderStep::ControllerChange { tool, .. } => format!("M6T{tool}"),
            EncoderStep::Stretch { .. } | EncoderStep::UserFunction { .. } => break,
            EncoderStep::AllowOverrides { .. }
            | EncoderStep::CheckStart
            | EncoderStep::CheckReturn { .. } => continue,
        };
        match lines.len() < SHOWN_MAX {
            true => lines.push(line),
            false => more += 1,
        }
    }
    if more > 0 {
        lines.push(format!("and {more} more"));
    }
    let mut text = String::new();
    if !lines.is_empty() {
        text = format!("; first come {}", lines.join(", "));
    }
    text + &further + descent.before()
}

/// Owns a request that only asks whether a path can be encoded. No run comes of it, so
/// that it goes on in every phase.
#[derive(Debug)]
pub(in crate::driver) struct Check {
    pub(in crate::driver) id: u64,
    pub(in crate::driver) request: RunRequest,
    pub(in crate::driver) proof: Proof,
    /// What a run from the middle would send before its first element, for people; else empty.
    pub(in crate::driver) beginning: String,
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
                let message = format!(
                    "{lines} lines, about {seconds:.0} s; nothing was sent{}",
                    self.beginning
                );
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::{EncoderConfig, start_at};
    use cnc_msgs::contour::{Action, Source};
    use cnc_msgs::geometry::{AxisSet, Shape};
    use cnc_msgs::path::{PathElement, PathEvent, Role};
    use std::sync::Arc;

    #[test]
    fn the_tool_comes_down_only_where_that_cuts_nothing() {
        use StartInSpan::{FromAbove, Refused, Standing};
        for (is_lifted, is_in_span, in_span, expected) in [
            (true, false, Refused, Descent::FromAbove),
            (true, true, FromAbove, Descent::FromAbove),
            (true, true, Standing, Descent::Cuts),
            // The control's answer is about another place than the path's.
            (true, false, Standing, Descent::FromAbove),
            (false, false, Refused, Descent::NotLifted),
            (false, true, FromAbove, Descent::NotLifted),
            (false, true, Standing, Descent::Cuts),
        ] {
            let descent = Descent::of(is_lifted, is_in_span, in_span);
            assert_eq!(descent, expected, "{is_lifted} {is_in_span} {in_span:?}");
            let stands = descent.before().starts_with("; the tool has to stand there");
            assert_eq!(stands, expected != Descent::FromAbove);
        }
    }

    #[test]
    fn of_many_lines_before_the_first_element_ten_are_shown() {
        let beginning = |offsets: u32| {
            let element = |line, x| PathElement {
                shape: Shape::Line,
                end: [x, 0.0, 0.0],
                feed_mm_per_min: Some(600.0),
                role: Role::None,
                side: None,
                axes: AxisSet::ALL,
                source: Source { line, ..Source::default() },
            };
            let events = (0..offsets).map(|number| PathEvent {
                at_element: 0,
                action: Action::SetWorkOffset {
                    system: 1,
                    axes: AxisSet::ALL,
                    origin: [f64::from(number), 0.0, 0.0],
                    by_position: false,
                },
                source: Source { line: 1, ..Source::default() },
            });
            let path = CompensatedPath {
                elements: vec![element(2, 10.0), element(3, 20.0)],
                events: events.collect(),
                ..CompensatedPath::default()
            };
            let config = EncoderConfig::default();
            let started = start_at(Arc::new(path), config, (3, 0), StartInSpan::Refused);
            let (encoder, _) = started.expect("it begins");
            beginning_of(encoder, Descent::FromAbove)
        };
        let few = beginning(2);
        assert!(!few.contains(" more"), "{few}");
        let shown = few.split(", ").count();
        let many = beginning(1000);
        assert_eq!(many.split(", ").count(), SHOWN_MAX + 1, "{many}");
        let rest = shown + 998 - SHOWN_MAX;
        assert!(many.ends_with(&format!(", and {rest} more")), "{many}");
    }
}
