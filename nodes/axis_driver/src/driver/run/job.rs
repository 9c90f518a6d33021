//! The part of a run that is still needed while it is being stopped.

use super::request::RunRequest;
use crate::driver::context::{Context, Origin};
use crate::report::ControllerState;
use crate::tracker::Tracker;
use crate::turns::Turns;
use cnc_msgs::contour::{CutterSide, Source};

/// Owns what was asked for and where the tool is on the path. A run hands it to the stop.
#[derive(Debug)]
pub(in crate::driver) struct Job {
    /// The command that began it.
    pub(in crate::driver) id: u64,
    pub(in crate::driver) request: RunRequest,
    /// The program that its path is of: with the results of probes it has another id.
    pub(in crate::driver) path_of: String,
    pub(in crate::driver) tracker: Tracker,
    /// Follows the lines between elements that turn A to W alone.
    pub(in crate::driver) turns: Turns,
    pub(in crate::driver) first_element: usize,
    pub(in crate::driver) has_sent: bool,
    /// The line of the block that the controller refused or stopped at.
    pub(in crate::driver) blamed_line: u32,
    /// A single block that runs while another run waits for its tool.
    pub(in crate::driver) is_in_tool_change: bool,
}

impl Job {
    /// `line 12 (N70), in o<pocket>, called from line 40`
    pub(in crate::driver) fn place_of(&self, source: Source) -> String {
        let calls = self.request.path.calls.after(source);
        match source.block {
            Some(block) => format!("line {} (N{block}){calls}", source.line),
            None => format!("line {}{calls}", source.line),
        }
    }

    /// The same without its N number.
    pub(in crate::driver) fn line_of(&self, source: Source) -> String {
        self.place_of(Source { block: None, ..source })
    }

    /// The block that is being cut.
    pub(in crate::driver) fn place(&self) -> String {
        match self.source() {
            Some(source) if self.line() > 0 => self.place_of(source),
            _ => "before the first line".into(),
        }
    }

    /// Whether the controller reads the program without moving.
    pub(in crate::driver) fn is_check(&self) -> bool {
        self.request.check_only
    }

    /// The block that is being cut; `None` before the first.
    fn source(&self) -> Option<Source> {
        let path = &self.request.path;
        let element = path.elements.get(self.tracker.element());
        let cut = element.filter(|_| self.tracker.is_under_way()).map(|element| element.source);
        self.turns.source(path).or(cut).filter(|_| self.has_sent)
    }

    /// The source line that is being cut, 0 before the first.
    pub(in crate::driver) fn line(&self) -> u32 {
        self.source().map_or(0, |source| source.line)
    }

    /// Which time the line that is being cut is run; 0: the only one.
    pub(in crate::driver) fn occurrence(&self) -> u32 {
        let source = self.source().filter(|source| source.line > 0);
        source.map_or(0, |source| self.request.path.occurrence(source))
    }

    /// A line of the program was answered.
    pub(in crate::driver) fn on_answer(&mut self, element: Option<usize>, events: usize) {
        if let Some(element) = element {
            self.tracker.on_answer(element);
        }
        self.turns.on_answer(events);
    }

    /// All that was answered has been cut.
    pub(in crate::driver) fn on_all_done(&mut self) {
        self.tracker.on_all_done();
        if let Some(gap) = self.gap() {
            self.turns.on_all_done(&self.request.path, gap);
        }
    }

    /// The element before which the tool stands; `None` where one is being cut.
    fn gap(&self) -> Option<usize> {
        let element = self.tracker.element();
        match () {
            () if element == self.first_element && self.tracker.part() <= 0.0 => Some(element),
            () => Some(element + 1).filter(|next| self.tracker.has_reached(*next)),
        }
    }

    /// The side that the tool runs on in the element that is being cut: from the
    /// beginning of the lead-on, and no longer at the end of the lead-off (A18, A19).
    pub(in crate::driver) fn compensation(&self) -> Option<CutterSide> {
        let elements = &self.request.path.elements;
        let side = |index: usize| elements.get(index).and_then(|element| element.side);
        let element = self.tracker.element();
        let is_over = self.tracker.is_at_end() && side(element + 1).is_none();
        side(element).filter(|_| self.has_sent && !is_over)
    }

    /// Follows the tool along the path with a status report.
    pub(in crate::driver) fn track(&mut self, context: &mut Context) {
        let machine = &mut context.machine;
        let oldest = match context.link.oldest() {
            Some(Origin::Program { element, .. }) => *element,
            _ => None,
        };
        if self.is_check() {
            machine.line = self.line();
            return;
        }
        // The way to the first element is not one of its elements.
        if self.has_sent && (oldest.is_some() || self.tracker.has_begun()) {
            let position = machine.work_position();
            // In idle it is the last one of whatever ran before.
            let status = machine.status.as_ref();
            let reported = status.filter(|status| status.state != ControllerState::Idle);
            let reported = reported.and_then(|status| status.line);
            let reported = reported.filter(|_| context.config.encoder.line_numbers);
            if let Some(position) = position {
                self.tracker.begin_at(&self.request.path, position);
            }
            if let Some(number) = reported {
                self.tracker.on_line_number(number, oldest);
            }
            let blocks = machine.blocks_in_use();
            self.tracker.on_position(&self.request.path, position, blocks, oldest);
            context.machine.line = self.line();
        }
        let oldest = match context.link.oldest() {
            Some(Origin::Program { events, .. }) => Some(*events),
            _ => None,
        };
        if self.has_sent {
            let (gap, places) = (self.gap(), context.machine.further_work());
            self.turns.on_places(&self.request.path, gap, places, oldest);
            if self.turns.under_way().is_some() {
                context.machine.line = self.line();
            }
        }
    }
}
