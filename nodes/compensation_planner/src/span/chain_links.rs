//! Lists the links of a span's chain: runs, the corners between them, and the leads that take part
//! in a corner.
//!
//! `chain` joins them.

use crate::geometry::element::Element;
use crate::geometry::frame::in_plane;
use crate::geometry::tolerance::REVERSAL;
use crate::span::chain::{ChainBuilder, ChainLink, Role, Turn, turn};
use crate::span::lead_arc::lead_arc;
use crate::span::links::ChainLinks;
use crate::span::{Lead, Run, Span};
use cnc_msgs::contour::Approach;
use cnc_msgs::profile::{Profile, SelectTarget};

/// The links of a span, with all radii scaled: leads that take part in a corner, runs and corners.
pub(crate) fn links(
    span: &Span<'_>,
    runs: &[Run],
    exit: Option<&Lead>,
    profile: &Profile,
    scale: f64,
) -> ChainLinks {
    let short_mm = profile.corner.short_block_mm;
    let mut links = ChainBuilder::new(runs.len(), scale, short_mm);
    let d_mm = span.d_mm * scale;
    let first = runs.first().map(|run| run.element);
    let joins_on = |lead: &Element| match profile.select.target {
        _ if span.entry.is_joined => true,
        // If the imaginary line comes straight back, there is no intersection.
        _ if span.entry.lead.along.is_some() => first
            .is_some_and(|first| 1.0 + lead.end_tangent().dot(&first.start_tangent()) >= REVERSAL),
        _ if span.entry.is_link => is_outside_corner(lead, first, d_mm, &span.entry.lead),
        SelectTarget::NormalEntry => true,
        SelectTarget::NormalNext => is_outside_corner(lead, first, d_mm, &span.entry.lead),
    };
    if let Some(from) = span.entry.from {
        let d_mm = from.d_mm * scale;
        links.push(link(Role::Entry, from.element, d_mm, d_mm), 0);
    } else if let Some(element) = lead_on(span, d_mm).filter(joins_on) {
        links.push(link(Role::Entry, element, d_mm, d_mm), 0);
    }
    push_runs(&mut links, runs, scale);
    if let Some(next) = span.next {
        let d_mm = next.d_mm * scale;
        links.push(link(Role::Exit, next.element, d_mm, d_mm), span.legs.len());
    } else if let (Some(lead), Some(last)) = (exit, runs.last()) {
        let d_mm = span.d_out_mm * scale;
        let joins_off = |element: &Element| {
            lead.approach == Approach::Corner && turn(&last.element, element, d_mm) == Turn::Outside
        };
        if let Some(element) = line_of(lead, span).filter(joins_off) {
            links.push(link(Role::Exit, element, d_mm, d_mm), span.legs.len());
        }
    }
    links.finish()
}

/// Runs and the corners between them, with all radii scaled.
pub(crate) fn push_runs(links: &mut ChainBuilder, runs: &[Run], scale: f64) {
    for (index, run) in runs.iter().enumerate() {
        let (d_in_mm, d_out_mm) = (run.d_in_mm * scale, run.d_out_mm * scale);
        links.push(link(Role::Run(index), run.element, d_in_mm, d_out_mm), run.legs.start);
    }
}

fn is_outside_corner(lead: &Element, first: Option<Element>, d_mm: f64, of: &Lead) -> bool {
    of.approach == Approach::Corner
        && first.is_some_and(|first| turn(lead, &first, d_mm) == Turn::Outside)
}

/// The lead-on at a signed offset. An arc is another one for each radius.
fn lead_on(span: &Span<'_>, d_mm: f64) -> Option<Element> {
    match span.entry.arc {
        Some(programmed) => lead_arc(&programmed, d_mm).ok().map(Element::Arc),
        None => line_of(&span.entry.lead, span),
    }
}

fn line_of(lead: &Lead, span: &Span<'_>) -> Option<Element> {
    let end = in_plane(span.plane, lead.motion.end);
    match lead.along {
        // However far away it begins.
        Some(along) => Element::line(end - along.normalize() * 1e3, end),
        None => Element::line(in_plane(span.plane, lead.start), end),
    }
}

/// A link of its own.
pub(crate) fn link(role: Role, element: Element, d_in_mm: f64, d_out_mm: f64) -> ChainLink {
    let straight_mm = if element.is_line() { element.length() as f32 } else { 0.0 };
    ChainLink {
        role,
        element,
        d_in_mm,
        d_out_mm,
        is_smooth: false,
        straight_mm,
        is_lengthened: false,
    }
}
