//! Opens, fills and closes spans.
//!
//! `walk` decides when; `compensate` makes the geometry of a closed span.

use super::{Active, Selection, Walk, WalkState};
use crate::check::lead::PreviousWall;
use crate::geometry::element::Element;
use crate::geometry::frame::{height, in_plane};
use crate::geometry::tolerance::RADIUS_MM;
use crate::span::feed;
use crate::span::{Entry, ItemKind, Lead, Leg, Span};
use crate::walk::compensate::Exit;
use crate::walk::rules;
use cnc_msgs::contour::{Approach, CutterSide, Motion, OutsideCorner, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::Position;
use cnc_msgs::radius;

impl<'a> Walk<'a> {
    pub(super) fn leg(
        &mut self,
        active: &mut Active<'a>,
        start: Position,
        element: &Element,
        motion: &'a Motion,
        source: Source,
    ) {
        let mut d_out_mm = active.span.d_out_mm;
        active.value_waits = match active.value_waits {
            Some((0, at)) => {
                active.radius_changes = Some(at);
                None
            }
            waits => waits.map(|(blocks, at)| (blocks - 1, at)),
        };
        let corner = match active.corner_arc.take() {
            Some((along, at)) => {
                let plane = active.span.plane;
                self.report.findings.extend(rules::corner_arc(at, along, plane, element));
                OutsideCorner::Arc
            }
            // The intersection with the imaginary line, whatever the corner mode.
            None if active.span.legs.is_empty() && active.span.entry.lead.along.is_some() => {
                OutsideCorner::Intersection
            }
            None => self.corner,
        };
        if let Some(at) = active.radius_changes.take() {
            let resolved = self.signed_offset(active.side, at);
            if (resolved - d_out_mm).abs() >= RADIUS_MM {
                let sign = if active.side == CutterSide::Left { 1.0 } else { -1.0 };
                let radii = (sign * d_out_mm, sign * resolved);
                let finding = rules::radius_change(source, element, radii, self.profile);
                let is_refused = finding.as_ref().is_some_and(Finding::is_error);
                self.report.findings.extend(finding);
                if element.is_line() && !is_refused {
                    d_out_mm = resolved;
                } else if !is_refused {
                    // The next straight block takes the new radius.
                    active.radius_changes = Some(at);
                }
            }
        }
        self.report.findings.extend(slow_corner(active, motion, source));
        active.span.d_out_mm = d_out_mm;
        self.report.findings.extend(rules::inside_arc(source, element, d_out_mm, self.profile));
        let end = in_plane(active.span.plane, motion.end);
        let uneven = rules::uneven_arc(source, element, end, d_out_mm, self.profile);
        self.report.findings.extend(uneven);
        active.span.legs.push(Leg {
            motion,
            source,
            start: in_plane(active.span.plane, start),
            corner,
            d_out_mm,
            tip: radius::tip(self.radius, self.spindle_tool, self.profile, self.tools),
            reach: 0.0,
        });
    }

    /// Checks the blocks between two blocks in the plane; returns whether there were too many.
    pub(super) fn off_plane_blocks(&mut self, active: &mut Active<'_>, source: Source) -> bool {
        let between = std::mem::take(&mut active.between);
        let excess = between.excess(source, self.profile);
        let is_too_much = excess.is_some();
        self.report.findings.extend(excess);
        active.between = rules::BlocksBetween::after(source);
        is_too_much
    }

    /// Begins a span with its lead-on; `link` when the motion also ends another one.
    pub(super) fn open(
        &mut self,
        selection: Selection,
        start: Position,
        motion: &Motion,
        source: Source,
        link: Option<Option<PreviousWall>>,
        is_joined: bool,
    ) {
        let approach = selection.approach.unwrap_or(self.profile.select.default);
        let mut lead = self.lead(start, motion, source, approach);
        lead.along = selection.along.map(|along| in_plane(self.plane, along));
        let d_mm = self.signed_offset(selection.side, selection.source);
        let plane = self.plane;
        let tip = radius::tip(self.radius, self.spindle_tool, self.profile, self.tools);
        let mut arc = None;
        if link.is_none() {
            arc = self.rules().lead_on(&lead, plane, d_mm, tip);
            if height(plane, motion.end) != height(plane, start) {
                self.rules().off_plane_move(source, plane);
            }
        } else {
            self.rules().link(&lead);
        }
        let span = Span {
            plane,
            d_mm,
            d_out_mm: d_mm,
            tip,
            entry: Entry { lead, arc, is_link: link.is_some(), is_joined, from: None },
            legs: Vec::new(),
            items: Vec::new(),
            next: None,
            at_change: [None, None],
            exit_corner: self.corner,
        };
        self.state = WalkState::Active(Box::new(Active {
            span,
            side: selection.side,
            relink: None,
            cancel: None,
            previous_wall: link.flatten(),
            between: rules::BlocksBetween::after(source),
            radius_changes: None,
            value_waits: None,
            corner_arc: None,
            other_side: None,
            before: None,
        }));
    }

    /// Hands over a gathered span; returns the wall that a link leaves.
    pub(super) fn close(&mut self, mut active: Active<'a>, exit: Exit) -> Option<PreviousWall> {
        self.settle(&mut active);
        let Active { span, previous_wall, .. } = active;
        self.out.span(span, exit, previous_wall, &mut self.report)
    }

    /// The radius in force with the sign of the side, mm; 0 when unknown.
    pub(super) fn signed_offset(&mut self, side: CutterSide, at: Source) -> f64 {
        let (radius_mm, finding) =
            radius::resolve(self.radius, self.spindle_tool, self.profile, self.tools, at);
        let radius_mm = self.radius_value_mm.unwrap_or(radius_mm);
        self.report.findings.extend(finding);
        match side {
            CutterSide::Left => radius_mm,
            CutterSide::Right => -radius_mm,
        }
    }

    pub(super) fn lead(
        &self,
        start: Position,
        motion: &Motion,
        source: Source,
        approach: Approach,
    ) -> Lead {
        Lead { motion: *motion, source, start, approach, along: None }
    }
}

/// A feed that came with a move out of the plane and now holds for the corner and the contour after
/// it (S54).
fn slow_corner(active: &Active<'_>, motion: &Motion, source: Source) -> Option<Finding> {
    let own = feed(motion)?;
    let before = match active.span.legs.last() {
        Some(leg) => leg.feed_mm_per_min()?,
        None => feed(&active.span.entry.lead.motion)?,
    };
    let count = active.span.legs.len();
    let came = active
        .span
        .items
        .iter()
        .rev()
        .take_while(|item| item.before == count)
        .find(|item| matches!(item.what, ItemKind::OffPlane(off) if feed(&off) == Some(own)))?;
    (own < before).then(|| {
        let mut finding = Finding::warning(
            Code::SuspiciousValue,
            source,
            format!(
                "the feed of {own} mm/min that came with a move out of the plane holds for this block \
                 and its corner; before it was {before} mm/min"
            ),
        )
        .help("write the feed of the contour into this block");
        finding.other = Some(came.source);
        finding
    })
}
