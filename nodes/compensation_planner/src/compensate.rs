//! One span: from its legs to compensated elements.
//!
//! Brings the parts together in order: runs, leads, joints, what cannot be
//! reached, and the way back from runs to blocks. Each part's rules are its own.

use crate::chain::{Link, Placed, Role as LinkRole, Turn, join, push, turn};
use crate::corner::{Around, around};
use crate::element::{Element, Vec2};
use crate::emit::{Emitter, Label, feed, follow};
use crate::finding;
use crate::frame::{height, in_plane, plane_axes};
use crate::lead;
use crate::normalise::runs;
use crate::reach::unreachable;
use crate::span::{ItemKind, Lead, Leg, Run, Span};
use crate::tolerance::{LENGTH_MM, RADIUS_MM};
use cnc_msgs::contour::{Approach, OutsideCorner, Source};
use cnc_msgs::diagnostic::{Code, Diagnostic};
use cnc_msgs::geometry::AxisSet;
use cnc_msgs::path::Role;
use cnc_msgs::profile::{Profile, SelectTarget};

/// How a span ends.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Exit<'a> {
    /// By a move back to the programmed path.
    LeadOff(&'a Lead),
    /// By a move that also begins the next span, which will put it out.
    Link(&'a Lead),
    /// Not at all: the program is over.
    None,
}

/// The wall that a link leaves behind, for its check.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WallBehind {
    pub wall: Element,
    pub source: Source,
    pub radius_mm: f64,
}

/// Puts a span out. `behind` is the wall that a link at its start leaves; the
/// wall that a link at its end leaves is given back.
pub(crate) fn compensate(
    mut span: Span,
    exit: Exit<'_>,
    behind: Option<WallBehind>,
    profile: &Profile,
    out: &mut Emitter,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<WallBehind> {
    let exit_lead = match exit {
        Exit::LeadOff(lead) | Exit::Link(lead) => Some(*lead),
        Exit::None => None,
    };
    let runs = runs(&mut span);
    let is_identity = runs.iter().all(|run| is_zero(run.d_in_mm) && is_zero(run.d_out_mm));
    let links = match is_identity {
        true => Vec::new(),
        false => links(&span, &runs, exit_lead.as_ref(), profile),
    };
    let placed = join(&links, profile.accept_tolerance_mm);
    for place in unreachable(&links, &placed, profile.accept_tolerance_mm) {
        diagnostics.push(finding::unreachable(&span, &runs, &place, profile));
    }
    let mut writer =
        Writer { span: &span, out, diagnostics, item: 0, exit_source: exit_lead.map(|l| l.source) };
    let lead_start = in_plane(span.plane, writer.out.position);
    writer.lead_on(&links, &placed);
    let lead_end = in_plane(span.plane, writer.out.position);
    if is_identity {
        writer.as_programmed();
    } else {
        writer.links(&runs, &links, &placed, exit_lead.as_ref());
    }
    writer.items_before(span.legs.len(), false);
    let mut check = lead::Check { profile, plane: span.plane, diagnostics };
    let move_on = (lead_start, lead_end);
    check.lead_on(&span, &runs, move_on, behind);
    let exit_start = in_plane(span.plane, out.position);
    if let Exit::LeadOff(lead) = exit {
        let end = in_plane(span.plane, lead.motion.end);
        let label = Label {
            role: Role::LeadOff,
            source: lead.source,
            feed_mm_per_min: feed(&lead.motion),
            axes: lead.motion.axes.union(plane_axes(span.plane)),
        };
        out.line_to(span.plane, end, height(span.plane, lead.motion.end), label);
        check.lead_off(&span, &runs, (exit_start, end), lead);
    }
    check.wall_behind(&span, &runs)
}

fn is_zero(d_mm: f64) -> bool {
    d_mm.abs() < RADIUS_MM
}

/// The chain of a span: the leads where they take part in a corner, runs and corners.
fn links(span: &Span, runs: &[Run], exit: Option<&Lead>, profile: &Profile) -> Vec<Link> {
    let mut links = Vec::with_capacity(runs.len() * 2 + 2);
    let first = runs.first().map(|run| run.element);
    let joins_on = |lead: &Element| match profile.select.target {
        _ if span.entry.is_link => is_outside_corner(lead, first, span.d_mm, &span.entry.lead),
        SelectTarget::NormalEntry => true,
        SelectTarget::NormalNext => is_outside_corner(lead, first, span.d_mm, &span.entry.lead),
    };
    if let Some(element) = line_of(&span.entry.lead, span).filter(joins_on) {
        links.push(link(LinkRole::Entry, element, span.d_mm, span.d_mm));
    }
    for (index, run) in runs.iter().enumerate() {
        let role = LinkRole::Run(index);
        push(&mut links, link(role, run.element, run.d_in_mm, run.d_out_mm), run.legs.start);
    }
    if let (Some(lead), Some(last)) = (exit, runs.last()) {
        let d_mm = span.d_out_mm;
        let joins_off = |element: &Element| {
            lead.approach == Approach::Corner && turn(&last.element, element, d_mm) == Turn::Outside
        };
        if let Some(element) = line_of(lead, span).filter(joins_off) {
            push(&mut links, link(LinkRole::Exit, element, d_mm, d_mm), span.legs.len());
        }
    }
    links
}

fn is_outside_corner(lead: &Element, first: Option<Element>, d_mm: f64, of: &Lead) -> bool {
    of.approach == Approach::Corner
        && first.is_some_and(|first| turn(lead, &first, d_mm) == Turn::Outside)
}

fn line_of(lead: &Lead, span: &Span) -> Option<Element> {
    Element::line(in_plane(span.plane, lead.start), in_plane(span.plane, lead.motion.end))
}

fn link(role: LinkRole, element: Element, d_in_mm: f64, d_out_mm: f64) -> Link {
    Link { role, element, d_in_mm, d_out_mm, is_smooth: false }
}

/// Puts out what was decided, block by block.
struct Writer<'a> {
    span: &'a Span,
    out: &'a mut Emitter,
    diagnostics: &'a mut Vec<Diagnostic>,
    /// The next item that has not been put out.
    item: usize,
    exit_source: Option<Source>,
}

impl Writer<'_> {
    /// Goes to where compensation begins.
    fn lead_on(&mut self, links: &[Link], placed: &[Placed]) {
        let lead = &self.span.entry.lead;
        let programmed = in_plane(self.span.plane, lead.motion.end);
        let target = match placed.first() {
            Some(first) if links[first.link].role == LinkRole::Entry => {
                match placed.get(1).map(|next| links[next.link]) {
                    Some(Link { role: LinkRole::Corner { next_leg }, element, .. }) => {
                        match self.corner(next_leg, &element, (links, placed, 1)) {
                            Around::Lines(lines) => lines.before_end,
                            Around::Arc => first.end,
                        }
                    }
                    _ => first.end,
                }
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
        let end_height = height(self.span.plane, lead.motion.end);
        self.out.line_to(self.span.plane, target, end_height, label);
    }

    /// A radius of 0: the contour as it is programmed.
    fn as_programmed(&mut self) {
        for (index, leg) in self.span.legs.iter().enumerate() {
            self.items_before(index, false);
            let motion = cnc_msgs::contour::Motion {
                shape: leg.shape,
                end: leg.end,
                class: if leg.feed_mm_per_min.is_some() {
                    cnc_msgs::contour::MotionClass::Feed
                } else {
                    cnc_msgs::contour::MotionClass::Rapid
                },
                feed_mm_per_min: leg.feed_mm_per_min.unwrap_or(0.0),
                axes: leg.axes.union(plane_axes(self.span.plane)),
            };
            self.out.programmed(&motion, leg.source, Role::Contour);
        }
    }

    fn links(&mut self, runs: &[Run], links: &[Link], placed: &[Placed], exit: Option<&Lead>) {
        // How much the last corner lengthened what comes after it.
        let mut longer_in = 0.0;
        for (index, place) in placed.iter().enumerate() {
            let link = &links[place.link];
            match link.role {
                LinkRole::Entry | LinkRole::Exit => {}
                LinkRole::Corner { next_leg } => {
                    self.items_before(next_leg, true);
                    let context = (links, placed, index);
                    longer_in = self.write_corner(next_leg, link, place, exit, context);
                }
                LinkRole::Run(run) => {
                    let longer_out = match placed.get(index + 1).map(|next| links[next.link]) {
                        Some(Link { role: LinkRole::Corner { next_leg }, element, .. }) => {
                            match self.corner(next_leg, &element, (links, placed, index + 1)) {
                                Around::Lines(lines) => Some(lines),
                                Around::Arc => None,
                            }
                        }
                        _ => None,
                    };
                    let (end, more) = longer_out
                        .map_or((place.end, 0.0), |lines| (lines.before_end, lines.before_longer));
                    let trims = (place.trim_in - longer_in, place.trim_out - more);
                    self.pieces(&runs[run], trims, end);
                    longer_in = 0.0;
                }
            }
        }
    }

    /// The shape of a corner; one that was cut short stays an arc.
    fn corner(
        &self,
        next_leg: usize,
        element: &Element,
        (links, placed, index): (&[Link], &[Placed], usize),
    ) -> Around {
        let place = &placed[index];
        let neighbour = |other: Option<usize>, offset: usize| {
            let other = placed.get(other?)?;
            (other.link == place.link + offset - 1).then(|| links[other.link].element.is_line())
        };
        let before = neighbour(index.checked_sub(1), 0);
        let after = neighbour(Some(index + 1), 2);
        let is_whole = place.trim_in <= 0.0 && place.trim_out <= 0.0;
        match (before, after, element) {
            (Some(before), Some(after), Element::Arc(arc)) if is_whole => {
                around(self.mode(next_leg), arc, (before, after), links[place.link].d_in_mm)
            }
            _ => Around::Arc,
        }
    }

    fn mode(&self, next_leg: usize) -> OutsideCorner {
        self.span.legs.get(next_leg).map_or(self.span.exit_corner, |leg| leg.corner)
    }

    /// Puts a corner out; gives by how much it lengthens what comes after.
    fn write_corner(
        &mut self,
        next_leg: usize,
        link: &Link,
        place: &Placed,
        exit: Option<&Lead>,
        context: (&[Link], &[Placed], usize),
    ) -> f64 {
        let plane = self.span.plane;
        let (source, own_feed) = match (self.span.legs.get(next_leg), exit) {
            (Some(leg), _) => (leg.source, leg.feed_mm_per_min),
            (None, Some(exit)) => (exit.source, feed(&exit.motion)),
            (None, None) => return 0.0,
        };
        let mut label = Label {
            role: Role::Corner,
            source,
            feed_mm_per_min: own_feed,
            axes: plane_axes(plane),
        };
        let here = height(plane, self.out.position);
        match self.corner(next_leg, &link.element, context) {
            Around::Arc => {
                let Some(Element::Arc(arc)) = link.element.offset(link.d_in_mm) else {
                    return 0.0;
                };
                // A chord across the corner would cut into it, so a rapid must not
                // take its place.
                label.feed_mm_per_min = own_feed.or(self.out.last_feed_mm_per_min);
                if label.feed_mm_per_min.is_none() {
                    self.diagnostics.push(finding::corner_without_feed(source));
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
                    let normal = place.end;
                    self.out.line_to(plane, normal, here, label);
                    return 0.0;
                }
                lines.after_longer
            }
        }
    }

    /// The blocks of a run, cut at their normal points.
    fn pieces(&mut self, run: &Run, trims: (f64, f64), end: Vec2) {
        let changes = run.d_in_mm != run.d_out_mm;
        let Some(element) = run.element.offset(run.d_in_mm) else { return };
        // Reach is mm on lines and rad on arcs.
        let unit = match element {
            Element::Line(_) => 1.0,
            Element::Arc(arc) => arc.radius.max(LENGTH_MM),
        };
        let full = match element {
            Element::Line(line) => line.length,
            Element::Arc(arc) => arc.sweep,
        };
        let (low, high) = (trims.0 / unit, full - trims.1 / unit);
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
            let end_height = height(self.span.plane, leg.end);
            follow(self.out, self.span.plane, &element, along, point, end_height, label);
        }
    }

    fn label(&self, leg: &Leg) -> Label {
        Label {
            role: Role::Contour,
            source: leg.source,
            feed_mm_per_min: leg.feed_mm_per_min,
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

    /// Puts out what comes before a leg and has not been put out; `foreign_only`
    /// leaves what stands in the leg's own block for after the corner (S51, S56).
    fn items_before(&mut self, leg: usize, foreign_only: bool) {
        let own = self.source_of(leg);
        while let Some(item) = self.span.items.get(self.item) {
            let is_own = item.before == leg && Some(item.source) == own;
            if item.before > leg || (foreign_only && is_own) {
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

fn axes_of(leg: &Leg, span: &Span) -> AxisSet {
    leg.axes.union(plane_axes(span.plane))
}

/// Reports a span that has no contour between its leads.
pub(crate) fn empty_span(span: &Span) -> Diagnostic {
    Diagnostic::error(
        Code::NeverActive,
        span.entry.lead.source,
        "compensation is selected and cancelled with no contour in between",
    )
    .help("put at least one move in the plane between the lead-on and the lead-off")
}
