//! Whether a lead cuts into the contour that it leads to or from.
//!
//! Leads are judged apart from their span, against all of its walls.

use crate::compensate::WallBehind;
use crate::distance::{Nearest, nearest, nearest_on_way};
use crate::element::{Element, Vec2};
use crate::finding::{self, LeadCut};
use crate::frame::{height, in_work};
use crate::span::{Lead, Run, Span};
use crate::tolerance::GOUGE_MM;
use crate::tree::{Bounds, NO_CHAIN, Tree};
use crate::walls::{Walls, budget};
use cnc_msgs::contour::Source;
use cnc_msgs::diagnostic::{Code, Diagnostic};
use cnc_msgs::geometry::Plane;
use cnc_msgs::profile::Profile;
use std::ops::ControlFlow;

/// The wall that a straight move comes nearest to, if nearer than `limit` mm.
pub(crate) fn deepest_cut(
    walls: &Walls<'_>,
    (from, to): (Vec2, Vec2),
    limit: f64,
) -> Option<(usize, Nearest)> {
    let way = Element::line(from, to).filter(|_| limit > 0.0)?;
    let tree = Tree::new(std::iter::once((Bounds::of(&way), NO_CHAIN)));
    let mut deepest: Option<(usize, Nearest)> = None;
    tree.near_pairs(walls.tree(), limit, budget(walls.count()), |_, into| {
        for run in into {
            // The quick look first.
            if nearest(from, to, walls.element(run)).distance >= limit {
                continue;
            }
            let Some(wall) = walls.of(run) else { continue };
            let near = nearest(from, to, &wall);
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
        span: &Span,
        runs: &[Run],
        ends: (Vec2, Vec2),
        behind: Option<WallBehind>,
    ) {
        let lead = &span.entry.lead;
        let code = if span.entry.is_link { Code::LinkGouge } else { Code::LeadGouge };
        self.span(code, span, runs, ends, span.d_mm, lead);
        if let Some(behind) = behind {
            let near = nearest(ends.0, ends.1, &behind.wall);
            if near.distance < behind.d_mm.abs() - GOUGE_MM {
                let negative = span.is_negative;
                self.report(Code::LinkGouge, near, behind.d_mm, lead, behind.source, negative);
            }
        }
    }

    /// The lead-off, from the end of the contour.
    pub(crate) fn lead_off(&mut self, span: &Span, runs: &[Run], ends: (Vec2, Vec2), lead: &Lead) {
        self.span(Code::LeadGouge, span, runs, ends, span.d_out_mm, lead);
    }

    /// The ways along the last block on one side and the first on the other (O02):
    /// each may cut into what the other follows.
    pub(crate) fn change_of_side(&mut self, span: &Span, way: Option<Element>, from: WallBehind) {
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
                let at = in_work(self.plane, near.on_wall, height(self.plane, to.end));
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
        span: &Span,
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
        span: &Span,
        runs: &[Run],
        (from, to): (Vec2, Vec2),
        d_mm: f64,
        lead: &Lead,
    ) {
        let limit = d_mm.abs() - GOUGE_MM;
        if let Some((run, near)) = deepest_cut(self.walls, (from, to), limit) {
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
