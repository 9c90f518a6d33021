//! Writes joined runs as blocks, in order.
//!
//! Runs are cut at the normal points of their blocks. Functions and moves out of the plane come
//! where they were programmed: before the corner or, if they stand in the block after it, at that
//! block's normal point. `chain` has decided where the tool is at each joint.

use crate::check::finding;
use crate::check::interference::Joined;
use crate::check::lead;
use crate::geometry::element::{Element, Vec2};
use crate::geometry::frame::{height, in_plane, in_work, plane_axes};
use crate::geometry::tolerance::{FAR_CORNER_RADII, LENGTH_MM};
use crate::span::chain::{ChainLink, Placed, Role as LinkRole};
use crate::span::corner::{Around, Corners};
use crate::span::links::Links;
use crate::span::{ItemKind, Lead, Leg, Run, Span};
use crate::span::{feed, feed_in_force};
use crate::walk::compensate::side_of;
use crate::walk::emitter::{Emitter, Label, follow};
use cnc_msgs::contour::{Motion, OutsideCorner, Source};
use cnc_msgs::finding::Finding;
use cnc_msgs::geometry::{AxisSet, Shape};
use cnc_msgs::path::Role;
use cnc_msgs::profile::{Anchor, Profile, Strictness};
use std::f64::consts::TAU;

/// Writes a solved span block by block.
pub(crate) struct SpanWriter<'a> {
    pub span: &'a Span<'a>,
    pub corners: Corners<'a>,
    pub profile: &'a Profile,
    pub out: &'a mut Emitter,
    pub findings: &'a mut Vec<Finding>,
    /// The next item to write.
    pub item: usize,
    pub exit_source: Option<Source>,
}

impl SpanWriter<'_> {
    /// Moves to where compensation begins.
    pub(crate) fn lead_on(&mut self, links: Links<'_>, placed: &[Placed]) {
        if self.span.entry.from.is_some() {
            return;
        }
        let lead = &self.span.entry.lead;
        let programmed = in_plane(self.span.plane, lead.motion.end);
        let target = match placed.first() {
            Some(first) if links.role(first.link) == LinkRole::Entry => {
                self.corners.lines(links, placed, 1).map_or(first.end, |lines| lines.before_end)
            }
            Some(first) => first.start,
            // No offset, or nothing is left of the contour.
            None => programmed,
        };
        let role = if self.span.entry.is_link { Role::Link } else { Role::LeadOn };
        let label = Label {
            role,
            source: lead.source,
            feed_mm_per_min: feed(&lead.motion),
            axes: lead.motion.axes.union(plane_axes(self.span.plane)),
        };
        let (plane, end_height) = (self.span.plane, height(self.span.plane, lead.motion.end));
        let joined = Joined { links, placed, corners: self.corners };
        let arc = match placed.first() {
            Some(_) => lead::arc_on(&joined).map(|(arc, taken_mm)| (arc, taken_mm / arc.radius)),
            None => self.span.entry.arc.map(|programmed| (programmed, 0.0)),
        };
        match arc {
            Some((arc, taken)) => {
                self.out.arc_to(plane, &arc, arc.sweep - taken, target, end_height, label);
            }
            None => self.out.line_to(plane, target, end_height, label),
        }
    }

    /// A radius of 0: writes the contour as programmed.
    ///
    /// The ends of arcs are trusted, as with any other radius: the centre moves to where both are
    /// equally far.
    pub(crate) fn as_programmed(&mut self) {
        let plane = self.span.plane;
        for (index, leg) in self.span.legs.iter().enumerate() {
            self.items_before(index, false);
            let mut motion = Motion { axes: axes_of(leg, self.span), ..*leg.motion };
            if let (Shape::Arc(shape), Some(Element::Arc(arc))) =
                (&mut motion.shape, leg.element(plane))
            {
                shape.center = in_work(plane, arc.center, height(plane, shape.center));
            }
            self.out.programmed(&motion, leg.source, Role::Contour);
        }
    }

    pub(crate) fn links(
        &mut self,
        runs: &[Run],
        links: Links<'_>,
        placed: &[Placed],
        exit: Option<&Lead>,
    ) {
        // How much the last corner lengthened the element after it.
        let mut longer_in = 0.0;
        for (index, place) in placed.iter().enumerate() {
            let link = &links.at(place.link);
            match link.role {
                LinkRole::Entry | LinkRole::Exit => {}
                LinkRole::Corner { next_leg } => {
                    self.items_before(next_leg, true);
                    let context = (links, placed, index);
                    longer_in = self.write_corner(next_leg, link, place, exit, context);
                }
                LinkRole::Run(run) => {
                    let longer_out = self.corners.lines(links, placed, index + 1);
                    let (end, more) = longer_out
                        .map_or((place.end, 0.0), |lines| (lines.before_end, lines.before_longer));
                    let trims = (place.trim_in - longer_in, place.trim_out - more);
                    self.pieces(&runs[run], trims, end);
                    longer_in = 0.0;
                }
            }
        }
    }

    /// Writes a corner; returns how much it lengthens the element after it.
    fn write_corner(
        &mut self,
        next_leg: usize,
        link: &ChainLink,
        place: &Placed,
        exit: Option<&Lead>,
        context: (Links<'_>, &[Placed], usize),
    ) -> f64 {
        let plane = self.span.plane;
        let (source, motion) = match (self.span.legs.get(next_leg), exit) {
            (Some(leg), _) => (leg.source, leg.motion),
            (None, Some(exit)) => (exit.source, &exit.motion),
            (None, None) => return 0.0,
        };
        let own_feed = feed(motion);
        let mut label = Label {
            role: Role::Corner,
            source,
            feed_mm_per_min: own_feed,
            axes: plane_axes(plane),
        };
        let here = height(plane, self.out.position);
        let (links, placed, index) = context;
        let around = self.corners.around(links, placed, index);
        self.check_corner(next_leg, source, link, &around);
        match around {
            Around::Arc | Around::NoIntersection => {
                let Some(Element::Arc(arc)) = link.element.offset(link.d_in_mm) else {
                    return 0.0;
                };
                // A chord across the corner would cut into it, so a rapid must not replace it.
                let in_force = own_feed.or(feed_in_force(motion));
                label.feed_mm_per_min = in_force.or(self.out.last_feed_mm_per_min);
                if label.feed_mm_per_min.is_none() {
                    self.findings.push(finding::corner_without_feed(source));
                }
                let cut = (place.trim_in + place.trim_out) / arc.radius;
                self.out.arc_to(plane, &arc, arc.sweep - cut, place.end, here, label);
                0.0
            }
            Around::Lines(lines) => {
                for &point in lines.points() {
                    self.out.line_to(plane, point, here, label);
                }
                if lines.after_longer > 0.0 && self.has_own_items(next_leg) {
                    // The block's own functions come at its normal point (S56).
                    let next = placed.get(index + 1).and_then(|next| {
                        let link = &links.at(next.link);
                        link.element.offset(link.d_in_mm)
                    });
                    match next {
                        Some(Element::Arc(arc)) if arc.radius > LENGTH_MM => {
                            let sweep = lines.after_longer / arc.radius;
                            self.out.arc_to(plane, &arc, sweep, place.end, here, label);
                        }
                        _ => self.out.line_to(plane, place.end, here, label),
                    }
                    return 0.0;
                }
                lines.after_longer
            }
        }
    }

    /// Reports an intersection that does not exist (O08), or is far away.
    fn check_corner(&mut self, next_leg: usize, source: Source, link: &ChainLink, around: &Around) {
        let Element::Arc(corner) = &link.element else { return };
        let radius_mm = link.d_in_mm.abs();
        let found = match around {
            Around::Arc => return,
            Around::NoIntersection => finding::no_corner(source, self.profile),
            // Only one mode has no line of its own between lines (O05).
            Around::Lines(_) if self.corners.mode(next_leg) != OutsideCorner::Intersection => {
                return;
            }
            Around::Lines(lines) => {
                let distance_mm = (lines.before_end - corner.center).norm();
                if distance_mm <= FAR_CORNER_RADII * radius_mm {
                    return;
                }
                finding::far_corner(source, distance_mm, link.d_in_mm)
            }
        };
        let mut found = found;
        let end = self.span.legs.get(next_leg.wrapping_sub(1));
        found.other = end.map(|leg| leg.source).filter(|other| !other.is_same_place(source));
        let at = end.map_or(0.0, |leg| height(self.span.plane, leg.motion.end));
        found.position = Some(in_work(self.span.plane, corner.center, at));
        self.findings.push(found);
    }

    /// Writes the blocks of a run, cut at their normal points.
    fn pieces(&mut self, run: &Run, trims: (f64, f64), end: Vec2) {
        let changes = run.d_in_mm != run.d_out_mm;
        self.out.side = side_of(run.d_in_mm);
        let Some(element) = run.element.offset(run.d_in_mm) else { return };
        // `reach` is mm on lines and rad on arcs.
        let unit = match element {
            Element::Line(_) => 1.0,
            Element::Arc(arc) => arc.radius.max(LENGTH_MM),
        };
        let full = match element {
            Element::Line(line) => line.length,
            Element::Arc(arc) => arc.sweep,
        };
        let (mut low, high) = (trims.0 / unit, full - trims.1 / unit);
        // If it is written as two arcs, neither becomes longer than a full circle.
        let is_one_block = run.legs.len() == 1;
        if is_one_block && !element.is_line() && high - low > TAU && full <= TAU {
            low += self.over_360(run, high - low);
        }
        let mut from = f64::NEG_INFINITY;
        for index in run.legs.clone() {
            let leg = self.span.legs[index];
            self.items_before(index, false);
            let is_last = index + 1 == run.legs.end;
            let to = if is_last { f64::INFINITY } else { leg.reach };
            let (begin, finish) = (low.max(from), high.min(to));
            from = to;
            let along = finish - begin;
            if along * unit <= LENGTH_MM && !changes {
                continue;
            }
            let is_end = finish >= high;
            let point = if is_end {
                end
            } else {
                match element {
                    Element::Line(line) => line.start + line.tangent * finish,
                    Element::Arc(arc) => arc.point_at_angle(finish),
                }
            };
            let label = self.label(&leg);
            let end_height = height(self.span.plane, leg.motion.end);
            follow(self.out, self.span.plane, &element, along, point, end_height, label);
        }
    }

    /// Reports a circle that its joints lengthen beyond a full one (S70); returns how much of it is
    /// left out, rad.
    fn over_360(&mut self, run: &Run, sweep: f64) -> f64 {
        let rule = self.profile.corner.arc_over_360;
        let leg = &self.span.legs[run.legs.start];
        self.findings.push(finding::over_360(leg.source, sweep, rule, self.profile));
        if rule == Strictness::Emulate { TAU } else { 0.0 }
    }

    fn label(&self, leg: &Leg<'_>) -> Label {
        Label {
            role: Role::Contour,
            source: leg.source,
            feed_mm_per_min: leg.feed_mm_per_min(),
            axes: axes_of(leg, self.span),
        }
    }

    fn source_of(&self, leg: usize) -> Option<Source> {
        self.span.legs.get(leg).map(|leg| leg.source).or(self.exit_source)
    }

    fn has_own_items(&self, leg: usize) -> bool {
        let own = self.source_of(leg);
        self.span.items[self.item..]
            .iter()
            .take_while(|item| item.before <= leg)
            .any(|item| item.before == leg && Some(item.source) == own)
    }

    /// The first item that waits for the end of the corner: functions after the last move out of
    /// the plane, if the profile says so (SINUMERIK 880).
    fn after_corner(&self, leg: usize, is_at_corner: bool) -> usize {
        if !is_at_corner || self.profile.auxiliary.anchor == Anchor::BeforeCorner {
            return usize::MAX;
        }
        let items = self.span.items[self.item..].iter().take_while(|item| item.before <= leg);
        let moves =
            items.enumerate().filter(|(_, item)| matches!(item.what, ItemKind::OffPlane(_)));
        self.item + moves.last().map_or(0, |(index, _)| index + 1)
    }

    /// Writes the items before a leg that are still due; `foreign_only` leaves those of the leg's
    /// own block for after the corner (S51, S56).
    pub(crate) fn items_before(&mut self, leg: usize, foreign_only: bool) {
        let own = self.source_of(leg);
        let waiting = self.after_corner(leg, foreign_only);
        while let Some(item) = self.span.items.get(self.item) {
            let is_own = item.before == leg && Some(item.source) == own;
            if item.before > leg || (foreign_only && is_own) || self.item >= waiting {
                return;
            }
            match item.what {
                ItemKind::Action(action) => self.out.action(action, item.source),
                ItemKind::OffPlane(motion) => {
                    self.out.off_plane(self.span.plane, &motion, item.source);
                }
            }
            self.item += 1;
        }
    }
}

fn axes_of(leg: &Leg<'_>, span: &Span<'_>) -> AxisSet {
    leg.motion.axes.union(plane_axes(span.plane))
}
