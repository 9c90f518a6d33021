//! Whether a tool fits a contour, without a path: where may its centre be?
//!
//! The tool touches a place of an element when its centre is one radius from it. It may
//! be there if no wall of the pass is nearer than the radius. Each element gives the
//! stretches of contact that are free. The tool fits when each element has one such stretch
//! and the centre gets from each to the next: at an inside corner both end at one point, at an
//! outside corner the path around the corner is free.

use crate::judge::ACCEPTED_MM;
use crate::piece::{Piece, Point};
use crate::program::{Corner, Element, End, Role, Span};

/// Rounding in coordinates of six decimals, mm.
const NOISE_MM: f64 = 3e-6;
/// How far apart two ends of contact may be at an inside corner, mm: the crossing of two
/// curves that are known to [`NOISE_MM`].
const MEETING_MM: f64 = 5e-3;
/// A stretch of contact that is shorter is none, mm.
const CONTACT_MM: f64 = 1e-4;

/// The stretches of an element, as parts of it, that the tool may touch while it is nearer to
/// other walls than its radius by no more than `slack_mm`.
pub fn contact(span: &Span, index: usize, slack_mm: f64) -> Vec<(f64, f64)> {
    let element = &span.elements[index];
    let radius_mm = tool(element, slack_mm);
    let way = element.shape.offset(span.side * radius_mm);
    let limit = radius_mm - NOISE_MM - slack_mm.max(0.0);
    let mut near: Vec<(f64, f64)> = bounding(span, element)
        .filter(|wall| !way.is_far_from(&wall.shape, radius_mm))
        .flat_map(|wall| way.too_near(&wall.shape, limit))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut free = Vec::new();
    let mut from = 0.0;
    for (low, high) in near {
        if low > from {
            free.push((from, low));
        }
        from = f64::max(from, high);
    }
    if from < 1.0 {
        free.push((from, 1.0));
    }
    let length = way.length().max(element.shape.length());
    free.retain(|(low, high)| (high - low) * length > CONTACT_MM);
    free
}

/// The radius of the tool at the start of an element; larger where there is less than no slack.
fn tool(element: &Element, slack_mm: f64) -> f64 {
    element.radius_mm.0 - slack_mm.min(0.0)
}

/// The walls of its pass; and, for a tail, itself and the rest of that tail.
fn bounding<'a>(span: &'a Span, element: &Element) -> impl Iterator<Item = &'a Element> + use<'a> {
    let (pass, role) = (element.pass, element.role);
    span.elements.iter().filter(move |other| {
        other.pass == pass
            && !other.is_copy
            && (other.role == Role::Wall || (role != Role::Wall && other.role == role))
    })
}

/// Whether a tool fits a contour.
#[derive(Debug, Clone, PartialEq)]
pub enum Fit {
    Fits,
    /// Why it does not.
    DoesNot(String),
    /// It passes by a short piece of a curve: the definitions do not say whether a sharp inside
    /// corner may take that.
    PassesBy(String),
    /// The definitions leave it open, or no simple argument decides it.
    Unknown(&'static str),
}

/// An element with less of this length left may be noise that the tool passes by, mm.
const NOISE_ELEMENT_MM: f64 = 0.03;

/// Whether the tool fits, if it may come nearer than its radius by `slack_mm`. A negative slack
/// asks for a tool that is so much larger.
pub fn fits(span: &Span, slack_mm: f64) -> Fit {
    match chain(span, slack_mm) {
        Ok(()) => Fit::Fits,
        Err(fit) => fit,
    }
}

fn chain(span: &Span, slack_mm: f64) -> Result<(), Fit> {
    let mut before: Option<Touched> = None;
    for index in 0..span.elements.len() {
        let element = &span.elements[index];
        let radius_mm = element.radius_mm.0;
        let free = contact(span, index, slack_mm);
        let &[stretch] = &free[..] else {
            if element.shape.length() < NOISE_ELEMENT_MM {
                return Err(Fit::Unknown("a small element"));
            }
            let mut others = span.elements.iter().enumerate();
            if others.any(|(other, it)| other != index && it.line == element.line) {
                return Err(Fit::Unknown("a part of a leg"));
            }
            let why = format!("line {}: {} stretches of contact", element.line, free.len());
            return Err(match element.shape {
                Piece::Line { .. } if element.shape.length() <= radius_mm => Fit::PassesBy(why),
                Piece::Line { .. } if is_on_neighbour(span, index) => Fit::PassesBy(why),
                Piece::Arc { radius, sweep, .. } if radius * sweep * sweep < 0.4 => {
                    Fit::PassesBy(why)
                }
                _ => Fit::DoesNot(why),
            });
        };
        match before {
            None if stretch.0 > 0.0 && matches!(span.begin, End::Joined { .. }) => {
                return Err(Fit::Unknown("a lead that meets the contour as a corner"));
            }
            None if stretch.0 > 0.0 => {
                let why = format!("line {}: no contact where the contour begins", element.line);
                return Err(Fit::DoesNot(why));
            }
            None => {}
            Some(before) => joint(span, before, (index, stretch), slack_mm)?,
        }
        before = Some((index, stretch));
    }
    match before {
        Some((_, stretch)) if stretch.1 < 1.0 && matches!(span.end, End::Joined { .. }) => {
            Err(Fit::Unknown("a lead that meets the contour as a corner"))
        }
        Some((index, stretch)) if stretch.1 < 1.0 => {
            let line = span.elements[index].line;
            Err(Fit::DoesNot(format!("line {line}: no contact where the contour ends")))
        }
        _ => Ok(()),
    }
}

/// Whether a straight lies on the line of its neighbour, but for what is accepted: the tool may
/// pass it by on that line.
fn is_on_neighbour(span: &Span, index: usize) -> bool {
    let shape = &span.elements[index].shape;
    let neighbours = [index.checked_sub(1), Some(index + 1)];
    let neighbours = neighbours.into_iter().flatten().filter_map(|it| span.elements.get(it));
    neighbours.filter(|it| matches!(it.shape, Piece::Line { .. })).any(|it| {
        let (from, along) = (it.shape.start(), it.shape.direction(0.0));
        let off = |at: Point| along.cross(at - from).abs();
        off(shape.start()).max(off(shape.end())) <= ACCEPTED_MM
            && along.dot(shape.direction(0.0)) > 0.0
    })
}

type Touched = (usize, (f64, f64));

/// Whether the centre gets from the contact with one element to that with the next.
fn joint(
    span: &Span,
    (before, (_, leaves)): Touched,
    (after, (begins, _)): Touched,
    slack_mm: f64,
) -> Result<(), Fit> {
    let (one, other) = (&span.elements[before], &span.elements[after]);
    let radius_mm = tool(other, slack_mm);
    let slack_mm = slack_mm.max(0.0);
    let way = |element: &Element| element.shape.offset(span.side * radius_mm);
    let (from, to) = (way(one).at(leaves), way(other).at(begins));
    let (ahead, next) = (one.shape.direction(1.0), other.shape.direction(0.0));
    let turn = ahead.cross(next) * span.side;
    let is_whole = leaves == 1.0 && begins == 0.0;
    if !is_whole || turn >= 0.0 {
        let gap_mm = from.to(to);
        // A bend that is too small to be seen leaves both ends of contact apart.
        let bend_mm = if is_whole { 2.0 * radius_mm * turn.abs() } else { 0.0 };
        // Where curves meet, a little slack is far along both.
        let slack_mm = 8.0 * slack_mm / turn.abs().max(1e-9) + 2.0 * (slack_mm * radius_mm).sqrt();
        return match gap_mm <= MEETING_MM + bend_mm + slack_mm {
            true => Ok(()),
            false => {
                let (one, other) = (one.line, other.line);
                Err(Fit::DoesNot(format!("lines {one}, {other}: contact ends {gap_mm} mm apart")))
            }
        };
    }
    if from.to(to) < 1e-6 {
        return Ok(());
    }
    let pieces = corner(span, one, other, radius_mm);
    let pieces = pieces.ok_or(Fit::Unknown("an outside corner of curves"))?;
    for piece in pieces {
        for wall in span.walls(one.pass).chain(span.walls(other.pass)) {
            let is_far = piece.is_far_from(&wall.shape, radius_mm);
            if !is_far && piece.apart(&wall.shape) < radius_mm - NOISE_MM - slack_mm {
                let (line, into) = (other.line, wall.line);
                return Err(Fit::DoesNot(format!(
                    "the corner before line {line} cuts line {into}"
                )));
            }
        }
    }
    Ok(())
}

/// The path around an outside corner; `None` where it is not known.
fn corner(span: &Span, one: &Element, other: &Element, radius_mm: f64) -> Option<Vec<Piece>> {
    let left = span.side * radius_mm;
    let vertex = other.shape.start();
    let (from, to) = (one.shape.offset(left).end(), other.shape.offset(left).start());
    let (ahead, next) = (one.shape.direction(1.0), other.shape.direction(0.0));
    // The tool on the left turns right around an outside corner.
    let around = Piece::arc(from, to, vertex, span.side < 0.0);
    let are_lines = [one, other].iter().all(|it| matches!(it.shape, Piece::Line { .. }));
    let turn = ahead.dot(next);
    match span.corner {
        Corner::Arc => Some(vec![around]),
        _ if turn > 1.0 - 1e-9 => Some(vec![around]),
        _ if !are_lines => None,
        Corner::Extended if turn < 0.0 => {
            let (first, second) = (from + ahead * radius_mm, to - next * radius_mm);
            Some(vec![
                Piece::line(from, first),
                Piece::line(first, second),
                Piece::line(second, to),
            ])
        }
        Corner::Intersection | Corner::Extended => {
            let middle = (from - vertex) + (to - vertex);
            let apex = vertex + middle * (1.0 / (1.0 + turn));
            Some(vec![Piece::line(from, apex), Piece::line(apex, to)])
        }
    }
}
