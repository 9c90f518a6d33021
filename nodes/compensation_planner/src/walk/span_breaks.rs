//! Handles what may stand between two blocks of a contour other than a corner.
//!
//! A change of side, a rapid that leaves the offset, a new radius that begins perpendicular: each
//! ends the span that is being gathered and begins another. `walk` decides about all other starts
//! and ends of spans.

use super::{Active, OneSide, Selection, Walk, WalkState};
use crate::check::finding;
use crate::check::reach::is_any_unreachable;
use crate::geometry::element::{Element, Vec2};
use crate::geometry::intersect::{Meeting, meet_across};
use crate::geometry::tolerance::{FAR_CORNER_RADII, LENGTH_MM, MERGE_MM};
use crate::span::chain::{ChainBuilder, Role, join};
use crate::span::chain_links;
use crate::span::runs::{first_runs, last_runs};
use crate::span::{AtChange, Lead, OtherSide, Run, Span};
use crate::walk::compensate::Exit;
use crate::walk::rules;
use cnc_msgs::contour::{Approach, Motion, MotionClass, Source};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::profile::{ChangeAt, Profile, RapidMode, Strictness};

impl<'a> Walk<'a> {
    /// Handles a joint before a leg that is not a corner; `None` when the motion was no leg after
    /// all.
    pub(super) fn before_leg(
        &mut self,
        mut active: Box<Active<'a>>,
        is_excess: bool,
        start: Position,
        motion: &Motion,
        source: Source,
        element: &Element,
    ) -> Option<Box<Active<'a>>> {
        if motion.class != MotionClass::Feed {
            self.report.findings.extend(rules::rapid(source, self.profile));
            if self.profile.rapid.rule == RapidMode::Raw {
                self.leave_raw(*active, start, motion, source);
                return None;
            }
        }
        let other_side = active.other_side.take();
        if is_excess && self.profile.off_plane.strictness == Strictness::Emulate {
            active.side = other_side.map_or(active.side, |selection| selection.side);
            return Some(self.stand_perpendicular(active, start, motion, source));
        }
        if let Some(selection) = other_side {
            return Some(self.change_side(active, selection, start, motion, source));
        }
        if active.radius_changes.is_some()
            && self.profile.radius.change_at == ChangeAt::Perpendicular
            && element.is_line()
            && !active.span.legs.is_empty()
        {
            self.change_perpendicular(active, start, motion, source);
            return None;
        }
        Some(active)
    }

    /// Changes to the other side at the intersection of the offsets (O02).
    ///
    /// The intersection depends on what the first block is merged with. [`Self::settle`] computes
    /// it once the blocks on the other side are known.
    fn change_side(
        &mut self,
        mut active: Box<Active<'a>>,
        selection: Selection,
        start: Position,
        motion: &Motion,
        source: Source,
    ) -> Box<Active<'a>> {
        self.settle(&mut active);
        let here = Motion { shape: Shape::Line, end: start, ..*motion };
        let selected = selection.source;
        let selection = Selection { approach: Some(Approach::Normal), ..selection };
        self.open(selection, start, &here, source, Some(None), false);
        let mut other_side = self.opened();
        other_side.before = Some(OneSide { active, selected });
        other_side
    }

    /// Ends the contour on the side that the tool came from, if there is one.
    ///
    /// Parallel lines have no intersection, and short ones none on themselves: there the old
    /// contour ends and the new one begins perpendicular. If an arc takes part, that breaks a rule.
    pub(super) fn settle(&mut self, active: &mut Active<'a>) {
        let Some(OneSide { active: mut one_side, selected }) = active.before.take() else { return };
        let lead = active.span.entry.lead;
        let Some(change) = Change::of(&one_side.span, &active.span, self.profile) else {
            let is_line = |run: Option<Run>| run.is_none_or(|it| it.element.is_line());
            let before = last_runs(&one_side.span, MERGE_MM).pop();
            let next = first_runs(&active.span, MERGE_MM).into_iter().next();
            if !(is_line(next) && is_line(before)) {
                self.report.findings.push(rules::no_intersection(selected, self.profile));
            }
            active.previous_wall = self.close(*one_side, Exit::Link(lead));
            return;
        };
        let Change { before, next, meeting, at_change: [at_end, at_start] } = change;
        let radius_mm = next.d_mm.abs();
        let distance_mm = (meeting.point - next.element.start()).norm();
        if distance_mm > FAR_CORNER_RADII * radius_mm {
            let finding = finding::far_corner(lead.source, distance_mm, next.d_mm);
            self.report.findings.push(finding);
        }
        one_side.span.next = Some(next);
        one_side.span.at_change[1] = Some(at_end);
        active.span.at_change[0] = Some(at_start);
        active.previous_wall = self.close(*one_side, Exit::None);
        active.span.entry.from = Some(before);
    }

    /// The span that has just been opened.
    fn opened(&mut self) -> Box<Active<'a>> {
        match std::mem::replace(&mut self.state, WalkState::Off) {
            WalkState::Active(active) => active,
            _ => unreachable!("open makes the state active"),
        }
    }

    /// Ends the span perpendicular at the programmed position, and begins another there.
    fn stand_perpendicular(
        &mut self,
        active: Box<Active<'a>>,
        start: Position,
        motion: &Motion,
        source: Source,
    ) -> Box<Active<'a>> {
        let here = Motion { shape: Shape::Line, end: start, ..*motion };
        let selection = Selection {
            side: active.side,
            approach: Some(Approach::Normal),
            along: None,
            source: active.span.entry.lead.source,
        };
        let lead = Lead { motion: here, source, start, approach: Approach::Normal, along: None };
        let wall = self.close(*active, Exit::Link(lead));
        self.open(selection, start, &here, source, Some(wall), false);
        self.opened()
    }

    /// Begins a block with a new radius perpendicular to the block before (SINUMERIK 880).
    fn change_perpendicular(
        &mut self,
        active: Box<Active<'a>>,
        start: Position,
        motion: &Motion,
        source: Source,
    ) {
        let selection = Selection {
            side: active.side,
            approach: Some(Approach::Normal),
            along: None,
            source: active.radius_changes.unwrap_or(source),
        };
        let lead = Lead { motion: *motion, source, start, approach: Approach::Normal, along: None };
        let wall = self.close(*active, Exit::Link(lead));
        self.open(selection, start, motion, source, Some(wall), true);
    }

    /// Runs a rapid as programmed: the tool leaves the offset and enters it again.
    ///
    /// A cancel that waited for its move has nothing left to lead off from.
    fn leave_raw(&mut self, active: Active<'a>, start: Position, motion: &Motion, source: Source) {
        let same_side = Selection {
            side: active.side,
            approach: None,
            along: None,
            source: active.span.entry.lead.source,
        };
        let next = match (active.cancel, active.relink) {
            (Some(_), _) => WalkState::Off,
            (None, Some((selection, _))) => WalkState::Selected(selection),
            (None, None) => WalkState::Selected(same_side),
        };
        let approach = self.profile.cancel.default;
        let lead = Lead { motion: *motion, source, start, approach, along: None };
        self.close(active, Exit::LeadOff(lead));
        self.state = next;
    }
}

/// How two contours on different sides of the tool are joined.
struct Change {
    before: OtherSide,
    next: OtherSide,
    meeting: Meeting,
    /// The last run before it, and the first after it.
    at_change: [AtChange; 2],
}

impl Change {
    /// `None` where they do not meet.
    ///
    /// What is too short for the tool next to a change of side is straightened within the accepted
    /// tolerance, as elsewhere in a contour.
    fn of(before: &Span<'_>, next: &Span<'_>, profile: &Profile) -> Option<Self> {
        let tolerance = profile.accept_tolerance_mm;
        let widths = [MERGE_MM, tolerance.max(MERGE_MM)];
        let befores = widths.map(|straight_mm| last_runs(before, straight_mm));
        let nexts = widths.map(|straight_mm| first_runs(next, straight_mm));
        let short_mm = profile.corner.short_block_mm;
        let ending = |run: &Run| OtherSide { element: run.element, d_mm: before.d_out_mm };
        let starting = |run: &Run| OtherSide { element: run.element, d_mm: next.d_mm };
        let mut first = None;
        for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let (last_run, first_run) = (befores[a].last()?, nexts[b].first()?);
            let (before, next) = (ending(last_run), starting(first_run));
            let Some(meeting) = meeting(&before, &next) else { continue };
            let at = |run: &Run, straight_mm| AtChange { legs: run.legs.clone(), straight_mm };
            let at_change = [at(last_run, widths[a]), at(first_run, widths[b])];
            let change = Self { before, next, meeting, at_change };
            if is_all_reached(Some(&before), &nexts[b], None, (short_mm, tolerance))
                && is_all_reached(None, &befores[a], Some(&next), (short_mm, tolerance))
            {
                return Some(change);
            }
            first = first.or(Some(change));
        }
        // A run that is dropped as noise after the change counts as little before it.
        let (exact, [_, second]) = (first?, nexts[0].first_chunk()?);
        let at = after_noise(&exact.before, &nexts[0], (short_mm, tolerance));
        let second = starting(second);
        match meeting(&exact.before, &second) {
            Some(meeting) if at.is_some_and(|at| (at - meeting.point).norm() <= LENGTH_MM) => {
                Some(Self { next: second, meeting, ..exact })
            }
            _ => Some(exact),
        }
    }
}

/// Where the second run begins after a change of side, if the first is dropped within the accepted
/// tolerance.
fn after_noise(from: &OtherSide, runs: &[Run], (short_mm, slack): (f64, f64)) -> Option<Vec2> {
    let mut links = ChainBuilder::new(runs.len(), 1.0, short_mm);
    links.push(chain_links::link(Role::Entry, from.element, from.d_mm, from.d_mm), 0);
    chain_links::push_runs(&mut links, runs, 1.0);
    let links = links.finish();
    let links = links.of(runs);
    let placed = join(links, slack);
    let first = placed.iter().find(|place| matches!(links.role(place.link), Role::Run(_)))?;
    let is_second = links.role(first.link) == Role::Run(1);
    (is_second && !is_any_unreachable(links, &placed, slack)).then_some(first.start)
}

/// Whether something is left of each run next to a change of side.
fn is_all_reached(
    from: Option<&OtherSide>,
    runs: &[Run],
    to: Option<&OtherSide>,
    (short_mm, slack): (f64, f64),
) -> bool {
    let end = |role, side: &OtherSide| chain_links::link(role, side.element, side.d_mm, side.d_mm);
    let mut links = ChainBuilder::new(runs.len(), 1.0, short_mm);
    from.into_iter().for_each(|from| links.push(end(Role::Entry, from), 0));
    chain_links::push_runs(&mut links, runs, 1.0);
    to.into_iter().for_each(|to| links.push(end(Role::Exit, to), 0));
    let links = links.finish();
    let links = links.of(runs);
    let placed = join(links, slack);
    placed.iter().filter(|place| matches!(links.role(place.link), Role::Run(_))).count()
        == runs.len()
}

/// Where the offsets on both sides of the tool meet, if something is left of each.
fn meeting(before: &OtherSide, next: &OtherSide) -> Option<Meeting> {
    let (ending, starting) = (before.element.offset(before.d_mm)?, next.element.offset(next.d_mm)?);
    let meeting = meet_across(&ending, &starting)?;
    let is_left = meeting.trim_a < ending.length() - LENGTH_MM
        && meeting.trim_b < starting.length() - LENGTH_MM;
    (is_left && before.d_mm * next.d_mm < 0.0).then_some(meeting)
}
