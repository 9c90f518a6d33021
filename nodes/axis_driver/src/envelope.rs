//! Whether a program stays within the machine, before a byte of it is sent.
//!
//! A path is judged block by block against what the controller says about its machine: the travel
//! ([`travel`]), keep-out boxes ([`keep_out`]), and the settings that change what a program asks
//! for ([`functions`]). `touch` compares a move with a box, `distance` measures. What cannot be judged is
//! named, with the reason. Knows no files, and no machine that moves.

mod distance;
mod functions;
mod keep_out;
mod touch;
mod travel;

use crate::encoder::Encoder;
use crate::machine_limits::{MachineLimits, StoredOffsets};
use crate::machine_path::{Known, MachineMove, MachinePath, Step};
use cnc_msgs::calls::Calls;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::further::FurtherAxes;
use cnc_msgs::geometry::{AxisSet, Position};
use cnc_msgs::keep_out::KeepOut;
use cnc_msgs::path::{CompensatedPath, PathEvent};
use functions::FunctionCheck;
use keep_out::KeepOutCheck;
use std::collections::{BTreeMap, BTreeSet};
use travel::TravelCheck;

/// Judges a path, in slices as long as the caller likes.
#[derive(Debug, Clone)]
pub struct Envelope {
    walk: MachinePath,
    travel: TravelCheck,
    keep_out: KeepOutCheck,
    /// Boxes of work systems whose place in the machine is not known.
    floating: Vec<Floating>,
    functions: FunctionCheck,
    /// What counts once the path has homed a machine that was not.
    after_homing: Option<Box<(TravelCheck, KeepOutCheck)>>,
    /// Whether the machine has moved since the beginning, or since it was homed.
    has_moved: bool,
    /// Of what comes before the homing.
    before_homing: EnvelopeReport,
    beginning: Beginning,
    /// Where the axes are before that.
    start: Known,
    /// Of the path.
    calls: Calls,
}

/// Boxes of one work system, and the path in its frame.
#[derive(Debug, Clone)]
struct Floating {
    /// 1 to 9.
    system: u8,
    walk: MachinePath,
    keep_out: KeepOutCheck,
}

/// Where a run begins in its path.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Beginning {
    /// The first element that is run.
    pub element: usize,
    /// The first event that is: of those before only the words stay in force.
    pub event: usize,
    /// How the tool gets there, where it does not stand there.
    pub approach: Option<Approach>,
}

/// A way from above to where a run begins in the middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Approach {
    /// Machine frame.
    pub height_mm: f64,
    /// The axes that move there.
    pub axes: AxisSet,
    /// Where A to W go at that height, work frame.
    pub further: FurtherAxes,
}

impl Beginning {
    /// With this element, and none of the events before it.
    pub fn with_element(path: &CompensatedPath, element: usize) -> Self {
        let before = |event: &PathEvent| element > 0 && event.at_element <= element;
        let event = path.events.partition_point(before);
        Self { element, event, approach: None }
    }

    /// Where this encoder stands.
    pub(crate) fn of_rest(encoder: &Encoder) -> Self {
        let (element, event) = (encoder.next_element(), encoder.events_begun());
        Self { element, event, approach: None }
    }
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
    /// The T number of the tool in the spindle before the first change; 0: there is none; `None`: not known.
    pub spindle_tool: Option<u32>,
    /// What follows homing and probes is judged again when the machine stands there.
    pub is_judged_again: bool,
}

impl Envelope {
    /// Begins with a path.
    pub fn new(
        limits: &MachineLimits,
        path: &CompensatedPath,
        beginning: Beginning,
        workplace: Workplace<'_>,
    ) -> Self {
        let start: Known = match workplace.start_in_machine {
            Some(start) => start.map(Some),
            None => [None; 3],
        };
        // What runs first begins where the tool is, whatever the path says before it.
        let comes_first = beginning.element == 0 && beginning.approach.is_none();
        let walk_start = if comes_first { start } else { [None; 3] };
        let mut walk = MachinePath::new(path, &limits.offsets, walk_start);
        walk.begin_with_tool(workplace.spindle_tool);
        walk.homes_to(limits.home_mm);
        let (keep_out, systems) = KeepOutCheck::new(limits, workplace);
        let floating = systems.into_iter().map(|system| {
            let mut walk = MachinePath::floating(path, system);
            walk.begin_with_tool(workplace.spindle_tool);
            Floating { system, walk, keep_out: KeepOutCheck::floating(limits, workplace, system) }
        });
        Self {
            walk,
            travel: TravelCheck::new(limits, start),
            keep_out,
            floating: floating.collect(),
            functions: FunctionCheck::new(limits, workplace),
            after_homing: None,
            has_moved: false,
            before_homing: EnvelopeReport::default(),
            beginning,
            start,
            calls: path.calls.clone(),
        }
    }

    /// The machine is not homed yet: where the path homes all axes, these limits count from there on.
    #[must_use]
    pub fn homed_by_path(mut self, limits: &MachineLimits, workplace: Workplace<'_>) -> Self {
        self.walk.homes_to(limits.home_mm);
        let travel = TravelCheck::new(limits, [None; 3]);
        let (keep_out, _) = KeepOutCheck::new(limits, workplace);
        Self { after_homing: Some(Box::new((travel, keep_out))), ..self }
    }

    /// Goes on from its beginning with these stored positions: those that the controller has
    /// there, after all that the path has set before. `here` is where the axes are, machine frame;
    /// `None`: where the path has taken them.
    pub fn go_on_with(
        &mut self,
        path: &CompensatedPath,
        offsets: &StoredOffsets,
        here: Option<Position>,
    ) {
        let Beginning { element, event, .. } = self.beginning;
        self.advance_to(path, element);
        while self.walk.next_event() < event && self.walk.next_element() == element {
            if !self.step(path) {
                break;
            }
        }
        self.walk.take_offsets(path, offsets);
        if let Some(here) = here {
            self.walk.assume(here);
        }
        for it in &mut self.floating {
            it.walk.float_again(path, it.system);
        }
    }

    /// Judges all that happens before this element; the number of elements means all of it.
    pub fn advance_to(&mut self, path: &CompensatedPath, element: usize) {
        while self.walk.next_element() < element {
            if !self.step(path) {
                return;
            }
        }
        if element >= path.elements.len() {
            while self.step(path) {}
        }
    }

    /// Judges what comes next; false at the end of the path.
    fn step(&mut self, path: &CompensatedPath) -> bool {
        let Beginning { element: first_element, event: first_event, .. } = self.beginning;
        let (element, event) = (self.walk.next_element(), self.walk.next_event());
        if (element, event) == (first_element, first_event) {
            self.approach(path);
        }
        let next = self.walk.next(path);
        let is_run = match self.walk.next_element() > element {
            true => element >= first_element,
            false => event >= first_event,
        };
        // They take the same steps.
        for it in &mut self.floating {
            if let (Some(Step::Move(moved)), true) = (it.walk.next(path), is_run) {
                it.keep_out.see(&moved);
            }
        }
        let Some(step) = next else { return false };
        match step {
            Step::Move(it) if is_run => {
                self.see(&it);
                self.functions.see_move(&it);
            }
            Step::Move(_) => {}
            Step::Further(it) if element >= first_element => {
                self.has_moved = true;
                self.travel.see_further(&it);
                self.functions.see_further(&it);
            }
            Step::Further(_) => {}
            Step::Function(action, source) => {
                if is_run && action.homes_all() {
                    self.begin_homed();
                }
                self.functions.see(action, source, is_run);
            }
        }
        true
    }

    fn see(&mut self, it: &MachineMove) {
        self.has_moved = true;
        self.travel.see(it);
        self.keep_out.see(it);
    }

    /// Judges the way to where the run begins.
    fn approach(&mut self, path: &CompensatedPath) {
        let Some(approach) = self.beginning.approach.take() else { return };
        let Some(first) = path.elements.get(self.beginning.element) else { return };
        let Approach { height_mm, axes, further } = approach;
        // Judged apart: no line of the program is to blame for it.
        let (mut travel, mut keep_out) = (self.travel.clone(), self.keep_out.clone());
        travel.see_further(&self.walk.rapid_to(further, first.source));
        let way = self.walk.way_from_above(self.start, height_mm, axes, first.source);
        for it in way.iter().filter(|it| !it.axes.is_empty()) {
            self.has_moved = true;
            travel.see(it);
            keep_out.see(it);
        }
        let mut report = EnvelopeReport::default();
        travel.report(&mut report);
        keep_out.report(&mut report);
        report.findings.iter_mut().for_each(blame_approach);
        self.before_homing.findings.extend(report.findings);
        self.before_homing.not_judged.extend(report.not_judged);
        let [_, _, down] = way;
        if let [Some(x), Some(y), Some(z)] = down.to {
            self.walk.assume([x, y, z]);
        }
    }

    /// All axes are homed: what was is in another frame.
    fn begin_homed(&mut self) {
        let Some(homed) = self.after_homing.take() else { return };
        if std::mem::take(&mut self.has_moved) {
            self.travel.report(&mut self.before_homing);
            self.keep_out.report(&mut self.before_homing);
        }
        (self.travel, self.keep_out) = *homed;
    }

    /// What was not compared with boxes.
    pub fn not_compared(&self) -> Vec<String> {
        let mut report = EnvelopeReport::default();
        self.keep_out.report(&mut report);
        self.floating.iter().for_each(|it| it.keep_out.report(&mut report));
        report.not_judged
    }

    /// What was found in all that was judged.
    pub fn report(&self) -> EnvelopeReport {
        let mut report = self.before_homing.clone();
        self.travel.report(&mut report);
        self.keep_out.report(&mut report);
        self.floating.iter().for_each(|it| it.keep_out.report(&mut report));
        self.functions.report(&mut report);
        self.calls.explain(&mut report.findings);
        // The same of before and after the homing.
        let mut said = BTreeSet::new();
        report.not_judged.retain(|it| said.insert(it.clone()));
        report.findings.sort_by_key(|finding| (!finding.is_error(), finding.source.line));
        report
    }
}

/// Says that it is on the way to where the run begins, and what to do about that.
fn blame_approach(finding: &mut Finding) {
    finding.message = format!("on the approach to it, {}", finding.message);
    finding.help = match finding.code {
        Code::KeepOut => {
            "raise approach_z_mm, or jog the tool to a place from which the way is free"
        }
        _ => "give an approach_z_mm within the travel, or correct the work offset",
    }
    .into();
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
