//! Reads the events once and separates compensated spans from everything else.
//!
//! What is not compensated is written as it is. From the first move in the plane after a selection
//! to the first after its cancel, blocks are gathered into a [`Span`]; `compensate` makes its path.
//! `rules` has the rules of controls about where compensation may begin and end. This file keeps the
//! state and selects; `motions` and `actions` handle the blocks, `spans` opens and closes spans, and
//! `span_breaks` joins them.

mod actions;
mod compensate;
mod emitter;
mod kept_walls;
mod motions;
mod other_spans;
mod output;
pub(crate) mod parts;
pub(crate) mod plan;
mod rules;
mod span_breaks;
mod span_index;
mod span_writer;
mod spans;
mod tool_tip;

use crate::check::certificate::Certificate;
use crate::check::lead::PreviousWall;
use crate::geometry::frame::height;
use crate::span::{Item, ItemKind, Span};
use crate::walk::compensate::{Exit, SpanReport};
use crate::walk::plan::{Plan, Workers};
use actions::Lengths;
use cnc_msgs::calls::Calls;
use cnc_msgs::contour::{
    Approach, ContourEventKind, CutterSide, OutsideCorner, ProgrammedContour, RadiusSource, Source,
};
use cnc_msgs::finding::Finding;
use cnc_msgs::geometry::{Direction, Plane, Position};
use cnc_msgs::profile::{Profile, SideChange};
use cnc_msgs::tool_table::ToolTable;
use output::Output;
use rules::Rules;
use std::collections::BTreeSet;

/// A selection that waits for its first move in the plane.
#[derive(Debug, Clone, Copy)]
struct Selection {
    side: CutterSide,
    approach: Option<Approach>,
    along: Option<Direction>,
    source: Source,
}

/// A span that is being gathered.
#[derive(Debug)]
struct Active<'a> {
    span: Span<'a>,
    side: CutterSide,
    /// A side change or reselection that waits for its move, and how the contour before it ends.
    relink: Option<(Selection, Approach)>,
    /// A cancel that waits for its move.
    cancel: Option<(Approach, Source)>,
    /// Of the span before, if a link leads from it.
    previous_wall: Option<PreviousWall>,
    between: rules::BlocksBetween,
    /// A new radius word waits for the next block in the plane (S43).
    radius_changes: Option<Source>,
    /// A new value is in force after this many more blocks (S47).
    value_waits: Option<(u32, Source)>,
    /// The next corner is an arc, to this direction if there is one (NCT G39).
    corner_arc: Option<(Option<Direction>, Source)>,
    /// The next leg is on the other side, from the intersection on (O02).
    other_side: Option<Selection>,
    /// The contour on the other side, which ends where this one begins.
    before: Option<OneSide<'a>>,
}

/// A contour whose end waits for the first blocks on the other side of the tool.
#[derive(Debug)]
struct OneSide<'a> {
    active: Box<Active<'a>>,
    /// Where the other side was selected.
    selected: Source,
}

#[derive(Debug)]
enum WalkState<'a> {
    Off,
    Selected(Selection),
    Active(Box<Active<'a>>),
}

pub(crate) struct Walk<'a> {
    /// Of the contour.
    calls: Calls,
    profile: &'a Profile,
    tools: &'a ToolTable,
    out: Output<'a>,
    report: SpanReport,
    plane: Plane,
    corner: OutsideCorner,
    radius: Option<RadiusSource>,
    /// The value that the program has given the offset in force, mm.
    radius_value_mm: Option<f64>,
    spindle_tool: Option<u32>,
    lengths: Lengths,
    /// Offsets whose length is not applied; each has been reported.
    reported_lengths: BTreeSet<u32>,
    /// The block of the last refused change of tool.
    refused_tool: Option<Source>,
    /// The block of the last lead-off.
    led_off_in: Option<Source>,
    /// The programmed position; the tool may be elsewhere.
    programmed: Position,
    state: WalkState<'a>,
}

impl<'a> Walk<'a> {
    pub(crate) fn new(
        contour: &ProgrammedContour,
        profile: &'a Profile,
        tools: &'a ToolTable,
        workers: &'a dyn Workers,
        goes_on: Option<&'a (dyn Fn() -> bool + Sync)>,
    ) -> Self {
        Self {
            calls: contour.calls.clone(),
            profile,
            tools,
            out: Output::new(contour, profile, workers, goes_on),
            report: SpanReport::default(),
            plane: Plane::default(),
            corner: profile.corner.default,
            radius: None,
            radius_value_mm: None,
            spindle_tool: None,
            lengths: Lengths::default(),
            reported_lengths: BTreeSet::new(),
            refused_tool: None,
            led_off_in: None,
            programmed: contour.start,
            state: WalkState::Off,
        }
    }

    pub(crate) fn event(&mut self, kind: &'a ContourEventKind, source: Source) {
        self.out.put_out_much(&mut self.report);
        match *kind {
            ContourEventKind::Motion(ref motion) => self.motion(motion, source),
            ContourEventKind::Plane(plane) => self.select_plane(plane, source),
            // A T word that is refused as a tool change does not change the radius either.
            ContourEventKind::Radius(_) if self.refused_tool == Some(source) => {}
            ContourEventKind::Radius(word) => {
                self.radius = Some(word);
                self.radius_value_mm = None;
                if let WalkState::Active(active) = &mut self.state {
                    active.radius_changes = Some(source);
                }
            }
            ContourEventKind::Select { side, approach, along } => {
                self.select(Selection { side, approach, along, source });
            }
            ContourEventKind::Cancel { exit } => self.cancel(exit, source),
            ContourEventKind::Corner(corner) => {
                self.corner = corner;
                self.block_between(source);
            }
            ContourEventKind::Calculation => {
                if let WalkState::Active(active) = &mut self.state {
                    active.between.calculation(source);
                }
            }
            ContourEventKind::RadiusValue { radius_mm } => self.radius_value(radius_mm, source),
            ContourEventKind::HoldDirection { .. } => {
                self.report.findings.push(rules::no_held_direction(source));
            }
            ContourEventKind::CornerArc { along } => {
                if let WalkState::Active(active) = &mut self.state {
                    active.corner_arc = Some((along, source));
                }
            }
            ContourEventKind::Action(action) => self.action(action, source),
        }
    }

    /// The programmed position after the events so far.
    pub(crate) fn programmed(&self) -> Position {
        self.programmed
    }

    /// Counts a block without motion under compensation.
    fn block_between(&mut self, source: Source) {
        if let WalkState::Active(active) = &mut self.state {
            active.between.block(source);
        }
    }

    /// Ends the program: its path and what was found.
    pub(crate) fn finish(mut self) -> Plan {
        self.end();
        self.take_plan()
    }

    /// What the events since the last plan have come to.
    fn take_plan(&mut self) -> Plan {
        let (path, spans) = self.out.take_path(&mut self.report);
        let SpanReport { mut findings, mut uncut } = std::mem::take(&mut self.report);
        findings.sort_by_key(|finding| finding.source.line);
        let is_refused = findings.iter().any(Finding::is_error);
        self.calls.explain(&mut findings);
        for region in &mut uncut {
            region.calls = self.calls.chain(region.first.call);
        }
        let mut plan = Plan { findings, spans, uncut, ..Plan::default() };
        if is_refused {
            plan.refused = path.elements;
        } else {
            plan.path = path;
            plan.path.calls = std::mem::take(&mut self.calls);
        }
        plan
    }

    /// The same where only certificates are wanted.
    pub(crate) fn finish_certificates(mut self) -> Vec<Certificate> {
        self.end();
        let mut certificates = self.out.finish_certificates(&mut self.report);
        certificates.iter_mut().for_each(|it| it.explain(&self.calls));
        certificates
    }

    /// Ends a span that the program does not end.
    fn end(&mut self) {
        match std::mem::replace(&mut self.state, WalkState::Off) {
            WalkState::Off => {}
            WalkState::Selected(selection) => self.never_active(selection.source),
            WalkState::Active(active) => {
                let source = match active.cancel {
                    Some((_, source)) => source,
                    None => active.span.entry.lead.source,
                };
                let is_above = active.is_above(self.programmed, self.profile);
                let has_cancel = active.cancel.is_some();
                let finding = rules::not_cancelled(source, has_cancel, is_above, self.profile);
                self.report.findings.push(finding);
                self.close(*active, Exit::None);
            }
        }
    }

    fn select_plane(&mut self, plane: Plane, source: Source) {
        if plane != self.plane && !matches!(self.state, WalkState::Off) {
            self.report.findings.push(rules::plane_change(source));
            return;
        }
        self.plane = plane;
    }

    fn select(&mut self, selection: Selection) {
        if !self.profile.language.planes.rule.contains(&self.plane) {
            let finding = rules::wrong_plane(selection.source, self.plane, self.profile);
            let is_refused = finding.is_error();
            self.report.findings.push(finding);
            if is_refused {
                return;
            }
        }
        self.report.findings.extend(rules::dominant_axes(
            selection.source,
            self.plane,
            self.profile,
        ));
        let WalkState::Active(active) = &mut self.state else {
            self.state = WalkState::Selected(selection);
            return;
        };
        let is_repeat = active.side == selection.side && active.cancel.is_none();
        let forbids = rules::takes_no_selection(self.profile, is_repeat);
        if forbids {
            let finding = rules::reselected(selection.source, is_repeat, self.profile);
            let is_refused = finding.is_error();
            self.report.findings.push(finding);
            if is_refused {
                return;
            }
        }
        let is_at_intersection = !is_repeat
            && active.cancel.is_none()
            && selection.approach.is_none()
            && self.profile.side_change.rule == SideChange::Intersection;
        if is_repeat {
            // Back to its own side, with no move between.
            active.other_side = None;
        }
        if is_at_intersection {
            active.other_side = Some(selection);
        } else if !is_repeat || selection.approach.is_some() {
            // S36 to S39: both ends as the word says, straight if there is none.
            let exit = match active.cancel.take() {
                Some((exit, _)) => exit,
                None => selection.approach.unwrap_or(Approach::Normal),
            };
            let approach = Some(selection.approach.unwrap_or(Approach::Normal));
            active.relink = Some((Selection { approach, ..selection }, exit));
        }
    }

    fn cancel(&mut self, exit: Option<Approach>, source: Source) {
        match &mut self.state {
            WalkState::Off => {}
            WalkState::Selected(selection) => {
                let at = selection.source;
                self.state = WalkState::Off;
                self.never_active(at);
            }
            WalkState::Active(active) => {
                active.relink = None;
                active.cancel = Some((exit.unwrap_or(self.profile.cancel.default), source));
            }
        }
    }

    /// Changes the value; while compensation is active, after some more blocks (S47).
    fn radius_value(&mut self, radius_mm: f64, source: Source) {
        self.radius_value_mm = Some(radius_mm);
        if let WalkState::Active(active) = &mut self.state {
            active.between.block(source);
            active.value_waits = Some((self.profile.radius.value_latency_blocks, source));
        }
    }

    fn never_active(&mut self, source: Source) {
        self.report.findings.push(rules::never_active(source, self.profile));
    }

    fn rules(&mut self) -> Rules<'_> {
        Rules { profile: self.profile, findings: &mut self.report.findings }
    }
}

impl Active<'_> {
    fn push_item(&mut self, source: Source, what: ItemKind) {
        self.span.items.push(Item { before: self.span.legs.len(), source, what });
    }

    /// Whether a position is above the whole contour and the material.
    fn is_above(&self, position: Position, profile: &Profile) -> bool {
        let heights = self.span.leg_heights();
        let top = heights.iter().fold(profile.interference.stock_top_mm, |top, it| top.max(it.1));
        height(self.span.plane, position) > top
    }
}
