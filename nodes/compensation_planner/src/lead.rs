//! Whether a lead cuts into the contour that it leads to or from.
//!
//! Leads are judged apart from their span, against all of its walls.

use crate::chain::Role;
use crate::compensate::WallBehind;
use crate::corner::PIECES;
use crate::distance::{Nearest, nearest, nearest_on_way};
use crate::element::{Element, Vec2};
use crate::finding::{self, LeadCut};
use crate::frame::{height, in_work};
use crate::interference::{self, Joined};
use crate::span::{Lead, Run, Span};
use crate::tolerance::GOUGE_MM;
use crate::tree::{Bounds, NO_CHAIN, Tree, budget};
use crate::walls::Walls;
use cnc_msgs::contour::Source;
use cnc_msgs::diagnostic::{Code, Diagnostic};
use cnc_msgs::geometry::Plane;
use cnc_msgs::profile::Profile;
use std::ops::ControlFlow;

/// The way of the tool between the programmed path and the contour: the straight
/// move, and the corner between it and the contour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Way {
    straight: (Vec2, Vec2),
    corner: [Option<Element>; PIECES],
}

impl Way {
    /// From `outside` to the contour; `None` where nothing leads to it.
    pub(crate) fn on(joined: &Joined<'_>, outside: Vec2) -> Option<Self> {
        let Joined { links, placed, corners } = *joined;
        let first = placed.first()?;
        let is_joined = links[first.link].role == Role::Entry;
        let end = match corners.lines(links, placed, 1).filter(|_| is_joined) {
            Some(lines) => lines.before_end,
            None if is_joined => first.end,
            None => first.start,
        };
        let corner = if is_joined { corner(joined, 1) } else { [None; PIECES] };
        Some(Self { straight: (outside, end), corner })
    }

    /// From the contour to `outside`.
    pub(crate) fn off(joined: &Joined<'_>, outside: Vec2) -> Option<Self> {
        let Joined { links, placed, corners } = *joined;
        let last = placed.last()?;
        if links[last.link].role != Role::Exit {
            return Some(Self { straight: (last.end, outside), corner: [None; PIECES] });
        }
        let Some(index) = placed.len().checked_sub(2) else {
            return Some(Self { straight: (last.start, outside), corner: [None; PIECES] });
        };
        let mut corner = corner(joined, index);
        let start = match corners.lines(links, placed, index) {
            // From the last line it goes straight outside.
            Some(lines) => {
                corner[PIECES - 1] = None;
                lines.last()
            }
            None => last.start,
        };
        Some(Self { straight: (start, outside), corner })
    }

    /// The wall that it comes nearest to, if nearer than `limit` mm.
    pub(crate) fn deepest_cut(&self, walls: &Walls<'_>, limit: f64) -> Option<(usize, Nearest)> {
        let straight = Element::line(self.straight.0, self.straight.1);
        let ways = straight.into_iter().chain(self.corner.into_iter().flatten());
        let cuts = ways.filter_map(|way| deepest_cut(walls, &way, None, limit, |_| true));
        cuts.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))
    }
}

/// What is placed there, if it is a corner.
fn corner(joined: &Joined<'_>, index: usize) -> [Option<Element>; PIECES] {
    let Joined { links, placed, corners } = *joined;
    let mut pieces = [None; PIECES];
    match placed.get(index) {
        Some(place) if matches!(links[place.link].role, Role::Corner { .. }) => {
            match corners.pieces(links, placed, index) {
                Some(lines) => pieces = lines,
                None => pieces[0] = interference::element(&links[place.link], place),
            }
        }
        _ => {}
    }
    pieces
}

/// The wall that a way comes nearest to, if nearer than `limit` mm, of runs that count; `on`
/// is the place of the run that it is along.
pub(crate) fn deepest_cut(
    walls: &Walls<'_>,
    way: &Element,
    on: Option<(usize, f64)>,
    limit: f64,
    counts: impl Fn(usize) -> bool,
) -> Option<(usize, Nearest)> {
    if limit <= 0.0 {
        return None;
    }
    let bounds = Bounds::of(way);
    let tree = Tree::new(std::iter::once((bounds, NO_CHAIN)));
    let mut deepest: Option<(usize, Nearest)> = None;
    tree.near_pairs(walls.tree(), limit, budget(walls.count()), |_, into| {
        for run in into.filter(|&run| counts(run)) {
            let whole = walls.element(run);
            // The quick looks first.
            if bounds.gap_squared(&Bounds::of(whole)) >= limit * limit
                || nearest_on_way(way, whole).distance >= limit
            {
                continue;
            }
            let Some(wall) = walls.seen_from(on, run) else { continue };
            let near = nearest_on_way(way, &wall);
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
    pub diagnostics: &'a mut Vec<Diagnostic>,
}

impl Check<'_> {
    /// The lead-on or link, from where the tool was to where compensation begins.
    pub(crate) fn lead_on(
        &mut self,
        span: &Span<'_>,
        runs: &[Run],
        way: &Way,
        behind: Option<WallBehind>,
    ) {
        let lead = &span.entry.lead;
        let code = if span.entry.is_link { Code::LinkGouge } else { Code::LeadGouge };
        self.span(code, span, runs, way, span.d_mm, lead);
        if let Some(behind) = behind {
            let near = nearest(way.straight.0, way.straight.1, &behind.wall);
            if near.distance < behind.d_mm.abs() - GOUGE_MM {
                let negative = span.is_negative;
                self.report(Code::LinkGouge, near, behind.d_mm, lead, behind.source, negative);
            }
        }
    }

    /// The lead-off, from the end of the contour.
    pub(crate) fn lead_off(&mut self, span: &Span<'_>, runs: &[Run], way: &Way, lead: &Lead) {
        self.span(Code::LeadGouge, span, runs, way, span.d_out_mm, lead);
    }

    /// The ways along the last block on one side and the first on the other (O02):
    /// each may cut into what the other follows.
    pub(crate) fn change_of_side(
        &mut self,
        span: &Span<'_>,
        way: Option<Element>,
        from: WallBehind,
    ) {
        let to = &span.legs[0];
        let pairs = [
            (from.way, self.walls.of(0), from.d_mm, from.source, to.source),
            (way, Some(from.wall), span.d_mm, to.source, from.source),
        ];
        for (way, wall, d_mm, source, other) in pairs {
            let Some(near) = way.zip(wall).map(|(way, wall)| nearest_on_way(&way, &wall)) else {
                continue;
            };
            if near.distance < d_mm.abs() - GOUGE_MM {
                let at = in_work(self.plane, near.on_wall, height(self.plane, to.motion.end));
                let what = "change of side";
                let code = Code::LinkGouge;
                let (distance_mm, is_negative) = (near.distance, span.is_negative);
                let cut = LeadCut { code, what, source, other, at, d_mm, distance_mm, is_negative };
                self.diagnostics.push(finding::lead_cut(&cut, self.profile));
            }
        }
    }

    /// What a link at the end of the span will be checked against.
    pub(crate) fn wall_behind(
        &self,
        span: &Span<'_>,
        runs: &[Run],
        way: Option<Element>,
    ) -> Option<WallBehind> {
        let last = runs.last()?;
        let source = span.legs[last.legs.end - 1].source;
        Some(WallBehind { wall: last.element, way, source, d_mm: span.d_out_mm })
    }

    fn span(
        &mut self,
        code: Code,
        span: &Span<'_>,
        runs: &[Run],
        way: &Way,
        d_mm: f64,
        lead: &Lead,
    ) {
        let limit = d_mm.abs() - GOUGE_MM;
        if let Some((run, near)) = way.deepest_cut(self.walls, limit) {
            let other = span.legs[runs[run].legs.start].source;
            self.report(code, near, d_mm, lead, other, span.is_negative);
        }
    }

    fn report(
        &mut self,
        code: Code,
        near: Nearest,
        d_mm: f64,
        lead: &Lead,
        other: Source,
        is_negative: bool,
    ) {
        let cut = LeadCut {
            code,
            what: if code == Code::LinkGouge { "link" } else { "lead" },
            source: lead.source,
            other,
            at: in_work(self.plane, near.on_wall, height(self.plane, lead.motion.end)),
            d_mm,
            distance_mm: near.distance,
            is_negative,
        };
        self.diagnostics.push(finding::lead_cut(&cut, self.profile));
    }
}
