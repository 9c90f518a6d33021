//! Measures the path of an accepted program: it cuts into no wall without a finding, and follows what
//! the tool can touch.

use super::center_path::{CenterPath, center_paths};
use super::{
    ACCEPTED_MM, GOUGE_MM, ProductResult, ROUNDING_MM, Wrong, WrongKind, add, is_about_fitting,
    is_plain,
};
use crate::fit::{self, Fit};
use crate::program::{Element, End, Program, Role, Span};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::path::Role as PathRole;

/// How far the path may be from where the tool touches an element, mm: runs are merged, and
/// noise is passed by.
const FOLLOWED_MM: f64 = ACCEPTED_MM + 2e-4;
/// Contact that is shorter need not be followed, mm.
const CONTACT_MM: f64 = 0.05;

pub(super) fn accepted(program: &Program, verdict: &ProductResult, wrong: &mut Vec<Wrong>) {
    let paths = center_paths(verdict.path.start, &verdict.path.elements, program.axes);
    for span in &program.spans {
        let own: Vec<&CenterPath> = paths.iter().filter(|way| span.contains(way.line)).collect();
        for way in &own {
            if let Some((wall, depth_mm)) = deepest(span, way, &own)
                && !is_reported(span, way, depth_mm, &verdict.findings)
            {
                add(
                    wrong,
                    WrongKind::SilentCut,
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
                WrongKind::NotFollowed,
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
        let way = element.shape.offset(span.side * radius_mm);
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
                WrongKind::NotFollowed,
                format!("line {} is not followed: the path is {off:.6} mm off", element.line),
            );
        }
    }
}
