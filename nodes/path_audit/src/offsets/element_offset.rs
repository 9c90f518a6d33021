//! Checks one element against its own leg: distance, direction, where it begins and ends, and the
//! joint with the element before it.

use crate::blocks::chains::Chains;
use crate::blocks::tool_path::ToolPath;
use crate::geometry::planar::{Piece, Point, carriers_cross, cross};
use crate::report::{self, Report};
use std::f64::consts::TAU;

/// How far an element may be off its place, mm: some times the longest element that the planner
/// drops.
pub(crate) const PLACE_MM: f64 = 5e-6;
/// Legs that stay so close to one line or arc may be merged, mm.
pub(crate) const MERGE_MM: f64 = 1e-4;
/// A shorter element has no reliable direction, mm.
const SHORT_MM: f64 = 1e-3;
/// Smaller offsets count as none, mm.
const ZERO_MM: f64 = 1e-9;
/// Smaller turns may be none, rad.
const STRAIGHT_RAD: f64 = 1.1e-3;

/// An element of role contour and the leg that it follows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ElementOnLeg {
    pub element: usize,
    pub block: u32,
    /// Index among all legs.
    pub leg_index: usize,
    pub piece: Piece,
    pub leg: Piece,
    pub d_in: f64,
    pub d_out: f64,
    /// It may begin before its leg or after it: at an outside corner.
    pub is_open: bool,
    /// It is merged with a neighbour, or the path leaves out legs next to it.
    pub is_loose: bool,
    /// It begins after a merged arc, so it may miss its own start.
    pub is_after_merged: bool,
    /// How far off its circle its arc, or the one before it, is programmed to end, mm.
    pub uneven_mm: f64,
}

/// Whether two elements are on one line or circle.
pub(crate) fn runs_on(a: &Piece, b: &Piece) -> bool {
    match (&a.round, &b.round) {
        (None, None) => {
            let (ta, tb) = (a.tangent(a.to), b.tangent(b.from));
            let shorter = a.length().min(b.length());
            ta.dot(&tb) > 0.0 && cross(ta, tb).abs() * shorter <= PLACE_MM
        }
        (Some(one), Some(other)) => {
            (one.center - other.center).norm() <= PLACE_MM
                && (one.radius - other.radius).abs() <= PLACE_MM
                && one.sweep * other.sweep > 0.0
        }
        _ => false,
    }
}

/// How far the circle of an element is from the offset circle of its leg, mm.
pub(crate) fn off_circle(piece: &Piece, leg: &Piece, d_mm: f64) -> f64 {
    match (&piece.round, &leg.round) {
        (Some(round), Some(leg)) if round.sweep * leg.sweep > 0.0 => {
            let radius = leg.radius - d_mm * leg.sweep.signum();
            (round.center - leg.center).norm() + (round.radius - radius).abs()
        }
        _ => f64::INFINITY,
    }
}

/// Checks one element, once the next one is known.
pub(crate) fn check_element(
    tool_path: &mut ToolPath<'_>,
    on_leg: &ElementOnLeg,
    chains: &Chains<'_>,
    opens: bool,
    report: &mut Report<'_>,
) {
    let ElementOnLeg { piece, leg, d_in, d_out, .. } = on_leg;
    let element = &tool_path.path.elements[on_leg.element];
    let is_short = leg.length() <= 1.01 * MERGE_MM;
    let coarse = report.profile.accept_tolerance_mm.max(MERGE_MM) + PLACE_MM;
    let mut place_mm = if on_leg.is_loose || is_short { coarse } else { PLACE_MM };
    place_mm += on_leg.uneven_mm + rounding(leg);
    if let Some(round) = &piece.round {
        let radii = (round.radius, (piece.to - round.center).norm());
        let is_merged = on_leg.is_loose || has_short_neighbour(tool_path, on_leg.leg_index, chains);
        let even_mm = if is_merged { coarse } else { 2.0 * PLACE_MM };
        // Without an offset the arc is the programmed one, uneven or not.
        let is_programmed = d_in.abs().max(d_out.abs()) < ZERO_MM;
        let even_mm = even_mm + if is_programmed { unevenness(leg) } else { 0.0 };
        if (radii.0 - radii.1).abs() > even_mm.max(1e-6 * radii.0) {
            report.push(report::uneven(element, radii));
            return;
        }
    }
    let (off, found) = match (&piece.round, &leg.round) {
        _ if d_in != d_out => {
            let off = |point: Point| cross(leg.tangent(leg.from), point - leg.from);
            let offs = (off(piece.from) - d_in, off(piece.to) - d_out);
            let worst = if offs.0.abs() > offs.1.abs() { offs.0 } else { offs.1 };
            (worst.abs(), d_in.abs() + worst * d_in.signum())
        }
        (None, None) => off_line(piece, leg, *d_in),
        (Some(round), Some(of_leg)) => {
            let found = (round.radius - of_leg.radius).abs();
            let off = off_circle(piece, leg, *d_in);
            let is_off_centre = off - (found - d_in.abs()).abs() > PLACE_MM;
            (off, if is_off_centre { d_in.abs() - off } else { found })
        }
        _ => (f64::INFINITY, f64::NAN),
    };
    if is_short && off > place_mm {
        // Accepted where its ends are at the right distance from the leg: it belongs to a
        // neighbour.
        let off_leg = |point: Point| match &piece.round {
            None => (cross(piece.tangent(piece.from), point - piece.from) + d_in).abs(),
            Some(round) => {
                let distance = (point - round.center).norm();
                ((distance - round.radius).abs() - d_in.abs()).abs()
            }
        };
        if off_leg(leg.from).max(off_leg(leg.to)) <= place_mm {
            return;
        }
    }
    if off.is_infinite() {
        report.push_shape(report::wrong_place(
            element,
            "has a different shape, or turns the other way",
        ));
        return;
    }
    if off > place_mm
        && (on_leg.is_after_merged || has_short_neighbour(tool_path, on_leg.leg_index, chains))
    {
        // A leg as short as that is merged with its neighbour; an element after a merged arc may
        // miss its start.
        place_mm = place_mm.max(1.01 * MERGE_MM);
    }
    if off > place_mm {
        report.push_shape(report::wrong_offset(element, d_in.abs(), found));
        return;
    }
    if on_leg.is_loose {
        let block = &mut tool_path.program.blocks[on_leg.block as usize];
        block.slack_mm =
            block.slack_mm.max((slack(piece, leg, *d_in) + PLACE_MM).min(coarse) as f32);
    }
    if d_in == d_out
        && let Some(what) = wrong_extent(on_leg, opens, place_mm)
    {
        report.push_shape(report::wrong_place(element, what));
    }
}

/// The rounding of far-away coordinates, where offsets meet at a small angle, mm.
fn rounding(leg: &Piece) -> f64 {
    const PART: f64 = 1e-11;
    PART * leg.from.amax().max(leg.to.amax())
}

/// How much the distances of the two programmed ends of an arc from its centre differ, mm. If the
/// ends are too close together to correct the centre, it stays as programmed.
pub(crate) fn unevenness(leg: &Piece) -> f64 {
    leg.round.map_or(0.0, |round| ((leg.to - round.center).norm() - round.radius).abs())
}

/// Whether a leg or a neighbour of it is so short that it is merged.
pub(crate) fn has_short_neighbour(
    tool_path: &ToolPath<'_>,
    index: usize,
    chains: &Chains<'_>,
) -> bool {
    let first = index.saturating_sub(1);
    (first..chains.all_legs.len().min(first + 3))
        .any(|leg| chains.leg(tool_path, leg).length() <= 1.01 * MERGE_MM)
}

/// How far off a line is, and how far from its leg it runs.
fn off_line(piece: &Piece, leg: &Piece, d_mm: f64) -> (f64, f64) {
    let (along_leg, along) = (leg.tangent(leg.from), piece.tangent(piece.from));
    let off_leg = |point: Point| cross(along_leg, point - leg.from) - d_mm;
    let off_path = |point: Point| cross(along, point - piece.from) + d_mm;
    let (a, b) = (off_leg(piece.from), off_leg(piece.to));
    let (c, d) = (off_path(leg.from), off_path(leg.to));
    let worst = if a.abs() > b.abs() { a } else { b };
    let off = worst.abs().min(c.abs().max(d.abs()));
    (off, d_mm.abs() + worst * d_mm.signum())
}

/// How much nearer to the leg than its radius the element may be, mm.
fn slack(piece: &Piece, leg: &Piece, d_mm: f64) -> f64 {
    match (&piece.round, &leg.round) {
        (None, None) => {
            let of =
                |point: Point| (cross(piece.tangent(piece.from), point - piece.from) + d_mm).abs();
            of(leg.from).max(of(leg.to))
        }
        _ => off_circle(piece, leg, d_mm).min(f64::MAX),
    }
}

/// What is wrong with where an element begins and ends along its leg.
fn wrong_extent(on_leg: &ElementOnLeg, opens: bool, place_mm: f64) -> Option<&'static str> {
    let ElementOnLeg { piece, leg, .. } = on_leg;
    let length = leg.length();
    let long_enough = length > 10.0 * place_mm && piece.length() > SHORT_MM;
    match (&piece.round, &leg.round) {
        (None, None) => {
            // For a merged line its own direction counts, not that of a short leg.
            let tangent = piece.tangent(piece.from);
            let along_leg = leg.tangent(leg.from);
            let ahead = tangent.dot(&along_leg);
            // Joints next to a block that is left out may turn it a little. Then the direction of
            // the leg is accepted too: over the radius of the tool a small turn is more than the
            // tolerance.
            let along = |off: Point| {
                [off.dot(&tangent), off.dot(if on_leg.is_loose { &along_leg } else { &tangent })]
            };
            let begins = along(piece.from - leg.from);
            let ends = along(piece.to - leg.to).map(|beyond| length + beyond);
            let is_early = |at: [f64; 2], limit: f64| at.into_iter().all(|at| at < limit);
            let is_late = |at: [f64; 2], limit: f64| at.into_iter().all(|at| at > limit);
            if long_enough && ahead <= 0.0 {
                return Some("runs backwards");
            }
            if (!on_leg.is_open && is_early(begins, -place_mm))
                || is_late(begins, length + place_mm)
            {
                return Some("begins outside the block");
            }
            if (!opens && is_late(ends, length + place_mm)) || is_early(ends, -place_mm) {
                return Some("ends outside the block");
            }
        }
        (Some(round), Some(of_leg)) => {
            let (begin, end) = (leg.along(piece.from), leg.along(piece.to));
            let swept = round.sweep.abs() * of_leg.radius;
            let full = TAU * of_leg.radius;
            let more = if on_leg.is_open || opens { full } else { 0.0 };
            // Both of its ends may be off by the tolerance.
            if swept > length + more + 2.0 * place_mm {
                return Some("turns too far");
            }
            if !on_leg.is_open && !opens && long_enough && length < full - place_mm {
                let inside =
                    |along: f64| along >= -2.0 * place_mm && along <= length + 2.0 * place_mm;
                // Next to a very short circle its own places are coarse.
                let scale = (of_leg.radius / round.radius.max(1e-9)).max(1.0);
                if !inside(begin)
                    || !inside(end)
                    || (end - begin - swept).abs() > 4.0 * scale * place_mm
                {
                    return Some("runs outside the block");
                }
            }
        }
        _ => {}
    }
    None
}

/// Whether an element is an arc at least as long as its leg.
fn is_lengthened(on_leg: &ElementOnLeg) -> bool {
    let round = on_leg.piece.round.zip(on_leg.leg.round);
    round.is_some_and(|(round, leg)| round.sweep.abs() >= leg.sweep.abs())
}

/// Checks that the contour begins at the start of its first leg, or ends at the end of its last.
pub(crate) fn check_reach(
    tool_path: &ToolPath<'_>,
    on_leg: &ElementOnLeg,
    lead: Option<u32>,
    is_first: bool,
    report: &mut Report<'_>,
) {
    let ElementOnLeg { piece, leg, .. } = on_leg;
    let place_mm = MERGE_MM.max(report.profile.accept_tolerance_mm) + PLACE_MM;
    if leg.length() <= place_mm || is_lengthened(on_leg) || piece.is_line() != leg.is_line() {
        return;
    }
    let (end, due) = if is_first { (piece.from, leg.from) } else { (piece.to, leg.to) };
    let ahead_mm = match &leg.round {
        // A line whose offset changes is not parallel to its leg.
        None if on_leg.d_in != on_leg.d_out => (end - due).dot(&leg.tangent(due)),
        None => (end - due).dot(&piece.tangent(end)),
        Some(round) => {
            let (a, b) = (due - round.center, end - round.center);
            cross(a, b).atan2(a.dot(&b)) * round.sweep.signum() * round.radius
        }
    };
    let missing = if is_first { ahead_mm } else { -ahead_mm };
    if missing <= place_mm {
        return;
    }
    // Where it is joined to the offset of the lead, it begins or ends within the leg.
    let d_mm = if is_first { on_leg.d_in } else { on_leg.d_out };
    if !meets_lead(tool_path, lead, end, d_mm, place_mm) {
        let element = &tool_path.path.elements[on_leg.element];
        let what = if is_first { "begins after its start" } else { "ends before its end" };
        report.push_shape(report::wrong_place(element, what));
    }
}

/// Whether a place is on the offset of a lead, where a joint with the lead is.
pub(crate) fn meets_lead(
    tool_path: &ToolPath<'_>,
    lead: Option<u32>,
    at: Point,
    d_mm: f64,
    place_mm: f64,
) -> bool {
    lead.is_some_and(|lead| {
        let lead = tool_path.leg(lead);
        let off = cross(lead.tangent(lead.from), at - lead.from);
        lead.is_line() && lead.length() > 0.0 && (off - d_mm).abs() <= place_mm
    })
}

/// Checks a joint without a corner element. Where the contour turns towards the tool, the elements
/// meet within both legs; where it turns away, beyond both.
pub(crate) fn check_joint(
    tool_path: &ToolPath<'_>,
    a: &ElementOnLeg,
    b: &ElementOnLeg,
    report: &mut Report<'_>,
) -> bool {
    if a.d_in != a.d_out || b.d_in != b.d_out || b.d_in == 0.0 {
        return true;
    }
    let short_mm = report.profile.corner.short_block_mm;
    if let Some(at) = nearer_joint(a, b, short_mm) {
        let element = &tool_path.path.elements[b.element];
        let what = format!("meets the block before it {at:.4} mm from where their offsets meet");
        report.push_shape(report::wrong_place(element, &what));
        return true;
    }
    let (before, after) = (a.piece.tangent(a.piece.to), b.piece.tangent(b.piece.from));
    let sine = cross(before, after) * b.d_in.signum();
    let shorter = a.piece.length().min(b.piece.length());
    if shorter <= SHORT_MM {
        return true;
    }
    let straight = STRAIGHT_RAD.max(4e-6 / shorter);
    if sine.abs() <= straight {
        return sine < 0.0 || before.dot(&after) < 0.0;
    }
    if sine > 0.0 {
        return false;
    }
    let place_mm = if a.is_loose || b.is_loose {
        report.profile.accept_tolerance_mm + MERGE_MM
    } else {
        PLACE_MM
    };
    let from_corner = (b.piece.from - b.leg.from).norm().max((b.piece.from - a.leg.to).norm());
    if from_corner < b.d_in.abs() - place_mm {
        let element = &tool_path.path.elements[b.element];
        report.push_shape(report::wrong_offset(element, b.d_in.abs(), from_corner));
        return true;
    }
    let turn = cross(a.leg.tangent(a.leg.to), b.leg.tangent(b.leg.from)) * b.d_in.signum();
    if a.leg_index + 1 == b.leg_index && !a.is_loose && !b.is_loose && turn > STRAIGHT_RAD {
        // At an inside corner there is nothing to go around.
        let element = &tool_path.path.elements[b.element];
        report.push_shape(report::wrong_place(
            element,
            "meets the block before it on the wrong side",
        ));
    }
    true
}

/// How far a joint is from a place nearer to its corner where the two offsets also cross, mm. Where
/// the offsets nearly touch, any place is as good, so the result is `None`.
fn nearer_joint(a: &ElementOnLeg, b: &ElementOnLeg, short_mm: f64) -> Option<f64> {
    if a.leg_index + 1 != b.leg_index || a.is_loose || b.is_loose {
        return None;
    }
    let turn = cross(a.leg.tangent(a.leg.to), b.leg.tangent(b.leg.from)) * b.d_in.signum();
    if turn.abs() <= STRAIGHT_RAD {
        return None;
    }
    let (before, after) = (a.leg.offset(a.d_out)?, b.leg.offset(b.d_in)?);
    let at = b.piece.from;
    let sine = |root: Point| cross(before.tangent(root), after.tangent(root)).abs();
    // What both lose at a joint. The smaller loss wins: inside both get shorter, outside both get
    // longer by no more than a short block. A hair beyond the joint of a full circle is not a whole
    // turn.
    let of = |piece: &Piece, lost: f64| {
        let around = piece.round.map_or(f64::INFINITY, |round| TAU * round.radius);
        if lost > around - PLACE_MM { lost - around } else { lost }
    };
    let lost = |root: Point| {
        let of_a = of(&before, before.length() - before.along(root));
        (of_a, of(&after, after.along(root)))
    };
    let mut roots = carriers_cross(&before, &after)
        .into_iter()
        .flatten()
        .filter(|&root| (at - root).norm() > SHORT_MM && sine(root) > STRAIGHT_RAD)
        .peekable();
    roots.peek()?;
    let (of_a, of_b) = lost(at);
    let (here, far) = (of_a + of_b, of_a.abs() + of_b.abs());
    let is_better = |root: &Point| {
        let (of_a, of_b) = lost(*root);
        let both = |is: &dyn Fn(f64) -> bool| is(of_a) && is(of_b);
        if turn > STRAIGHT_RAD {
            both(&|of| of > PLACE_MM) && of_a + of_b + SHORT_MM < here
        } else {
            turn < -STRAIGHT_RAD
                && both(&|of| (-2.0 * short_mm..=PLACE_MM).contains(&of))
                && of_a.abs() + of_b.abs() + SHORT_MM < far
        }
    };
    roots.find(is_better).map(|root| (at - root).norm())
}
