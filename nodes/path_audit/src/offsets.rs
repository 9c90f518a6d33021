//! Checks that every element runs at its radius along its own block and around its own corner, in
//! order.
//!
//! `element_offset` checks one element against its leg; this file knows what comes before and
//! after, `run` which line or circle an element is part of, and `sharp_corner` what a sharp corner
//! takes away. Blocks that the path leaves out must be noise: as near to their lengthened
//! neighbours as the profile accepts.

mod element_offset;
mod lead_arc;
mod run;
mod sharp_corner;

use crate::blocks::chains::Chains;
use crate::blocks::program::{BlockKind, NONE};
use crate::blocks::spans::Span;
use crate::blocks::tool_path::ToolPath;
use crate::geometry::planar::{Piece, Point, cross};
use crate::offsets::element_offset::{
    ElementOnLeg, MERGE_MM, PLACE_MM, check_element, check_joint, check_reach, has_short_neighbour,
    meets_lead, off_circle, runs_on, unevenness,
};
use crate::offsets::run::{off_run, run};
use crate::offsets::sharp_corner::is_corner_of_curves;
use crate::report::{self, Report};
use cnc_msgs::path::Role;
use cnc_msgs::profile::{Reaction, SelectTarget};

pub(crate) fn check(tool_path: &mut ToolPath<'_>, chains: &Chains<'_>, report: &mut Report<'_>) {
    let span = chains.span;
    lead_arc::check(tool_path, span, chains.all_legs, report);
    let mut check = Check {
        chains,
        span,
        legs: chains.all_legs,
        next: span.legs.start,
        before: None,
        has_corner: false,
        corner_moves: Vec::new(),
    };
    for element in span.elements.clone() {
        if report.is_full() {
            return;
        }
        if tool_path.block_of[element] == NONE {
            // `align` has reported it.
            continue;
        }
        check.goes_to(tool_path.block_of[element]);
        match tool_path.roles[element] {
            Role::Corner => check.corner(tool_path, element, report),
            Role::Contour => check.contour(tool_path, element, report),
            _ => {}
        }
    }
    check.last(tool_path, report);
}

struct Check<'a> {
    chains: &'a Chains<'a>,
    span: &'a Span,
    legs: &'a [u32],
    /// The first leg, among all, that is not before the block of the element.
    next: usize,
    before: Option<ElementOnLeg>,
    /// Whether a corner lies between it and the next element, and the corner's moves.
    has_corner: bool,
    corner_moves: Vec<CornerMove>,
}

/// A corner element: the tool goes around the start of a leg.
#[derive(Debug, Clone, Copy)]
struct CornerMove {
    /// Index among all legs.
    leg: usize,
    from: Point,
    to: Point,
}

/// What comes before or after legs that are left out: an element, a point on a corner, or nothing.
#[derive(Clone, Copy)]
struct Neighbour<'a> {
    on_leg: Option<&'a ElementOnLeg>,
    at: Option<Point>,
}

impl Check<'_> {
    /// Advances to a block; elements come in the order of their blocks.
    fn goes_to(&mut self, block: u32) {
        while self.next < self.span.legs.end && self.legs[self.next] < block {
            self.next += 1;
        }
    }

    /// The leg at an index among all, if this span has it.
    fn leg_at(&self, index: usize) -> Option<u32> {
        self.span.legs.contains(&index).then(|| self.legs[index])
    }

    fn contour(&mut self, tool_path: &mut ToolPath<'_>, element: usize, report: &mut Report<'_>) {
        let block = tool_path.block_of[element];
        if self.leg_at(self.next) != Some(block) {
            return;
        }
        let offset = *tool_path.program.offset(block);
        let mut now = ElementOnLeg {
            element,
            block,
            leg_index: self.next,
            piece: self.chains.element(element),
            leg: self.chains.leg(tool_path, self.next),
            d_in: offset.d_in,
            d_out: offset.d_out,
            is_open: self.has_corner,
            is_loose: false,
            is_after_merged: false,
            uneven_mm: self
                .uneven(tool_path, self.next, report)
                .max(self.uneven_before(tool_path, report)),
        };
        if now.uneven_mm > PLACE_MM {
            let block = &mut tool_path.program.blocks[block as usize];
            block.slack_mm = block.slack_mm.max(now.uneven_mm as f32);
        }
        let is_joined = offset.is_joined || self.span.from_side;
        let mut opens = self.has_corner;
        match self.before.take() {
            Some(mut before) => {
                let left_out = before.leg_index + 1..now.leg_index;
                let runs_on = !self.has_corner && runs_on(&before.piece, &now.piece);
                if runs_on || !left_out.is_empty() {
                    (before.is_loose, now.is_loose) = (true, true);
                }
                now.is_after_merged = before.is_loose && !before.piece.is_line();
                self.left_out(tool_path, left_out, (Some(&before), Some(&now)), report);
                if !self.has_corner && !runs_on {
                    opens = check_joint(tool_path, &before, &now, report);
                }
                now.is_open = opens;
                check_element(tool_path, &before, self.chains, opens, report);
            }
            None => {
                let left_out = self.span.legs.start..now.leg_index;
                if !left_out.is_empty() {
                    now.is_loose = true;
                    self.left_out(tool_path, left_out, (None, Some(&now)), report);
                } else if !is_joined && !self.has_corner {
                    check_reach(tool_path, &now, self.lead(tool_path, true), true, report);
                }
                now.is_open = true;
            }
        }
        self.before = Some(now);
        self.has_corner = false;
        self.corner_moves.clear();
    }

    fn last(&mut self, tool_path: &mut ToolPath<'_>, report: &mut Report<'_>) {
        let Some(mut last) = self.before.take() else {
            let all = self.span.legs.clone();
            // The path has nothing of this contour.
            self.left_out(tool_path, all, (None, None), report);
            return;
        };
        let left_out = last.leg_index + 1..self.span.legs.end;
        if left_out.is_empty() {
            if !self.span.to_side {
                check_reach(tool_path, &last, self.lead(tool_path, false), false, report);
            }
        } else {
            last.is_loose = true;
            self.left_out(tool_path, left_out, (Some(&last), None), report);
        }
        check_element(tool_path, &last, self.chains, true, report);
    }

    /// The block of the lead-on or the lead-off.
    fn lead(&self, tool_path: &ToolPath<'_>, is_first: bool) -> Option<u32> {
        let lead = if is_first { self.span.lead_on } else { self.span.lead_off };
        lead.map(|element| tool_path.block_of[element])
    }

    /// Where the tool is at the end of the lead-on, or at the start of the lead-off.
    fn lead_end(&self, tool_path: &ToolPath<'_>, is_first: bool) -> Option<Point> {
        let on = self.span.lead_on.map(|element| tool_path.end(element));
        let off = self.span.lead_off.map(|element| tool_path.start(element));
        let at = if is_first { on.or(off) } else { off.or(on) };
        at.or_else(|| {
            // The planner drops a lead of no length: the tool is where it was before.
            let is_before = |block: &u32| *block != NONE && *block < self.span.blocks.start;
            tool_path.block_of.iter().rposition(is_before).map(|element| tool_path.end(element))
        })
    }

    /// Whether the contour may begin or end anywhere along its first or last leg: where it meets
    /// the offset of its lead.
    fn is_joined_at(&self, tool_path: &ToolPath<'_>, at: Point, is_first: bool) -> bool {
        let index = if is_first { self.span.legs.start } else { self.span.legs.end - 1 };
        let offset = tool_path.program.offset(self.legs[index]);
        let d_mm = if is_first { offset.d_in } else { offset.d_out };
        let is_free =
            if is_first { offset.is_joined || self.span.from_side } else { self.span.to_side };
        is_free || meets_lead(tool_path, self.lead(tool_path, is_first), at, d_mm, PLACE_MM)
    }

    /// How far off its circle a leg is programmed to end, mm; 0 if that is more than noise.
    fn uneven(&self, tool_path: &ToolPath<'_>, index: usize, report: &Report<'_>) -> f64 {
        let off = unevenness(&self.chains.leg(tool_path, index));
        if off <= report.profile.accept_tolerance_mm.max(MERGE_MM) { off } else { 0.0 }
    }

    /// The same for the leg before.
    fn uneven_before(&self, tool_path: &ToolPath<'_>, report: &Report<'_>) -> f64 {
        let before = self.next.checked_sub(1).filter(|before| self.span.legs.contains(before));
        before.map_or(0.0, |before| self.uneven(tool_path, before, report))
    }

    /// Whether the leg before a block, or the block's own leg, has no element.
    fn is_between_lost(&self, tool_path: &ToolPath<'_>) -> bool {
        let is_lost = |leg: u32| tool_path.program.blocks[leg as usize].element == NONE;
        let before = self.next.checked_sub(1).and_then(|before| self.leg_at(before));
        before.is_some_and(is_lost) || self.leg_at(self.next).is_some_and(is_lost)
    }

    /// Checks a corner, which goes around the start of its block.
    fn corner(&mut self, tool_path: &mut ToolPath<'_>, element: usize, report: &mut Report<'_>) {
        self.has_corner = true;
        let block = tool_path.block_of[element];
        let kind = tool_path.program.blocks[block as usize].kind;
        let offset = self.span.offset(tool_path, self.legs, block);
        let d_mm = if kind == BlockKind::Leg { offset.d_in } else { offset.d_out };
        let radius_mm = d_mm.abs();
        let vertex = tool_path.program.ends(block).0;
        let place_mm = if self.is_between_lost(tool_path) {
            report.profile.accept_tolerance_mm + 2.0 * MERGE_MM
        } else if self.before.is_some_and(|before| before.is_loose)
            || has_short_neighbour(tool_path, self.next, self.chains)
        {
            1.01 * MERGE_MM
        } else {
            PLACE_MM
        };
        let place_mm = place_mm + self.uneven_before(tool_path, report);
        let piece = self.chains.element(element);
        self.corner_moves.push(CornerMove { leg: self.next, from: piece.from, to: piece.to });
        let path_element = &tool_path.path.elements[element];
        let nearest_mm = (piece.nearest(vertex) - vertex).norm();
        if let Some(round) = &piece.round {
            let off = (round.center - vertex).norm();
            if off <= place_mm {
                let to_end = (piece.to - vertex).norm();
                let off = |radius: &f64| (radius - radius_mm).abs();
                let radii = [round.radius, to_end];
                if let Some(radius) = radii.into_iter().find(|radius| off(radius) > place_mm) {
                    report.push_shape(report::wrong_offset(path_element, radius_mm, radius));
                } else if round.sweep * d_mm > 0.0 {
                    report.push_shape(report::wrong_place(
                        path_element,
                        "turns the wrong way around its corner",
                    ));
                }
                return;
            }
            // A piece of the next arc, lengthened to where its functions run.
            let off_own = off_circle(&piece, &tool_path.leg(block), d_mm);
            if kind != BlockKind::Leg || off_own > place_mm {
                let found = if off <= radius_mm { radius_mm - off.min(off_own) } else { off };
                report.push_shape(report::wrong_offset(path_element, radius_mm, found));
                return;
            }
        }
        if nearest_mm < radius_mm - place_mm {
            report.push_shape(report::wrong_offset(path_element, radius_mm, nearest_mm));
        }
    }

    /// Checks the legs that the path leaves out, from corner to corner.
    fn left_out(
        &self,
        tool_path: &mut ToolPath<'_>,
        left_out: std::ops::Range<usize>,
        (before, after): (Option<&ElementOnLeg>, Option<&ElementOnLeg>),
        report: &mut Report<'_>,
    ) {
        let mut begin = left_out.start;
        let at = before.map(|on_leg| on_leg.piece.to).or_else(|| self.lead_end(tool_path, true));
        let mut from = Neighbour { on_leg: before, at };
        for stand in &self.corner_moves {
            let end = stand.leg.clamp(begin, left_out.end);
            let to = Neighbour { on_leg: after, at: Some(stand.from) };
            self.between(tool_path, begin..end, [from, to], report);
            (begin, from.at) = (end, Some(stand.to));
        }
        let at = after.map(|on_leg| on_leg.piece.from).or_else(|| self.lead_end(tool_path, false));
        let to = Neighbour { on_leg: after, at };
        self.between(tool_path, begin..left_out.end, [from, to], report);
    }

    /// The line that a leg is part of, and the legs of it among these.
    fn whole_line(
        &self,
        tool_path: &ToolPath<'_>,
        index: usize,
        among: &std::ops::Range<usize>,
    ) -> (std::ops::Range<usize>, Piece) {
        const LEGS_MAX: usize = 64;
        let leg = |index: usize| self.chains.leg(tool_path, index);
        let (mut all, mut whole) = (index..index + 1, leg(index));
        if !whole.is_line() {
            return (all, whole);
        }
        while all.start > among.start
            && all.len() < LEGS_MAX
            && runs_on(&leg(all.start - 1), &whole)
        {
            all.start -= 1;
            whole = Piece::line(leg(all.start).from, whole.to);
        }
        while all.end < among.end && all.len() < LEGS_MAX && runs_on(&whole, &leg(all.end)) {
            whole = Piece::line(whole.from, leg(all.end).to);
            all.end += 1;
        }
        (all, whole)
    }

    /// Checks that legs left out between two neighbours lie along those neighbours, lengthened.
    fn between(
        &self,
        tool_path: &mut ToolPath<'_>,
        left_out: std::ops::Range<usize>,
        [from, to]: [Neighbour<'_>; 2],
        report: &mut Report<'_>,
    ) {
        if left_out.is_empty() {
            return;
        }
        let (before, after) = (from.on_leg, to.on_leg);
        let run_before = before.map(|on_leg| run(tool_path, on_leg, self.chains, true));
        let run_after = after.map(|on_leg| run(tool_path, on_leg, self.chains, false));
        let d_mm = after.map(|on_leg| on_leg.d_in).or(before.map(|on_leg| on_leg.d_out));
        let d_mm = d_mm.unwrap_or(tool_path.program.offset(self.legs[left_out.start]).d_in);
        let off = |point: Point| {
            let of = |run: &Option<(Piece, f64)>| {
                run.as_ref().map_or(f64::INFINITY, |(run, d_mm)| off_run(run, point, *d_mm))
            };
            // Where the tool stands still, it touches everything at its radius.
            let stands = [from.at, to.at].into_iter().flatten();
            let touched = stands.map(|at| ((point - at).norm() - d_mm.abs()).abs());
            touched.fold(of(&run_before).min(of(&run_after)), f64::min)
        };
        // A lead that the contour begins on is one line with a first leg that continues it. An
        // inside corner at the end of that leg belongs to both.
        let is_entry = report.profile.select.target == SelectTarget::NormalEntry;
        let lead_on = self.lead(tool_path, true).filter(|_| is_entry && !self.span.from_side);
        let lead_on = lead_on.map(|block| tool_path.leg(block)).filter(Piece::is_line);
        let mut worst = (0.0_f64, left_out.start, Point::zeros());
        for index in left_out.clone() {
            let leg = self.chains.leg(tool_path, index);
            let length = leg.length();
            // A whole line is touched in one place.
            let (all, whole) = self.whole_line(tool_path, index, &left_out);
            let (is_first, is_last) =
                (all.start == self.span.legs.start, all.end == self.span.legs.end);
            let lead = lead_on.filter(|lead| is_first && runs_on(lead, &whole));
            let whole = lead.map_or(whole, |lead| Piece::line(lead.from, whole.to));
            let touches = |at: Point| {
                let (leg, length) = (&whole, whole.length());
                // At a free end the tool has to reach the very end.
                let is_short = is_last && !self.is_joined_at(tool_path, at, false);
                let least = if is_short { length - PLACE_MM } else { -PLACE_MM };
                let is_late = is_first && !self.is_joined_at(tool_path, at, true);
                let most = if is_late { PLACE_MM } else { length + PLACE_MM };
                least <= most && is_touched(leg, at, d_mm, least..=most)
            };
            if let Some(across_mm) = across(&leg, d_mm).filter(|across| *across > worst.0) {
                // Its two joints are one point; the tool misses as much on the other side of it.
                worst = (across_mm, index, leg.at(length / 2.0));
                continue;
            }
            if [from.at, to.at].into_iter().flatten().any(touches) {
                // Its joints leave one point of it, and the tool is there.
                continue;
            }
            for quarter in 0..=4 {
                let point = leg.at(length * f64::from(quarter) / 4.0);
                let off = off(point);
                if off > worst.0 {
                    worst = (off, index, point);
                }
            }
        }
        let accepted = report.profile.accept_tolerance_mm + MERGE_MM + PLACE_MM;
        // A lead can meet the contour in a corner, as an element does.
        let end = |index: Option<usize>, is_first: bool| match index.and_then(|i| self.leg_at(i)) {
            Some(leg) => Some(tool_path.leg(leg)),
            None => self.lead(tool_path, is_first).map(|block| tool_path.leg(block)),
        };
        let (first, last) =
            (end(left_out.start.checked_sub(1), true), end(Some(left_out.end), false));
        let at_corner = first.zip(last).zip(from.at.or(to.at));
        let at_corner = at_corner.is_some_and(|((first, last), stand)| {
            let left_out = left_out.clone().map(|index| self.chains.leg(tool_path, index));
            let legs = std::iter::once(first).chain(left_out).chain([last]);
            is_corner_of_curves(legs, stand, d_mm)
        });
        let is_lost = worst.0 > accepted && !at_corner;
        let slack = match worst.0 {
            _ if at_corner => accepted as f32,
            off if off <= PLACE_MM => 0.0,
            off => (off + MERGE_MM) as f32,
        };
        // A lead that joins the contour in a corner may skip its first or last blocks; the planner
        // warns of that.
        let is_at_lead = left_out.start == self.span.legs.start && from.on_leg.is_none()
            || left_out.end == self.span.legs.end && to.on_leg.is_none();
        let first = tool_path.program.source(self.legs[left_out.start]);
        let is_skipped = is_lost && is_at_lead && report.is_known_uncut(first, worst.0);
        // Trimmed blocks bound the tool as before, at its exact radius.
        let is_trimmed =
            is_skipped || is_lost && report.profile.interference.react == Reaction::Trim;
        let slack = if is_lost { 0.0 } else { slack };
        for index in left_out.clone() {
            let block = &mut tool_path.program.blocks[self.legs[index] as usize];
            block.is_lost = is_lost && !is_trimmed;
            block.slack_mm = block.slack_mm.max(slack);
        }
        for on_leg in [before, after].into_iter().flatten() {
            let block = &mut tool_path.program.blocks[on_leg.block as usize];
            block.slack_mm = block.slack_mm.max(slack);
        }
        if is_lost && !is_skipped {
            let source = |index: usize| tool_path.program.source(self.legs[index]);
            let other = if worst.1 == left_out.start { left_out.end - 1 } else { left_out.start };
            let sources = (source(worst.1), source(other));
            let mut at = tool_path.program.motion(self.legs[worst.1]).end;
            let [u, v, _] = tool_path.program.offset(self.legs[worst.1]).plane.axes();
            (at[u], at[v]) = (worst.2.x, worst.2.y);
            report.push(report::left_out(sources, (worst.0, left_out.len()), at, report.profile));
        }
    }
}

/// The width of the tool's path along a full circle, mm: only at its start does the tool reach it.
fn across(leg: &Piece, d_mm: f64) -> Option<f64> {
    let round = leg.round.filter(|_| (leg.to - leg.from).norm() <= PLACE_MM)?;
    let goes_around = round.sweep.abs() > std::f64::consts::PI;
    goes_around.then(|| 2.0 * (round.radius - d_mm * round.sweep.signum()).max(0.0))
}

/// Whether a tool at this point touches a leg within this range.
fn is_touched(leg: &Piece, at: Point, d_mm: f64, along: std::ops::RangeInclusive<f64>) -> bool {
    let off = match &leg.round {
        None => cross(leg.tangent(leg.from), at - leg.from) - d_mm,
        Some(round) => (at - round.center).norm() - (round.radius - d_mm * round.sweep.signum()),
    };
    off.abs() <= PLACE_MM && along.contains(&leg.along(at))
}
