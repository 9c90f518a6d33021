//! How near the path comes to the walls of its pass: the exact distance, everywhere.

use super::bounds::Bounds;
use super::planar::{Near, Piece, Point, nearest};
use super::program::Kind;
use super::report::{self, Cut, Report};
use super::spans::Span;
use super::strip::{self, Chain, StripTree};
use super::way::Way;
use cnc_msgs::diagnostic::Code;
use cnc_msgs::geometry::Position;
use cnc_msgs::path::Role;

/// How much nearer than its radius the tool may be, mm.
pub(super) const GOUGE_MM: f64 = 1e-4;
/// Cuts that are kept of a span; what is cut everywhere needs no more.
const CUTS_MAX: usize = 20_000;
/// Places of a span that are told.
const PLACES_MAX: usize = 100;

struct Legs<'a> {
    way: &'a Way<'a>,
    legs: &'a [u32],
}

impl Chain for Legs<'_> {
    fn count(&self) -> usize {
        self.legs.len()
    }
    fn piece(&self, index: usize) -> Piece {
        self.way.leg(self.legs[index])
    }
    fn begin(&self, index: usize) -> Point {
        self.way.program.ends(self.legs[index]).0
    }
    fn end(&self, index: usize) -> Point {
        self.way.program.ends(self.legs[index]).1
    }
}

struct Elements<'a> {
    way: &'a Way<'a>,
    first: usize,
    count: usize,
}

impl Chain for Elements<'_> {
    fn count(&self) -> usize {
        self.count
    }
    fn piece(&self, index: usize) -> Piece {
        self.way.piece(self.first + index)
    }
    fn begin(&self, index: usize) -> Point {
        self.way.start(self.first + index)
    }
    fn end(&self, index: usize) -> Point {
        self.way.end(self.first + index)
    }
}

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
    span: &Span,
    all_legs: &[u32],
    nearest_mm: &mut Option<f64>,
    report: &mut Report<'_>,
) {
    let legs = Legs { way, legs: &all_legs[span.legs.clone()] };
    let offset = |leg: u32| way.program.offset(leg);
    let reach = legs.legs.iter().fold(0.0_f64, |reach, &leg| {
        reach.max(offset(leg).d_in.abs()).max(offset(leg).d_out.abs())
    });
    if reach <= GOUGE_MM {
        return;
    }
    let first = way.program.source(legs.legs[0]);
    let leg_tree = StripTree::new(&legs);
    let Some(bounds) = Bounds::of(&legs, &leg_tree) else {
        report.push(report::too_entangled(first));
        return;
    };
    let mut search =
        Search { way, span, all_legs, legs: &legs, bounds: &bounds, found: Vec::new() };
    let elements = Elements {
        way,
        first: span.elements.start,
        count: span.elements.end - span.elements.start,
    };
    let tree = StripTree::new(&elements);
    let on_way =
        strip::near((&elements, &tree), (&legs, &leg_tree), reach - GOUGE_MM, |on, into| {
            for element in on {
                search.element(span.elements.start + element, into.clone());
            }
            search.found.len() < CUTS_MAX
        });
    if !on_way {
        report.push(report::too_entangled(first));
    }
    for lead in [span.lead_on, span.lead_off].into_iter().flatten() {
        let way_of_it = Elements { way, first: lead, count: 1 };
        let tree = StripTree::new(&way_of_it);
        strip::near((&way_of_it, &tree), (&legs, &leg_tree), reach - GOUGE_MM, |_, into| {
            search.lead(lead, into);
            true
        });
    }
    let found = std::mem::take(&mut search.found);
    for found in deepest_places(found) {
        if found.near.distance < nearest_mm.unwrap_or(f64::INFINITY) {
            *nearest_mm = Some(found.near.distance);
        }
        report.push(report::cut(&search.cut(&found), report.profile));
    }
}

struct Search<'a> {
    way: &'a Way<'a>,
    span: &'a Span,
    all_legs: &'a [u32],
    legs: &'a Legs<'a>,
    bounds: &'a Bounds,
    found: Vec<Found>,
}

impl Search<'_> {
    /// The leg, in the span, that an element follows or leads to.
    fn leg_of(&self, element: usize) -> usize {
        let block = self.way.of[element];
        let index = self.legs.legs.partition_point(|&leg| leg < block);
        index.min(self.legs.legs.len() - 1)
    }

    fn element(&mut self, element: usize, into: std::ops::Range<usize>) {
        let role = self.way.path.elements[element].role;
        if !matches!(role, Role::Contour | Role::Corner) {
            return;
        }
        let block = self.way.of[element];
        let offset = self.span.offset(self.way, self.all_legs, block);
        // A corner runs at the radius before it; a leg that changes it has both.
        let radius_mm = match role {
            Role::Corner => offset.d_in.abs(),
            _ => offset.d_in.abs().min(offset.d_out.abs()),
        };
        let slack = f64::from(self.way.program.blocks[block as usize].slack_mm);
        let on = self.leg_of(element);
        self.piece(element, on, radius_mm, slack, into);
    }

    fn lead(&mut self, element: usize, into: std::ops::Range<usize>) {
        let leads_on = self.span.lead_on == Some(element);
        let leg = if leads_on { 0 } else { self.legs.legs.len() - 1 };
        let offset = self.way.program.offset(self.legs.legs[leg]);
        let radius_mm = if leads_on { offset.d_in } else { offset.d_out }.abs();
        self.piece(element, leg, radius_mm, 0.0, into);
    }

    fn piece(
        &mut self,
        element: usize,
        on: usize,
        radius_mm: f64,
        slack: f64,
        into: std::ops::Range<usize>,
    ) {
        let piece = self.way.piece(element);
        let own = self.way.of[element];
        for leg in into {
            let number = self.legs.legs[leg];
            let block = &self.way.program.blocks[number as usize];
            let limit = radius_mm - GOUGE_MM - slack - f64::from(block.slack_mm);
            if limit <= 0.0 || block.is_lost {
                continue;
            }
            let whole = self.legs.piece(leg);
            if number == own && whole.is_line() {
                continue;
            }
            let mut near = nearest(&piece, &whole);
            if near.distance >= limit {
                continue;
            }
            if !self.bounds.is_whole(leg) {
                let Some(wall) = self.bounds.wall(leg, &whole) else { continue };
                near = nearest(&piece, &wall);
                if near.distance >= limit {
                    continue;
                }
            }
            let is_other_pass = self.bounds.pass(on) != self.bounds.pass(leg);
            let role = self.way.path.elements[element].role;
            let is_lead = !matches!(role, Role::Contour | Role::Corner);
            self.found.push(Found {
                element,
                on,
                into: leg,
                near,
                radius_mm,
                is_other_pass,
                is_lead,
            });
        }
    }

    fn cut(&self, found: &Found) -> Cut {
        let way = self.way;
        let element = &way.path.elements[found.element];
        let block = way.of[found.element];
        let kind = way.program.blocks[block as usize].kind;
        let first = self.legs.legs[0];
        // Corners of the leads are judged with them.
        let is_before = self.span.elements.start <= found.element
            && element.role == Role::Corner
            && (block == first || kind != Kind::Leg);
        let code = match element.role {
            Role::Link => Code::LinkGouge,
            _ if kind == Kind::Link => Code::LinkGouge,
            Role::LeadOn | Role::LeadOff => Code::LeadGouge,
            _ if is_before => Code::LeadGouge,
            _ if found.is_other_pass => Code::CutsOtherPass,
            _ => Code::Gouge,
        };
        let into = self.legs.legs[found.into];
        let offset = way.program.offset(self.legs.legs[found.on]);
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
                let (a, b) = (self.legs.piece(leg), self.legs.piece(leg + 1));
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

/// Cuts that hang together are one place, and so is a pair of walls that is cut from both.
fn deepest_places(mut found: Vec<Found>) -> Vec<Found> {
    let depth = |found: &Found| found.radius_mm - found.near.distance;
    found.sort_by(|a, b| depth(b).total_cmp(&depth(a)).then(a.element.cmp(&b.element)));
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
