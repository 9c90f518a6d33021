//! Puts the planner's findings about geometry into words and numbers.
//!
//! It decides nothing: the code that computes a fault decides about it.

use crate::check::interference::Cut;
use crate::check::reach::{Skipped, Unreachable};
use crate::geometry::element::Vec2;
use crate::geometry::frame::{height, in_work};
use crate::span::{Lead, Run, Span};
use cnc_msgs::contour::{Approach, Source};
use cnc_msgs::finding::{Code, Finding, Severity};
use cnc_msgs::geometry::{AXIS_LETTERS, Plane, Position};
use cnc_msgs::numbers::with_enough_digits;
use cnc_msgs::profile::{OtherSpans, Profile, Reaction, Strictness};

/// `block N40`, or the line if the block has no number.
pub(crate) fn block_name(source: Source) -> String {
    match source.block {
        Some(block) => format!("block N{block}"),
        None => format!("line {}", source.line),
    }
}

/// `X65.000 Y55.000`.
pub(crate) fn place(plane: Plane, position: Position) -> String {
    let [u, v, _] = plane.axes();
    let (first, second) = (u.min(v), u.max(v));
    format!(
        "{}{:.3} {}{:.3}",
        AXIS_LETTERS[first], position[first], AXIS_LETTERS[second], position[second]
    )
}

/// `the tool (radius 5.000 mm, on the right)`: G41 and G42 are often confused (O04).
fn tool(d_mm: f64) -> String {
    tool_of(d_mm, &format!("{:.3}", d_mm.abs()))
}

fn tool_of(d_mm: f64, radius: &str) -> String {
    let side = if d_mm < 0.0 { "right" } else { "left" };
    format!("the tool (radius {radius} mm, on the {side})")
}

/// Rounds a radius down to three decimals, so that the shown value certainly fits.
pub(crate) fn rounded_down(radius_mm: f64) -> f64 {
    (radius_mm * 1e3).floor() / 1e3
}

/// The tool is too large for these elements.
pub(crate) fn unreachable(
    span: &Span<'_>,
    runs: &[Run],
    place_of: &Unreachable,
    profile: &Profile,
) -> Finding {
    let blamed = &runs[place_of.longest];
    let leg = &span.legs[blamed.legs.start];
    let radius_mm = blamed.d_in_mm.abs();
    let limit_mm = place_of.radius_mm_max;
    let position = in_work(span.plane, blamed.element.start(), height(span.plane, leg.motion.end));
    let first = span.legs[runs[place_of.first].legs.start].source;
    let last = span.legs[runs[place_of.last].legs.end - 1].source;
    let blocks = if first.line == last.line {
        block_name(leg.source)
    } else {
        format!("{} to {}", block_name(first), block_name(last))
    };
    let [radius, limit] = with_enough_digits(radius_mm, limit_mm);
    let mut finding = Finding::error(
        Code::Unreachable,
        leg.source,
        format!(
            "{} does not reach {blocks} at {}: \
             nothing is left of the compensated path; at most {limit} mm fits",
            tool_of(blamed.d_in_mm, &radius),
            place(span.plane, position)
        ),
    );
    finding.alarm.clone_from(&profile.interference.alarm);
    let apart = place_of.last - place_of.first + 2;
    soften(&mut finding, apart, profile);
    finding.other = [first, last].into_iter().find(|other| !other.is_same_place(leg.source));
    finding.position = Some(position);
    finding.needed_mm = Some(radius_mm);
    finding.available_mm = Some(limit_mm);
    let fits = rounded_down(limit_mm);
    if place_of.is_by_lead {
        finding.message += "; the lead meets the contour in an inside corner";
        return finding.help(
            "turn the lead so that it meets the contour at a right angle or less, from the side of the tool, or use a smaller tool",
        );
    }
    finding.help(if fits > 0.0 {
        format!("this place takes tools up to radius {fits:.3} mm")
    } else {
        "no tool fits here: check that the compensation is on the right side".into()
    })
}

/// Applies what the profile says of a contour that the tool does not fit (C18), and of one that its
/// control cannot see because it looks too few blocks ahead (C17).
fn soften(finding: &mut Finding, apart: usize, profile: &Profile) {
    let mut severity = match profile.interference.react {
        Reaction::Alarm => Severity::Error,
        Reaction::Trim | Reaction::Ignore => Severity::Warning,
    };
    if profile.interference.react == Reaction::Trim {
        finding.message += "; what does not fit is left out";
    }
    if let Some(blocks) = profile.lookahead.blocks
        && apart > blocks as usize
    {
        finding.message += &format!(
            "; {} looks {blocks} {} ahead and would not see it",
            profile.name,
            if blocks == 1 { "block" } else { "blocks" }
        );
        severity = severity.min(profile.lookahead.strictness.severity());
    }
    finding.severity = severity;
}

/// The tool does not reach more places than are listed.
pub(crate) fn more_unreachable(
    span: &Span<'_>,
    runs: &[Run],
    next: &Unreachable,
    listed: usize,
    profile: &Profile,
) -> Finding {
    let source = span.legs[runs[next.longest].legs.start].source;
    let message = format!(
        "from here on there are more places that the tool does not reach; only the first {listed} \
         are listed"
    );
    let mut finding = Finding::error(Code::Limit, source, message)
        .help("use a smaller tool, or check that the compensation is on the right side");
    if profile.interference.react != Reaction::Alarm {
        finding.severity = Severity::Warning;
    }
    finding
}

/// A lead makes the tool skip these blocks.
pub(crate) fn skipped_by_lead(
    span: &Span<'_>,
    runs: &[Run],
    skipped: &Skipped,
    exit: Option<&Lead>,
) -> Finding {
    let (first, last) = (&span.legs[runs[skipped.first].legs.start], {
        &span.legs[runs[skipped.last].legs.end - 1]
    });
    let lead = match exit {
        Some(exit) if !skipped.is_by_entry => exit.source,
        _ => span.entry.lead.source,
    };
    let blocks = match first.source.line == last.source.line {
        true => block_name(first.source),
        false => format!("{} to {}", block_name(first.source), block_name(last.source)),
    };
    let stays_mm = skipped.stays_mm;
    let message = format!(
        "{} meets the contour in an inside corner with the lead and skips {blocks}: up to \
         {stays_mm:.4} mm of them stays",
        tool(span.d_mm)
    );
    let mut finding =
        Finding::warning(Code::Uncut, lead, message).help(match skipped.is_by_entry {
            true => "lead onto the contour in the direction of its first block",
            false => "leave the contour in the direction of its last block",
        });
    finding.other = Some(first.source).filter(|other| !other.is_same_place(lead));
    let at = runs[skipped.first].element.start();
    finding.position = Some(in_work(span.plane, at, height(span.plane, first.motion.end)));
    finding.available_mm = Some(stays_mm);
    finding
}

/// The tool cuts into one element while it follows another.
pub(crate) fn cut(span: &Span<'_>, runs: &[Run], cut: &Cut, profile: &Profile) -> Finding {
    let into = &span.legs[runs[cut.into].legs.start];
    let (on, later) = (
        span.legs[runs[cut.on].legs.start].source,
        span.legs[runs[cut.on.max(cut.into)].legs.start].source,
    );
    let depth_mm = cut.radius_mm - cut.distance_mm;
    let position =
        in_work(span.plane, (cut.foot + cut.on_wall) / 2.0, height(span.plane, into.motion.end));
    let code = if cut.is_other_pass { Code::CutsOtherPass } else { Code::Gouge };
    let mut finding = Finding::error(
        code,
        later,
        format!(
            "{} cuts {depth_mm:.4} mm into {} at {} while it follows {}",
            tool(cut.radius_mm.copysign(runs[cut.on].d_in_mm)),
            block_name(into.source),
            place(span.plane, position),
            block_name(on)
        ),
    );
    let apart = runs[cut.on].legs.start.abs_diff(runs[cut.into].legs.start);
    soften(&mut finding, apart, profile);
    if cut.is_other_pass || cut.is_forgiven {
        finding.severity = Severity::Warning;
    }
    finding.other = [into.source, on].into_iter().find(|other| !other.is_same_place(later));
    finding.position = Some(position);
    finding.depth_mm = Some(depth_mm);
    finding.needed_mm = Some(cut.radius_mm);
    finding.available_mm = Some(cut.radius_mm - depth_mm / 2.0);
    finding.alarm.clone_from(&profile.interference.alarm);
    finding.help("use a smaller tool, or begin and end the contour where it does not bend back")
}

/// The tool cuts into a contour of an earlier span.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OtherCut {
    pub on: Source,
    pub into: Source,
    pub on_wall: Vec2,
    pub height_mm: f64,
    /// Signed, positive to the left.
    pub d_mm: f64,
    pub distance_mm: f64,
}

impl OtherCut {
    pub(crate) fn depth_mm(&self) -> f64 {
        self.d_mm.abs() - self.distance_mm
    }
}

/// The tool cuts into an earlier contour.
pub(crate) fn cuts_other_span(
    cut: &OtherCut,
    plane: Plane,
    is_last: bool,
    profile: &Profile,
) -> Finding {
    let depth_mm = cut.depth_mm();
    let position = in_work(plane, cut.on_wall, cut.height_mm);
    let message = format!(
        "{} cuts {depth_mm:.4} mm into {}, of an earlier contour, at {} while it follows {}{}",
        tool(cut.d_mm),
        block_name(cut.into),
        place(plane, position),
        block_name(cut.on),
        if is_last { "; contours after this one are not compared with earlier ones" } else { "" }
    );
    let mut finding = Finding::error(Code::CutsOtherSpan, cut.on, message).help(
        "check the distance between both contours; where each is of a part of its own, set \
         interference.other_spans to ignore",
    );
    if profile.interference.other_spans != OtherSpans::Error {
        finding.severity = Severity::Warning;
    }
    finding.other = Some(cut.into);
    finding.position = Some(position);
    finding.depth_mm = Some(depth_mm);
    finding.needed_mm = Some(cut.d_mm.abs());
    finding.available_mm = Some(cut.distance_mm);
    finding
}

/// More contours lie near each other than can be compared.
pub(crate) fn too_many_spans(span: &Span<'_>) -> Finding {
    Finding::warning(
        Code::Limit,
        span.entry.lead.source,
        "so many contours lie near each other that those after this block are not compared with \
         earlier ones",
    )
    .help("split the program in two, or set interference.other_spans to ignore")
}

/// A cut that remains after everything that does not fit was left out.
pub(crate) fn not_trimmed(span: &Span<'_>, runs: &[Run], cut: &Cut, profile: &Profile) -> Finding {
    let mut finding = self::cut(span, runs, cut, profile);
    finding.severity = Severity::Error;
    let left_out = "; what does not fit is left out";
    finding.message = finding.message.replace(left_out, "; leaving blocks out does not help");
    finding
}

/// The tool fits nowhere on the contour.
pub(crate) fn nothing_left(span: &Span<'_>) -> Finding {
    let at = span.legs.first().map_or(span.entry.lead.source, |leg| leg.source);
    let mut finding = Finding::error(
        Code::Unreachable,
        at,
        format!("{} fits nowhere on the contour that begins here", tool(span.d_mm)),
    )
    .help("use a smaller tool, or check that the compensation is on the right side");
    finding.needed_mm = Some(span.d_mm.abs());
    finding
}

/// A contour that meets itself so often that it could not be checked completely.
pub(crate) fn too_entangled(span: &Span<'_>) -> Finding {
    Finding::error(
        Code::Limit,
        span.entry.lead.source,
        "the contour after this block comes near to itself in so many places that they cannot all be checked",
    )
    .help("split the contour into several, each with its own selection and cancel")
}

/// A lead that comes too near to the contour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LeadCut {
    pub code: Code,
    /// `lead`, `link`, `change of side`.
    pub what: &'static str,
    pub source: Source,
    pub other: Source,
    pub at: Position,
    /// The signed offset, mm.
    pub d_mm: f64,
    pub distance_mm: f64,
    /// It already goes straight to the normal position.
    pub is_straight: bool,
}

/// A lead or link that cuts into the element next to it.
pub(crate) fn lead_cut(cut: &LeadCut, profile: &Profile) -> Finding {
    let radius_mm = cut.d_mm.abs();
    let depth_mm = radius_mm - cut.distance_mm;
    let what = cut.what;
    let mut finding = Finding::error(
        cut.code,
        cut.source,
        format!(
            "{} cuts {depth_mm:.4} mm into {} on the {what}: it comes as near as {:.4} mm",
            tool(cut.d_mm),
            match cut.code {
                Code::LeadNick => format!("the free end of {}", block_name(cut.other)),
                _ => block_name(cut.other),
            },
            cut.distance_mm
        ),
    );
    let rule = match cut.code {
        Code::LeadNick => profile.interference.lead_nick,
        _ => profile.interference.leads,
    };
    finding.severity = rule.severity();
    finding.other = Some(cut.other);
    finding.position = Some(cut.at);
    finding.depth_mm = Some(depth_mm);
    finding.needed_mm = Some(radius_mm);
    finding.available_mm = Some(cut.distance_mm);
    if what == "change of side" {
        return finding.help(
            "end the contour with G40 before, and select the other side with a lead-on after it",
        );
    }
    let word = profile
        .select
        .words
        .iter()
        .find(|(_, approach)| !cut.is_straight && **approach == Approach::Normal)
        .map_or(String::new(), |(word, _)| format!(", or {word} with the tool above the part"));
    finding.help(format!(
        "lead from the side of the tool, perpendicular to the contour, or with a longer {what}{word}"
    ))
}

/// A lead-on that is an arc starts past the path along the contour. The length of the arc, and of what
/// the contour takes from it, mm.
pub(crate) fn lead_starts_past(span: &Span<'_>, (length_mm, taken_mm): (f64, f64)) -> Finding {
    let first = span.legs.first().map_or(span.entry.lead.source, |leg| leg.source);
    let [length, taken] = with_enough_digits(length_mm, taken_mm);
    let mut finding = Finding::error(
        Code::LeadLength,
        span.entry.lead.source,
        format!(
            "the lead-on is an arc of {length} mm; the tool meets the path along {} {taken} mm before \
             the end of that arc",
            block_name(first)
        ),
    )
    .help("begin the arc farther from the contour, or put a straight move in the plane before it");
    finding.other = Some(first);
    finding.position = Some(span.entry.lead.start);
    (finding.needed_mm, finding.available_mm) = (Some(taken_mm), Some(length_mm));
    finding
}

/// An outside corner whose offsets do not meet (O08).
pub(crate) fn no_corner(source: Source, profile: &Profile) -> Finding {
    let rule = profile.corner.no_intersection;
    let what = match rule {
        Strictness::Error => format!(", and {} goes to their intersection", profile.name),
        Strictness::Warn | Strictness::Emulate => "; an arc goes around the corner".into(),
    };
    let mut finding = Finding::error(
        Code::Unsupported,
        source,
        format!(
            "the offsets of the blocks at the start of {} do not meet{what}",
            block_name(source)
        ),
    )
    .help(
        "split the turn with a short block, or end the contour before it and begin a new one after it",
    );
    finding.severity = rule.severity();
    finding
}

/// An outside corner whose offsets meet far away.
pub(crate) fn far_corner(source: Source, distance_mm: f64, d_mm: f64) -> Finding {
    let mut finding = Finding::warning(
        Code::SuspiciousValue,
        source,
        format!(
            "{} goes {distance_mm:.3} mm beyond the corner at the start of {}, \
             to where both offsets meet",
            tool(d_mm),
            block_name(source)
        ),
    )
    .help("make sure that nothing is in the way, or split the turn with a short block");
    finding.available_mm = Some(distance_mm);
    finding
}

/// A circle that its joints lengthen beyond 360 degrees (S70).
pub(crate) fn over_360(source: Source, sweep: f64, rule: Strictness, profile: &Profile) -> Finding {
    let degrees = sweep.to_degrees();
    let what = if rule == Strictness::Emulate {
        format!("only {:.3} degrees are run", degrees - 360.0)
    } else {
        format!("{} would run {:.3} degrees of it", profile.name, degrees - 360.0)
    };
    let mut finding = Finding::error(
        Code::ArcOver360,
        source,
        format!("the arc is lengthened to {degrees:.3} degrees to meet its neighbour; {what}"),
    )
    .help("write the arc as two");
    finding.severity = rule.severity();
    finding
}

/// A corner arc between rapids before any feed rate.
pub(crate) fn corner_without_feed(source: Source) -> Finding {
    Finding::error(
        Code::Unsupported,
        source,
        "an outside corner before a rapid needs an arc, and no feed rate was given for it",
    )
    .help("program a feed rate before the contour, or go around the corner with G1")
}
