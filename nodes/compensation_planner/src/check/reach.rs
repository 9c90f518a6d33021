//! Finds what the tool cannot reach: what consumed elements mean for a program.
//!
//! Where elements are consumed, the tool runs as if their neighbours were extended until they meet.
//! That is right when the programmed corner they make is within the accepted tolerance of what was
//! consumed (noise of posted coordinates), and a finding when it is not. This covers neighbours
//! only; `interference` checks distant parts of a contour.

use crate::geometry::distance::distance_to;
use crate::geometry::element::{Element, Vec2, cross};
use crate::geometry::intersect::crossings;
use crate::geometry::tolerance::{
    CHORD_MM, CHORD_RADII, CHORD_TURN_RAD, CURVE_RADIUS_MM, GOUGE_MM, LENGTH_MM, SHARP_TURN_RAD,
};
use crate::span::chain::{ChainLink, Placed, Role, Turn, join, turn};
use crate::span::links::Links;

/// Consecutive elements that the tool cannot reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Unreachable {
    /// The first and the last consumed run, and the longest.
    pub first: usize,
    pub last: usize,
    pub longest: usize,
    /// The largest radius, mm, for which the tool reaches all of them; 0 when none was found.
    pub radius_mm_max: f64,
    /// They lie between the contour and a lead that joins it in a corner: the tool does not fit
    /// because of the direction of the lead.
    pub is_by_lead: bool,
}

/// Whether there is any place that the tool cannot reach.
pub(crate) fn is_any_unreachable(links: Links<'_>, placed: &[Placed], tolerance: f64) -> bool {
    gaps(links, placed).any(|gap| is_deep(links, placed, &gap, tolerance))
}

/// All places that the tool cannot reach, each with its own search for the radius.
pub(crate) fn unreachable<'a>(
    links: Links<'a>,
    placed: &'a [Placed],
    tolerance: f64,
) -> impl Iterator<Item = Unreachable> + 'a {
    gaps(links, placed).filter(move |gap| is_deep(links, placed, gap, tolerance)).filter_map(
        move |gap| {
            place(links, &gap, tolerance, |links, placed| {
                !is_any_unreachable(links, placed, tolerance)
            })
        },
    )
}

fn place(
    links: Links<'_>,
    gap: &Gap,
    slack: f64,
    fits: impl Fn(Links<'_>, &[Placed]) -> bool,
) -> Option<Unreachable> {
    let runs = || {
        links.range(gap.from, gap.to).iter().filter_map(|link| match link.role {
            Role::Run(run) => Some((run, link.element.length())),
            _ => None,
        })
    };
    let (first, last) = (runs().next()?, runs().next_back()?);
    let longest = runs().fold(first, |best, run| if run.1 > best.1 { run } else { best });
    let from = gap.before.unwrap_or(gap.from);
    let to = gap.after.map_or(gap.to, |after| after + 1);
    let is_lead = |link: Option<usize>| {
        link.is_some_and(|link| matches!(links.role(link), Role::Entry | Role::Exit))
    };
    Some(Unreachable {
        is_by_lead: is_lead(gap.before) || is_lead(gap.after),
        first: first.0,
        last: last.0,
        longest: longest.0,
        radius_mm_max: largest_radius(links.range(from, to), slack, fits),
    })
}

/// All consumed elements, accepted or not, each with its own search for the radius.
pub(crate) fn consumed<'a>(
    links: Links<'a>,
    placed: &'a [Placed],
) -> impl Iterator<Item = Unreachable> + 'a {
    let is_any = |links: Links<'_>, placed: &[Placed]| {
        gaps(links, placed).any(|gap| !is_corner_of_curves(links, placed, &gap, 0.0))
    };
    gaps(links, placed)
        .filter(move |gap| !is_corner_of_curves(links, placed, gap, 0.0))
        .filter_map(move |gap| place(links, &gap, 0.0, |links, placed| !is_any(links, placed)))
}

/// What the joints leave of the compensated element of a run, mm; below 0 when it vanishes.
pub(crate) fn left_of(links: Links<'_>, placed: &[Placed], run: usize) -> Option<f64> {
    let place = placed.iter().find(|place| links.role(place.link) == Role::Run(run))?;
    let link = &links.at(place.link);
    let length = link.element.offset(link.d_in_mm)?.length();
    Some(length - place.trim_in - place.trim_out)
}

/// Where blocks are left out, sharp corners of curves included: the index of what is placed before
/// each gap.
pub(crate) fn left_out<'a>(
    links: Links<'a>,
    placed: &'a [Placed],
    tolerance: f64,
) -> impl Iterator<Item = Option<usize>> + 'a {
    gaps(links, placed)
        .filter(move |gap| deviation(links, placed, gap, tolerance) > tolerance)
        .map(|gap| gap.index.checked_sub(1))
}

/// Runs that a lead makes the tool skip, and how much of them stays along its path, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Skipped {
    pub first: usize,
    pub last: usize,
    pub stays_mm: f64,
    pub is_by_entry: bool,
}

/// The runs of a curve that a lead skips where it meets the curve in an inside corner. The tool
/// takes chords from the end of a curve as it takes a piece of an arc, and the lead cuts no wall
/// there.
pub(crate) fn skipped_by_leads<'a>(
    links: Links<'a>,
    placed: &'a [Placed],
    tolerance: f64,
) -> impl Iterator<Item = Skipped> + 'a {
    let skipped = move |gap: Gap| {
        let is = |link: Option<usize>, role| link.is_some_and(|link| links.role(link) == role);
        let is_by_entry = is(gap.before, Role::Entry);
        if !is_by_entry && !is(gap.after, Role::Exit) {
            return None;
        }
        let runs = || {
            links.range(gap.from, gap.to).iter().filter_map(|link| match link.role {
                Role::Run(run) => Some((run, link)),
                _ => None,
            })
        };
        let stand = placed.get(gap.index)?.start;
        let lead = &links.at(if is_by_entry { gap.before? } else { gap.after? });
        let offset = lead.element.offset(lead.d_in_mm)?;
        let outside = if is_by_entry { offset.start() } else { offset.end() };
        let path = match offset {
            Element::Arc(arc) => Element::arc(outside, stand, arc.center, arc.turn > 0.0, 0)?,
            Element::Line(_) => Element::line(outside, stand)?,
        };
        let stays = |link: &ChainLink, point: Vec2| distance_to(&path, point) - link.d_in_mm.abs();
        let parts = [0.0, 0.5, 1.0];
        let all = runs().flat_map(|(_, link)| {
            let at = move |part: f64| link.element.point_at(link.element.length() * part);
            parts.into_iter().map(move |part| stays(&link, at(part)))
        });
        let stays_mm = all.fold(0.0, f64::max);
        let (first, last) = (runs().next()?.0, runs().next_back()?.0);
        (stays_mm > tolerance).then_some(Skipped { first, last, stays_mm, is_by_entry })
    };
    gaps(links, placed)
        .filter(move |gap| !is_deep(links, placed, gap, tolerance))
        .filter_map(skipped)
}

/// Links `from..to` are consumed. `before` and `after` are the neighbours that stay, `after` as an
/// index of what is placed.
struct Gap {
    index: usize,
    from: usize,
    to: usize,
    before: Option<usize>,
    after: Option<usize>,
}

fn gaps<'a>(links: Links<'a>, placed: &'a [Placed]) -> impl Iterator<Item = Gap> + 'a {
    (0..=placed.len()).filter_map(move |index| {
        let before = index.checked_sub(1).map(|index| placed[index].link);
        let after = placed.get(index).map(|placed| placed.link);
        let from = before.map_or(0, |before| before + 1);
        let to = after.unwrap_or(links.len());
        let is_gap = (from..to).any(|link| matches!(links.role(link), Role::Run(_)));
        is_gap.then_some(Gap { index, from, to, before, after })
    })
}

/// Whether the consumed links are more than noise, and more than a sharp corner takes.
fn is_deep(links: Links<'_>, placed: &[Placed], gap: &Gap, tolerance: f64) -> bool {
    deviation(links, placed, gap, tolerance) > tolerance
        && !is_end_that_is_touched(links, placed, gap, tolerance)
        && !is_curve_that_is_touched(links, placed, gap, tolerance)
        && !is_corner_of_curves(links, placed, gap, tolerance)
}

/// Whether a contour begins or ends with an arc that the tool touches completely while it stands
/// still: an arc hardly smaller than the tool, and so short that its offset goes nowhere.
fn is_end_that_is_touched(links: Links<'_>, placed: &[Placed], gap: &Gap, tolerance: f64) -> bool {
    let last = gap.index.checked_sub(1).and_then(|index| placed.get(index));
    let stand = match (gap.before, gap.after) {
        (Some(_), None) => last.map(|last| last.end),
        (None, Some(_)) => placed.get(gap.index).map(|first| first.start),
        _ => None,
    };
    let Some(stand) = stand else { return false };
    let mut runs =
        links.range(gap.from, gap.to).iter().filter(|link| matches!(link.role, Role::Run(_)));
    runs.all(|link| {
        let (radius_mm, length) = (link.d_in_mm.abs(), link.element.length());
        let is_short = matches!(link.element, Element::Arc(arc) if arc.sweep <= CHORD_TURN_RAD);
        is_short
            && (0..=8).all(|part| {
                let point = link.element.point_at(length * f64::from(part) / 8.0);
                (radius_mm - GOUGE_MM..=radius_mm + tolerance).contains(&(point - stand).norm())
            })
    })
}

/// The links on both sides of a gap and all between them, without the arcs around outside corners:
/// those are no part of the contour.
fn along(links: Links<'_>, gap: &Gap) -> Option<Vec<usize>> {
    let is_corner = |link: &usize| matches!(links.role(*link), Role::Corner { .. });
    let (before, after) = (gap.before?, gap.after?);
    let before = if is_corner(&before) { before.checked_sub(1)? } else { before };
    let after = if is_corner(&after) { after + 1 } else { after };
    (after < links.len()).then(|| (before..=after).filter(|link| !is_corner(link)).collect())
}

/// Whether all of it is one curve made of chords, which the tool touches where it stands still.
///
/// The noise of posted coordinates turns short chords so much that whole groups are consumed inside
/// a curve that the tool fits into. What it leaves there is still noise.
fn is_curve_that_is_touched(
    links: Links<'_>,
    placed: &[Placed],
    gap: &Gap,
    tolerance: f64,
) -> bool {
    let Some(stand) = placed.get(gap.index).map(|place| place.start) else { return false };
    let Some(along) = along(links, gap) else { return false };
    let consumed = &along[1..along.len() - 1];
    let off = |link: &ChainLink, point: Vec2| ((point - stand).norm() - link.d_in_mm.abs()).abs();
    along.windows(2).all(|pair| are_chords(&links.at(pair[0]), &links.at(pair[1])))
        && consumed.iter().map(|&link| links.at(link)).all(|link| {
            let length = link.element.length();
            is_chord(&link)
                && [0.0, 0.25, 0.5, 0.75, 1.0]
                    .into_iter()
                    .all(|part| off(&link, link.element.point_at(length * part)) <= tolerance)
        })
}

/// Whether a link may be a chord of a curve, and no arc or straight that is a feature.
fn is_chord(link: &ChainLink) -> bool {
    match link.element {
        Element::Line(_) => f64::from(link.straight_mm) <= CHORD_RADII * link.d_in_mm.abs(),
        Element::Arc(arc) => arc.radius * arc.sweep * arc.sweep / 8.0 <= CHORD_MM,
    }
}

/// Whether two curves, written as chords, meet in a sharp inside corner, and the tool fits into
/// each of them alone.
///
/// The tool takes chords from their ends as it takes a piece of an arc.
fn is_corner_of_curves(links: Links<'_>, placed: &[Placed], gap: &Gap, tolerance: f64) -> bool {
    const CHORDS_MIN: usize = 3;
    let Some(along) = along(links, gap) else { return false };
    if !is_passed_by(links, placed, gap, tolerance) {
        return false;
    }
    let (before, after) = (along[0], along[along.len() - 1]);
    // A link on the other side of the tool makes no corner with this one.
    if links.at(before).d_out_mm * links.at(after).d_in_mm < 0.0 {
        return false;
    }
    let is_chord = |link: usize| is_chord(&links.at(link)) && bends_as_chords(&links.at(link));
    if !along[1..along.len() - 1].iter().all(|&link| is_chord(link)) {
        return false;
    }
    let is_bent = |pair: &[usize]| !are_chords(&links.at(pair[0]), &links.at(pair[1]));
    let mut sharp = (1..along.len()).filter(|&index| is_bent(&along[index - 1..=index]));
    let (Some(corner), None) = (sharp.next(), sharp.next()) else { return false };
    // Next to a feature a few straights are no curve.
    let consumed = [corner - 1, along.len() - 1 - corner];
    let is_curve =
        |(end, consumed): (usize, usize)| consumed == 0 || consumed >= CHORDS_MIN || is_chord(end);
    let (last, first) = (along[corner - 1], along[corner]);
    [before, after].into_iter().zip(consumed).all(is_curve)
        && is_sharp(&links.at(last).element, &links.at(first).element)
        && turn(&links.at(last).element, &links.at(first).element, links.at(first).d_in_mm)
            == Turn::Inside
        && [links.range(before, last + 1), links.range(first, after + 1)]
            .into_iter()
            .all(|side| !is_any_unreachable(side, &join(side, tolerance), tolerance))
}

/// Whether an arc bends no more than the chords of a curve. A short arc of a small radius is a
/// feature, however near it is to its chord.
fn bends_as_chords(link: &ChainLink) -> bool {
    match link.element {
        Element::Line(_) => true,
        Element::Arc(arc) => arc.sweep <= CHORD_TURN_RAD || arc.radius >= CURVE_RADIUS_MM,
    }
}

/// Whether two elements meet in a real corner, and not in a coarse joint of one curve.
fn is_sharp(a: &Element, b: &Element) -> bool {
    let (before, after) = (a.end_tangent(), b.start_tangent());
    before.dot(&after) <= 0.0 || cross(before, after).abs() > SHARP_TURN_RAD
}

/// Whether the tool clears everything that is consumed, at the joint across a gap and on its
/// lengthened neighbours, and leaves nothing along those.
fn is_passed_by(links: Links<'_>, placed: &[Placed], gap: &Gap, tolerance: f64) -> bool {
    let (Some(before), Some(after)) =
        (gap.index.checked_sub(1).and_then(|index| placed.get(index)), placed.get(gap.index))
    else {
        return false;
    };
    let stand = after.start;
    let end = |place: &Placed| links.at(place.link).element.offset(links.at(place.link).d_out_mm);
    let start = |place: &Placed| links.at(place.link).element.offset(links.at(place.link).d_in_mm);
    let lengthened = [
        end(before).filter(|_| before.trim_out < 0.0).map(|element| element.end()),
        start(after).filter(|_| after.trim_in < 0.0).map(|element| element.start()),
    ];
    let lengthened = lengthened.map(|end| end.and_then(|end| Element::line(stand, end)));
    links.range(gap.from, gap.to).iter().filter(|link| matches!(link.role, Role::Run(_))).all(
        |link| {
            let radius = link.d_in_mm.abs();
            [link.element.start(), link.element.end()].into_iter().all(|point| {
                let is_clear = |path: &Element| {
                    let along = path.along_from_start(point, 0.0);
                    let off = (path.project(point) - point).norm();
                    !(0.0..=path.length()).contains(&along)
                        || (off - radius).abs() <= tolerance.max(LENGTH_MM)
                };
                (point - stand).norm() >= radius - tolerance.max(LENGTH_MM)
                    && lengthened.iter().flatten().all(is_clear)
            })
        },
    )
}

/// Whether two links continue each other as chords of one curve.
fn are_chords(a: &ChainLink, b: &ChainLink) -> bool {
    let (before, after) = (a.element.end_tangent(), b.element.start_tangent());
    let sine = cross(before, after).abs();
    let shorter = a.element.length().min(b.element.length());
    before.dot(&after) > 0.0 && sine <= CHORD_TURN_RAD && shorter * sine / 4.0 <= CHORD_MM
}

/// The greatest distance between what was consumed and the programmed corner that replaces it, mm:
/// the neighbours, lengthened until they meet.
fn deviation(links: Links<'_>, placed: &[Placed], gap: &Gap, tolerance: f64) -> f64 {
    // A link on the other side of the tool is not lengthened along this one.
    let on_this_side = |other: &usize| links.at(*other).d_in_mm * links.at(gap.from).d_in_mm >= 0.0;
    let before = gap.before.filter(on_this_side).map(|index| links.at(index).element);
    let after = gap.after.filter(on_this_side).map(|index| links.at(index).element);
    let ends = [links.at(gap.from).element.start(), links.at(gap.to - 1).element.end()];
    let Some(corner) = programmed_corner(before, after, ends, tolerance) else {
        return f64::INFINITY;
    };
    let before_place = gap.index.checked_sub(1).and_then(|index| placed.get(index));
    let is_backwards = [
        before_place.is_some_and(|place| place.trim_out >= 0.0),
        placed.get(gap.index).is_some_and(|place| place.trim_in < 0.0),
    ];
    let longer = [
        before.and_then(|element| piece(&element, element.end(), corner, is_backwards[0])),
        after.and_then(|element| piece(&element, element.start(), corner, is_backwards[1])),
    ];
    let to_corner = |point: Vec2| {
        let to_pieces = longer.iter().flatten().map(|piece| distance_to(piece, point));
        to_pieces.fold((point - corner).norm(), f64::min)
    };
    let consumed = || links.range(gap.from, gap.to).iter().map(|link| link.element);
    let from_corner = consumed().map(|element| distance_to(&element, corner));
    let points = consumed().flat_map(|element| {
        let length = element.length();
        (0..=4).map(move |quarter| element.point_at(length * f64::from(quarter) / 4.0))
    });
    points.map(to_corner).fold(from_corner.fold(f64::INFINITY, f64::min), f64::max)
}

/// The piece of an element's line or circle between two points, the shorter way around; straight
/// when the second point is off it. About half a circle is equally long both ways: there the caller
/// knows whether it goes against the direction of the element.
fn piece(element: &Element, from: Vec2, to: Vec2, is_backwards: bool) -> Option<Element> {
    let straight = Element::line(from, to);
    let Element::Arc(arc) = element else { return straight };
    let (from_center, to_center) = (from - arc.center, to - arc.center);
    let ccw = match from_center.dot(&to_center) < 0.0 {
        true => (arc.turn > 0.0) != is_backwards,
        false => cross(from_center, to_center) >= 0.0,
    };
    Element::arc(from, to, arc.center, ccw, 0).or(straight)
}

/// Where the neighbours of a gap meet. At a free end of the contour: as far as a line can be
/// lengthened along the gap.
fn programmed_corner(
    before: Option<Element>,
    after: Option<Element>,
    [from, to]: [Vec2; 2],
    tolerance: f64,
) -> Option<Vec2> {
    let end_beyond = |line: &Element, end: Vec2, point: Vec2| {
        let foot = line.project(point);
        let is_beyond = !(0.0..=line.length()).contains(&line.along_from_start(point, 0.0));
        if line.is_line() && is_beyond && (foot - point).norm() <= tolerance { foot } else { end }
    };
    let (a, b) = match (before, after) {
        (Some(a), Some(b)) => (a, b),
        (Some(a), None) => return Some(end_beyond(&a, a.end(), to)),
        (None, Some(b)) => return Some(end_beyond(&b, b.start(), from)),
        (None, None) => return None,
    };
    let near = (a.end() + b.start()) / 2.0;
    let distance = |point: &Vec2| (point - near).norm();
    let crossing = crossings(&a, &b, tolerance)
        .points()
        .iter()
        .copied()
        .min_by(|p, q| distance(p).total_cmp(&distance(q)));
    // Two that nearly continue each other may meet anywhere.
    let along = (a.project(near) - b.project(near)).norm() <= tolerance;
    match crossing {
        Some(point) if !along || distance(&point) <= tolerance => Some(point),
        _ if along => Some(near),
        other => other,
    }
}

/// The largest radius for which a piece of the chain fits.
fn largest_radius(
    links: Links<'_>,
    slack: f64,
    fits: impl Fn(Links<'_>, &[Placed]) -> bool,
) -> f64 {
    let radius = links.iter().map(|link| link.d_in_mm.abs()).fold(0.0, f64::max);
    let fits = |part: f64| {
        let scaled = links.scaled(part);
        fits(scaled, &join(scaled, slack))
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..48 {
        let middle = f64::midpoint(low, high);
        if fits(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low * radius
}
