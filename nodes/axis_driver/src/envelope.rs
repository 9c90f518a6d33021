//! Whether a program stays within the machine, before a byte of it is sent.
//!
//! A path is judged block by block against what the controller says about its machine: the travel
//! ([`travel`]), keep-out boxes ([`keep_out`]), and the settings that change what a program asks
//! for ([`functions`]). `distance` measures between a tool and a box. What cannot be judged is
//! named, with the reason. Knows no files, and no machine that moves.

mod distance;
mod functions;
mod keep_out;
mod travel;

use crate::machine_limits::{MachineLimits, StoredOffsets};
use crate::machine_path::{Known, MachinePath, Step};
use cnc_msgs::calls::Calls;
use cnc_msgs::finding::Finding;
use cnc_msgs::geometry::Position;
use cnc_msgs::keep_out::KeepOut;
use cnc_msgs::path::CompensatedPath;
use functions::FunctionCheck;
use keep_out::KeepOutCheck;
use std::collections::BTreeMap;
use travel::TravelCheck;

/// Judges a path, in slices as long as the caller likes.
#[derive(Debug, Clone)]
pub struct Envelope {
    walk: MachinePath,
    travel: TravelCheck,
    keep_out: KeepOutCheck,
    functions: FunctionCheck,
    /// Elements before this one are not run.
    first_element: usize,
    /// Of the path.
    calls: Calls,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EnvelopeReport {
    /// An error refuses the program.
    pub findings: Vec<Finding>,
    /// What was not judged, and why.
    pub not_judged: Vec<String>,
}

/// Against what a path is judged besides the machine.
#[derive(Debug, Clone, Copy)]
pub struct Workplace<'a> {
    pub keep_out: &'a KeepOut,
    /// By T number, mm.
    pub tool_diameters_mm: &'a BTreeMap<u32, f64>,
    /// Where the axes are before the first element, machine frame; `None`: not known.
    pub start_in_machine: Option<Position>,
}

impl Envelope {
    /// Begins with a path. A run that starts in the middle begins with `first_element`.
    pub fn new(
        limits: &MachineLimits,
        path: &CompensatedPath,
        first_element: usize,
        workplace: Workplace<'_>,
    ) -> Self {
        let start: Known = match workplace.start_in_machine {
            Some(start) => start.map(Some),
            None => [None; 3],
        };
        // What runs first begins where the tool is, whatever the path says before it.
        let walk_start = if first_element == 0 { start } else { [None; 3] };
        Self {
            walk: MachinePath::new(path, &limits.offsets, walk_start),
            travel: TravelCheck::new(limits, start),
            keep_out: KeepOutCheck::new(limits, workplace),
            functions: FunctionCheck::new(limits, workplace),
            first_element,
            calls: path.calls.clone(),
        }
    }

    /// Goes on from its first element with these stored positions: those that the controller has
    /// there, after all that the path has set before. `here` is where the axes are, machine frame;
    /// `None`: where the path has taken them.
    pub fn go_on_with(
        &mut self,
        path: &CompensatedPath,
        offsets: &StoredOffsets,
        here: Option<Position>,
    ) {
        self.advance_to(path, self.first_element);
        self.walk.take_offsets(path, offsets);
        if let Some(here) = here {
            self.walk.assume(here);
        }
    }

    /// Judges all that happens before this element; the number of elements means all of it.
    pub fn advance_to(&mut self, path: &CompensatedPath, element: usize) {
        while self.walk.next_element() < element {
            let Some(step) = self.walk.next(path) else { return };
            self.take(step);
        }
        if element >= path.elements.len() {
            while let Some(step) = self.walk.next(path) {
                self.take(step);
            }
        }
    }

    fn take(&mut self, step: Step) {
        // Of what comes before the first element, only the words that stay in force count.
        let is_run = self.walk.next_element() > self.first_element
            || (self.first_element == 0 && self.walk.next_element() == 0);
        match step {
            Step::Move(it) if is_run => {
                self.travel.see(&it);
                self.keep_out.see(&it);
                self.functions.see_move(&it);
            }
            Step::Move(_) => {}
            Step::Further(it) if self.walk.next_element() >= self.first_element => {
                self.travel.see_further(&it);
                self.functions.see_further(&it);
            }
            Step::Further(_) => {}
            Step::Function(action, source) => self.functions.see(action, source, is_run),
        }
    }

    /// What was found in all that was judged.
    pub fn report(&self) -> EnvelopeReport {
        let mut report = EnvelopeReport::default();
        self.travel.report(&mut report);
        self.keep_out.report(&mut report);
        self.functions.report(&mut report);
        self.calls.explain(&mut report.findings);
        report.findings.sort_by_key(|finding| (!finding.is_error(), finding.source.line));
        report
    }
}

/// `line 12 (N70)`
fn place(source: cnc_msgs::contour::Source) -> String {
    match source.block {
        Some(block) => format!("line {} (N{block})", source.line),
        None => format!("line {}", source.line),
    }
}

#[cfg(test)]
mod tests;
