//! Leaves out of the tool path what does not fit the contour.
//!
//! It begins with the path along all blocks, however much neighbours take of each other. Where this
//! path crosses itself and continues too near to a wall, it continues at the later crossing
//! instead. The loop between is left out, as controls do that look far enough ahead (CDON, M120).
//! The result is checked again.

use crate::check::interference::{self, Cut, Joined, cut_places, element};
use crate::check::lead::deepest_cut;
use crate::check::reach::left_out;
use crate::check::walls::Walls;
use crate::geometry::bounds::Bounds;
use crate::geometry::chains::NO_CHAIN;
use crate::geometry::distance::is_on;
use crate::geometry::element::{Element, Vec2};
use crate::geometry::intersect::crossings;
use crate::geometry::tolerance::{GOUGE_MM, LENGTH_MM};
use crate::geometry::tree::{Tree, budget};
use crate::span::chain::{Placed, Role, joint};
use std::ops::ControlFlow;

/// Crossings kept for each element, plus a constant.
const CROSSINGS_MAX: (usize, usize) = (4, 10_000);

/// Joined ends may be so far apart, mm: rounding of nearly tangent elements.
const JOINED_MM: f64 = 10.0 * LENGTH_MM;

/// The path that is left.
#[derive(Debug)]
pub(crate) struct Trimmed {
    pub placed: Vec<Placed>,
    /// Indices in `placed` after which a loop is left out.
    pub loops: Vec<usize>,
    /// Where the tool still cuts into a wall.
    pub cuts: Vec<Cut>,
    /// Whether the placed elements are connected.
    is_connected: bool,
}

/// The path crosses itself.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    point: Vec2,
    /// Index of what is placed, and mm along its path.
    early: (usize, f64),
    late: (usize, f64),
    /// A crossing of neighbours at an inside corner; the path does not go beyond it.
    is_joint: bool,
}

/// Leaves out what is nearer to a wall of its pass than the radius; the tool may be `tolerance` mm
/// nearer next to what was consumed.
pub(crate) fn trim(walls: &Walls<'_>, joined: &Joined<'_>, tolerance: f64) -> Trimmed {
    let (placed, joints) = with_consumed(joined, tolerance);
    let trimmed = trim_path(walls, &Joined { placed: &placed, ..*joined }, joints, tolerance);
    if trimmed.is_connected && trimmed.cuts.is_empty() {
        return trimmed;
    }
    // The contour begins or ends with something that does not fit.
    trim_path(walls, joined, Vec::new(), tolerance)
}

/// All elements, those that the tool does not reach included, and the joints between them.
fn with_consumed(joined: &Joined<'_>, tolerance: f64) -> (Vec<Placed>, Vec<Crossing>) {
    let Joined { links, placed, .. } = *joined;
    let mut gaps = left_out(links, placed, tolerance).peekable();
    let mut all: Vec<Placed> = Vec::with_capacity(links.len());
    let mut joints: Vec<Crossing> = Vec::new();
    let mut push = |mut place: Placed, is_joined: bool, all: &mut Vec<Placed>| {
        let link = &links.at(place.link);
        let ahead = link.element.offset(link.d_in_mm);
        if !is_joined {
            let Some(ahead) = ahead else { return };
            (place.start, place.trim_in) = (ahead.start(), 0.0);
            if let Some(last) = all.last_mut() {
                let before = &links.at(last.link);
                if let Some(element) = before.element.offset(before.d_out_mm) {
                    (last.end, last.trim_out) = (element.end(), 0.0);
                    let meeting = (last.link + 1 == place.link && !link.is_smooth)
                        .then(|| joint(before, &element, link, &ahead, true, tolerance))
                        .flatten();
                    if let Some(meeting) = meeting {
                        if link.is_lengthened {
                            (last.end, last.trim_out) = (meeting.point, meeting.trim_a);
                            (place.start, place.trim_in) = (meeting.point, meeting.trim_b);
                        } else {
                            joints.push(Crossing {
                                point: meeting.point,
                                early: (all.len() - 1, meeting.trim_a),
                                late: (all.len(), meeting.trim_b),
                                is_joint: true,
                            });
                        }
                    }
                }
            }
        }
        all.push(place);
    };
    for index in 0..=placed.len() {
        let before = index.checked_sub(1);
        let is_gap = gaps.next_if_eq(&before).is_some();
        if is_gap {
            let from = before.map_or(0, |before| placed[before].link + 1);
            let to = placed.get(index).map_or(links.len(), |place| place.link);
            for (link, whole) in links.iter().enumerate().take(to).skip(from) {
                let Some(whole) = whole.element.offset(whole.d_in_mm) else { continue };
                let (start, end) = (whole.start(), whole.end());
                push(Placed { link, start, end, trim_in: 0.0, trim_out: 0.0 }, false, &mut all);
            }
        }
        if let Some(&place) = placed.get(index) {
            push(place, !is_gap, &mut all);
        }
    }
    let length = |index: usize| {
        let place: &Placed = &all[index];
        element(&links.at(place.link), place).map_or(0.0, |path| path.length())
    };
    for joint in &mut joints {
        // Converts a trim into a place along the path.
        joint.early.1 = length(joint.early.0) - joint.early.1;
    }
    joints.retain(|joint| {
        joint.early.1 >= 0.0 && (0.0..=length(joint.late.0)).contains(&joint.late.1)
    });
    (all, joints)
}

fn trim_path(
    walls: &Walls<'_>,
    joined: &Joined<'_>,
    joints: Vec<Crossing>,
    tolerance: f64,
) -> Trimmed {
    let Joined { links, placed, .. } = *joined;
    let paths: Vec<Option<Element>> =
        placed.iter().map(|place| element(&links.at(place.link), place)).collect();
    let crossings = all_crossings(&paths, joints);
    let trimmer = Trimmer {
        walls,
        joined,
        is_cutting: cut_places(walls, joined, [GOUGE_MM, GOUGE_MM + tolerance]),
        breaks: breaks(&crossings, placed.len()),
        paths,
    };
    let mut left: Vec<Placed> = Vec::with_capacity(placed.len());
    let (mut loops, mut is_connected) = (Vec::new(), true);
    let mut index = 0;
    // Where the path entered the element, if not at its start.
    let mut entered: Option<Crossing> = None;
    while index < placed.len() {
        let begin = entered.map_or(0.0, |crossing| crossing.late.1);
        let leaves = trimmer.leaves(&crossings, index, begin);
        let mut place = placed[index];
        if let Some(crossing) = entered {
            place.start = crossing.point;
            place.trim_in = place.trim_in.max(0.0) + crossing.late.1;
        } else if let Some(last) = left.last() {
            is_connected &= (last.end - place.start).norm() <= JOINED_MM;
        }
        if let Some(crossing) = leaves {
            place.end = crossing.point;
            place.trim_out = place.trim_out.max(0.0) + trimmer.length(index) - crossing.early.1;
            if !crossing.is_joint {
                loops.push(left.len());
            }
        }
        left.push(place);
        index = leaves.map_or(index + 1, |crossing| crossing.late.0);
        entered = leaves;
    }
    let of_left = Joined { placed: &left, ..*joined };
    let mut cuts = interference::cuts(walls, &of_left, tolerance, GOUGE_MM).cuts;
    cuts.retain(|cut| !cut.is_other_pass);
    Trimmed { placed: left, loops, cuts, is_connected }
}

struct Trimmer<'a> {
    walls: &'a Walls<'a>,
    joined: &'a Joined<'a>,
    paths: Vec<Option<Element>>,
    /// For each path, whether it cuts into a wall anywhere.
    is_cutting: Vec<bool>,
    /// Where each path is crossed, mm along it, in order.
    breaks: Vec<Vec<f64>>,
}

impl Trimmer<'_> {
    /// Where the path along an element leaves it for a later one.
    fn leaves(&self, crossings: &[Crossing], index: usize, begin: f64) -> Option<Crossing> {
        let from = crossings.partition_point(|crossing| crossing.early.0 < index);
        let here = crossings[from..].iter().take_while(|crossing| crossing.early.0 == index);
        here.copied().filter(|crossing| crossing.early.1 >= begin).find(|crossing| {
            (crossing.is_joint || !self.is_free(crossing.early)) && self.is_free(crossing.late)
        })
    }

    /// Whether the tool may continue from a crossing to the next.
    fn is_free(&self, (index, along): (usize, f64)) -> bool {
        if along >= self.length(index) - LENGTH_MM {
            // It continues with the next element.
            return index + 1 >= self.paths.len() || self.is_free_from(index + 1, 0.0);
        }
        self.is_free_from(index, along)
    }

    fn is_free_from(&self, index: usize, along: f64) -> bool {
        if !self.is_cutting[index] {
            return true;
        }
        let Some(path) = self.paths[index] else { return true };
        let next = self.breaks[index].iter().copied().find(|next| *next > along + LENGTH_MM);
        let piece = next.map_or(Some(path), |next| path.before(next));
        let Some(piece) = piece.and_then(|piece| piece.after(along)) else { return true };
        let Joined { links, placed, .. } = *self.joined;
        let run = placed[index..].iter().find_map(|place| match links.role(place.link) {
            Role::Run(run) => Some(run),
            _ => None,
        });
        let Some(run) = run else { return true };
        let link = &links.at(placed[index].link);
        let limit = link.d_in_mm.abs().min(link.d_out_mm.abs()) - GOUGE_MM;
        let pass = self.walls.pass(run);
        let counts = |into| self.walls.pass(into) == pass;
        let on = self.walls.place(run, piece.point_at(piece.length() / 2.0));
        deepest_cut(self.walls, &piece, Some(on), limit, counts).is_none()
    }

    fn length(&self, index: usize) -> f64 {
        self.paths[index].map_or(0.0, |path| path.length())
    }
}

fn breaks(crossings: &[Crossing], count: usize) -> Vec<Vec<f64>> {
    let mut breaks = vec![Vec::new(); count];
    for crossing in crossings {
        for (index, along) in [crossing.early, crossing.late] {
            breaks[index].push(along);
        }
    }
    for of_one in &mut breaks {
        of_one.sort_by(f64::total_cmp);
    }
    breaks
}

/// All places where the path crosses itself, with the known ones, by the earlier place.
fn all_crossings(paths: &[Option<Element>], joints: Vec<Crossing>) -> Vec<Crossing> {
    let bounds = |path: &Option<Element>| path.as_ref().map_or(Bounds::EMPTY, Bounds::of);
    let tree = Tree::new(paths.iter().map(|path| (bounds(path), NO_CHAIN)));
    let mut found = joints;
    let most = CROSSINGS_MAX.0 * paths.len() + CROSSINGS_MAX.1;
    let bounds = |path: usize| bounds(&paths[path]);
    tree.near_itself(LENGTH_MM, &mut budget(paths.len()), bounds, |early, late| {
        if let (Some(a), Some(b)) = (&paths[early], &paths[late]) {
            let joint = (early + 1 == late).then(|| a.end());
            cross(early, late, (a, b), joint, &mut found);
        }
        if found.len() < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    let key = |crossing: &Crossing| (crossing.early.0, crossing.late.0);
    found.sort_by(|a, b| {
        let by_place = a.early.0.cmp(&b.early.0).then(a.early.1.total_cmp(&b.early.1));
        by_place.then(key(a).cmp(&key(b)))
    });
    found
}

fn cross(
    early: usize,
    late: usize,
    (a, b): (&Element, &Element),
    joint: Option<Vec2>,
    found: &mut Vec<Crossing>,
) {
    for &point in crossings(a, b, 0.0).points() {
        if joint.is_some_and(|joint| (joint - point).norm() <= LENGTH_MM)
            || !is_on(a, point)
            || !is_on(b, point)
        {
            continue;
        }
        let along = |element: &Element| {
            element.along_from_start(point, LENGTH_MM).clamp(0.0, element.length())
        };
        let (early, late) = ((early, along(a)), (late, along(b)));
        found.push(Crossing { point, early, late, is_joint: false });
    }
}
