//! How near the path comes to the walls of its pass: the exact distance, everywhere.

use super::apart;
use super::bounds::Bounds;
use super::pieces::{Chains, Pieces};
use super::planar::{Near, Piece, Point, cross, nearest};
use super::program::{Kind, NONE};
use super::report::{self, Cut, Report};
use super::spans::Span;
use super::strip::{self, StripTree};
use super::way::Way;
use cnc_msgs::diagnostic::Code;
use cnc_msgs::geometry::Position;
use cnc_msgs::path::Role;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// How much nearer than its radius the tool may be, mm.
pub(super) const GOUGE_MM: f64 = 1e-4;
/// Cuts that are kept of a span; what is cut everywhere needs no more.
const CUTS_MAX: usize = 20_000;
/// Places of a span that are told.
const PLACES_MAX: usize = 100;

/// The tool on an element comes too near to a leg.
#[derive(Debug, Clone, Copy)]
struct Found {
    element: usize,
    /// The leg it follows and the one it cuts, in the span.
    on: usize,
    into: usize,
    near: Near,
    radius_mm: f64,
    is_other_pass: bool,
    /// The element is a lead, which is judged apart.
    is_lead: bool,
}

pub(super) fn check(
    way: &Way<'_>,
    chains: &Chains<'_>,
    nearest_mm: &mut Option<f64>,
    report: &mut Report<'_>,
) {
    let Chains { span, legs: walls, elements, .. } = chains;
    let legs = chains.blocks();
    let offset = |leg: u32| way.program.offset(leg);
    let reach = legs.iter().fold(0.0_f64, |reach, &leg| {
        reach.max(offset(leg).d_in.abs()).max(offset(leg).d_out.abs())
    });
    if reach <= GOUGE_MM {
        return;
    }
    let first = way.program.source(legs[0]);
    let wall_tree = StripTree::new(walls).with_fans();
    let Some(bounds) = Bounds::of(&wall_tree) else {
        report.push(report::too_entangled(first));
        return;
    };
    let slack = |&leg: &u32| {
        let block = &way.program.blocks[leg as usize];
        // Nothing comes too near to what is lost.
        if block.is_lost { f32::INFINITY } else { block.slack_mm }
    };
    let slacks = legs.iter().map(slack).collect();
    let mut search = Search {
        way,
        span,
        all_legs: chains.all_legs,
        legs,
        walls,
        slacks,
        bounds,
        found: Vec::new(),
    };
    let tools = search.tools();
    let tree = StripTree::new(elements);
    let on_way = strip::near(&tree, &wall_tree, reach - GOUGE_MM, |on, into| {
        for element in on {
            search.tool((elements, span.elements.start), element, &tools[element], into.clone());
        }
        search.found.len() < CUTS_MAX
    });
    if !on_way {
        report.push(report::too_entangled(first));
    }
    for lead in [span.lead_on, span.lead_off].into_iter().flatten() {
        let elements = Pieces::new(std::iter::once(way.piece(lead)));
        let tool = search.lead(lead);
        let tree = StripTree::new(&elements);
        strip::near(&tree, &wall_tree, reach - GOUGE_MM, |_, into| {
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

/// How near the tool may come to walls while it is on an element.
#[derive(Debug, Clone, Copy)]
struct Tool {
    /// The leg it follows or leads to, in the span; [`NONE`]: it need not keep away.
    on: u32,
    /// Its own leg.
    own: u32,
    /// Without what merging and acceptance took beside it.
    limit_mm: f64,
}

struct Search<'a> {
    way: &'a Way<'a>,
    span: &'a Span,
    all_legs: &'a [u32],
    legs: &'a [u32],
    walls: &'a Pieces,
    /// How far the path may be off beside each leg.
    slacks: Vec<f32>,
    bounds: Bounds,
    found: Vec<Found>,
}

impl Search<'_> {
    /// Of all elements of the span.
    fn tools(&self) -> Vec<Tool> {
        let mut on = 0;
        let tool = |element: usize| {
            let role = self.way.roles[element];
            let block = self.way.of[element];
            let is_judged = matches!(role, Role::Contour | Role::Corner) && block != NONE;
            let (mut limit_mm, mut own) = (0.0, NONE);
            if is_judged {
                let slack = self.way.program.blocks[block as usize].slack_mm;
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

    /// Of the tool on an element.
    fn radius_mm(&self, element: usize) -> f64 {
        let block = self.way.of[element];
        match self.way.roles[element] {
            // A corner runs at the radius before it; a leg that changes it has both.
            Role::Corner => self.span.offset(self.way, self.all_legs, block).d_in.abs(),
            Role::Contour => {
                let offset = self.span.offset(self.way, self.all_legs, block);
                offset.d_in.abs().min(offset.d_out.abs())
            }
            _ if self.span.lead_on == Some(element) => {
                self.way.program.offset(self.legs[0]).d_in.abs()
            }
            _ => self.way.program.offset(self.legs[self.legs.len() - 1]).d_out.abs(),
        }
    }

    fn lead(&self, element: usize) -> Tool {
        let leads_on = self.span.lead_on == Some(element);
        let leg = if leads_on { 0 } else { self.legs.len() - 1 };
        let own = if self.way.of[element] == self.legs[leg] { leg as u32 } else { NONE };
        Tool { on: leg as u32, own, limit_mm: self.radius_mm(element) - GOUGE_MM }
    }

    /// The tool on one of some elements, beside some walls.
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
            let limit = tool.limit_mm - f64::from(self.slacks[leg]);
            let bow_of_leg = self.walls.bow(leg);
            let is_own_line = leg == tool.own as usize && bow_of_leg.is_none();
            if !is_own_line && !apart::pieces(chord, bow, self.walls.chord(leg), bow_of_leg, limit)
            {
                self.measure(&elements.piece(index), (first + index, tool), leg, limit);
            }
        }
    }

    /// The exact distance.
    #[cold]
    fn measure(&mut self, piece: &Piece, (element, tool): (usize, &Tool), leg: usize, limit: f64) {
        let role = self.way.roles[element];
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

    /// An element between what it is lengthened by at outside corners with the leads: that is
    /// part of them.
    fn without_leads(&self, piece: &Piece, tool: &Tool) -> [Option<Piece>; 3] {
        let own = tool.own as usize;
        let is_first = own == 0 && self.span.lead_on.is_some() && !self.span.from_side;
        let is_last =
            own + 1 == self.legs.len() && self.span.lead_off.is_some() && !self.span.to_side;
        if tool.own == NONE || !piece.is_line() || !(is_first || is_last) {
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
        if !self.bounds.is_whole(leg) {
            let foot = foot(&self.walls.piece(on), piece, piece.nearest(near.on_b));
            let beside = (!is_lead).then_some((on, foot));
            let Some(wall) = self.bounds.wall(beside, leg, &whole) else { return };
            near = nearest(piece, &wall);
            if near.distance >= limit {
                return;
            }
        }
        let is_other_pass = self.bounds.pass(on) != self.bounds.pass(leg);
        if is_other_pass && !is_lead && self.bounds.leads_away(self.walls, leg) {
            return;
        }
        self.found.push(Found {
            element,
            on,
            into: leg,
            near,
            radius_mm: self.radius_mm(element),
            is_other_pass,
            is_lead,
        });
    }

    fn cut(&self, found: &Found) -> Cut {
        let way = self.way;
        let element = &way.path.elements[found.element];
        let block = way.of[found.element];
        let kind = way.program.blocks[block as usize].kind;
        let code = match element.role {
            Role::Link => Code::LinkGouge,
            _ if kind == Kind::Link => Code::LinkGouge,
            Role::LeadOn | Role::LeadOff => Code::LeadGouge,
            _ if found.is_lead => Code::LeadGouge,
            _ if found.is_other_pass => Code::CutsOtherPass,
            _ => Code::Gouge,
        };
        let into = self.legs[found.into];
        let offset = way.program.offset(self.legs[found.on]);
        let is_lead = matches!(code, Code::LeadGouge | Code::LinkGouge);
        Cut {
            code,
            on: element.source,
            into: way.program.source(into),
            legs_apart: found.on.abs_diff(found.into),
            at: self.position(found, into),
            plane: offset.plane,
            radius_mm: found.radius_mm,
            distance_mm: found.near.distance,
            is_excused: offset.is_negative && (is_lead || self.is_at_ends(found)),
        }
    }

    /// Whether an element is a corner between a lead and the contour: it is judged with the lead,
    /// and a tail bounds neither.
    fn is_of_lead(&self, element: usize) -> bool {
        let block = self.way.of[element];
        self.way.roles[element] == Role::Corner
            && self.span.elements.start <= element
            && (block == self.legs[0] || self.way.program.blocks[block as usize].kind != Kind::Leg)
    }

    fn position(&self, found: &Found, into: u32) -> Position {
        let plane = self.way.program.offset(into).plane;
        let [u, v, w] = plane.axes();
        let mut at = self.way.program.motion(into).end;
        (at[u], at[v]) = (found.near.on_b.x, found.near.on_b.y);
        at[w] = self.way.path.elements[found.element].end[w];
        at
    }

    /// Whether the cut is between what the walls of a pass begin with and what they end with.
    fn is_at_ends(&self, found: &Found) -> bool {
        let Some((first, last)) = self.bounds.ends(found.on) else { return false };
        let (low, high) = (found.on.min(found.into), found.on.max(found.into));
        let is_straight = |from: usize, to: usize| {
            (from..to).all(|leg| {
                let (a, b) = (self.walls.piece(leg), self.walls.piece(leg + 1));
                (a.tangent(a.to) - b.tangent(b.from)).norm() <= 1e-2
            })
        };
        first != last
            && low >= first
            && high <= last
            && is_straight(first, low)
            && is_straight(high, last)
    }
}

/// How far along its leg the tool is at a place of an element, mm: of arcs that go around more
/// than once counted from where the element begins.
fn foot(leg: &Piece, element: &Piece, at: Point) -> f64 {
    match (&leg.round, &element.round) {
        (Some(of_leg), Some(round)) if of_leg.sweep * round.sweep > 0.0 && round.radius > 0.0 => {
            // It begins late on its leg, or is lengthened by less than a quarter of a turn.
            let (a, b) = (leg.from - of_leg.center, element.from - of_leg.center);
            let begin = cross(a, b).atan2(a.dot(&b)) * of_leg.sweep.signum();
            let begin = if begin < -FRAC_PI_2 { begin + TAU } else { begin };
            (begin + element.along(at) / round.radius) * of_leg.radius
        }
        _ => leg.along(at),
    }
}

/// Cuts that hang together are one place, and so is a pair of walls that is cut from both.
fn deepest_places(mut found: Vec<Found>) -> Vec<Found> {
    let depth = |found: &Found| found.radius_mm - found.near.distance;
    // Of what is as deep the first, in whatever order it was found.
    let place = |found: &Found| (found.element, found.into);
    found.sort_by(|a, b| depth(b).total_cmp(&depth(a)).then(place(a).cmp(&place(b))));
    let mut places: Vec<(Found, [usize; 4])> = Vec::new();
    for cut in found {
        let within = |low: usize, high: usize, leg: usize| leg + 2 >= low && leg <= high + 2;
        let has_room = places.len() < PLACES_MAX;
        let known = places.iter_mut().find(|(deepest, [a, b, c, d])| {
            let same = within(*a, *b, cut.on) && within(*c, *d, cut.into);
            let turned = within(*c, *d, cut.on) && within(*a, *b, cut.into);
            let alike =
                (deepest.is_lead, deepest.is_other_pass) == (cut.is_lead, cut.is_other_pass);
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
