//! Measures how near the path comes to the walls of its pass: the exact distance, everywhere.
//!
//! `leads` has what a lead may pass over.

mod leads;

use crate::blocks::chains::Chains;
use crate::blocks::program::{BlockKind, NONE};
use crate::blocks::spans::Span;
use crate::blocks::tool_path::ToolPath;
use crate::geometry::distance_bounds;
use crate::geometry::pieces::Pieces;
use crate::geometry::planar::{Near, Piece, Point, cross, nearest};
use crate::geometry::strip_tree::{self, StripTree};
use crate::report::{self, Cut, Report};
use crate::walls::passes::Passes;
use crate::walls::retraced_legs::RetracedLegs;
use cnc_msgs::finding::{Code, Severity};
use cnc_msgs::geometry::Position;
use cnc_msgs::path::Role;
use cnc_msgs::profile::Profile;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// How much nearer than its radius the tool may be, mm.
pub(crate) const GOUGE_MM: f64 = 1e-4;
/// A lead may come so much nearer to its leg than to the free end of that leg, mm: rounding.
const FREE_END_MM: f64 = 2e-6;
/// Cuts kept for each span. A span that is cut everywhere needs no more.
const CUTS_MAX: usize = 20_000;
/// Places reported for each span.
const PLACES_MAX: usize = 100;

/// The tool on an element comes too near to a leg.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Found {
    element: usize,
    /// The leg that it follows and the leg that it cuts, as indices in the span.
    on: usize,
    into: usize,
    near: Near,
    radius_mm: f64,
    is_other_pass: bool,
    /// The element is a lead, which has rules of its own.
    is_lead: bool,
    /// The lead only passes over the free end of the contour that it leads to or from.
    is_nick: bool,
    /// The cut is where the contour closes, and the profile forgives that.
    is_forgiven: bool,
}

pub(crate) fn check(
    tool_path: &ToolPath<'_>,
    chains: &Chains<'_>,
    nearest_mm: &mut Option<f64>,
    report: &mut Report<'_>,
) {
    let Chains { span, legs: walls, elements, .. } = chains;
    let legs = chains.blocks();
    let offset = |leg: u32| tool_path.program.offset(leg);
    let reach = legs.iter().fold(0.0_f64, |reach, &leg| {
        reach.max(offset(leg).d_in.abs()).max(offset(leg).d_out.abs())
    });
    if reach <= GOUGE_MM {
        return;
    }
    let first = tool_path.program.source(legs[0]);
    let mut wall_tree = StripTree::new(walls).with_directions();
    let (mut passes, mut copies) = (Passes::of(&wall_tree), None);
    if passes.is_none() {
        let all = RetracedLegs::of(walls, |_| true);
        passes = Passes::of_copies(wall_tree, &all);
        let is_whole = |leg| {
            let piece = walls.piece(leg);
            let wall = passes.as_ref().and_then(|passes| passes.wall(None, leg, &piece));
            wall.is_some_and(|wall| (wall.from, wall.to) == (piece.from, piece.to))
        };
        let whole = copies.insert(RetracedLegs::of(walls, is_whole));
        wall_tree = StripTree::new(walls).holding(|leg| whole.is_first(leg));
    }
    let Some(passes) = passes else {
        report.push(report::too_entangled(first));
        return;
    };
    let slack = |&leg: &u32| {
        let block = &tool_path.program.blocks[leg as usize];
        // Nothing can come too near to a block that is lost.
        if block.is_lost { f32::INFINITY } else { block.slack_mm }
    };
    let slacks = legs.iter().map(slack).collect();
    let mut search = Search {
        profile: report.profile,
        tool_path,
        span,
        all_legs: chains.all_legs,
        legs,
        walls,
        slacks,
        passes,
        copies,
        found: Vec::new(),
    };
    let tools = search.tools();
    let tree = StripTree::new(elements);
    let on_way = strip_tree::near(&tree, &wall_tree, reach - GOUGE_MM, |on, into| {
        for element in on {
            search.tool((elements, span.elements.start), element, &tools[element], into.clone());
        }
        search.found.len() < CUTS_MAX
    });
    if !on_way {
        report.push(report::too_entangled(first));
    }
    for lead in [span.lead_on, span.lead_off].into_iter().flatten() {
        let elements = Pieces::new(std::iter::once(tool_path.piece(lead)));
        let tool = search.lead(lead);
        let tree = StripTree::new(&elements);
        strip_tree::near(&tree, &wall_tree, reach - GOUGE_MM, |_, into| {
            search.tool((&elements, lead), 0, &tool, into);
            true
        });
    }
    let found = std::mem::take(&mut search.found);
    for found in deepest_places(found) {
        if found.near.distance < nearest_mm.unwrap_or(f64::INFINITY) {
            *nearest_mm = Some(found.near.distance);
        }
        report.push_cut(&search.cut(&found));
    }
}

/// Checks an intersection where the tool changes from one side of the contour to the other. The
/// first element after it may cut the leg before it, and the last element before it the leg after
/// it, both lengthened as they are.
pub(crate) fn check_change_of_side(
    tool_path: &ToolPath<'_>,
    (before, after): (&Chains<'_>, &Chains<'_>),
    report: &mut Report<'_>,
) {
    let is_contour = |element: &usize| tool_path.roles[*element] == Role::Contour;
    let last = before.span.elements.clone().rev().find(is_contour);
    let first = after.span.elements.clone().find(is_contour);
    let legs = [before.blocks().last().copied(), after.blocks().first().copied()];
    let (Some(last), Some(first), [Some(leg_before), Some(leg_after)]) = (last, first, legs) else {
        return;
    };
    let pairs = [
        (last, leg_before, leg_after, tool_path.program.offset(leg_before).d_out),
        (first, leg_after, leg_before, tool_path.program.offset(leg_after).d_in),
    ];
    for (element, on, into, d_mm) in pairs {
        let near = nearest(&tool_path.piece(element), &tool_path.leg(into));
        let radius_mm = d_mm.abs();
        if near.distance >= radius_mm - GOUGE_MM {
            continue;
        }
        let plane = tool_path.program.offset(into).plane;
        let [u, v, _] = plane.axes();
        let mut at = tool_path.program.motion(into).end;
        (at[u], at[v]) = (near.on_b.x, near.on_b.y);
        report.push_cut(&Cut {
            code: Code::LinkGouge,
            on: tool_path.program.source(on),
            into: tool_path.program.source(into),
            legs_apart: 1,
            at,
            plane,
            radius_mm,
            distance_mm: near.distance,
            is_forgiven: false,
        });
    }
}

/// How near the tool may come to walls while it is on an element.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tool {
    /// The leg that it follows or leads to, in the span; [`NONE`]: it need not keep away.
    pub on: u32,
    /// Its own leg.
    pub own: u32,
    /// Without the slack that merging and the accepted tolerance take.
    pub limit_mm: f64,
}

pub(crate) struct Search<'a> {
    pub profile: &'a Profile,
    pub tool_path: &'a ToolPath<'a>,
    pub span: &'a Span,
    pub all_legs: &'a [u32],
    pub legs: &'a [u32],
    pub walls: &'a Pieces,
    /// The slack of each leg: how far the path may be off it.
    pub slacks: Vec<f32>,
    pub passes: Passes,
    /// Walls that are cut more than once, so that each is checked once.
    pub copies: Option<RetracedLegs>,
    pub found: Vec<Found>,
}

impl Search<'_> {
    /// One tool for each element of the span.
    fn tools(&self) -> Vec<Tool> {
        let mut on = 0;
        let tool = |element: usize| {
            let role = self.tool_path.roles[element];
            let block = self.tool_path.block_of[element];
            let is_judged = matches!(role, Role::Contour | Role::Corner) && block != NONE;
            let (mut limit_mm, mut own) = (0.0, NONE);
            if is_judged {
                let slack = self.tool_path.program.blocks[block as usize].slack_mm;
                limit_mm = self.radius_mm(element) - GOUGE_MM - f64::from(slack);
                // Elements come in the order of their blocks.
                while self.legs.get(on).is_some_and(|&leg| leg < block) {
                    on += 1;
                }
                if self.legs.get(on) == Some(&block) {
                    own = on as u32;
                }
            }
            let on = if is_judged { on.min(self.legs.len() - 1) as u32 } else { NONE };
            Tool { on, own, limit_mm }
        };
        self.span.elements.clone().map(tool).collect()
    }

    /// The radius of the tool on an element.
    pub(crate) fn radius_mm(&self, element: usize) -> f64 {
        let block = self.tool_path.block_of[element];
        match self.tool_path.roles[element] {
            // A corner runs at the radius before it; a leg that changes the radius has both.
            Role::Corner => self.span.offset(self.tool_path, self.all_legs, block).d_in.abs(),
            Role::Contour => {
                let offset = self.span.offset(self.tool_path, self.all_legs, block);
                offset.d_in.abs().min(offset.d_out.abs())
            }
            _ if self.span.lead_on == Some(element) => {
                self.tool_path.program.offset(self.legs[0]).d_in.abs()
            }
            _ => self.tool_path.program.offset(self.legs[self.legs.len() - 1]).d_out.abs(),
        }
    }

    /// The tool on one of some elements, against some walls.
    fn tool(
        &mut self,
        (elements, first): (&Pieces, usize),
        index: usize,
        tool: &Tool,
        into: Range<usize>,
    ) {
        if tool.on == NONE {
            return;
        }
        let (chord, bow) = (elements.chord(index), elements.bow(index));
        for leg in into {
            let leg = match &self.copies {
                Some(copies) if !copies.is_first(leg) => continue,
                Some(copies) => {
                    let pass = self.passes.pass(tool.on as usize);
                    copies.within(leg, &self.passes.legs(pass))
                }
                None => leg,
            };
            let limit = tool.limit_mm - f64::from(self.slacks[leg]);
            let bow_of_leg = self.walls.bow(leg);
            let is_own_line = leg == tool.own as usize && bow_of_leg.is_none();
            if !is_own_line
                && !distance_bounds::are_pieces_apart(
                    chord,
                    bow,
                    self.walls.chord(leg),
                    bow_of_leg,
                    limit,
                )
            {
                self.measure(&elements.piece(index), (first + index, tool), leg, limit);
            }
        }
    }

    /// The exact distance.
    #[cold]
    fn measure(&mut self, piece: &Piece, (element, tool): (usize, &Tool), leg: usize, limit: f64) {
        let role = self.tool_path.roles[element];
        let is_lead = !matches!(role, Role::Contour | Role::Corner) || self.is_of_lead(element);
        let [before, inner, after] = match role {
            Role::Contour => self.without_leads(piece, tool),
            _ => [None, Some(*piece), None],
        };
        if let Some(inner) = inner {
            self.near(&inner, (element, tool), leg, (limit, is_lead));
        }
        for outer in [before, after].into_iter().flatten() {
            self.near(&outer, (element, tool), leg, (limit, true));
        }
    }

    fn near(
        &mut self,
        piece: &Piece,
        (element, tool): (usize, &Tool),
        leg: usize,
        (limit, is_lead): (f64, bool),
    ) {
        let whole = self.walls.piece(leg);
        let mut near = nearest(piece, &whole);
        if near.distance >= limit {
            return;
        }
        let on = tool.on as usize;
        if !self.passes.is_whole(leg) {
            let foot = foot(&self.walls.piece(on), piece, piece.nearest(near.on_b));
            let foot = (!is_lead).then_some((on, foot));
            let Some(wall) = self.passes.wall(foot, leg, &whole) else { return };
            near = nearest(piece, &wall);
            if near.distance >= limit {
                return;
            }
        }
        let is_other_pass = self.passes.pass(on) != self.passes.pass(leg);
        if is_lead && (self.is_above(element, leg) || self.is_copy(element, leg, &near)) {
            return;
        }
        let mut is_nick = false;
        if is_lead && let Some((nearest_mm, part, rest)) = self.at_free_end(piece, element, leg) {
            // A cut farther from the end than that, or a deeper one, is no nick.
            let is_cut = |near: &Near| near.distance < limit;
            let of = |part: Option<Piece>| part.map(|part| nearest(piece, &part)).filter(is_cut);
            match (of(rest), of(part)) {
                (Some(farther), _) => near = farther,
                (None, Some(at_end)) => {
                    near = at_end;
                    is_nick = at_end.distance >= nearest_mm - FREE_END_MM;
                }
                (None, None) => return,
            }
        }
        let radius_mm = self.radius_mm(element);
        if is_nick && radius_mm - near.distance <= self.profile.accept_tolerance_mm {
            return;
        }
        self.found.push(Found {
            element,
            on,
            into: leg,
            near,
            radius_mm,
            is_other_pass,
            is_lead,
            is_nick,
            is_forgiven: self.forgives_closing() && self.is_at_closing(on, leg),
        });
    }

    fn cut(&self, found: &Found) -> Cut {
        let tool_path = self.tool_path;
        let element = &tool_path.path.elements[found.element];
        let block = tool_path.block_of[found.element];
        let kind = tool_path.program.blocks[block as usize].kind;
        let code = match element.role {
            Role::Link => Code::LinkGouge,
            _ if kind == BlockKind::Link => Code::LinkGouge,
            _ if found.is_nick => Code::LeadNick,
            Role::LeadOn | Role::LeadOff => Code::LeadGouge,
            _ if found.is_lead && self.at_change_of_side(found.on) != (false, false) => {
                Code::LinkGouge
            }
            _ if found.is_lead => Code::LeadGouge,
            _ if found.is_other_pass => Code::CutsOtherPass,
            _ => Code::Gouge,
        };
        let into = self.legs[found.into];
        let offset = tool_path.program.offset(self.legs[found.on]);
        Cut {
            code,
            on: element.source,
            into: tool_path.program.source(into),
            legs_apart: found.on.abs_diff(found.into),
            at: self.position(found, into),
            plane: offset.plane,
            radius_mm: found.radius_mm,
            distance_mm: found.near.distance,
            is_forgiven: found.is_forgiven,
        }
    }

    fn position(&self, found: &Found, into: u32) -> Position {
        let plane = self.tool_path.program.offset(into).plane;
        let [u, v, w] = plane.axes();
        let mut at = self.tool_path.program.motion(into).end;
        (at[u], at[v]) = (found.near.on_b.x, found.near.on_b.y);
        at[w] = self.tool_path.path.elements[found.element].end[w];
        at
    }

    fn forgives_closing(&self) -> bool {
        self.profile.interference.at_closing.severity() == Severity::Warning
    }

    /// Whether the cut is between the first and the last wall of a pass.
    fn is_at_closing(&self, on: usize, into: usize) -> bool {
        let Some((first, last)) = self.passes.ends(on) else { return false };
        let (low, high) = (on.min(into), on.max(into));
        let is_straight = |from: usize, to: usize| {
            (from..to).all(|leg| {
                let (a, b) = (self.walls.piece(leg), self.walls.piece(leg + 1));
                (a.tangent(a.to) - b.tangent(b.from)).norm() <= 1e-2
            })
        };
        let wall = |leg: usize| self.passes.wall(None, leg, &self.walls.piece(leg));
        let ends = wall(first).zip(wall(last));
        let closes = ends.is_some_and(|(first, last)| (first.from - last.to).norm() <= GOUGE_MM);
        first != last
            && closes
            && low >= first
            && high <= last
            && is_straight(first, low)
            && is_straight(high, last)
    }
}

/// How far along its leg the tool is at a place of an element, mm. On an arc of more than one turn
/// it is counted from where the element begins.
fn foot(leg: &Piece, element: &Piece, at: Point) -> f64 {
    match (&leg.round, &element.round) {
        (Some(of_leg), Some(round)) if of_leg.sweep * round.sweep > 0.0 && round.radius > 0.0 => {
            // It begins late on its leg, or is lengthened by less than a quarter turn.
            let (a, b) = (leg.from - of_leg.center, element.from - of_leg.center);
            let begin = cross(a, b).atan2(a.dot(&b)) * of_leg.sweep.signum();
            let begin = if begin < -FRAC_PI_2 { begin + TAU } else { begin };
            (begin + element.along(at) / round.radius) * of_leg.radius
        }
        _ => leg.along(at),
    }
}

/// Merges cuts that hang together into one place, also where two walls are cut from both sides.
fn deepest_places(mut found: Vec<Found>) -> Vec<Found> {
    let kind = |it: &Found| (it.is_lead, it.is_nick, it.is_other_pass, it.is_forgiven);
    let depth = |found: &Found| found.radius_mm - found.near.distance;
    // Of equally deep cuts the first one counts, in whatever order they were found.
    let place = |found: &Found| (found.element, found.into);
    found.sort_by(|a, b| depth(b).total_cmp(&depth(a)).then(place(a).cmp(&place(b))));
    let mut places: Vec<(Found, [usize; 4])> = Vec::new();
    for cut in found {
        let within = |low: usize, high: usize, leg: usize| leg + 2 >= low && leg <= high + 2;
        let has_room = places.len() < PLACES_MAX;
        let known = places.iter_mut().find(|(deepest, [a, b, c, d])| {
            let same = within(*a, *b, cut.on) && within(*c, *d, cut.into);
            let turned = within(*c, *d, cut.on) && within(*a, *b, cut.into);
            let alike = kind(deepest) == kind(&cut);
            (same || turned) && alike
        });
        match known {
            Some((_, [a, b, c, d])) if within(*a, *b, cut.on) => {
                (*a, *b) = ((*a).min(cut.on), (*b).max(cut.on));
                (*c, *d) = ((*c).min(cut.into), (*d).max(cut.into));
            }
            Some((_, [a, b, c, d])) => {
                (*c, *d) = ((*c).min(cut.on), (*d).max(cut.on));
                (*a, *b) = ((*a).min(cut.into), (*b).max(cut.into));
            }
            None if has_room => {
                places.push((cut, [cut.on, cut.on, cut.into, cut.into]));
            }
            None => {}
        }
    }
    places.sort_by_key(|(cut, _)| (cut.on.max(cut.into), cut.on));
    places.into_iter().map(|(cut, _)| cut).collect()
}
