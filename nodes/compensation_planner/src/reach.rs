//! What the tool cannot reach: the meaning of consumed elements.
//!
//! Where elements are consumed the tool runs as if the neighbours were extended
//! until they meet. That is right when the programmed corner they make is within
//! the accepted tolerance of what was consumed (noise of posted coordinates),
//! and a finding when it is not. The answer holds for neighbours only; what
//! distant parts of a contour do to each other is not seen here.

use crate::chain::{Link, Placed, Role, join};
use crate::element::{Element, Vec2};
use crate::intersect::crossings;

/// Elements in a row that the tool cannot reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Unreachable {
    /// The first and last run that are consumed, and the longest.
    pub first: usize,
    pub last: usize,
    pub longest: usize,
    /// The largest radius, mm, for which the tool reaches all of them; 0 when
    /// none was found.
    pub radius_mm_max: f64,
}

/// All places that the tool cannot reach.
pub(crate) fn unreachable(links: &[Link], placed: &[Placed], tolerance: f64) -> Vec<Unreachable> {
    let mut found = Vec::new();
    for gap in gaps(links, placed) {
        if deviation(links, &gap, tolerance) <= tolerance {
            continue;
        }
        let runs = |from: usize, to: usize| {
            links[from..to].iter().filter_map(|link| match link.role {
                Role::Run(run) => Some((run, link.element.length())),
                _ => None,
            })
        };
        let inside = || runs(gap.from, gap.to);
        let (Some(first), Some(last)) = (inside().next(), inside().next_back()) else { continue };
        let longest = inside().fold(first, |best, run| if run.1 > best.1 { run } else { best });
        let from = gap.before.unwrap_or(gap.from);
        let to = gap.after.map_or(gap.to, |after| after + 1);
        found.push(Unreachable {
            first: first.0,
            last: last.0,
            longest: longest.0,
            radius_mm_max: largest_radius(&links[from..to], tolerance),
        });
    }
    found
}

/// Links `from..to` are consumed; `before` and `after` are the neighbours that stay.
struct Gap {
    from: usize,
    to: usize,
    before: Option<usize>,
    after: Option<usize>,
}

fn gaps<'a>(links: &'a [Link], placed: &'a [Placed]) -> impl Iterator<Item = Gap> + 'a {
    (0..=placed.len()).filter_map(move |index| {
        let before = index.checked_sub(1).map(|index| placed[index].link);
        let after = placed.get(index).map(|placed| placed.link);
        let from = before.map_or(0, |before| before + 1);
        let to = after.unwrap_or(links.len());
        let is_gap = links[from.min(to)..to].iter().any(|link| matches!(link.role, Role::Run(_)));
        is_gap.then_some(Gap { from, to, before, after })
    })
}

/// The largest distance between what was consumed and the programmed corner
/// that takes its place, mm.
fn deviation(links: &[Link], gap: &Gap, tolerance: f64) -> f64 {
    let before = gap.before.map(|index| links[index].element);
    let after = gap.after.map(|index| links[index].element);
    let Some(corner) = programmed_corner(before, after, tolerance) else {
        return f64::INFINITY;
    };
    links[gap.from..gap.to]
        .iter()
        .flat_map(|link| {
            let length = link.element.length();
            (0..=4).map(move |quarter| link.element.point_at(length * f64::from(quarter) / 4.0))
        })
        .map(|point| (point - corner).norm())
        .fold(0.0, f64::max)
}

fn programmed_corner(
    before: Option<Element>,
    after: Option<Element>,
    tolerance: f64,
) -> Option<Vec2> {
    let (a, b) = match (before, after) {
        (Some(a), Some(b)) => (a, b),
        (Some(a), None) => return Some(a.end()),
        (None, Some(b)) => return Some(b.start()),
        (None, None) => return None,
    };
    let near = (a.end() + b.start()) / 2.0;
    let distance = |point: &Vec2| (point - near).norm();
    let crossing = crossings(&a, &b, tolerance)
        .points()
        .iter()
        .copied()
        .min_by(|p, q| distance(p).total_cmp(&distance(q)));
    // Two that nearly run on in each other meet anywhere.
    let along = (a.project(near) - b.project(near)).norm() <= tolerance;
    match crossing {
        Some(point) if !along || distance(&point) <= tolerance => Some(point),
        _ if along => Some(near),
        other => other,
    }
}

/// The largest radius for which a piece of the chain has nothing unreachable.
fn largest_radius(links: &[Link], tolerance: f64) -> f64 {
    let radius = links.iter().map(|link| link.d_in_mm.abs()).fold(0.0, f64::max);
    let fits = |part: f64| {
        let scaled: Vec<Link> = links
            .iter()
            .map(|link| Link {
                d_in_mm: link.d_in_mm * part,
                d_out_mm: link.d_out_mm * part,
                ..*link
            })
            .collect();
        let placed = join(&scaled, tolerance);
        gaps(&scaled, &placed).all(|gap| deviation(&scaled, &gap, tolerance) <= tolerance)
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
