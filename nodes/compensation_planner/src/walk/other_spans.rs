//! Checks whether the tool cuts into an earlier contour of the program.
//!
//! Contours belong to one part when they lie in one plane of one work coordinate system. A wall
//! protects itself from every cut at its depth or below. A cut only above it, such as the
//! counterbore of a hole, is meant to take its rim. A contour that is cut again is the same
//! contour.

use crate::check::finding::{self, OtherCut};
use crate::check::interference;
use crate::geometry::bounds::Bounds;
use crate::geometry::chains::NO_CHAIN;
use crate::geometry::distance::nearest_between;
use crate::geometry::element::{Element, Vec2};
use crate::geometry::tolerance::{GOUGE_MM, LENGTH_MM};
use crate::geometry::tree::{Tree, boxes_of, budget};
use crate::span::{ItemKind, Run, Span};
use crate::walk::compensate::{Exit, Solution};
use crate::walk::span_index::SpanIndex;
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::Plane;
use cnc_msgs::profile::{OtherSpans, Profile};
use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// Findings of this kind in a program; more help nobody.
const FINDINGS_MAX: usize = 100;

/// What identifies a part: a plane, the number of a work coordinate system, and how often such a
/// system has been moved.
type Part = (Plane, u8, u32);

/// The contours of the spans so far.
#[derive(Debug)]
pub(crate) struct EarlierSpans<'a> {
    /// The first span waits for a second one: most long programs have one only.
    first: Option<Box<(Part, Span<'a>, Solution)>>,
    left: Vec<SpanWalls>,
    /// Where they are, and which have a fingerprint.
    places: SpanIndex,
    known: BTreeMap<Fingerprint, Vec<usize>>,
    work_system: u8,
    systems_moved: u32,
    /// Boxes that may still be visited.
    budget: usize,
    /// How many findings may still be reported.
    findings_left: usize,
}

/// The walls of one span.
#[derive(Debug)]
struct SpanWalls {
    part: Part,
    walls: Vec<Wall>,
    /// Over the walls, once another contour is near.
    tree: OnceCell<Tree>,
    bounds: Bounds,
    /// Equal for a contour that is cut again, in either direction.
    fingerprint: Fingerprint,
}

/// How many walls, and a sum over them.
type Fingerprint = (usize, u64);

#[derive(Debug, Clone, Copy)]
struct Wall {
    element: Element,
    /// The lowest height at which it was cut, mm.
    height_mm: f64,
    source: Source,
}

/// A piece of the tool path.
#[derive(Debug, Clone, Copy)]
struct Piece {
    path: Element,
    radius_mm: f64,
    /// The lowest height of the tool along it, mm.
    height_mm: f64,
    source: Source,
}

impl<'a> EarlierSpans<'a> {
    pub(crate) fn new() -> Self {
        Self {
            first: None,
            left: Vec::new(),
            places: SpanIndex::default(),
            known: BTreeMap::new(),
            work_system: 1,
            systems_moved: 0,
            budget: budget(0),
            findings_left: FINDINGS_MAX,
        }
    }

    /// Follows the work coordinate system.
    pub(crate) fn action(&mut self, action: &Action) {
        match action {
            Action::WorkOffset { system } => self.work_system = *system,
            Action::SetWorkOffset { .. } => self.systems_moved += 1,
            _ => {}
        }
    }

    /// Compares the next span with those before it; `said`: its own findings.
    pub(crate) fn compare(
        &mut self,
        span: Span<'a>,
        exit: &Exit,
        solution: Solution,
        profile: &Profile,
        said: &[Finding],
    ) -> Option<Finding> {
        let part = (span.plane, self.work_system, self.systems_moved);
        for item in &span.items {
            if let ItemKind::Action(action) = &item.what {
                self.action(action);
            }
        }
        let is_over = profile.interference.other_spans == OtherSpans::Ignore
            || self.findings_left == 0
            || solution.is_identity();
        if is_over {
            return None;
        }
        if self.first.is_none() && self.left.is_empty() {
            self.first = Some(Box::new((part, span, solution)));
            return None;
        }
        if let Some((part, span, solution)) = self.first.take().map(|first| *first) {
            let left = SpanWalls::of(part, &span, &solution, &span.leg_heights());
            left.into_iter().for_each(|left| self.push(left));
        }
        let heights = span.leg_heights();
        let left = SpanWalls::of(part, &span, &solution, &heights)?;
        // The span itself checks a link against the wall that it leaves.
        let by_link = |said: &&Finding| said.code == Code::LinkGouge;
        let checked: Vec<Source> = said.iter().filter(by_link).filter_map(|it| it.other).collect();
        let pieces = pieces(&span, exit, &solution, &heights, profile, said);
        let found = self.cut(&left, pieces, &checked, &span, profile);
        let mut known = self.known.get(&left.fingerprint).into_iter().flatten();
        match known.find(|other| self.left[**other].is_same(&left)) {
            Some(same) => self.left[*same].is_cut_again(&left),
            None => self.push(left),
        }
        self.findings_left -= usize::from(found.is_some());
        found
    }

    fn push(&mut self, left: SpanWalls) {
        self.known.entry(left.fingerprint).or_default().push(self.left.len());
        self.places.push(left.bounds);
        self.left.push(left);
    }

    /// The deepest cut into the latest span that is cut.
    fn cut(
        &mut self,
        of: &SpanWalls,
        pieces: Vec<Piece>,
        checked: &[Source],
        span: &Span<'_>,
        profile: &Profile,
    ) -> Option<Finding> {
        self.budget += budget(pieces.len()) - budget(0);
        let boxes: Vec<Bounds> = pieces.iter().map(|piece| Bounds::of(&piece.path)).collect();
        let reach = pieces.iter().fold(0.0, |reach: f64, piece| reach.max(piece.radius_mm));
        let bounds = boxes.iter().copied().fold(Bounds::EMPTY, Bounds::union);
        let are_near = |a: &Bounds, b: &Bounds| a.gap_squared(b) < reach * reach;
        let near = self.places.near(&bounds, reach).into_iter().map(|left| &self.left[left]);
        let mut tree = None;
        for left in near.filter(|left| left.part == of.part && !left.is_same(of)) {
            let chained = boxes.iter().map(|bounds| (*bounds, NO_CHAIN));
            let tree = tree.get_or_insert_with(|| Tree::new(chained));
            let mut deepest: Option<OtherCut> = None;
            let is_complete = tree.near_pairs(left.tree(), reach, &mut self.budget, |on, into| {
                let walls = &left.walls[into];
                let wall_boxes = boxes_of(walls.iter().map(|wall| &wall.element));
                // One contour inside another is near to its bounds, and to nothing else.
                if !wall_boxes.iter().any(|wall| are_near(wall, &bounds)) {
                    return ControlFlow::Continue(());
                }
                let near = on.filter(|piece| are_near(&boxes[*piece], &left.bounds));
                for (piece, piece_box) in near.map(|piece| (&pieces[piece], &boxes[piece])) {
                    for (wall, wall_box) in walls.iter().zip(&wall_boxes) {
                        let gap_squared = piece_box.gap_squared(wall_box);
                        let cut = piece.cut_into(wall, gap_squared, profile, span.d_mm);
                        let is_deeper = |cut: &OtherCut| {
                            !checked.contains(&cut.into)
                                && deepest.is_none_or(|other| cut.depth_mm() > other.depth_mm())
                        };
                        deepest = cut.filter(is_deeper).or(deepest);
                    }
                }
                ControlFlow::Continue(())
            });
            if let Some(cut) = deepest {
                let is_last = self.findings_left == 1;
                return Some(finding::cuts_other_span(&cut, span.plane, is_last, profile));
            }
            if !is_complete {
                self.findings_left = 1;
                return Some(finding::too_many_spans(span));
            }
        }
        None
    }
}

impl SpanWalls {
    /// `None` when the walls of the contour are not complete.
    fn of(
        part: Part,
        span: &Span<'_>,
        solution: &Solution,
        heights: &[(f64, f64)],
    ) -> Option<Self> {
        let walls = solution.walls();
        let runs = solution.runs();
        let is_first = |&run: &usize| walls.copies(run).nth(1).is_none_or(|first| first == run);
        let wall = |run: usize| {
            let lowest = |run| lowest(heights, &runs[run]);
            Some(Wall {
                element: walls.of(run).filter(|_| walls.is_judged(run))?,
                height_mm: walls.copies(run).map(lowest).fold(f64::INFINITY, f64::min),
                source: span.legs[runs[run].legs.start].source,
            })
        };
        let walls: Vec<Wall> = match walls.is_complete() {
            true => (0..walls.count()).filter(is_first).filter_map(wall).collect(),
            false => return None,
        };
        let boxes = walls.iter().map(|wall| Bounds::of(&wall.element));
        let bounds = boxes.fold(Bounds::EMPTY, Bounds::union);
        let print = walls.iter().fold(0_u64, |sum, wall| sum.wrapping_add(print(&wall.element)));
        let fingerprint = (walls.len(), print);
        Some(Self { part, fingerprint, walls, tree: OnceCell::new(), bounds })
    }

    fn tree(&self) -> &Tree {
        let boxes = self.walls.iter().map(|wall| (Bounds::of(&wall.element), NO_CHAIN));
        self.tree.get_or_init(|| Tree::new(boxes))
    }

    fn is_same(&self, other: &Self) -> bool {
        (self.part, self.fingerprint) == (other.part, other.fingerprint)
    }

    /// Merges the same contour, cut at another height.
    fn is_cut_again(&mut self, other: &Self) {
        let highest = other.walls.iter().fold(f64::NEG_INFINITY, |a, wall| a.max(wall.height_mm));
        for wall in &mut self.walls {
            wall.height_mm = wall.height_mm.min(highest);
        }
    }
}

impl Piece {
    /// The cut into a wall, if any; `gap_squared` is between the boxes of both, mm².
    fn cut_into(
        &self,
        wall: &Wall,
        gap_squared: f64,
        profile: &Profile,
        d_mm: f64,
    ) -> Option<OtherCut> {
        let limit = self.radius_mm - GOUGE_MM - profile.accept_tolerance_mm;
        if self.height_mm > wall.height_mm + LENGTH_MM || limit <= 0.0 {
            return None;
        }
        if gap_squared >= limit * limit {
            return None;
        }
        let near = nearest_between(&self.path, &wall.element);
        (near.distance < limit).then_some(OtherCut {
            on: self.source,
            into: wall.source,
            on_wall: near.on_wall,
            height_mm: self.height_mm,
            d_mm: self.radius_mm.copysign(d_mm),
            distance_mm: near.distance,
        })
    }
}

/// The tool path along a span, and along those of its leads without a finding.
fn pieces(
    span: &Span<'_>,
    exit: &Exit,
    solution: &Solution,
    heights: &[(f64, f64)],
    profile: &Profile,
    said: &[Finding],
) -> Vec<Piece> {
    let runs = solution.runs();
    let on_contour = |(run, radius_mm, path): (usize, f64, Element)| Piece {
        path,
        radius_mm,
        height_mm: lowest(heights, &runs[run]),
        source: span.legs[runs[run].legs.start].source,
    };
    let walls = solution.walls();
    let mut pieces: Vec<Piece> =
        interference::pieces(&walls, &solution.joined(span, profile)).map(on_contour).collect();
    let leads = [Some(&span.entry.lead), exit.lead()];
    for (lead, path) in leads.into_iter().zip(solution.leads()) {
        let (Some(lead), Some((radius_mm, path))) = (lead, path) else { continue };
        let is_cut = |said: &&Finding| {
            said.source == lead.source && matches!(said.code, Code::LeadGouge | Code::LinkGouge)
        };
        if said.iter().find(is_cut).is_some() {
            continue;
        }
        let height = |position| crate::geometry::frame::height(span.plane, position);
        let height_mm = height(lead.start).min(height(lead.motion.end));
        let piece = |path| Piece { path, radius_mm, height_mm, source: lead.source };
        pieces.extend(path.elements().map(piece));
    }
    pieces
}

/// The lowest height of the tool along a run, mm.
fn lowest(heights: &[(f64, f64)], run: &Run) -> f64 {
    heights[run.legs.clone()].iter().fold(f64::INFINITY, |low, heights| low.min(heights.0))
}

/// A fingerprint of a wall, the same in both directions.
fn print(element: &Element) -> u64 {
    let center = match element {
        Element::Line(_) => Vec2::zeros(),
        Element::Arc(arc) => arc.center,
    };
    let number = |value: f64| (value / LENGTH_MM).round() as i64 as u64;
    let of = |point: Vec2| mixed(mixed(number(point.x)) ^ number(point.y));
    mixed(of(element.start()).wrapping_add(of(element.end())) ^ of(center))
}

/// Each bit depends on each (the finalizer of `SplitMix64`).
fn mixed(mut bits: u64) -> u64 {
    bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
