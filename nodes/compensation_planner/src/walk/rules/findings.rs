//! The findings about broken rules of a control, each with the values of the profile that it obeys.

use super::of;
use crate::check::finding::{block_name, rounded_down};
use crate::geometry::element::{Arc, Element, Vec2};
use crate::geometry::tolerance::{MERGE_MM, RADIUS_MM};
use crate::span::lead_arc::{NoLeadArc, radius_of_angle};
use cnc_msgs::contour::{Motion, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{AXIS_LETTERS, Direction, Plane, Shape};
use cnc_msgs::numbers::with_enough_digits;
use cnc_msgs::profile::{
    CancelBeforeEnd, HomeMode, InsideArc, LeadMove, Profile, RadiusChange, RapidMode, Reselect,
    SideChange, Strictness,
};

/// Coordinates that can be computed with: finite, and no farther than 1000 km.
pub(crate) fn is_sane(motion: &Motion) -> bool {
    const FAR_MM: f64 = 1e9;
    let center = match motion.shape {
        Shape::Arc(arc) => arc.center,
        Shape::Line => motion.end,
    };
    motion.end.iter().chain(&center).all(|value| value.abs() <= FAR_MM)
}

/// Axes of the plane that compensation does not apply to (A01).
pub(crate) fn dominant_axes(source: Source, plane: Plane, profile: &Profile) -> Option<Finding> {
    let rule = &profile.language.dominant_axes;
    let missing = crate::geometry::frame::plane_axes(plane).without(rule.rule);
    (!missing.is_empty()).then(|| {
        of(
            rule.strictness,
            Code::Axes,
            source,
            format!(
                "compensation in the {} plane needs {}, and {} compensates {} only",
                plane.name(),
                missing.letters(),
                profile.name,
                rule.rule.letters()
            ),
        )
        .help("configure the axis as dominant (language.dominant_axes in the profile), or choose another plane")
    })
}

/// Homing while compensation is active (A05, C16).
pub(crate) fn homed(source: Source, since: Source, was_active: bool, profile: &Profile) -> Finding {
    let message = match profile.home.rule {
        HomeMode::Drop if was_active => format!(
            "homing ends the compensation of {} at once, without a lead-off",
            block_name(since)
        ),
        HomeMode::Drop => format!(
            "homing ends the compensation of {} before its lead-on; what follows is not compensated",
            block_name(since)
        ),
        HomeMode::Forbidden => format!(
            "homing while the compensation of {} is active, which {} forbids",
            block_name(since),
            profile.name
        ),
    };
    let mut finding =
        of(profile.home.strictness, Code::ForbiddenUnderCompensation, source, message).help(
            if was_active {
                "cancel with G40 and a lead-off before homing"
            } else {
                "home first, then select the compensation"
            },
        );
    finding.other = Some(since);
    finding
}

/// The cancel and its move stand in the block that ends the program (S32).
pub(crate) fn cancelled_with_the_end(source: Source, profile: &Profile) -> Option<Finding> {
    let rule = profile.cancel.before_end;
    (rule.rule == CancelBeforeEnd::OwnBlock).then(|| {
        of(
            rule.strictness,
            Code::NotCancelled,
            source,
            format!(
                "the cancel stands in the block that ends the program; {} needs it in a block before",
                profile.name
            ),
        )
        .help("write G40 and its move into a block of their own, and the end of the program after it")
    })
}

/// A rapid does not hold the offset (A08, C9).
pub(crate) fn rapid(source: Source, profile: &Profile) -> Option<Finding> {
    let what = match profile.rapid.rule {
        RapidMode::Compensated => return None,
        RapidMode::Endpoint => {
            "only its ends are compensated, and each axis moves independently between them"
        }
        RapidMode::Raw => "it goes to the programmed point, and compensation begins anew after it",
    };
    Some(
        of(
            profile.rapid.strictness,
            Code::SuspiciousValue,
            source,
            format!("{} does not hold the offset along a rapid: {what}", profile.name),
        )
        .help("use a feed move, or cancel the compensation before"),
    )
}

/// A change of side where the offsets do not meet (O02, C12).
pub(crate) fn no_intersection(source: Source, profile: &Profile) -> Finding {
    let mut finding = of(
        profile.side_change.strictness,
        Code::SideChange,
        source,
        "the side changes where the offsets of both blocks do not meet",
    )
    .help("change the side at a corner, or cancel and select again");
    finding.alarm.clone_from(&profile.side_change.alarm);
    finding
}

/// The tool runs inside an arc that is too small for the control.
pub(crate) fn inside_arc(
    source: Source,
    element: &Element,
    d_mm: f64,
    profile: &Profile,
) -> Option<Finding> {
    let rule = profile.interference.inside_arc;
    let Element::Arc(arc) = element else { return None };
    let needed_mm = 2.0 * d_mm.abs();
    if rule.rule == InsideArc::Any || arc.turn * d_mm <= 0.0 || arc.radius >= needed_mm - RADIUS_MM
    {
        return None;
    }
    let [radius, needed] = with_enough_digits(arc.radius, needed_mm);
    let mut finding = of(
        rule.strictness,
        Code::ArcRadius,
        source,
        format!(
            "the tool runs inside an arc of radius {radius} mm; {} needs twice the radius of the tool, {needed} mm",
            profile.name
        ),
    )
    .help(format!("use a nose radius of at most {:.3} mm", rounded_down(arc.radius / 2.0)));
    finding.needed_mm = Some(needed_mm);
    finding.available_mm = Some(arc.radius);
    Some(finding)
}

/// The programmed ends of an arc are not on one circle, and too near to each other to locate it.
///
/// Without an offset the arc runs as programmed.
pub(crate) fn uneven_arc(
    source: Source,
    element: &Element,
    end: Vec2,
    d_mm: f64,
    profile: &Profile,
) -> Option<Finding> {
    let Element::Arc(arc) = element else { return None };
    let off_mm = element.unevenness(end);
    if d_mm.abs() < RADIUS_MM || off_mm <= profile.accept_tolerance_mm.max(MERGE_MM) {
        return None;
    }
    let at_end = (end - arc.center).norm();
    let [begin, end] = with_enough_digits(arc.radius, at_end);
    let mut finding = Finding::error(
        Code::ArcRadius,
        source,
        format!(
            "the arc begins {begin} mm and ends {end} mm from its centre, and its ends are too near to each other to correct that; at most {} mm are accepted under compensation",
            profile.accept_tolerance_mm
        ),
    )
    .help("write the end or the centre with more decimals, or split the arc");
    finding.needed_mm = Some(arc.radius);
    finding.available_mm = Some(at_end);
    Some(finding)
}

/// An arc that no arc leads to its offset, for a tool at a signed distance from it.
pub(crate) fn no_lead_arc(source: Source, why: NoLeadArc, d_mm: f64) -> Finding {
    let radius_mm = d_mm.abs();
    let straight = "put a straight move in the plane before the arc";
    match why {
        NoLeadArc::FullCircle => Finding::error(
            Code::LeadType,
            source,
            "the lead-on is a full circle; an arc that leads to the contour must end elsewhere",
        )
        .help(straight),
        NoLeadArc::Short { chord_mm } => {
            let [chord, radius] = with_enough_digits(chord_mm, radius_mm);
            let mut finding = Finding::error(
                Code::LeadLength,
                source,
                format!(
                    "the lead-on is an arc whose ends are {chord} mm apart; they must be farther \
                     apart than the radius of {radius} mm"
                ),
            )
            .help(format!("move its start away from its end, use a smaller tool, or {straight}"));
            (finding.needed_mm, finding.available_mm) = (Some(radius_mm), Some(chord_mm));
            finding
        }
        NoLeadArc::Inside { radius_mm_limit, wanted_mm } => {
            let [limit, radius] = with_enough_digits(radius_mm_limit, radius_mm);
            let mut finding = Finding::error(
                Code::LeadType,
                source,
                format!(
                    "the lead-on is an arc that leads tools with a radius below {limit} mm along its \
                     inside; this one has {radius} mm"
                ),
            )
            .help(format!("{}, use a smaller tool, or {straight}", larger_arc(wanted_mm, radius_mm)));
            (finding.needed_mm, finding.available_mm) = (Some(radius_mm), Some(radius_mm_limit));
            finding
        }
    }
}

/// The arc that leads a tool along its inside: one of the same angle, unless it would be huge. With the same ends a
/// larger one may be worse.
fn larger_arc(wanted_mm: f64, radius_mm: f64) -> String {
    const HUGE: f64 = 10.0;
    let (arc, least) = match wanted_mm < HUGE * radius_mm {
        true => ("an arc of the same angle", wanted_mm),
        false => ("half a circle", radius_mm),
    };
    // Its ends are rounded when they are written.
    let least = (least * 1.002 * 1e2).ceil() / 1e2 + 0.01;
    format!("make it {arc} with a radius of at least {least:.2} mm")
}

/// An arc that leads to its offset as one that is much larger.
pub(crate) fn grown_lead_arc(source: Source, arc: &Arc, run_mm: f64, radius_mm: f64) -> Finding {
    let programmed_mm = arc.radius;
    let [programmed, run] = with_enough_digits(programmed_mm, run_mm);
    let message = format!(
        "the lead-on is an arc with a radius of {programmed} mm, and the centre of this tool runs one with \
         {run} mm"
    );
    let larger = larger_arc(radius_of_angle(arc, radius_mm), radius_mm);
    Finding::warning(Code::LeadType, source, message).help(format!(
        "{larger}, use a smaller tool, or put a straight move in the plane before the arc"
    ))
}

/// An arc as the first move of a tip.
pub(crate) fn arc_lead_of_tip(source: Source, tip: u8) -> Finding {
    Finding::error(
        Code::LeadType,
        source,
        format!("the lead-on is an arc; with tip direction {tip} it must be a straight line"),
    )
    .help("put a straight move in the plane before the arc")
}

/// A corner arc towards a direction that the next block does not have (NCT G39).
pub(crate) fn corner_arc(
    source: Source,
    along: Option<Direction>,
    plane: Plane,
    next: &Element,
) -> Option<Finding> {
    let along = crate::geometry::frame::in_plane(plane, along?);
    let tangent = next.start_tangent();
    let is_same = along.dot(&tangent) > 0.0 && along.normalize().perp(&tangent).abs() < 1e-3;
    (!is_same).then(|| {
        Finding::error(
            Code::Unsupported,
            source,
            "the corner arc ends in a direction that the next block does not have",
        )
        .help("leave out I, J and K, or give the direction of the next block")
    })
}

/// An offset that keeps its direction.
pub(crate) fn no_held_direction(source: Source) -> Finding {
    Finding::error(Code::Unsupported, source, "an offset that keeps its direction is not supported")
        .help("end the contour with G40 and begin the next with G41")
}

/// A motion with invalid coordinates; it is left out.
pub(crate) fn not_sane(source: Source, motion: &Motion) -> Finding {
    let [x, y, z] = motion.end;
    Finding::error(
        Code::BadNumber,
        source,
        format!(
            "the motion to X{x} Y{y} Z{z} has invalid coordinates or an invalid arc centre: not \
             finite, or beyond 1000 km"
        ),
    )
    .help("correct the coordinates of this block")
}

/// A new radius while compensation is active that is refused, or accepted with a warning (A14, S43,
/// S44). The radii are those of the program, with its sign.
pub(crate) fn radius_change(
    source: Source,
    element: &Element,
    (old_mm, new_mm): (f64, f64),
    profile: &Profile,
) -> Option<Finding> {
    const STRAIGHT: &str = "change the radius in a straight block";
    const ANEW: &str = "cancel the compensation before, and select it again with the new radius";
    let rule = profile.radius.change;
    let mut strictness = rule.strictness;
    let mut code = Code::RadiusSource;
    let (what, help) = if rule.rule == RadiusChange::WhenOff {
        ("while compensation is active", ANEW)
    } else if rule.rule == RadiusChange::StraightBlocks && !element.is_line() {
        ("in an arc; it may only change in a straight block", STRAIGHT)
    } else if !element.is_line() {
        strictness = Strictness::Error;
        ("in an arc, which has no offset of two radii", STRAIGHT)
    } else if new_mm.abs() < RADIUS_MM || old_mm.abs() < RADIUS_MM {
        ("from or to 0 while compensation is active", ANEW)
    } else if new_mm.signum() != old_mm.signum() {
        code = Code::SideChange;
        ("its sign while compensation is active, and with it the side", ANEW)
    } else {
        return None;
    };
    let [old, new] = with_enough_digits(old_mm, new_mm);
    let message = format!("the radius changes {what} ({old} mm to {new} mm)");
    let mut finding = of(strictness, code, source, message).help(help);
    finding.needed_mm = Some(new_mm);
    finding.available_mm = Some(old_mm);
    Some(finding)
}

/// A D whose length would shift another axis than Z (S34).
pub(crate) fn length_of_d(source: Source, number: u32, length_mm: f64, axis: usize) -> Finding {
    Finding::warning(
        Code::SuspiciousValue,
        source,
        format!(
            "D{number} has a length of {length_mm} mm, which acts on {} in this plane; controllers offset only Z, so it is not applied",
            AXIS_LETTERS[axis]
        ),
    )
    .help("shift the work offset by the length, and set length_mm of the offset to 0")
}

/// A plane that the control does not compensate in (M16).
pub(crate) fn wrong_plane(source: Source, plane: Plane, profile: &Profile) -> Finding {
    let planes: Vec<&str> = profile.language.planes.rule.iter().map(|plane| plane.name()).collect();
    of(
        profile.language.planes.strictness,
        Code::Plane,
        source,
        format!(
            "compensation in the {} plane; {} compensates in {}",
            plane.name(),
            profile.name,
            planes.join(", ")
        ),
    )
    .help("select the plane before the compensation")
}

/// Another plane while compensation is selected (S17, S27).
pub(crate) fn plane_change(source: Source) -> Finding {
    Finding::error(
        Code::ForbiddenUnderCompensation,
        source,
        "the plane changes while cutter compensation is active",
    )
    .help("cancel the compensation, change the plane, and select the compensation again")
}

/// Whether the control refuses a selection while compensation is active.
pub(crate) fn takes_no_selection(profile: &Profile, is_repeat: bool) -> bool {
    if is_repeat {
        profile.reselect.rule == Reselect::Forbidden
    } else {
        profile.side_change.rule == SideChange::Forbidden
    }
}

/// A selection while compensation is active, which the control refuses.
pub(crate) fn reselected(source: Source, is_repeat: bool, profile: &Profile) -> Finding {
    let what = if is_repeat { "selected again" } else { "selected anew or for the other side" };
    let rule = if is_repeat { profile.reselect.strictness } else { profile.side_change.strictness };
    of(
        rule,
        Code::SideChange,
        source,
        format!("compensation is {what} while it is active, which {} does not take", profile.name),
    )
    .help("cancel with G40 and a lead-off, then select again with a lead-on")
}

/// Compensation that the program does not end (S32), with the tool above the contour or not.
pub(crate) fn not_cancelled(
    source: Source,
    has_cancel: bool,
    is_above: bool,
    profile: &Profile,
) -> Finding {
    let rules = &profile.cancel;
    let message = if has_cancel {
        format!("the cancel has no effect: no {} in the plane follows it", lead_name(rules.lead))
    } else {
        "the program ends while this compensation is active".into()
    };
    let mut finding = Finding::error(Code::NotCancelled, source, message).help(format!(
        "end the contour with G40 and a straight {} in the plane, then end the program",
        lead_name(rules.lead)
    ));
    let at_contour = if has_cancel { rules.if_no_move } else { rules.missing };
    let strictness = rules.missing_above.filter(|_| is_above).unwrap_or(at_contour);
    finding.severity = strictness.severity();
    finding
}

/// A selection that no move in the plane follows.
pub(crate) fn never_active(source: Source, profile: &Profile) -> Finding {
    of(
        profile.select.if_no_move,
        Code::NeverActive,
        source,
        format!(
            "compensation is selected and never becomes active: no {} in the plane follows",
            lead_name(profile.select.lead)
        ),
    )
    .help(format!(
        "program a {} in the plane after the selection, or leave it out",
        lead_name(profile.select.lead)
    ))
}

/// What a lead must be.
fn lead_name(rule: LeadMove) -> &'static str {
    match rule {
        LeadMove::Any => "move",
        LeadMove::Coordinated => "coordinated move (G1, G2 or G3)",
    }
}

/// A move out of the plane right after the cancel (M13).
pub(crate) fn no_lead_off(source: Source, profile: &Profile) -> Finding {
    of(
        profile.cancel.before_off_plane.strictness,
        Code::Cancel,
        source,
        "the tool leaves the plane after the cancel before it has led off the contour",
    )
    .help("after the cancel move to a safe place in the plane, then retract")
}
