//! Reads the events once and separates compensated spans from everything else.
//!
//! What is not compensated is written as it is. From the first move in the plane after a selection
//! to the first after its cancel, blocks are gathered into a [`Span`]; `compensate` makes its path.
//! `rules` has the rules of controls about where compensation may begin and end.

mod compensate;
mod emitter;
mod other_spans;
mod output;
pub(crate) mod plan;
mod rules;
mod span_breaks;
mod span_writer;
mod spans;
mod tool_tip;

use crate::check::lead::PreviousWall;
use crate::geometry::frame::{element, height};
use crate::geometry::tolerance::LENGTH_MM;
use crate::span::{Item, ItemKind, Span};
use crate::walk::compensate::{Exit, SpanReport};
use crate::walk::plan::{Plan, Planning};
use cnc_msgs::contour::{
    Action, Approach, ContourEventKind, CutterSide, Motion, MotionClass, OutsideCorner,
    ProgrammedContour, RadiusSource, Source,
};
use cnc_msgs::finding::Finding;
use cnc_msgs::geometry::{Direction, Plane, Position, Shape};
use cnc_msgs::path::Role;
use cnc_msgs::profile::{LeadMove, LengthOfD, OffPlaneAfterCancel, Profile, SideChange};
use cnc_msgs::radius;
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

/// Tool lengths where D selects them: `None` without one (S34).
#[derive(Debug, Default)]
struct Lengths {
    /// The length of the last D.
    selected: Option<(u32, f64)>,
    /// The length at the last move of Z.
    in_force: Option<(u32, f64)>,
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
        contour: &'a ProgrammedContour,
        profile: &'a Profile,
        tools: &'a ToolTable,
        planning: Planning<'a>,
    ) -> Self {
        let certificates = planning.certifies.then(Vec::new);
        Self {
            profile,
            tools,
            out: Output::new(contour, profile, planning),
            report: SpanReport { certificates, ..SpanReport::default() },
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
                if let WalkState::Active(active) = &mut self.state {
                    active.between.block(source);
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

    /// Ends the program.
    pub(crate) fn finish(mut self) -> Plan {
        match std::mem::replace(&mut self.state, WalkState::Off) {
            WalkState::Off => {}
            WalkState::Selected(selection) => self.never_active(selection.source),
            WalkState::Active(active) => {
                let source = match active.cancel {
                    Some((_, source)) => source,
                    None => active.span.entry.lead.source,
                };
                self.report.findings.push(rules::not_cancelled(
                    source,
                    active.cancel.is_some(),
                    self.profile,
                ));
                self.close(*active, Exit::None);
            }
        }
        let (path, spans) = self.out.finish(&mut self.report);
        self.report.findings.sort_by_key(|finding| finding.source.line);
        let is_refused = self.report.findings.iter().any(Finding::is_error);
        let mut plan = Plan {
            findings: self.report.findings,
            spans,
            certificates: self.report.certificates.unwrap_or_default(),
            uncut: self.report.uncut,
            ..Plan::default()
        };
        if is_refused {
            plan.refused = path.elements;
        } else {
            plan.path = path;
        }
        plan
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

    fn action(&mut self, action: Action, source: Source) {
        if let Action::ToolLength { offset, .. } = action
            && self.profile.radius.length_of_d == LengthOfD::WithZ
        {
            self.lengths.selected = offset.map(|number| (number, self.length_of(number)));
            return;
        }
        let action = self.with_length(action, source);
        match action {
            Action::ChangeTool { tool } => self.spindle_tool = Some(tool),
            // It applies to the elements of this block, generated ones included (S55).
            Action::ExactStop => return self.out.stop_exactly_in(source),
            Action::Home { .. } => self.home(source),
            Action::ProgramEnd { .. } => self.end_of_program(source),
            _ => {}
        }
        let rules = Rules { profile: self.profile, findings: &mut self.report.findings };
        match &mut self.state {
            WalkState::Off => self.out.action(action, source),
            WalkState::Selected(selection) => {
                let _ = rules.action(&action, source, selection.source);
                self.out.action(action, source);
            }
            WalkState::Active(active) => {
                let since = active.span.entry.lead.source;
                let is_refused = rules.action(&action, source, since);
                if is_refused && matches!(action, Action::ChangeTool { .. }) {
                    self.refused_tool = Some(source);
                }
                active.between.block(source);
                active.push_item(source, ItemKind::Action(action));
            }
        }
    }

    /// Homing ends compensation at once, without a lead-off (A05).
    fn home(&mut self, source: Source) {
        match std::mem::replace(&mut self.state, WalkState::Off) {
            WalkState::Off => {}
            WalkState::Selected(selection) => {
                let finding = rules::homed(source, selection.source, false, self.profile);
                self.report.findings.push(finding);
            }
            WalkState::Active(active) => {
                let since = active.span.entry.lead.source;
                self.report.findings.push(rules::homed(source, since, true, self.profile));
                self.close(*active, Exit::None);
            }
        }
    }

    /// Compensation is cancelled, with its move, in a block before the end of the program (S32).
    fn end_of_program(&mut self, source: Source) {
        if self.led_off_in == Some(source) && matches!(self.state, WalkState::Off) {
            self.report.findings.extend(rules::cancelled_with_the_end(source, self.profile));
        }
    }

    /// The length of the register D, or of the tool of that number where there is no register.
    fn length_of(&self, number: u32) -> f64 {
        let register = self.tools.offsets.get(&number).map(|offset| offset.length_mm);
        let tool = || self.tools.tools.get(&number).map(|tool| tool.length_mm);
        register.or_else(tool).unwrap_or(0.0)
    }

    /// Applies the length of the last D at the next move of Z (S34); returns whether it does so
    /// now.
    ///
    /// In another plane the control shifts another axis, which no controller can do. That is
    /// reported once for each number.
    fn apply_length_of_d(&mut self, motion: &Motion, source: Source) -> bool {
        let Lengths { selected, in_force } = self.lengths;
        let length_mm = |it: Option<(u32, f64)>| it.map_or(0.0, |(_, length_mm)| length_mm);
        let [.., normal] = self.plane.axes();
        if length_mm(selected) == length_mm(in_force) || !motion.axes.contains(normal) {
            return false;
        }
        if normal != 2 {
            if let Some((number, length_mm)) = selected
                && self.reported_lengths.insert(number)
            {
                let finding = rules::length_of_d(source, number, length_mm, normal);
                self.report.findings.push(finding);
            }
            return false;
        }
        self.lengths.in_force = selected;
        let offset = selected.map(|(number, _)| number);
        let action = Action::ToolLength { offset, length_mm: length_mm(selected) };
        match &mut self.state {
            WalkState::Active(active) => active.push_item(source, ItemKind::Action(action)),
            WalkState::Off | WalkState::Selected(_) => self.out.action(action, source),
        }
        true
    }

    fn with_length(&mut self, action: Action, source: Source) -> Action {
        let Action::ToolLength { offset: Some(number), .. } = action else { return action };
        let length_mm = match self.tools.tools.get(&number) {
            Some(tool) => tool.length_mm,
            None => {
                let mut finding = radius::unknown(format!("H{number}"), self.tools, source);
                if self.tools.tools.is_empty() {
                    finding.severity = cnc_msgs::finding::Severity::Warning;
                    finding.message += "; a length of 0 is taken";
                }
                self.report.findings.push(finding);
                0.0
            }
        };
        Action::ToolLength { offset: Some(number), length_mm }
    }

    fn motion(&mut self, motion: &'a Motion, source: Source) {
        if !rules::is_sane(motion) {
            self.report.findings.push(rules::not_sane(source, motion));
            return;
        }
        let shifts_z = self.apply_length_of_d(motion, source);
        let start = self.programmed;
        self.programmed = motion.end;
        match std::mem::replace(&mut self.state, WalkState::Off) {
            WalkState::Off => self.out.programmed(motion, source, Role::None),
            WalkState::Selected(selection) => {
                let leads = is_lead(motion, self.profile.select.lead);
                if leads && self.moves_in_plane(start, motion) {
                    self.open(selection, start, motion, source, None, false);
                } else {
                    let plane = self.plane;
                    if height(plane, motion.end) != height(plane, start) {
                        self.rules().off_plane_move(source, plane);
                    }
                    self.out.programmed(motion, source, Role::None);
                    self.state = WalkState::Selected(selection);
                }
            }
            WalkState::Active(active) => {
                let rises = shifts_z || height(self.plane, motion.end) != height(self.plane, start);
                self.active_motion(active, start, motion, source, rises);
            }
        }
    }

    fn active_motion(
        &mut self,
        mut active: Box<Active<'a>>,
        start: Position,
        motion: &'a Motion,
        source: Source,
        rises: bool,
    ) {
        let plane = active.span.plane;
        let leads = match (&active.cancel, &active.relink) {
            (Some(_), _) => is_lead(motion, self.profile.cancel.lead),
            (None, Some(_)) => is_lead(motion, self.profile.select.lead),
            (None, None) => false,
        };
        let is_only_up = rises && !self.shifts(start, motion);
        if leads && self.moves_in_plane(start, motion) && !is_only_up {
            self.off_plane_blocks(&mut active, source);
            if let Some((exit, _)) = active.cancel {
                let lead = self.lead(start, motion, source, exit);
                active.span.exit_corner = self.corner;
                self.rules().lead_off(&lead, plane, active.span.d_out_mm.abs());
                self.led_off_in = Some(source);
                self.close(*active, Exit::LeadOff(lead));
            } else if let Some((selection, exit)) = active.relink {
                let lead = self.lead(start, motion, source, exit);
                active.span.exit_corner = self.corner;
                let wall = self.close(*active, Exit::Link(lead));
                self.open(selection, start, motion, source, Some(wall), false);
            }
            return;
        }
        self.rules().wrong_arc_plane(source, motion, plane);
        match element(plane, start, motion).filter(|element| element.length() > 0.0) {
            Some(element) => {
                if rises {
                    self.rules().off_plane_move(source, plane);
                }
                self.rules().leg(source, motion, &element);
                let excess = self.off_plane_blocks(&mut active, source);
                active = match self.before_leg(active, excess, start, motion, source, &element) {
                    Some(active) => active,
                    None => return,
                };
                self.leg(&mut active, start, &element, motion, source);
            }
            None => {
                active.between.block(source);
                if rises {
                    if active.cancel.is_some()
                        && self.profile.cancel.before_off_plane.rule
                            == OffPlaneAfterCancel::LeadOffFirst
                    {
                        self.report.findings.push(rules::no_lead_off(source, self.profile));
                    } else {
                        self.rules().off_plane_move(source, plane);
                    }
                    active.push_item(source, ItemKind::OffPlane(*motion));
                }
            }
        }
        self.state = WalkState::Active(active);
    }

    fn rules(&mut self) -> Rules<'_> {
        Rules { profile: self.profile, findings: &mut self.report.findings }
    }

    /// Whether a motion counts as one in the plane: it moves there, or names one of its axes (S21).
    fn moves_in_plane(&self, start: Position, motion: &Motion) -> bool {
        let [u, v, _] = self.plane.axes();
        self.shifts(start, motion) || motion.axes.contains(u) || motion.axes.contains(v)
    }

    /// Whether a motion changes the position in the plane.
    fn shifts(&self, start: Position, motion: &Motion) -> bool {
        let [u, v, _] = self.plane.axes();
        let far = (motion.end[u] - start[u]).abs().max((motion.end[v] - start[v]).abs());
        far > LENGTH_MM * 1e-3
            || matches!(motion.shape, Shape::Arc(arc) if arc.turns > 0 && arc.plane == self.plane)
    }
}

/// Whether a motion in the plane can be a lead.
fn is_lead(motion: &Motion, rule: LeadMove) -> bool {
    rule == LeadMove::Any || motion.class == MotionClass::Feed
}

impl Active<'_> {
    fn push_item(&mut self, source: Source, what: ItemKind) {
        self.span.items.push(Item { before: self.span.legs.len(), source, what });
    }
}
