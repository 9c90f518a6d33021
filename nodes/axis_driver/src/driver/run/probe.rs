//! A probe in a program: the machine stands, one line moves it until the probe touches, and the
//! run goes on from there.
//!
//! Nothing is streamed meanwhile: where the lines that follow begin is known only then.

use super::exit::Exit;
use super::job::Job;
use super::request::RunRequest;
use super::workplace::WorkplaceCheck;
use super::{ProgramRun, Stage, Then};
use crate::codes::error_code;
use crate::driver::context::config::PLANNED;
use crate::driver::context::place::show;
use crate::driver::context::queries::OFFSETS_QUERY;
use crate::driver::context::{Context, Origin};
use crate::driver::output::{LogLevel, Output, ProbesOfRun};
use crate::encoder::EncodedLine;
use crate::link::LineKind;
use crate::vectors::{dot, minus, norm, unit};
use cnc_msgs::contour::{Probe, Source};
use cnc_msgs::geometry::{AxisSet, Position};
use cnc_msgs::path::UnknownAxes;
use cnc_msgs::probing::ProbeResult;
use std::time::Duration;

/// How far beyond the place where it has touched a probe may stop without a warning, mm.
const BEYOND_MM: f64 = 0.02;
/// How far from the way of the tool a touch may be reported: steps and rounding, mm.
const OFF_WAY_MM: f64 = 0.1;

/// A probe that is under way.
#[derive(Debug, Clone)]
pub(super) struct Probing {
    probe: Probe,
    source: Source,
    element: Option<usize>,
    /// Where the tool stood before, machine frame.
    began: Option<Position>,
    /// Where it has touched, machine frame, and whether it has.
    touch: Option<(Position, bool)>,
    /// The controller has said nothing of it by itself, and was asked.
    is_asked: bool,
}

impl Probing {
    pub(super) fn reason(&self, job: &Job) -> String {
        let place = job.place_of(self.source);
        format!("PROBE: {} in {place}", self.probe.word())
    }

    /// Whether it has ended before the end of its way.
    pub(super) fn has_touched(&self) -> bool {
        self.touch.is_some_and(|(_, has_touched)| has_touched)
    }

    /// Why the tool cannot have touched there and stopped here: the controller has not run the line.
    fn contradiction(&self, stands: Option<Position>) -> Option<String> {
        let (touch, _) = self.touch.filter(|_| self.has_touched())?;
        let (began, stands) = self.began.zip(stands)?;
        let direction = unit(minus(stands, began));
        let along = dot(minus(touch, began), direction).clamp(0.0, norm(minus(stands, began)));
        let nearest: Position = std::array::from_fn(|axis| began[axis] + along * direction[axis]);
        (norm(minus(touch, nearest)) > OFF_WAY_MM).then(|| {
            format!(
                "the controller says that the probe touched at {}, which is not on the way of the tool from {} to {} in the machine frame: it has not run the line as it was sent",
                show(touch),
                show(began),
                show(stands)
            )
        })
    }
}

impl ProgramRun {
    pub(in crate::driver) fn is_probing(&self) -> bool {
        matches!(self.stage, Stage::Probing(_))
    }

    /// All motion has ended: sends the line of the probe.
    pub(super) fn begin_probe(&mut self, context: &mut Context, line: EncodedLine, probe: Probe) {
        let EncodedLine { element, source, .. } = line;
        let began = context.machine.machine_position();
        let (touch, is_asked) = (None, false);
        self.stage = Stage::Probing(Probing { probe, source, element, began, touch, is_asked });
        self.send(context, EncodedLine { is_alone: true, ..line });
    }

    /// Takes what the controller reports about a probe.
    pub(in crate::driver) fn on_probe(&mut self, position: Position, has_touched: bool) {
        if let Stage::Probing(probing) = &mut self.stage {
            probing.touch = Some((position, has_touched));
        }
    }

    /// The line of the probe was answered, or the question after it.
    pub(super) fn end_probe(&mut self, context: &mut Context) -> Option<Exit> {
        let Stage::Probing(probing) = &mut self.stage else { return None };
        if probing.touch.is_none() && !std::mem::replace(&mut probing.is_asked, true) {
            // The report was lost, or is switched off ($10 of grblHAL); the offsets have it at their end.
            context.link.send_line(OFFSETS_QUERY, LineKind::Slow, Origin::Offsets);
            return None;
        }
        let probing = probing.clone();
        let place = self.job.place_of(probing.source);
        let ends = if probing.probe.away { "let go" } else { "touched" };
        let nowhere = format!("{place}: the probe {ends} nowhere on the way");
        let failed = match probing.touch {
            Some((at, true)) => {
                let work = context.machine.in_work_frame(at).map(show);
                let work = work.map_or(String::new(), |at| format!(", {at} in the work frame"));
                let at = show(at);
                let text = format!("{place}: the probe {ends} at {at} in the machine frame{work}");
                context.log(LogLevel::Info, text);
                None
            }
            Some(_) if probing.probe.may_miss => match self.after(&probing).zeroed {
                Some((line, _)) => Some(format!(
                    "{nowhere}, and line {line} would set the zero where it has ended: with {} that is an alarm",
                    Probe { may_miss: false, ..probing.probe }.word()
                )),
                None => {
                    context.log(LogLevel::Info, nowhere);
                    None
                }
            },
            Some(_) => Some(nowhere),
            None => Some(format!("{place}: the controller did not say where the probe {ends}")),
        };
        if let Some(text) = failed {
            self.job.blamed_line = probing.source.line;
            return Some(Exit::abort(error_code::PROBE_FAILED, text));
        }
        self.stage = Stage::Settling { then: Then::Probed(probing), from: context.now };
        context.link.ask_status(context.now);
        None
    }

    /// The machine stands where the probe has ended.
    pub(super) fn after_probe(&mut self, context: &mut Context, probing: &Probing) -> Option<Exit> {
        if let Some(text) = probing.contradiction(context.machine.machine_position()) {
            self.job.blamed_line = probing.source.line;
            let place = self.job.place_of(probing.source);
            return Some(Exit::abort(error_code::PROBE_FAILED, format!("{place}: {text}")));
        }
        let stands = context.machine.work_position();
        let contact = match probing.touch {
            Some((touch, true)) => context.machine.in_work_frame(touch),
            _ => stands,
        };
        let Some((contact, stands)) = contact.zip(stands) else {
            let place = self.job.place_of(probing.source);
            let text = format!("{place}: the controller does not say where the work frame is");
            return Some(Exit::abort(error_code::PROBE_FAILED, text));
        };
        let has_touched = probing.has_touched();
        self.measured.probes.push(ProbeResult { has_touched, contact, stands });
        let UnknownAxes { until, relative, zeroed } = self.after(probing);
        if let (Some((line, _)), Some((touch, true)), Some(at)) =
            (zeroed, probing.touch, context.machine.machine_position())
        {
            let beyond = norm(minus(at, touch));
            if beyond > BEYOND_MM {
                let place = self.job.place_of(probing.source);
                context.log(
                    LogLevel::Warn,
                    format!(
                        "{place}: the tool has stopped {beyond:.3} mm beyond the place where the probe has ended, and line {line} sets the zero where it stands: probe a second time, more slowly"
                    ),
                );
            }
        }
        // Other ends in the travel were judged before the run.
        let is_judged = zeroed.is_none() && relative.is_empty();
        if is_judged && context.config.keep_out.keep_out.is_empty() {
            self.go_on();
            return None;
        }
        // With another zero all that follows is somewhere else.
        let until = zeroed.map_or(until, |_| self.job.request.path.elements.len());
        self.stage = Stage::Probed { until };
        context.link.send_line(OFFSETS_QUERY, LineKind::Slow, Origin::Offsets);
        None
    }

    /// The axes are where homing, or a change by the controller, has left them: boxes are compared with
    /// what follows from there, up to the elements that name all axes again.
    pub(super) fn judge_from_here(&mut self, context: &mut Context) {
        if context.config.keep_out.keep_out.is_empty() || self.judged_by.is_none() {
            return self.go_on();
        }
        let path = &self.job.request.path;
        let UnknownAxes { until, zeroed, .. } =
            path.unknown_from(self.encoder.next_element(), AxisSet::ALL);
        let until = zeroed.map_or(until, |_| path.elements.len());
        self.stage = Stage::Probed { until };
        context.link.send_line(OFFSETS_QUERY, LineKind::Slow, Origin::Offsets);
    }

    /// Judges what follows from where the machine stands, with the offsets that the controller has.
    pub(super) fn judge_from_probe(&mut self, context: &mut Context) {
        let Stage::Probed { until } = self.stage else { return };
        let part = (&self.encoder, until);
        let request = &self.job.request;
        let check = WorkplaceCheck::begin_from_here(context, request, part, self.judged_by);
        self.judged_again = check.map(Box::new);
        if !self.is_judging() {
            self.go_on();
        }
    }

    /// All motion has ended. What follows is judged by what the controller has stored: the program may
    /// have set it.
    pub(super) fn begin_stretch(&mut self, context: &mut Context, source: Source) {
        self.stage = Stage::Stretch { source };
        context.link.send_line(OFFSETS_QUERY, LineKind::Slow, Origin::Offsets);
    }

    /// Says what the probes have found, and waits for the rest of the path.
    pub(super) fn await_plan(&mut self, context: &mut Context) {
        let Stage::Stretch { source } = self.stage else { return };
        let until = context.now + PLANNED;
        let (program_id, refused) = (None, None);
        self.stage = Stage::AwaitingPlan { source, until, program_id, refused };
        let RunRequest { program_id, revision, .. } = &self.job.request;
        context.outputs.push_back(Output::Probes(ProbesOfRun {
            program_id: program_id.clone(),
            revision: *revision,
            line: source.line,
            measured: self.measured.clone(),
        }));
    }

    /// The loader has read the program on, or refuses it; of another run or stretch it says nothing.
    pub(in crate::driver) fn on_program_continued(
        &mut self,
        of: u64,
        answer: Result<String, String>,
        now: Duration,
    ) {
        if let Stage::AwaitingPlan { until, program_id, refused, .. } = &mut self.stage
            && of == self.job.request.revision
        {
            match answer {
                Ok(id) => (*program_id, *until) = (Some(id), now + PLANNED),
                Err(why) => *refused = Some(why),
            }
        }
    }

    /// Why the run does not go on: what was planned from the results of probes is refused.
    pub(super) fn end_without_plan(&mut self, source: Source, why: &str) -> Exit {
        self.job.blamed_line = source.line;
        let place = self.job.place_of(source);
        let text = format!("{place}: what follows was not planned from what was measured: {why}");
        Exit::abort(error_code::PROBE_FAILED, text)
    }

    /// What follows does with the axes of the probe.
    fn after(&self, probing: &Probing) -> UnknownAxes {
        let path = &self.job.request.path;
        let element = probing.element.and_then(|index| path.elements.get(index));
        let axes = element.map_or(AxisSet::NONE, |element| element.axes);
        path.unknown_from(self.encoder.next_element(), axes)
    }
}
