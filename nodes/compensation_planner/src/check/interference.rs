//! Finds gouges: whether the tool, anywhere on its path along a span, cuts into a wall of it.
//!
//! Joints keep the tool clear of the elements that they join. This file checks all others, however
//! far apart they are in the program: walls of a slot, a contour that comes back on itself, an arc
//! that bends back to its neighbour. `reach` decides about what the tool cannot reach.

use crate::check::walls::Walls;
use crate::geometry::bounds::Bounds;
use crate::geometry::chains::NO_CHAIN;
use crate::geometry::contact::{Normals, contact};
use crate::geometry::distance::{Nearest, are_apart, nearest_between, nearest_on_element};
use crate::geometry::element::{Element, Vec2};
use crate::geometry::tolerance::{LENGTH_MM, LOOP_MM};
use crate::geometry::tree::{FLAT_MAX, Tree, budget};
use crate::span::chain::{ChainLink, Placed, Role};
use crate::span::corner::{Corners, PIECES};
use crate::span::links::Links;
use std::ops::ControlFlow;

/// The tool on one run comes too near to another.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cut {
    /// The run that the tool follows, and the run that it cuts into.
    pub on: usize,
    pub into: usize,
    /// The two places of the contour that are too near: on the followed run and on the cut one.
    pub foot: Vec2,
    pub on_wall: Vec2,
    pub radius_mm: f64,
    /// Distance of the tool centre from the wall, mm.
    pub distance_mm: f64,
    pub is_other_pass: bool,
    /// The cut is between the start and the end of a closed contour, and the profile forgives that.
    pub is_forgiven: bool,
}

impl Cut {
    /// Cuts of the same kind are equally bad.
    const fn kind(&self) -> (bool, bool) {
        (self.is_other_pass, self.is_forgiven)
    }
}

/// The cuts, and whether everything was checked.
#[derive(Debug)]
pub(crate) struct Cuts {
    pub cuts: Vec<Cut>,
    pub is_complete: bool,
}

/// One element of the tool path.
#[derive(Debug, Clone, Copy)]
struct ToolMove {
    place: usize,
    /// The piece of a corner that is not an arc.
    piece: Option<usize>,
    /// The run that it belongs to; a corner belongs to the run after it (S07).
    run: usize,
    chain: u32,
    /// How much nearer than the radius the tool may be, mm.
    slack: f64,
}

/// The most cuts kept of each kind; a span that is cut everywhere needs no more.
const CUTS_MAX: usize = 100_000;

/// Cuts with the place that each is made from. Those into another pass may be warnings: however
/// many there are, they hide no error.
#[derive(Debug, Default)]
struct FoundCuts {
    cuts: Vec<(usize, Cut)>,
    /// Cuts into the same pass that count.
    plain: usize,
    others: usize,
}

impl FoundCuts {
    /// Keeps a cut unless there are many of its kind; breaks when no more are needed.
    fn push(&mut self, place: usize, cut: Cut) -> ControlFlow<()> {
        let is_plain = cut.kind() == (false, false);
        let kept = if is_plain { &mut self.plain } else { &mut self.others };
        if *kept < CUTS_MAX {
            *kept += 1;
            self.cuts.push((place, cut));
        } else if is_plain {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }
}

/// The joined path of the tool along a span.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Joined<'a> {
    pub links: Links<'a>,
    pub placed: &'a [Placed],
    pub corners: Corners<'a>,
}

/// All places where the tool cuts into a wall, the deepest point of each.
///
/// The tool may be `gouge_mm` nearer than its radius, and `tolerance` more where
/// something was consumed, mm.
pub(crate) fn cuts(walls: &Walls<'_>, joined: &Joined<'_>, tolerance: f64, gouge_mm: f64) -> Cuts {
    let (found, is_complete) = all_cuts(walls, joined, [gouge_mm, gouge_mm + tolerance]);
    Cuts { cuts: deepest_of_each_group(found), is_complete }
}

/// For each place whether the tool cuts into a wall of the same pass from there.
pub(crate) fn cut_places(walls: &Walls<'_>, joined: &Joined<'_>, slack: [f64; 2]) -> Vec<bool> {
    let mut is_cutting = vec![false; joined.placed.len()];
    for (place, cut) in all_cuts(walls, joined, slack).0 {
        is_cutting[place] |= !cut.is_other_pass;
    }
    is_cutting
}

/// All cuts, each with the place that it is made from, and whether the list is complete.
fn all_cuts(walls: &Walls<'_>, joined: &Joined<'_>, slack: [f64; 2]) -> (Vec<(usize, Cut)>, bool) {
    if !walls.is_complete() {
        // Without the passes, each copy of a wall would obstruct the others.
        return (Vec::new(), false);
    }
    let Joined { links, placed, .. } = *joined;
    let paths = paths(walls, joined, slack);
    // Elements of long contours are computed when they are needed.
    let kept: Vec<Option<Element>> = match paths.len() <= FLAT_MAX {
        true => paths.iter().map(|path| path.element(joined)).collect(),
        false => Vec::new(),
    };
    let element = |path: usize| match kept.get(path) {
        Some(element) => *element,
        None => paths[path].element(joined),
    };
    let reach = links.iter().map(|link| link.d_in_mm.abs().max(link.d_out_mm.abs()));
    let reach = reach.fold(0.0, f64::max);
    let touched = |path: usize, element: &Element| {
        contact(element, links.at(placed[paths[path].place].link).d_in_mm)
    };
    let elements = (0..paths.len()).map(|path| (element(path), paths[path].chain));
    let tree = Tree::of_elements(elements, walls.tree().widest_mm, touched);
    let mut found = FoundCuts::default();
    let nothing = (Bounds::EMPTY, Normals::NONE);
    let boxes = (
        |path: usize| element(path).map_or(nothing, |element| touched(path, &element)),
        |run: usize| Bounds::of(walls.element(run)),
    );
    let budget = &mut budget(paths.len());
    let is_complete = tree.near_pairs(walls.tree(), reach, budget, boxes, |on, run| {
        let link = &links.at(placed[paths[on].place].link);
        let radius_mm = link.d_in_mm.abs().min(link.d_out_mm.abs());
        match cut(walls, &paths[on], || element(on), radius_mm, link, run) {
            Some(cut) => found.push(paths[on].place, cut),
            None => ControlFlow::Continue(()),
        }
    });
    (found.cuts, is_complete)
}

impl ToolMove {
    fn element(&self, joined: &Joined<'_>) -> Option<Element> {
        let Joined { links, placed, corners } = *joined;
        match self.piece {
            None => element(&links.at(placed[self.place].link), &placed[self.place]),
            Some(piece) => corners.pieces(links, placed, self.place)?[piece],
        }
    }
}

/// The tool path between the leads: each piece with its run and its radius, mm.
pub(crate) fn pieces(
    walls: &Walls<'_>,
    joined: &Joined<'_>,
) -> impl Iterator<Item = (usize, f64, Element)> {
    paths(walls, joined, [0.0; 2]).into_iter().filter_map(|path| {
        let link = &joined.links.at(joined.placed[path.place].link);
        let radius_mm = link.d_in_mm.abs().min(link.d_out_mm.abs());
        Some((path.run, radius_mm, path.element(joined)?))
    })
}

/// The moves between the leads. A corner belongs to the run after it, or before it when there is
/// none.
fn paths(walls: &Walls<'_>, joined: &Joined<'_>, [near, nearer]: [f64; 2]) -> Vec<ToolMove> {
    let Joined { links, placed, corners } = *joined;
    let role = |place: Option<usize>| Some(links.role(placed.get(place?)?.link));
    let mut paths: Vec<ToolMove> = Vec::with_capacity(placed.len());
    let mut run_before: Option<usize> = None;
    for place in 0..placed.len() {
        let run = match role(Some(place)) {
            Some(Role::Run(run)) => Some(run),
            Some(Role::Corner { .. }) => {
                match (role(place.checked_sub(1)), role(Some(place + 1))) {
                    // Those belong to the lead.
                    (Some(Role::Entry), _) | (_, Some(Role::Exit)) => None,
                    (_, Some(Role::Run(run))) => Some(run),
                    _ => run_before,
                }
            }
            _ => None,
        };
        let Some(run) = run else { continue };
        let is_corner = role(Some(place)) != Some(Role::Run(run));
        let is_gap = run_before.is_some_and(|before| before + 1 != run);
        if is_gap && let Some(path) = paths.last_mut() {
            path.slack = nearer;
        }
        let slack = if is_gap { nearer } else { near };
        let mut chain = walls.chain(run);
        if is_corner {
            let before = run_before.filter(|before| *before != run);
            if before.map(|before| walls.chain(before)) != Some(chain) {
                chain = NO_CHAIN;
            }
        } else {
            run_before = Some(run);
        }
        let path = ToolMove { place, piece: None, run, chain, slack };
        if is_corner && corners.lines(links, placed, place).is_some() {
            paths.extend((0..PIECES).map(|piece| ToolMove { piece: Some(piece), ..path }));
        } else {
            paths.push(path);
        }
    }
    paths
}

/// The cut into one run, if any.
fn cut(
    walls: &Walls<'_>,
    on: &ToolMove,
    path: impl Fn() -> Option<Element>,
    radius_mm: f64,
    link: &ChainLink,
    into: usize,
) -> Option<Cut> {
    let into = walls.in_pass_of(on.run, into);
    // What the tool does not touch was reported as unreachable, or accepted.
    if !walls.is_judged(into) || (on.chain != NO_CHAIN && on.chain == walls.chain(into)) {
        return None;
    }
    let limit = radius_mm - on.slack;
    let whole = walls.element(into);
    // Cheap tests first.
    if into == on.run && whole.is_line() {
        return None;
    }
    let path = &path()?;
    if are_apart(path, whole, limit) {
        return None;
    }
    let mut near = nearest_between(path, whole);
    if near.distance >= limit {
        return None;
    }
    near = nearest_between(path, &walls.seen_from(Some(walls.place(on.run, near.on_path)), into)?);
    if near.distance >= limit {
        return None;
    }
    let is_other_pass = walls.pass(on.run) != walls.pass(into);
    if !is_other_pass && is_retraced(walls, on.run, into, near) {
        return None;
    }
    Some(Cut {
        on: on.run,
        into,
        foot: link.element.project(near.on_path),
        on_wall: near.on_wall,
        radius_mm,
        distance_mm: near.distance,
        is_other_pass,
        is_forgiven: walls.forgives_closing() && walls.close_on(on.run, into),
    })
}

/// Whether a wall is a copy of the one that the tool follows there. Copies of a wall count as one
/// wall, not as two near each other. Rounded coordinates leave them less than the width of a loop
/// apart, and the tool is no deeper in one of them than that.
fn is_retraced(walls: &Walls<'_>, on: usize, into: usize, near: Nearest) -> bool {
    let followed = walls.element(on);
    let at = nearest_on_element(followed, near.on_path);
    let is_at = |point: Vec2| (point - near.on_wall).norm() <= LOOP_MM;
    // Where one continues the other, neither is retraced; nor where the contour nearly closes.
    let is_before = into + 1 == on || on < into && walls.are_ends_of_pass(on, into);
    let is_after = into == on + 1 || into < on && walls.are_ends_of_pass(into, on);
    let is_joint = is_before && is_at(followed.start()) || is_after && is_at(followed.end());
    // A tangent that leaves a circle stays near it for a while, and is no copy of it.
    let is_same = match (followed, walls.element(into)) {
        (Element::Line(_), Element::Line(_)) => true,
        (Element::Arc(a), Element::Arc(b)) => {
            (a.center - b.center).norm().max((a.radius - b.radius).abs()) <= LOOP_MM
        }
        _ => false,
    };
    into != on
        && is_same
        && !is_joint
        && is_at(at)
        && followed.tangent_at(at).dot(&walls.element(into).tangent_at(near.on_wall)) > 0.0
}

/// Merges cuts between neighbours into one group, also where the tool cuts a pair of walls from
/// both.
fn deepest_of_each_group(mut found: Vec<(usize, Cut)>) -> Vec<Cut> {
    found.sort_by_key(|(path, cut)| (*path, cut.into));
    let mut groups: Vec<CutGroup> = Vec::new();
    for (path, cut) in found {
        let open = groups.iter_mut().rev().take(8).find(|group| group.continues(path, &cut));
        match open {
            Some(group) => group.take(path, cut),
            None => groups.push(CutGroup::new(path, cut)),
        }
    }
    groups.sort_by(|a, b| {
        a.deepest.distance_mm.total_cmp(&b.deepest.distance_mm).then(a.on.0.cmp(&b.on.0))
    });
    let mut kept: Vec<CutGroup> = Vec::new();
    for group in groups {
        // A warning must not hide an error.
        let is_other_side = |other: &CutGroup| {
            other.deepest.kind() == group.deepest.kind()
                && (overlap(group.on, other.into) && overlap(group.into, other.on)
                    || overlap(group.on, other.on) && overlap(group.into, other.into))
        };
        if kept.len() < 1000 && !kept.iter().any(is_other_side) {
            kept.push(group);
        }
    }
    kept.sort_by_key(|group| (group.on.0.max(group.into.0), group.on.0));
    kept.into_iter().map(|group| group.deepest).collect()
}

/// Cuts that hang together.
#[derive(Debug, Clone, Copy)]
struct CutGroup {
    last_move: usize,
    /// The first and last run that the tool follows, and the first and last that it cuts.
    on: (usize, usize),
    into: (usize, usize),
    deepest: Cut,
}

impl CutGroup {
    fn new(path: usize, cut: Cut) -> Self {
        Self { last_move: path, on: (cut.on, cut.on), into: (cut.into, cut.into), deepest: cut }
    }

    fn continues(&self, path: usize, cut: &Cut) -> bool {
        path <= self.last_move + 2
            && cut.into + 2 >= self.into.0
            && cut.into <= self.into.1 + 2
            && cut.kind() == self.deepest.kind()
    }

    fn take(&mut self, path: usize, cut: Cut) {
        self.last_move = path;
        self.on = (self.on.0.min(cut.on), self.on.1.max(cut.on));
        self.into = (self.into.0.min(cut.into), self.into.1.max(cut.into));
        // At a vertex both runs are equally near; it belongs to the later one (S07).
        let nearer = self.deepest.distance_mm - cut.distance_mm;
        if nearer > LENGTH_MM || (nearer > -LENGTH_MM && cut.into > self.deepest.into) {
            self.deepest = cut;
        }
    }
}

fn overlap(a: (usize, usize), b: (usize, usize)) -> bool {
    a.0 <= b.1 + 1 && b.0 <= a.1 + 1
}

/// The tool path along an element, without what its joints cut off.
pub(crate) fn element(link: &ChainLink, place: &Placed) -> Option<Element> {
    match link.element.offset(link.d_in_mm)? {
        Element::Line(_) => Element::line(place.start, place.end),
        Element::Arc(arc) if arc.radius <= LENGTH_MM => None,
        Element::Arc(arc) => {
            // The extension at a short corner is not checked (S68); next to a lead it is part of
            // the lead.
            let (skipped, left_out) = (place.trim_in.max(0.0), place.trim_out.max(0.0));
            Element::Arc(arc).after(skipped)?.before(arc.radius * arc.sweep - skipped - left_out)
        }
    }
}

/// The same, with what its joints lengthen it by.
pub(crate) fn lengthened(link: &ChainLink, place: &Placed) -> Option<Element> {
    match link.element.offset(link.d_in_mm)? {
        Element::Line(_) => Element::line(place.start, place.end),
        Element::Arc(arc) => Element::arc(place.start, place.end, arc.center, arc.turn > 0.0, 0),
    }
}

/// The part by which a joint lengthens an arc, at its end or at its start.
pub(crate) fn beyond(link: &ChainLink, place: &Placed, at_end: bool) -> Option<Element> {
    let whole = link.element.offset(link.d_in_mm)?;
    let Element::Arc(arc) = whole else { return None };
    let (trim, from, to) = match at_end {
        true => (place.trim_out, whole.end(), place.end),
        false => (place.trim_in, place.start, whole.start()),
    };
    if trim >= 0.0 { None } else { Element::arc(from, to, arc.center, arc.turn > 0.0, 0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_of_cuts_into_other_passes_hides_one_into_the_same() {
        let cut = |is_other_pass| Cut {
            on: 0,
            into: 1,
            foot: Vec2::zeros(),
            on_wall: Vec2::zeros(),
            radius_mm: 1.0,
            distance_mm: 0.5,
            is_other_pass,
            is_forgiven: false,
        };
        let mut found = FoundCuts::default();
        for place in 0..CUTS_MAX + 5 {
            assert!(found.push(place, cut(true)).is_continue());
        }
        for place in 0..CUTS_MAX {
            assert!(found.push(place, cut(false)).is_continue());
        }
        assert!(found.push(0, cut(false)).is_break());
        let plain = found.cuts.iter().filter(|(_, cut)| !cut.is_other_pass).count();
        assert_eq!((found.cuts.len(), plain), (2 * CUTS_MAX, CUTS_MAX));
    }
}
