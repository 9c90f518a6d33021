//! Rules for leads: a lead that passes above the cuts cuts nothing, and before a free end of the
//! contour there is only air.

use crate::blocks::program::{BlockKind, NONE};
use crate::clearance::{GOUGE_MM, Search, Tool};
use crate::geometry::planar::{Near, Piece, Point, cross};
use cnc_msgs::path::Role;

/// How much a contour may bend from its lead and still have a free end there, as a curve made of
/// chords does.
const BEND_RAD: f64 = 0.1;
/// Copies of a leg are at most so far from each other, mm.
const COPY_MM: f64 = 2e-3;

impl Search<'_> {
    pub(crate) fn lead(&self, element: usize) -> Tool {
        let leads_on = self.span.lead_on == Some(element);
        let leg = if leads_on { 0 } else { self.legs.len() - 1 };
        let own =
            if self.tool_path.block_of[element] == self.legs[leg] { leg as u32 } else { NONE };
        Tool { on: leg as u32, own, limit_mm: self.radius_mm(element) - GOUGE_MM }
    }

    /// An element without the parts that lengthen it at outside corners with the leads: those
    /// belong to the leads.
    pub(crate) fn without_leads(&self, piece: &Piece, tool: &Tool) -> [Option<Piece>; 3] {
        let own = tool.own as usize;
        let is_first = own == 0 && self.span.lead_on.is_some() && !self.span.from_side;
        let is_last =
            own + 1 == self.legs.len() && self.span.lead_off.is_some() && !self.span.to_side;
        if tool.own != NONE && !piece.is_line() {
            let (from_side, to_side) = self.at_change_of_side(own);
            return self.without_ends(piece, own, (is_first || from_side, is_last || to_side));
        }
        if tool.own == NONE || !(is_first || is_last) {
            return [None, Some(*piece), None];
        }
        let (leg, length) = (self.walls.piece(own), piece.length());
        let begin = if is_first { piece.along(leg.from) } else { 0.0 };
        let end = if is_last { piece.along(leg.to) } else { length };
        let (begin, end) = (begin.clamp(0.0, length), end.clamp(0.0, length));
        let part = |from: f64, to: f64| (to - from > GOUGE_MM).then(|| piece.part(from, to));
        if begin <= GOUGE_MM && end >= length - GOUGE_MM {
            return [None, Some(*piece), None];
        }
        [part(0.0, begin), part(begin, end), part(end, length)]
    }

    /// An arc without the parts that lengthen it at leads and changes of side: those belong to
    /// them.
    fn without_ends(
        &self,
        piece: &Piece,
        own: usize,
        (is_first, is_last): (bool, bool),
    ) -> [Option<Piece>; 3] {
        let whole = [None, Some(*piece), None];
        let leg = self.walls.piece(own);
        let (Some(round), false) = (&piece.round, leg.is_line()) else { return whole };
        // How far along the circle the second point is from the first, mm; less than half a turn.
        let after = |first: Point, second: Point| {
            let (a, b) = (first - round.center, second - round.center);
            cross(a, b).atan2(a.dot(&b)) * round.sweep.signum() * round.radius
        };
        let length = piece.length();
        let begin = if is_first { after(piece.from, leg.from).max(0.0) } else { 0.0 };
        let end = if is_last { length - after(leg.to, piece.to).max(0.0) } else { length };
        if begin <= GOUGE_MM && end >= length - GOUGE_MM || begin >= end {
            return whole;
        }
        let part = |from: f64, to: f64| (to - from > GOUGE_MM).then(|| piece.part(from, to));
        [part(0.0, begin), part(begin, end), part(end, length)]
    }

    /// Whether the side changes where a leg begins, and where it ends.
    pub(crate) fn at_change_of_side(&self, leg: usize) -> (bool, bool) {
        let is_last = leg + 1 == self.legs.len();
        (leg == 0 && self.span.from_side, is_last && self.span.to_side)
    }

    /// Whether a lead passes above everything that the pass of a leg cuts, and above
    /// the material.
    pub(crate) fn is_above(&self, element: usize, leg: usize) -> bool {
        let tool_path = self.tool_path;
        if matches!(tool_path.roles[element], Role::Corner | Role::Contour) {
            return false;
        }
        let along = tool_path.program.offset(self.legs[leg]).plane.axes()[2];
        let lowest = tool_path.position_before(element)[along]
            .min(tool_path.path.elements[element].end[along]);
        let pass = self.passes.pass(leg);
        let highest = |leg: usize| {
            let block = self.legs[leg];
            tool_path.program.start(block)[along].max(tool_path.program.motion(block).end[along])
        };
        lowest > self.profile.interference.stock_top_mm
            && self.passes.legs(pass).all(|leg| lowest > highest(leg))
            && self
                .copies
                .as_ref()
                .is_none_or(|copies| copies.of_leg(leg).iter().all(|copy| lowest > highest(*copy)))
    }

    /// Whether a lead comes near to a copy of its own leg. A retraced wall is one wall, except for
    /// rounding.
    pub(crate) fn is_copy(&self, element: usize, leg: usize, near: &Near) -> bool {
        let leads_on = self.span.lead_on == Some(element);
        let is_lead = leads_on || self.span.lead_off == Some(element);
        let own = if leads_on { 0 } else { self.legs.len() - 1 };
        if !is_lead || self.tool_path.roles[element] == Role::Link || leg == own {
            return false;
        }
        let (of, copy) = (self.walls.piece(own), self.walls.piece(leg));
        let Some(wall) = self.passes.wall(None, own, &of) else { return false };
        let is_free = if leads_on { wall.from == of.from } else { wall.to == of.to };
        if !is_free || of.is_line() != copy.is_line() {
            return false;
        }
        let at = of.nearest(near.on_b);
        let (along, along_copy) = (of.tangent(at), copy.tangent(near.on_b));
        near.distance >= self.radius_mm(element) - GOUGE_MM - COPY_MM
            && (at - near.on_b).norm() <= COPY_MM
            && along.dot(&along_copy) > 0.0
            && cross(along, along_copy).abs() <= BEND_RAD
    }

    /// For a lead that joins the contour one radius from its free end, before which there is only
    /// air: how near it comes to that end, the part of a leg that it passes over, and the rest of
    /// the leg. `None`: the lead or the leg is not of this kind.
    pub(crate) fn at_free_end(
        &self,
        lead: &Piece,
        element: usize,
        leg: usize,
    ) -> Option<(f64, Option<Piece>, Option<Piece>)> {
        let leads_on = self.span.lead_on == Some(element);
        let is_straight = leads_on || self.span.lead_off == Some(element);
        if !is_straight || self.tool_path.roles[element] == Role::Link {
            return None;
        }
        let last = self.legs.len() - 1;
        let first = if leads_on { 0 } else { last };
        let piece = self.walls.piece(first);
        let wall = self.passes.wall(None, first, &piece)?;
        let (end, begins) = match leads_on {
            true => (piece.from, wall.from),
            false => (piece.to, wall.to),
        };
        let (radius_mm, nearest_mm) = (self.radius_mm(element), (lead.nearest(end) - end).norm());
        let side = if leads_on { lead.to - end } else { lead.from - end };
        let farthest_mm = radius_mm / (BEND_RAD / 2.0).cos() + GOUGE_MM;
        if begins != end || side.norm() > farthest_mm || nearest_mm >= radius_mm {
            return None;
        }
        // Along this much of the contour the tool is nearer than the radius, whatever the bend.
        let tangent = ((radius_mm - nearest_mm) / (radius_mm + nearest_mm)).sqrt();
        let mut left = 2.0 * radius_mm * tangent;
        let between = if leads_on { 0..leg } else { leg + 1..last + 1 };
        for other in between {
            left -= self.walls.piece(other).length();
            if left <= 0.0 {
                return None;
            }
        }
        let piece = self.passes.wall(None, leg, &self.walls.piece(leg))?;
        let length = piece.length();
        if left >= length {
            return Some((nearest_mm, Some(piece), None));
        }
        let (before, after) = match leads_on {
            true => (piece.part(0.0, left), piece.part(left, length)),
            false => (piece.part(length - left, length), piece.part(0.0, length - left)),
        };
        Some((nearest_mm, Some(before), Some(after)))
    }

    /// Whether an element is a corner between a lead and the contour: it is judged with the lead,
    /// and tails bound neither.
    pub(crate) fn is_of_lead(&self, element: usize) -> bool {
        let block = self.tool_path.block_of[element];
        self.tool_path.roles[element] == Role::Corner
            && self.span.elements.start <= element
            && (block == self.legs[0]
                || self.tool_path.program.blocks[block as usize].kind != BlockKind::Leg)
    }
}
