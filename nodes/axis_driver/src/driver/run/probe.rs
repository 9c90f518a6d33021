//! A probe in a program: the machine stands, one line moves it until the probe touches, and the
//! run goes on from there.
//!
//! Nothing is streamed meanwhile: where the lines that follow begin is known only then.

use super::exit::Exit;
use super::workplace::WorkplaceCheck;
use super::{ProgramRun, Stage, Then};
use crate::codes::error_code;
use crate::driver::context::place::show;
use crate::driver::context::{Context, Origin};
use crate::driver::output::LogLevel;
use crate::encoder::EncodedLine;
use cnc_msgs::contour::{Action, Probe};
use cnc_msgs::geometry::Position;
use cnc_msgs::path::PathEvent;

/// A probe that is under way.
#[derive(Debug, Clone)]
pub(super) struct Probing {
    probe: Probe,
    source_line: u32,
    element: Option<usize>,
    /// Where it has touched, machine frame, and whether it has.
    touch: Option<(Position, bool)>,
}

impl Probing {
    pub(super) fn reason(&self) -> String {
        format!("PROBE: {} in line {}", self.probe.word(), self.source_line)
    }
}

impl ProgramRun {
    pub(in crate::driver) fn is_probing(&self) -> bool {
        matches!(self.stage, Stage::Probing(_))
    }

    /// All motion has ended: sends the line of the probe.
    pub(super) fn begin_probe(&mut self, context: &mut Context, line: EncodedLine, probe: Probe) {
        let EncodedLine { text, kind, element, source_line, events, .. } = line;
        self.stage = Stage::Probing(Probing { probe, source_line, element, touch: None });
        self.job.has_sent = true;
        self.is_alone = true;
        let sent = text.clone();
        let origin = Origin::Program { text, source_line, element, events };
        context.link.send_line(&sent, kind, origin);
    }

    /// Takes what the controller reports about a probe.
    pub(in crate::driver) fn on_probe(&mut self, position: Position, has_touched: bool) {
        if let Stage::Probing(probing) = &mut self.stage {
            probing.touch = Some((position, has_touched));
        }
    }

    /// The line of the probe was answered.
    pub(super) fn end_probe(&mut self, context: &mut Context) -> Option<Exit> {
        let Stage::Probing(probing) = &self.stage else { return None };
        let Probing { probe, source_line, element, touch } = probing.clone();
        let place = self.job.place_of_line(source_line, element);
        let ends = if probe.away { "let go" } else { "touched" };
        let text = match touch {
            Some((at, true)) => {
                let work = context.machine.in_work_frame(at).map(show);
                let work = work.map_or(String::new(), |at| format!(", {at} in the work frame"));
                format!("{place}: the probe {ends} at {} in the machine frame{work}", show(at))
            }
            Some(_) if probe.may_miss => format!("{place}: the probe {ends} nowhere on the way"),
            touch => {
                let text = match touch {
                    Some(_) => format!("{place}: the probe {ends} nowhere on the way"),
                    None => format!("{place}: the controller did not say where the probe {ends}"),
                };
                self.job.blamed_line = source_line;
                return Some(Exit::abort(error_code::PROBE_FAILED, text));
            }
        };
        context.log(LogLevel::Info, text);
        self.stage = Stage::Settling { then: Then::Probed, from: context.now };
        context.link.ask_status(context.now);
        None
    }

    /// The machine stands where the probe has ended. Where a work offset is set by that position,
    /// the travel of what follows could not be judged before.
    pub(super) fn judge_from_probe(&mut self, context: &mut Context) {
        let events = &self.job.request.path.events[self.encoder.events_begun()..];
        let until_next = events.iter().take_while(|it| !matches!(it.action, Action::Probe(_)));
        let sets_offset = |event: &PathEvent| {
            matches!(event.action, Action::SetWorkOffset { by_position: true, .. })
        };
        if until_next.into_iter().any(sets_offset) {
            let first = self.encoder.next_element();
            let check = WorkplaceCheck::begin_from_here(context, &self.job.request, first);
            self.judged_again = check.map(Box::new);
        }
        self.stage = match self.is_judging() {
            true => Stage::Probed,
            false => Stage::Streaming,
        };
    }
}
