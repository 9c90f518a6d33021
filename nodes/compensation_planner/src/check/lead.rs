//! Whether a lead cuts into the contour that it leads to or from.
//!
//! Leads have rules of their own, and are checked against all walls of their span.

use crate::check::finding::{self, LeadCut};
use crate::check::interference::{self, Joined};
use crate::check::walls::Walls;
use crate::geometry::bounds::Bounds;
use crate::geometry::distance::{Nearest, nearest_between, nearest_on_element};
use crate::geometry::element::{Arc, Element, Vec2, cross};
use crate::geometry::frame::{height, in_work};
use crate::geometry::tolerance::{CHORD_TURN_RAD, GOUGE_MM, LENGTH_MM, LOOP_MM};
use crate::geometry::tree::budget;
use crate::span::chain::Role;
use crate::span::corner::PIECES;
use crate::span::{Lead, Run, Span};
use cnc_msgs::contour::{Approach, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::Plane;
use cnc_msgs::profile::Profile;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// The wall that a link leaves, and the tool path along it, for the check of the next span.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PreviousWall {
    pub wall: Element,
    pub path: Option<Element>,
    pub source: Source,
    /// The signed offset along it, mm.
    pub d_mm: f64,
}

/// The tool path between the programmed path and the contour: the move, and the corner between it and
/// the contour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LeadPath {
    /// Where the move starts; it is `None` if it ends there.
    from: Vec2,
    path: Option<Element>,
    corner: [Option<Element>; PIECES],
}

impl LeadPath {
    /// From `outside` to the contour; `None` where nothing leads to it.
    pub(crate) fn on(joined: &Joined<'_>, outside: Vec2) -> Option<Self> {
        let Joined { links, placed, corners } = *joined;
        let first = placed.first()?;
        let is_joined = links.role(first.link) == Role::Entry;
        let has_no_arc = !is_joined && corners.span.entry.arc.is_some();
        if has_no_arc || starts_past(joined).is_some() {
            // That is refused as such.
            return None;
        }
        let end = match corners.lines(links, placed, 1).filter(|_| is_joined) {
            Some(lines) => lines.before_end,
            None if is_joined => first.end,
            None => first.start,
        };
        let mut corner = if is_joined { corner(joined, 1) } else { [None; PIECES] };
        if let Some(place) = placed.get(1).filter(|_| is_joined && corner[0].is_none()) {
            corner[0] = interference::beyond(&links.at(place.link), place, false);
        }
        let arc = arc_on(joined).map(|(arc, _)| {
            let turns = (arc.sweep / TAU).floor() as u16;
            Element::arc(outside, end, arc.center, arc.turn > 0.0, turns)
        });
        let path = arc.unwrap_or_else(|| Element::line(outside, end));
        Some(Self { from: outside, path, corner })
    }

    fn straight(from: Vec2, to: Vec2, corner: [Option<Element>; PIECES]) -> Self {
        Self { from, path: Element::line(from, to), corner }
    }

    /// From the contour to `outside`.
    pub(crate) fn off(joined: &Joined<'_>, outside: Vec2) -> Option<Self> {
        let Joined { links, placed, corners } = *joined;
        let last = placed.last()?;
        if links.role(last.link) != Role::Exit {
            return Some(Self::straight(last.end, outside, [None; PIECES]));
        }
        let Some(index) = placed.len().checked_sub(2) else {
            return Some(Self::straight(last.start, outside, [None; PIECES]));
        };
        let mut corner = corner(joined, index);
        if corner[0].is_none() {
            corner[0] = interference::beyond(&links.at(placed[index].link), &placed[index], true);
        }
        let start = match corners.lines(links, placed, index) {
            // From the last line it leaves straight.
            Some(lines) => {
                corner[PIECES - 1] = None;
                lines.last()
            }
            None => last.start,
        };
        Some(Self::straight(start, outside, corner))
    }

    /// Its elements.
    pub(crate) fn elements(&self) -> impl Iterator<Item = Element> {
        self.corner.into_iter().flatten().chain(self.path)
    }

    /// How near its move comes to a wall.
    fn nearest(&self, wall: &Element) -> Nearest {
        match &self.path {
            Some(path) => nearest_between(path, wall),
            None => {
                let on_wall = nearest_on_element(wall, self.from);
                Nearest { distance: (on_wall - self.from).norm(), on_path: self.from, on_wall }
            }
        }
    }

    /// What it cuts, if nearer than `limit` mm. Where the lead passes above a run, only its corner
    /// can cut that run's wall.
    pub(crate) fn cuts(
        &self,
        walls: &Walls<'_>,
        free_end: Option<FreeEnd>,
        limit: f64,
        is_above: impl Fn(usize) -> bool,
    ) -> LeadCuts {
        let mut cuts = LeadCuts::default();
        for path in self.corner.iter().flatten() {
            cuts.gouge = nearer(cuts.gouge, deepest_cut(walls, path, None, limit, |_| true));
        }
        let Some(path) = self.path else { return cuts };
        let passed = free_end.map_or(Vec::new(), |end| end.passed(walls, &path, limit));
        let is_copy =
            |run: usize| free_end.is_some_and(|end| end.is_copy(walls, &path, limit, run));
        let counts = |run: usize| {
            !is_above(run) && passed.iter().all(|part| part.run != run) && !is_copy(run)
        };
        cuts.gouge = nearer(cuts.gouge, deepest_cut(walls, &path, None, limit, counts));
        for part in passed.iter().filter(|part| !is_above(part.run)) {
            let near = |wall: Element| (part.run, nearest_between(&path, &wall));
            let is_cut = |found: &(usize, Nearest)| found.1.distance < limit;
            cuts.gouge = nearer(cuts.gouge, part.rest.map(near).filter(is_cut));
            match part.passed.map(near).filter(is_cut) {
                Some(found) if found.1.distance < part.nearest_mm - LENGTH_MM => {
                    cuts.gouge = nearer(cuts.gouge, Some(found));
                }
                found => cuts.nick = nearer(cuts.nick, found),
            }
        }
        cuts
    }
}

type Found = Option<(usize, Nearest)>;

fn nearer(one: Found, other: Found) -> Found {
    one.into_iter().chain(other).min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))
}

/// What a lead cuts: for each kind the run of the deepest place, and how near the tool comes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct LeadCuts {
    pub gouge: Found,
    /// A cut into the free end of the contour and into nothing else.
    pub nick: Found,
}

/// The end of the contour that a lead leads to or from: before it there is only air.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FreeEnd {
    at: Vec2,
    is_start: bool,
}

/// A run at a free end, and the part of it that a lead passes over.
#[derive(Debug)]
struct Part {
    run: usize,
    passed: Option<Element>,
    rest: Option<Element>,
    /// How near the lead comes to the end.
    nearest_mm: f64,
}

impl FreeEnd {
    /// The start of the contour; `None` where that is a tail, which bounds nothing.
    pub(crate) fn first(walls: &Walls<'_>) -> Option<Self> {
        let at = walls.of(0)?.start();
        (at == walls.element(0).start()).then_some(Self { at, is_start: true })
    }

    /// The end of the contour.
    pub(crate) fn last(walls: &Walls<'_>) -> Option<Self> {
        let run = walls.count().checked_sub(1)?;
        let at = walls.of(run)?.end();
        (at == walls.element(run).end()).then_some(Self { at, is_start: false })
    }

    /// Whether the run near a lead is a copy of the wall that it leads to or from. Copies of a wall
    /// count as one. Rounded coordinates leave them less than the width of a loop apart, and the
    /// lead cuts no deeper.
    fn is_copy(&self, walls: &Walls<'_>, path: &Element, limit: f64, run: usize) -> bool {
        let own = if self.is_start { 0 } else { walls.count() - 1 };
        let (of, Some(wall)) = (walls.element(own), walls.of(run)) else { return false };
        if run == own || of.is_line() != wall.is_line() {
            return false;
        }
        let Nearest { distance, on_wall, .. } = nearest_between(path, &wall);
        let at = nearest_on_element(of, on_wall);
        let (along, along_wall) = (of.tangent_at(at), wall.tangent_at(on_wall));
        distance >= limit - LOOP_MM
            && (at - on_wall).norm() <= LOOP_MM
            && along.dot(&along_wall) > 0.0
            && cross(along, along_wall).abs() <= CHORD_TURN_RAD
    }

    /// What a lead passes over if it joins the contour one radius from its end. If it misses the
    /// perpendicular to that radius by the angle φ, it comes as near to the end as R cos φ. It
    /// comes nearer than R to whatever is within R tan φ/2 of the end, or twice that if the contour
    /// bends towards it.
    fn passed(&self, walls: &Walls<'_>, path: &Element, radius_mm: f64) -> Vec<Part> {
        let out = (path.start() - self.at).norm().min((path.end() - self.at).norm());
        let nearest_mm = (nearest_on_element(path, self.at) - self.at).norm();
        // A curve made of chords bends away from the lead at once: there they meet a little farther
        // out.
        let farthest_mm = radius_mm / (CHORD_TURN_RAD / 2.0).cos() + 2.0 * GOUGE_MM;
        if out > farthest_mm || nearest_mm >= radius_mm {
            return Vec::new();
        }
        let part = (radius_mm - nearest_mm) / (radius_mm + nearest_mm);
        let mut left_mm = 2.0 * radius_mm * part.sqrt();
        let mut parts = Vec::new();
        for index in 0..walls.count() {
            let run = if self.is_start { index } else { walls.count() - 1 - index };
            let Some(wall) = walls.of(run) else { break };
            let (passed, rest) = match self.is_start {
                true => (wall.before(left_mm), wall.after(left_mm)),
                false => {
                    let from = wall.length() - left_mm;
                    (wall.after(from), wall.before(from))
                }
            };
            parts.push(Part { run, passed, rest, nearest_mm });
            left_mm -= wall.length();
            if left_mm <= 0.0 {
                break;
            }
        }
        parts
    }
}

/// The path of a lead-on that is an arc, and how much of its end the contour takes away, mm.
pub(crate) fn arc_on(joined: &Joined<'_>) -> Option<(Arc, f64)> {
    let Joined { links, placed, corners } = *joined;
    let first = placed.first().filter(|first| links.role(first.link) == Role::Entry)?;
    let link = links.at(first.link);
    match link.element.offset(link.d_in_mm)? {
        Element::Arc(arc) if corners.span.entry.arc.is_some() => Some((arc, first.trim_out)),
        _ => None,
    }
}

/// Whether the contour takes away a lead-on that is an arc: the tool is past the contour's path where it
/// starts. Its length and what is taken away, mm.
pub(crate) fn starts_past(joined: &Joined<'_>) -> Option<(f64, f64)> {
    let (arc, taken_mm) = arc_on(joined)?;
    let length_mm = arc.radius * arc.sweep;
    (taken_mm >= length_mm - LENGTH_MM).then_some((length_mm, taken_mm))
}

/// The corner at this index, if it is one.
fn corner(joined: &Joined<'_>, index: usize) -> [Option<Element>; PIECES] {
    let Joined { links, placed, corners } = *joined;
    let mut pieces = [None; PIECES];
    match placed.get(index) {
        Some(place) if matches!(links.role(place.link), Role::Corner { .. }) => {
            match corners.pieces(links, placed, index) {
                Some(lines) => pieces = lines,
                None => pieces[0] = interference::element(&links.at(place.link), place),
            }
        }
        _ => {}
    }
    pieces
}

/// The wall nearest to a path, if nearer than `limit` mm, among runs that count; `on` is the place
/// of the run that the path follows.
pub(crate) fn deepest_cut(
    walls: &Walls<'_>,
    path: &Element,
    on: Option<(usize, f64)>,
    limit: f64,
    counts: impl Fn(usize) -> bool,
) -> Option<(usize, Nearest)> {
    if limit <= 0.0 {
        return None;
    }
    let bounds = Bounds::of(path);
    let mut deepest: Option<(usize, Nearest)> = None;
    walls.tree().near_box(&bounds, limit, &mut budget(walls.count()), |into| {
        for run in into {
            let whole = walls.element(run);
            // Cheap tests first.
            if bounds.gap_squared(&Bounds::of(whole)) >= limit * limit
                || !counts(run)
                || nearest_between(path, whole).distance >= limit
            {
                continue;
            }
            let Some(wall) = walls.seen_from(on, run) else { continue };
            let near = nearest_between(path, &wall);
            let is_deepest = deepest.is_none_or(|(_, other)| near.distance < other.distance);
            if near.distance < limit && is_deepest {
                deepest = Some((run, near));
            }
        }
        ControlFlow::Continue(())
    });
    deepest
}

/// What every check of a lead needs.
pub(crate) struct Check<'a> {
    pub profile: &'a Profile,
    pub plane: Plane,
    pub walls: &'a Walls<'a>,
    pub findings: &'a mut Vec<Finding>,
}

impl Check<'_> {
    /// Checks the lead-on or link, from where the tool was to where compensation begins.
    pub(crate) fn lead_on(
        &mut self,
        span: &Span<'_>,
        runs: &[Run],
        path: &LeadPath,
        previous_wall: Option<PreviousWall>,
    ) {
        let lead = &span.entry.lead;
        let code = if span.entry.is_link { Code::LinkGouge } else { Code::LeadGouge };
        let free_end = FreeEnd::first(self.walls).filter(|_| !span.entry.is_link);
        self.span(code, (span, runs), (path, span.d_mm, free_end), lead);
        if let Some(previous) = previous_wall {
            let near = path.nearest(&previous.wall);
            if near.distance < previous.d_mm.abs() - GOUGE_MM {
                self.report(Code::LinkGouge, near, previous.d_mm, lead, previous.source);
            }
        }
    }

    /// Checks the lead-off, from the end of the contour.
    pub(crate) fn lead_off(&mut self, span: &Span<'_>, runs: &[Run], path: &LeadPath, lead: &Lead) {
        let free_end = FreeEnd::last(self.walls);
        self.span(Code::LeadGouge, (span, runs), (path, span.d_out_mm, free_end), lead);
    }

    /// Checks the paths along the last block on one side and the first on the other (O02): each may
    /// cut into what the other follows.
    pub(crate) fn change_of_side(
        &mut self,
        span: &Span<'_>,
        path: Option<Element>,
        from: PreviousWall,
    ) {
        let to = &span.legs[0];
        let pairs = [
            (from.path, self.walls.of(0), from.d_mm, from.source, to.source),
            (path, Some(from.wall), span.d_mm, to.source, from.source),
        ];
        for (path, wall, d_mm, source, other) in pairs {
            let Some(near) = path.zip(wall).map(|(path, wall)| nearest_between(&path, &wall))
            else {
                continue;
            };
            if near.distance < d_mm.abs() - GOUGE_MM {
                let at = in_work(self.plane, near.on_wall, height(self.plane, to.motion.end));
                let what = "change of side";
                let code = Code::LinkGouge;
                let distance_mm = near.distance;
                let is_straight = true;
                let cut = LeadCut { code, what, source, other, at, d_mm, distance_mm, is_straight };
                self.findings.push(finding::lead_cut(&cut, self.profile));
            }
        }
    }

    /// Checks the part by which a change of side lengthens the last arc, or the first: it belongs
    /// to the change, and may cut into the walls of the span.
    pub(crate) fn beyond(&mut self, span: &Span<'_>, runs: &[Run], path: &Element, run: usize) {
        let d_mm = if run == 0 { span.d_mm } else { span.d_out_mm };
        let limit = d_mm.abs() - GOUGE_MM;
        let cut = deepest_cut(self.walls, path, None, limit, |into| into != run);
        let Some((into, near)) = cut else { return };
        let leg = |run: usize| span.legs[runs[run].legs.end - 1];
        let cut = LeadCut {
            code: Code::LinkGouge,
            what: "change of side",
            source: leg(run).source,
            other: leg(into).source,
            at: in_work(self.plane, near.on_wall, height(self.plane, leg(run).motion.end)),
            d_mm,
            distance_mm: near.distance,
            is_straight: true,
        };
        self.findings.push(finding::lead_cut(&cut, self.profile));
    }

    /// What the check of the next span needs of a link at the end of this one.
    pub(crate) fn last_wall(
        &self,
        span: &Span<'_>,
        runs: &[Run],
        path: Option<Element>,
    ) -> Option<PreviousWall> {
        let last = runs.last()?;
        let source = span.legs[last.legs.end - 1].source;
        Some(PreviousWall { wall: last.element, path, source, d_mm: span.d_out_mm })
    }

    fn span(
        &mut self,
        code: Code,
        (span, runs): (&Span<'_>, &[Run]),
        (path, d_mm, free_end): (&LeadPath, f64, Option<FreeEnd>),
        lead: &Lead,
    ) {
        let limit = d_mm.abs() - GOUGE_MM;
        let mut cuts = path.cuts(self.walls, free_end, limit, |_| false);
        if cuts.gouge.is_some() || cuts.nick.is_some() {
            let below = Below::of(span, runs, self.walls, lead, self.profile);
            cuts = path.cuts(self.walls, free_end, limit, |run| below.is(self.walls, run));
        }
        let is_deep = |(_, near): &(usize, Nearest)| {
            d_mm.abs() - near.distance > self.profile.accept_tolerance_mm
        };
        let gouge = cuts.gouge.map(|gouge| (code, gouge));
        let nick = cuts.nick.filter(is_deep).map(|nick| (Code::LeadNick, nick));
        if let Some((code, (run, near))) = gouge.or(nick) {
            let other = span.legs[runs[run].legs.start].source;
            self.report(code, near, d_mm, lead, other);
        }
    }

    fn report(&mut self, code: Code, near: Nearest, d_mm: f64, lead: &Lead, other: Source) {
        let cut = LeadCut {
            code,
            what: if code == Code::LinkGouge { "link" } else { "lead" },
            source: lead.source,
            other,
            at: in_work(self.plane, near.on_wall, height(self.plane, lead.motion.end)),
            d_mm,
            distance_mm: near.distance,
            is_straight: lead.approach == Approach::Normal,
        };
        self.findings.push(finding::lead_cut(&cut, self.profile));
    }
}

/// The passes of a span that a lead is above, all along them.
#[derive(Debug)]
pub(crate) struct Below(Vec<bool>);

impl Below {
    pub(crate) fn of(
        span: &Span<'_>,
        runs: &[Run],
        walls: &Walls<'_>,
        lead: &Lead,
        profile: &Profile,
    ) -> Self {
        let at = |position| height(span.plane, position);
        let lowest = at(lead.start).min(at(lead.motion.end));
        let heights = span.leg_heights();
        let mut is_below = vec![lowest > profile.interference.stock_top_mm; walls.passes()];
        for (index, run) in runs.iter().enumerate() {
            let highest =
                heights[run.legs.clone()].iter().fold(f64::NEG_INFINITY, |a, b| a.max(b.1));
            is_below[walls.pass(index)] &= lowest > highest;
        }
        Self(is_below)
    }

    /// Whether the lead is above the wall of a run.
    pub(crate) fn is(&self, walls: &Walls<'_>, run: usize) -> bool {
        walls.copies(run).all(|copy| self.0[walls.pass(copy)])
    }
}
