//! Joins the compensated elements of a span, and leaves out what the tool cannot reach.
//!
//! The joints between neighbours: tangent, around an outside corner, or the intersection of both
//! offsets. If the joints of an element leave nothing of it, it is consumed and its neighbours are
//! joined instead, until nothing changes. Every element enters and leaves once, so the time is
//! linear. `reach` decides what consumed elements mean for a program.

use crate::geometry::distance::distance_to;
use crate::geometry::element::{Element, Vec2, cross, left};
use crate::geometry::intersect::{Meeting, meet, meet_across};
use crate::geometry::tolerance::{
    FLAT_MM, LENGTH_MM, MERGE_MM, SHORT_CORNER_MM, SMALL_TURN_RAD, TANGENT_RAD,
};
use crate::span::links::{ChainLinks, Links};

/// What a link of the chain is made from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Role {
    /// The lead-on, extended backwards as far as needed.
    Entry,
    /// The run of this index.
    Run(usize),
    /// The corner before this leg; the number of legs means before the lead-off.
    Corner { next_leg: usize },
    /// The lead-off, extended as far as needed.
    Exit,
}

/// An element and the signed offsets at its ends, mm.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChainLink {
    pub role: Role,
    pub element: Element,
    pub d_in_mm: f64,
    pub d_out_mm: f64,
    /// The tool goes from the link before to this one without cutting either short.
    pub is_smooth: bool,
    /// The longest straight in it, mm; if chords were merged into one line, the longest chord.
    pub straight_mm: f32,
    /// It and the link before are lengthened until they meet: a corner too short for
    /// a block of its own (S68).
    pub is_lengthened: bool,
}

/// A link that is not consumed, and where the tool is on it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed {
    /// Index of the link.
    pub link: usize,
    pub start: Vec2,
    pub end: Vec2,
    /// What is cut off its compensated element at each end, mm.
    pub trim_in: f64,
    pub trim_out: f64,
}

/// How the programmed contour turns at a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Turn {
    Tangent,
    /// Towards the tool.
    Inside,
    /// Away from the tool.
    Outside,
}

/// How the contour turns from one element to the next, seen from the tool.
pub(crate) fn turn(a: &Element, b: &Element, d_mm: f64) -> Turn {
    let (before, after) = (a.end_tangent(), b.start_tangent());
    let sine = cross(before, after) * d_mm.signum();
    let cosine = before.dot(&after);
    if cosine > 0.0 {
        if sine.abs() < TANGENT_RAD {
            return Turn::Tangent;
        }
        let gap_mm = -sine * d_mm.abs();
        if sine < 0.0
            && -sine < SMALL_TURN_RAD
            && gap_mm < SHORT_CORNER_MM
            && is_flat(a, d_mm, gap_mm)
            && is_flat(b, d_mm, gap_mm)
        {
            return Turn::Tangent;
        }
    } else if sine.abs() < TANGENT_RAD {
        // A cusp: the tool is inside when both arcs bend around it.
        let bend = (a.curvature() + b.curvature()) * d_mm.signum();
        return if bend < 0.0 { Turn::Inside } else { Turn::Outside };
    }
    if sine > 0.0 { Turn::Inside } else { Turn::Outside }
}

/// Whether the offset of an element bends so little that half of a short corner is on it.
///
/// If the tool just fits into a fillet, hardly a circle is left of it.
fn is_flat(element: &Element, d_mm: f64, gap_mm: f64) -> bool {
    match element {
        Element::Line(_) => true,
        Element::Arc(arc) => gap_mm * gap_mm <= 8.0 * FLAT_MM * (arc.radius - d_mm * arc.turn),
    }
}

/// Where the offsets of two lines through a corner meet, given their tangents there.
pub(crate) fn line_corner(at: Vec2, before: Vec2, after: Vec2, d_mm: f64) -> Vec2 {
    let (na, nb) = (left(before), left(after));
    at + (na + nb) * (d_mm / (1.0 + na.dot(&nb)))
}

/// A chain that is being made.
#[derive(Debug)]
pub(crate) struct ChainBuilder {
    links: ChainLinks,
    last: Option<ChainLink>,
    /// Corners with arcs whose ends are nearer than this get none, mm.
    short_mm: f64,
}

impl ChainBuilder {
    /// For so many runs, whose radii are multiplied by `scale`.
    pub(crate) fn new(runs: usize, scale: f64, short_mm: f64) -> Self {
        Self { links: ChainLinks::new(runs, scale), last: None, short_mm }
    }

    /// Appends a link and, where the contour turns away from the tool, the corner before it.
    pub(crate) fn push(&mut self, mut link: ChainLink, next_leg: usize) {
        if let Some(before) = &self.last {
            let changes_side = before.d_out_mm * link.d_in_mm < 0.0;
            match turn(&before.element, &link.element, link.d_in_mm) {
                // Both sides meet at the intersection of their offsets (O02).
                _ if changes_side => {}
                Turn::Inside => {}
                Turn::Tangent => link.is_smooth = true,
                Turn::Outside if is_short(before, &link, self.short_mm) => {
                    link.is_lengthened = true;
                }
                Turn::Outside => {
                    let element = Element::corner(
                        link.element.start(),
                        before.element.end_tangent(),
                        link.element.start_tangent(),
                        link.d_in_mm,
                    );
                    self.links.push(&ChainLink {
                        role: Role::Corner { next_leg },
                        element,
                        d_in_mm: link.d_in_mm,
                        d_out_mm: link.d_in_mm,
                        is_smooth: true,
                        straight_mm: 0.0,
                        is_lengthened: false,
                    });
                    link.is_smooth = true;
                }
            }
        }
        self.links.push(&link);
        self.last = Some(link);
    }

    /// The whole chain.
    pub(crate) fn finish(self) -> ChainLinks {
        self.links
    }
}

/// The distance between the ends of the offsets at an outside corner, mm (S68: A and C).
pub(crate) fn gap(before: Vec2, after: Vec2, d_mm: f64) -> f64 {
    (after - before).norm() * d_mm.abs()
}

/// Whether the corner between two elements is so short that they are lengthened instead.
fn is_short(before: &ChainLink, link: &ChainLink, short_mm: f64) -> bool {
    if before.element.is_line() && link.element.is_line() {
        return false;
    }
    let tangents = (before.element.end_tangent(), link.element.start_tangent());
    if gap(tangents.0, tangents.1, link.d_in_mm) >= short_mm {
        return false;
    }
    let offsets = before.element.offset(before.d_out_mm).zip(link.element.offset(link.d_in_mm));
    // Nearly tangent circles may meet far away: then the tool goes around the corner.
    let is_near = |trim: f64| trim.abs() <= 2.0 * short_mm;
    offsets
        .and_then(|(before, next)| meet_across(&before, &next))
        .is_some_and(|meeting| is_near(meeting.trim_a) && is_near(meeting.trim_b))
}

/// Joins all links.
///
/// `slack` is how far elements that were not neighbours in the program may miss each other, mm. If
/// two neighbours in the result have indices that are not consecutive, they have consumed what lies
/// between.
pub(crate) fn join(links: Links<'_>, slack: f64) -> Vec<Placed> {
    let mut placed: Vec<Placed> = Vec::with_capacity(links.len());
    for (index, link) in links.iter().enumerate() {
        let Some(ahead) = link.element.offset(link.d_in_mm) else { continue };
        let room = length(&link, &ahead);
        loop {
            let Some(top) = placed.last_mut() else {
                let end = end_of(&link, &ahead);
                let start = ahead.start();
                placed.push(Placed { link: index, start, end, trim_in: 0.0, trim_out: 0.0 });
                break;
            };
            let last = &links.at(top.link);
            let is_neighbour = top.link + 1 == index;
            let ending = last.element.offset(last.d_out_mm);
            let meeting = ending.and_then(|ending| {
                joint(last, &ending, &link, &ahead, is_neighbour, slack)
                    .map(|meeting| (meeting, length(last, &ending)))
            });
            let Some((meeting, top_room)) = meeting else {
                if is_smaller(last, &link) {
                    placed.pop();
                    continue;
                }
                break;
            };
            let ends_before = room - meeting.trim_b.max(0.0) < -LENGTH_MM;
            if top_room - top.trim_in.max(0.0) - meeting.trim_a.max(0.0) < -LENGTH_MM {
                // Beyond the end of a chord the curve bends away, so the chord consumes only what
                // the tool cannot reach next to it.
                if ends_before && distance_to(&link.element, top.start) >= link.d_in_mm.abs() {
                    break;
                }
                placed.pop();
                continue;
            }
            if ends_before {
                break;
            }
            top.trim_out = meeting.trim_a;
            top.end = meeting.point;
            placed.push(Placed {
                link: index,
                start: meeting.point,
                end: end_of(&link, &ahead),
                trim_in: meeting.trim_b,
                trim_out: 0.0,
            });
            break;
        }
    }
    // The last one ends untrimmed, even if something after it was tried.
    if let Some(last) = placed.last_mut() {
        let link = &links.at(last.link);
        if let Some(element) = link.element.offset(link.d_out_mm) {
            last.end = element.end();
            last.trim_out = 0.0;
        }
    }
    lengthen_ends(links, &mut placed, slack);
    placed
}

/// Consumes chords at the free ends of a contour that are noise next to a line: the tool follows
/// the line as far as they go.
fn lengthen_ends(links: Links<'_>, placed: &mut [Placed], slack: f64) {
    let mut ends = links.iter();
    let Some(very_first) = ends.next() else { return };
    let very_last = ends.next_back().unwrap_or(very_first);
    let is_run = |link: &ChainLink| matches!(link.role, Role::Run(_));
    if let Some(last) = placed.last_mut().filter(|last| last.link + 1 < links.len())
        && is_run(&very_last)
        && let Some(along) = along_line(&links.at(last.link), very_last.element.end(), slack)
        && let Some(Element::Line(line)) =
            links.at(last.link).element.offset(links.at(last.link).d_out_mm)
        && along > line.length
    {
        last.end = line.start + line.tangent * along;
        last.trim_out = line.length - along;
    }
    if let Some(first) = placed.first_mut().filter(|first| first.link > 0)
        && is_run(&very_first)
        && let Some(along) = along_line(&links.at(first.link), very_first.element.start(), slack)
        && let Some(Element::Line(line)) =
            links.at(first.link).element.offset(links.at(first.link).d_in_mm)
        && along < 0.0
    {
        first.start = line.start + line.tangent * along;
        first.trim_in = along;
    }
}

/// How far along the line of a link a point lies that is within `slack` of the line, mm.
fn along_line(link: &ChainLink, point: Vec2, slack: f64) -> Option<f64> {
    let Element::Line(line) = &link.element else { return None };
    let out = point - line.start;
    (cross(line.tangent, out).abs() <= slack).then(|| out.dot(&line.tangent))
}

fn end_of(link: &ChainLink, ahead: &Element) -> Vec2 {
    if link.d_in_mm == link.d_out_mm {
        ahead.end()
    } else {
        link.element.offset(link.d_out_mm).map_or(ahead.end(), |element| element.end())
    }
}

fn length(link: &ChainLink, compensated: &Element) -> f64 {
    match link.role {
        Role::Entry | Role::Exit => f64::INFINITY,
        Role::Run(_) | Role::Corner { .. } => compensated.length(),
    }
}

/// Which of two that do not meet is left out: corners first, then the shorter one.
fn is_smaller(a: &ChainLink, b: &ChainLink) -> bool {
    length(a, &a.element) < length(b, &b.element)
}

/// Where the tool leaves one link for the next that is placed.
pub(crate) fn joint(
    a: &ChainLink,
    ending: &Element,
    b: &ChainLink,
    ahead: &Element,
    is_neighbour: bool,
    slack: f64,
) -> Option<Meeting> {
    if a.d_out_mm * b.d_in_mm < 0.0 {
        return meet_across(ending, ahead);
    }
    if !is_neighbour {
        return meet(ending, ahead, slack);
    }
    if b.is_smooth {
        let around_corner =
            matches!(a.role, Role::Corner { .. }) || matches!(b.role, Role::Corner { .. });
        let point = if around_corner {
            // The corner has the exact normals of both; its own point is the run's.
            if matches!(a.role, Role::Corner { .. }) { ahead.start() } else { ending.end() }
        } else {
            line_corner(
                b.element.start(),
                a.element.end_tangent(),
                b.element.start_tangent(),
                b.d_in_mm,
            )
        };
        return Some(Meeting { point, trim_a: 0.0, trim_b: 0.0 });
    }
    if b.is_lengthened {
        return meet_across(ending, ahead);
    }
    if let (Element::Line(before), Element::Line(after)) = (&a.element, &b.element) {
        let cosine = 1.0 + before.tangent.dot(&after.tangent);
        let trim = b.d_in_mm.abs() * cross(before.tangent, after.tangent).abs() / cosine;
        if trim.is_finite() {
            let point = line_corner(after.start, before.tangent, after.tangent, b.d_in_mm);
            return Some(Meeting { point, trim_a: trim, trim_b: trim });
        }
    }
    let meeting = meet(ending, ahead, LENGTH_MM);
    if !is_hardly_bent(a, b) {
        return bent(a, b, meeting);
    }
    // Rounded coordinates bend what was tangent, and what was merged ends a hair off what comes
    // next. Such nearly tangent offsets meet far from the joint, or not at all.
    let is_near = |it: &Meeting| it.trim_a.max(it.trim_b) <= 2.0 * MERGE_MM;
    meeting.filter(is_near).or_else(|| {
        let (before, after) = (a.element.end_tangent(), b.element.start_tangent());
        let point = line_corner(b.element.start(), before, after, b.d_in_mm);
        Some(Meeting { point, trim_a: 0.0, trim_b: 0.0 })
    })
}

/// The joint at a small inside corner, where the last digit of a centre moves the meeting point of
/// two nearly tangent circles away: there the tangents meet.
fn bent(a: &ChainLink, b: &ChainLink, meeting: Option<Meeting>) -> Option<Meeting> {
    let (before, after) = (a.element.end_tangent(), b.element.start_tangent());
    let sine = cross(before, after) * b.d_in_mm.signum();
    let gap_mm = sine * b.d_in_mm.abs();
    let is_near = |it: &Meeting| it.trim_a.max(it.trim_b) <= 4.0 * gap_mm;
    let is_small = before.dot(&after) > 0.0
        && (0.0..SMALL_TURN_RAD).contains(&sine)
        && (b.element.start() - a.element.end()).norm() <= LENGTH_MM
        && is_flat(&a.element, a.d_out_mm, gap_mm)
        && is_flat(&b.element, b.d_in_mm, gap_mm);
    if !is_small || meeting.as_ref().is_some_and(is_near) {
        return meeting;
    }
    let point = line_corner(b.element.start(), before, after, b.d_in_mm);
    Some(Meeting { point, trim_a: gap_mm / 2.0, trim_b: gap_mm / 2.0 })
}

/// Whether one element continues the other within what merging allows. Without a joint the tool
/// would come nearer by half the square of the sine, times its radius.
fn is_hardly_bent(a: &ChainLink, b: &ChainLink) -> bool {
    let (before, after) = (a.element.end_tangent(), b.element.start_tangent());
    let sine = cross(before, after).abs();
    before.dot(&after) > 0.0
        && sine < SMALL_TURN_RAD
        && sine * b.d_in_mm.abs() <= MERGE_MM
        && (b.element.start() - a.element.end()).norm() <= MERGE_MM
}
