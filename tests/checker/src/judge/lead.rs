//! Judges a lead that is said to cut into the contour.

use super::center_path::CenterPath;
use super::{GOUGE_MM, Judgement, NotJudged, ROUNDING_MM, Wrong, WrongKind, add};
use crate::piece::Piece;
use crate::program::{Element, End, Role, Span};
use cnc_msgs::finding::Finding;

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
pub(super) fn lead_refused(
    span: &Span,
    finding: &Finding,
    refused: &[CenterPath],
    wrong: &mut Vec<Wrong>,
) -> Judgement {
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
        End::OtherSide => Judgement::NotJudged(NotJudged::Change),
        End::Normal { outside } => {
            let lead_end = element.shape.offset(span.side * radius_mm).at(at_end);
            let way = Piece::line(outside, lead_end);
            // Over the free end, from where there is only air.
            let (away, normal) =
                ((outside - lead_end).unit(), (lead_end - element.shape.at(at_end)).unit());
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
                way.line == line && ends.iter().any(|end| end.to(lead_end) < 1e-3)
            };
            if refused.iter().find(is_from_here).is_none() {
                return Judgement::NotJudged(NotJudged::Lead);
            }
            if !cuts {
                add(
                    wrong,
                    WrongKind::FalseLeadGouge,
                    format!(
                        "false alarm: {} at line {line}: the lead cuts nothing",
                        finding.code.name()
                    ),
                );
            }
            Judgement::Refused
        }
        End::Joined { .. } => {
            let mut lead = refused.iter().filter(|way| way.line == line).peekable();
            if lead.peek().is_none() {
                return Judgement::NotJudged(NotJudged::Lead);
            }
            let cuts = |way: &CenterPath| {
                walls()
                    .any(|wall| way.shape.apart(&wall.shape) < radius_mm - GOUGE_MM + ROUNDING_MM)
            };
            if lead.any(cuts) { Judgement::Refused } else { Judgement::NotJudged(NotJudged::Lead) }
        }
    }
}
