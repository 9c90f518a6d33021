//! Whether a lead cuts into the contour that it leads to or from.
//!
//! Looks at the element next to the lead, without its tail (see `tails`).
//! Other parts of the contour are not seen here.

use crate::compensate::WallBehind;
use crate::distance::nearest;
use crate::element::{Element, Vec2};
use crate::finding::{self, LeadCut};
use crate::span::{Lead, Run, Span};
use crate::tails::Walls;
use crate::tolerance::GOUGE_MM;
use cnc_msgs::contour::Source;
use cnc_msgs::diagnostic::{Code, Diagnostic};
use cnc_msgs::geometry::Plane;
use cnc_msgs::profile::Profile;

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
        if let Some(first) = runs.first() {
            let other = span.legs[first.legs.start].source;
            let code = if span.entry.is_link { Code::LinkGouge } else { Code::LeadGouge };
            let walls = self.walls;
            let wall = || walls.of(0);
            self.one(code, ends, (&first.element, wall), span.d_mm.abs(), lead, other);
        }
        if let Some(behind) = behind {
            let wall = || Some(behind.wall);
            let parts = (&behind.wall, wall);
            self.one(Code::LinkGouge, ends, parts, behind.radius_mm, lead, behind.source);
        }
    }

    /// The lead-off, from the end of the contour.
    pub(crate) fn lead_off(&mut self, span: &Span, runs: &[Run], ends: (Vec2, Vec2), lead: &Lead) {
        let Some(last) = runs.last() else { return };
        let other = span.legs[last.legs.end - 1].source;
        let walls = self.walls;
        let wall = || walls.of(runs.len() - 1);
        let radius_mm = span.d_out_mm.abs();
        self.one(Code::LeadGouge, ends, (&last.element, wall), radius_mm, lead, other);
    }

    /// What a link at the end of the span will be checked against.
    pub(crate) fn wall_behind(&self, span: &Span, runs: &[Run]) -> Option<WallBehind> {
        let last = runs.last()?;
        let source = span.legs[last.legs.end - 1].source;
        Some(WallBehind { wall: last.element, source, radius_mm: span.d_out_mm.abs() })
    }

    fn one(
        &mut self,
        code: Code,
        (from, to): (Vec2, Vec2),
        (element, wall): (&Element, impl Fn() -> Option<Element>),
        radius_mm: f64,
        lead: &Lead,
        other: Source,
    ) {
        // The quick look first: tails are searched for only where something is cut.
        if nearest(from, to, element).distance >= radius_mm - GOUGE_MM {
            return;
        }
        let Some(wall) = wall() else { return };
        let near = nearest(from, to, &wall);
        if near.distance >= radius_mm - GOUGE_MM {
            return;
        }
        let cut = LeadCut {
            code,
            source: lead.source,
            other,
            at: crate::frame::in_work(
                self.plane,
                near.on_wall,
                crate::frame::height(self.plane, lead.motion.end),
            ),
            radius_mm,
            distance_mm: near.distance,
        };
        self.diagnostics.push(finding::lead_cut(&cut, self.profile));
    }
}
