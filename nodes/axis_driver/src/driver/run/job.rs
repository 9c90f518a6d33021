//! The part of a run that is still needed while it is being stopped.

use super::request::RunRequest;
use crate::driver::context::{Context, Origin};
use crate::report::ControllerState;
use crate::tracker::Tracker;
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
        match self.request.path.elements.get(self.tracker.element()) {
            Some(element) if self.line() > 0 => self.place_of(element.source),
            _ => "before the first line".into(),
        }
    }

    /// Whether the controller reads the program without moving.
    pub(in crate::driver) fn is_check(&self) -> bool {
        self.request.check_only
    }

    /// The source line that is being cut, 0 before the first.
    pub(in crate::driver) fn line(&self) -> u32 {
        let element = self.request.path.elements.get(self.tracker.element());
        let has_begun = self.has_sent && self.tracker.is_under_way();
        element.filter(|_| has_begun).map_or(0, |element| element.source.line)
    }

    /// Which time the line that is being cut is run; 0: the only one.
    pub(in crate::driver) fn occurrence(&self) -> u32 {
        let path = &self.request.path;
        let element = path.elements.get(self.tracker.element()).filter(|_| self.line() > 0);
        element.map_or(0, |element| path.occurrence(element.source))
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
            machine.line = self.line();
        }
    }
}
