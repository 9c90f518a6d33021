//! Whether a verdict of the product is right.
//!
//! A path is measured against the walls of the contour that was drawn, a refusal against what
//! [`fit`](crate::fit) says. What neither proves is counted as not judged.

use crate::fit::{self, Fit};
use crate::piece::{Piece, Point, point};
use crate::program::{Element, End, Program, Role, Span};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{CompensatedPath, PathElement, Role as PathRole};
use std::f64::consts::TAU;

/// How much nearer than its radius the tool may come, mm: the definition.
pub const GOUGE_MM: f64 = 1e-4;
/// What rounding adds to a distance that is computed, mm.
const ROUNDING_MM: f64 = 1e-5;
/// `accept_tolerance_mm` of every shipped profile.
pub const ACCEPTED_MM: f64 = 0.002;
/// How far the path may be from where the tool touches an element, mm: runs are merged, and
/// noise is passed by.
const FOLLOWED_MM: f64 = ACCEPTED_MM + 2e-4;
/// A tool that is this much larger must fit too, before a refusal is a false alarm, mm: what is
/// consumed is decided without a tolerance, by coordinates that are rounded.
const MARGIN_MM: f64 = 5e-4;
/// Contact that is shorter need not be followed, mm.
const CONTACT_MM: f64 = 0.05;

/// What the product says of a program.
#[derive(Debug, Clone, Default)]
pub struct ProductResult {
    /// Empty when the program is refused.
    pub path: CompensatedPath,
    pub findings: Vec<Finding>,
    /// The path that was refused.
    pub refused: Vec<PathElement>,
    /// Whether the loader refused the program.
    pub is_unread: bool,
}

impl ProductResult {
    pub fn is_accepted(&self) -> bool {
        !self.findings.iter().any(Finding::is_error)
    }
}

/// What is wrong with a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// It cuts into a wall, and no finding says so.
    SilentCut,
    /// It leaves out what the tool can reach, or runs elsewhere, and no finding says so.
    NotFollowed,
    /// Said to cut, and does not.
    FalseGouge,
    /// Said not to fit, and does.
    FalseUnreachable,
    /// A lead that is said to cut, and does not.
    FalseLeadGouge,
    /// The planner and the audit do not agree.
    InternalError,
}

/// One thing that is wrong, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wrong {
    pub kind: Kind,
    pub what: String,
}

fn add(wrong: &mut Vec<Wrong>, kind: Kind, what: String) {
    wrong.push(Wrong { kind, what });
}

/// What is right or wrong with a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// Accepted; the path was measured.
    Accepted,
    /// Refused, and the tool does not fit.
    Refused,
    /// Refused for a rule of the control that is not about where the tool fits.
    RefusedByRule,
    /// Refused for a place that is not judged here.
    NotJudged(NotJudged),
    Wrong,
}

/// Why a refusal is not judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NotJudged {
    /// Within the tolerances of the definitions.
    Tolerance,
    /// At an outside corner of curves, or where an element may be noise.
    Unknown,
    /// A lead that meets the contour as a corner, or runs over its end.
    Lead,
    /// A change of side or of the tool within the contour.
    Change,
}

/// The verdict on a verdict, and what is wrong with it.
pub fn judge(program: &Program, verdict: &ProductResult) -> (Outcome, Vec<Wrong>) {
    let mut wrong = Vec::new();
    let outcome = if verdict.is_accepted() {
        accepted(program, verdict, &mut wrong);
        Outcome::Accepted
    } else {
        refused(program, verdict, &mut wrong)
    };
    if wrong.is_empty() { (outcome, wrong) } else { (Outcome::Wrong, wrong) }
}

/// One element of a path, in the plane.
struct CenterPath {
    shape: Piece,
    line: u32,
    role: PathRole,
}

fn ways(start: Position, elements: &[PathElement], axes: [usize; 3]) -> Vec<CenterPath> {
    let [u, v, _] = axes;
    let flat = |at: Position| point(at[u], at[v]);
    let mut from = start;
    let mut ways = Vec::new();
    for element in elements {
        let (a, b) = (flat(from), flat(element.end));
        from = element.end;
        let shape = match element.shape {
            Shape::Line if a == b => continue,
            Shape::Line => Piece::line(a, b),
            Shape::Arc(arc) => around(a, b, flat(arc.center), !arc.clockwise, arc.turns > 0),
        };
        ways.push(CenterPath { shape, line: element.source.line, role: element.role });
    }
    ways
}

/// An arc of the path about its own centre; a whole turn, however far apart rounding has put its
/// ends.
fn around(start: Point, end: Point, center: Point, is_ccw: bool, is_whole: bool) -> Piece {
    let angle = |at: Point| (at.v - center.v).atan2(at.u - center.u);
    let ccw = (angle(end) - angle(start)).rem_euclid(TAU);
    let sweep = match (is_whole || start == end, is_ccw) {
        (true, true) => TAU,
        (true, false) => -TAU,
        (false, true) => ccw,
        (false, false) => ccw - TAU,
    };
    Piece::Arc { center, radius: center.to(start), from: angle(start), sweep }
}

fn accepted(program: &Program, verdict: &ProductResult, wrong: &mut Vec<Wrong>) {
    let ways = ways(verdict.path.start, &verdict.path.elements, program.axes);
    for span in &program.spans {
        let own: Vec<&CenterPath> = ways.iter().filter(|way| span.contains(way.line)).collect();
        for way in &own {
            if let Some((wall, depth_mm)) = deepest(span, way, &own)
                && !is_reported(span, way, depth_mm, &verdict.findings)
            {
                add(
                    wrong,
                    Kind::SilentCut,
                    format!(
                        "silent: line {} ({}) cuts {depth_mm:.6} mm into line {}",
                        way.line,
                        way.role.name(),
                        wall.line
                    ),
                );
            }
        }
        followed(span, &own, wrong);
        let is_reported = verdict.findings.iter().any(|finding| {
            let is_about = is_about_fitting(finding.code) || finding.code == Code::Uncut;
            is_about && span.contains(finding.source.line)
        });
        if !is_reported
            && is_plain(span)
            && fit::fits(span, 0.0) != Fit::Fits
            && let Fit::DoesNot(why) = fit::fits(span, 2.0 * ACCEPTED_MM)
        {
            add(
                wrong,
                Kind::NotFollowed,
                format!("silent: accepted, and the tool does not fit: {why}"),
            );
        }
    }
}

/// The wall that an element of the path cuts deepest, and how deep, mm.
fn deepest<'a>(
    span: &'a Span,
    way: &CenterPath,
    own: &[&CenterPath],
) -> Option<(&'a Element, f64)> {
    let mut walls: Vec<(&Element, f64)> = Vec::new();
    let is_followed =
        |line: u32| own.iter().any(|way| way.line == line && way.role == PathRole::Contour);
    match way.role {
        PathRole::LeadOn | PathRole::LeadOff | PathRole::Link => {
            let (first, last) = (span.elements.first()?, span.elements.last()?);
            let is_on = way.role != PathRole::LeadOff;
            let radius_mm = if is_on { first.radius_mm.0 } else { last.radius_mm.1 };
            let all = span.elements.iter().filter(|it| it.role == Role::Wall && !it.is_copy);
            walls.extend(all.map(|wall| (wall, radius_mm - ACCEPTED_MM)));
        }
        PathRole::Contour | PathRole::Corner => {
            let index = span.elements.iter().position(|element| element.line == way.line)?;
            let before = span.elements[index.saturating_sub(1)];
            let on = span.elements[index];
            let radius_mm = on.radius_mm.0.min(on.radius_mm.1).min(before.radius_mm.1);
            // What is too small to be followed, and its neighbours.
            let is_noise = |index: usize| {
                (index.saturating_sub(1)..=index + 1)
                    .filter_map(|index| span.elements.get(index))
                    .any(|element| !is_followed(element.line))
            };
            let is_rounded = is_noise(index) || on.is_copy || before.is_copy;
            let walls_here = span.elements.iter().enumerate().filter(|(_, wall)| {
                wall.pass == on.pass && wall.role == Role::Wall && !wall.is_copy
            });
            walls.extend(walls_here.map(|(index, wall)| {
                // A retraced piece is the same wall, but for the rounding of its coordinates.
                let slack_mm = if is_rounded || is_noise(index) { ACCEPTED_MM } else { 0.0 };
                (wall, radius_mm - slack_mm)
            }));
        }
        PathRole::None | PathRole::OffPlane => {}
    }
    walls
        .into_iter()
        .filter(|(wall, limit)| !way.shape.is_far_from(&wall.shape, *limit))
        .map(|(wall, limit)| (wall, limit - way.shape.apart(&wall.shape)))
        .filter(|(_, depth_mm)| *depth_mm > GOUGE_MM + ROUNDING_MM)
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

const fn is_about_fitting(code: Code) -> bool {
    matches!(
        code,
        Code::Gouge
            | Code::Unreachable
            | Code::CutsOtherPass
            | Code::LeadGouge
            | Code::LeadNick
            | Code::LinkGouge
    )
}

/// Whether a finding says it, and as deep.
fn is_reported(span: &Span, way: &CenterPath, depth_mm: f64, findings: &[Finding]) -> bool {
    findings.iter().any(|finding| {
        let lines = [Some(finding.source.line), finding.other.map(|other| other.line)];
        // At a change of side both contours share a place, and either may be named.
        let is_shared = [span.begin, span.end].contains(&End::OtherSide)
            && matches!(finding.code, Code::LinkGouge | Code::CutsOtherSpan)
            && lines.into_iter().flatten().any(|line| span.contains(line));
        let is_here = match way.role {
            PathRole::Contour | PathRole::Corner => {
                is_shared || lines.into_iter().flatten().all(|line| span.contains(line))
            }
            _ => finding.source.line == way.line,
        };
        let is_deep =
            finding.depth_mm.is_none_or(|reported_mm| reported_mm > 0.9 * depth_mm - ACCEPTED_MM);
        let is_deep = is_deep || !matches!(way.role, PathRole::Contour | PathRole::Corner);
        (is_about_fitting(finding.code) || is_shared) && is_here && is_deep
    })
}

/// Checks that the path follows every element that the tool can touch, at one radius.
fn followed(span: &Span, own: &[&CenterPath], wrong: &mut Vec<Wrong>) {
    if span.changes_tool() {
        return;
    }
    for (index, element) in span.elements.iter().enumerate() {
        let radius_mm = element.radius_mm.0;
        let free = fit::contact(span, index, 0.0);
        let way = element.shape.beside(span.side * radius_mm);
        let length = element.shape.length().min(way.length());
        let longest = free.into_iter().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)));
        let Some((low, high)) = longest.filter(|(low, high)| (high - low) * length > CONTACT_MM)
        else {
            continue;
        };
        // What a lead or another side takes away is at the ends.
        let is_taken = |end: End, between: &[Element]| {
            let lengths = || between.iter().map(|element| element.shape.length());
            let way_mm: f64 = lengths().sum();
            // A short block is merged with its neighbour, and both are one.
            let count = lengths().filter(|length| *length > CONTACT_MM).count();
            !matches!(end, End::Normal { .. }) && (count < 2 || way_mm < 8.0 * radius_mm)
        };
        // A leg that crosses is cut in two; its tail shortens its neighbours too.
        let near = index.saturating_sub(2)..(index + 3).min(span.elements.len());
        if span.elements[near].windows(2).any(|pair| pair[0].line == pair[1].line) {
            continue;
        }
        let is_normal = |end: End| matches!(end, End::Normal { .. });
        let part = match (
            is_taken(span.begin, &span.elements[..=index]),
            is_taken(span.end, &span.elements[index..]),
        ) {
            (false, false) => 0.5,
            // At its other end it is followed all the same.
            (true, false) if index + 1 == span.elements.len() && is_normal(span.end) => 1.0 - 1e-6,
            (false, true) if index == 0 && is_normal(span.begin) => 1e-6,
            _ => continue,
        };
        let at = way.at(low + (high - low) * part);
        let off = own
            .iter()
            .filter(|way| way.role == PathRole::Contour)
            .map(|way| way.shape.distance(at))
            .fold(f64::INFINITY, f64::min);
        if off > FOLLOWED_MM {
            add(
                wrong,
                Kind::NotFollowed,
                format!("line {} is not followed: the path is {off:.6} mm off", element.line),
            );
        }
    }
}

/// Whether the definitions leave nothing open for a span.
fn is_plain(span: &Span) -> bool {
    !span.changes_tool() && span.begin != End::OtherSide && span.end != End::OtherSide
}

fn refused(program: &Program, verdict: &ProductResult, wrong: &mut Vec<Wrong>) -> Outcome {
    let errors = || verdict.findings.iter().filter(|finding| finding.is_error());
    if let Some(finding) = errors().find(|finding| finding.code == Code::InternalError) {
        add(wrong, Kind::InternalError, format!("internal error: {}", finding.message));
    }
    if verdict.is_unread
        || errors()
            .any(|finding| !is_about_fitting(finding.code) && finding.code != Code::InternalError)
    {
        return Outcome::RefusedByRule;
    }
    let refused = ways([0.0; 3], &verdict.refused, program.axes);
    let mut outcomes = Vec::new();
    for finding in errors() {
        let span = program.spans.iter().find(|span| span.contains(finding.source.line));
        let one = match (span, finding.code) {
            (None, _) if finding.code == Code::InternalError => continue,
            // A contradiction is reported once.
            _ if errors().any(|other| other.code == Code::InternalError) => continue,
            (None, _) => {
                add(
                    wrong,
                    Kind::FalseGouge,
                    format!("{} at line {}: no contour", finding.code.name(), finding.source.line),
                );
                continue;
            }
            (Some(span), Code::LeadGouge | Code::LeadNick | Code::LinkGouge) => {
                let is_here = |other: &&Finding| span.contains(other.source.line);
                // Where the contour is not followed to its end a lead begins anywhere.
                let mut others = verdict.findings.iter().filter(is_here);
                match others.any(|other| matches!(other.code, Code::Unreachable | Code::Gouge)) {
                    true => Outcome::NotJudged(NotJudged::Lead),
                    false => lead_refused(span, finding, &refused, wrong),
                }
            }
            (Some(span), Code::Gouge) if errors().any(|other| is_by_lead(span, other)) => {
                Outcome::NotJudged(NotJudged::Lead)
            }
            (Some(span), _) => span_refused(span, finding, wrong),
        };
        outcomes.push(one);
    }
    // One good reason is enough.
    outcomes.into_iter().min().unwrap_or(Outcome::Wrong)
}

/// Whether a tool that is said not to fit does not.
fn span_refused(span: &Span, finding: &Finding, wrong: &mut Vec<Wrong>) -> Outcome {
    if !is_plain(span) {
        return Outcome::NotJudged(NotJudged::Change);
    }
    if let Some(outcome) = not_fitting(span) {
        return outcome;
    }
    if is_by_lead(span, finding) {
        return Outcome::NotJudged(NotJudged::Lead);
    }
    let kind = match finding.code {
        Code::Gouge => Kind::FalseGouge,
        _ => Kind::FalseUnreachable,
    };
    add(
        wrong,
        kind,
        format!(
            "false alarm: {} at line {}: {}",
            finding.code.name(),
            finding.source.line,
            finding.message
        ),
    );
    Outcome::Wrong
}

/// Whether it is the direction of a lead that the tool does not fit.
fn is_by_lead(span: &Span, finding: &Finding) -> bool {
    finding.code == Code::Unreachable
        && span.contains(finding.source.line)
        && finding.message.contains("the lead meets the contour")
}

/// What a refusal is where the tool does not fit.
fn not_fitting(span: &Span) -> Option<Outcome> {
    let all = [2.0 * ACCEPTED_MM, 0.0, -MARGIN_MM].map(|slack_mm| fit::fits(span, slack_mm));
    if matches!(all[0], Fit::DoesNot(_) | Fit::PassesBy(_)) && all[1] != Fit::Fits {
        return Some(Outcome::Refused);
    }
    if all.iter().any(|fit| matches!(fit, Fit::Unknown(_))) {
        return Some(Outcome::NotJudged(NotJudged::Unknown));
    }
    all.iter().any(|fit| *fit != Fit::Fits).then_some(Outcome::NotJudged(NotJudged::Tolerance))
}

/// Elements of tails that meet a wall again after the place where they leave the contour: what
/// lies between encloses another loop, and is no tail.
fn closed_by_tails(span: &Span) -> Vec<usize> {
    let count = span.elements.len();
    let is_tail = |index: &usize| span.elements[*index].role != Role::Wall;
    // From the contour outwards.
    let mut at_start: Vec<usize> = (0..count).take_while(is_tail).collect();
    let mut at_end: Vec<usize> = (0..count).rev().take_while(is_tail).collect();
    at_start.reverse();
    at_end.reverse();
    let mut closed = Vec::new();
    for (tail, is_at_start) in [(at_start, true), (at_end, false)] {
        let Some(&first) = tail.first() else { continue };
        let root = span.elements[first].shape.at(if is_at_start { 1.0 } else { 0.0 });
        let meets = |index: usize| {
            let own = &span.elements[index].shape;
            let mut walls = span.elements.iter().filter(|it| it.role == Role::Wall);
            walls
                .any(|it| it.shape.distance(root) > GOUGE_MM && own.apart(&it.shape) <= ROUNDING_MM)
        };
        let last = tail.iter().rposition(|&index| meets(index));
        closed.extend(tail.iter().take(last.map_or(0, |last| last + 1)));
    }
    closed
}

/// Whether a lead that is said to cut does, and more than it may.
fn lead_refused(
    span: &Span,
    finding: &Finding,
    refused: &[CenterPath],
    wrong: &mut Vec<Wrong>,
) -> Outcome {
    let line = finding.source.line;
    let is_on = line < span.elements[0].line;
    let (end, at_end) = if is_on { (span.begin, 0.0) } else { (span.end, 1.0) };
    let index = if is_on { 0 } else { span.elements.len() - 1 };
    let element = &span.elements[index];
    let radius_mm = element.radius_mm.0;
    let closed = closed_by_tails(span);
    let is_wall = |index: usize, it: &Element| it.role == Role::Wall || closed.contains(&index);
    let walls = || {
        let all = span.elements.iter().enumerate();
        all.filter(|(index, it)| is_wall(*index, it) && !it.is_copy).map(|(_, it)| it)
    };
    match end {
        End::OtherSide => Outcome::NotJudged(NotJudged::Change),
        End::Normal { outside } => {
            let beside = element.shape.beside(span.side * radius_mm).at(at_end);
            let way = Piece::line(outside, beside);
            // Over the free end, from where there is only air.
            let (away, normal) =
                ((outside - beside).unit(), (beside - element.shape.at(at_end)).unit());
            let air = element.shape.direction(at_end) * if is_on { -1.0 } else { 1.0 };
            let is_nick = !span.is_closed && away.dot(normal) < 0.0 && away.dot(air) > 0.0;
            let nick_mm = if is_nick { radius_mm * (1.0 - away.cross(normal).abs()) } else { 0.0 };
            let depth = |wall: &Element| radius_mm - way.apart(&wall.shape);
            let cuts = walls().any(|wall| {
                let is_own = wall.line == element.line;
                let allowed_mm = if is_own { nick_mm } else { 0.0 };
                depth(wall) > allowed_mm + GOUGE_MM - ROUNDING_MM
            });
            // A lead that begins elsewhere belongs to a contour that is not followed to its end.
            let is_from_here = |way: &&CenterPath| {
                let ends = [way.shape.start(), way.shape.end()];
                way.line == line && ends.iter().any(|end| end.to(beside) < 1e-3)
            };
            if refused.iter().find(is_from_here).is_none() {
                return Outcome::NotJudged(NotJudged::Lead);
            }
            if !cuts {
                add(
                    wrong,
                    Kind::FalseLeadGouge,
                    format!(
                        "false alarm: {} at line {line}: the lead cuts nothing",
                        finding.code.name()
                    ),
                );
            }
            Outcome::Refused
        }
        End::Joined { .. } => {
            let mut lead = refused.iter().filter(|way| way.line == line).peekable();
            if lead.peek().is_none() {
                return Outcome::NotJudged(NotJudged::Lead);
            }
            let cuts = |way: &CenterPath| {
                walls()
                    .any(|wall| way.shape.apart(&wall.shape) < radius_mm - GOUGE_MM + ROUNDING_MM)
            };
            if lead.any(cuts) { Outcome::Refused } else { Outcome::NotJudged(NotJudged::Lead) }
        }
    }
}
