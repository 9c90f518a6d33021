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
use crate::geometry::distance::{are_apart, nearest_between};
use crate::geometry::element::{Element, Vec2};
use crate::geometry::tolerance::{GOUGE_MM, LENGTH_MM};
use crate::geometry::tree::{Tree, budget};
use crate::span::{ItemKind, Run, Span};
use crate::walk::compensate::{Exit, Solution};
use crate::walk::kept_walls::{Judged, KeptWalls};
use crate::walk::span_index::SpanIndex;
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::geometry::Plane;
use cnc_msgs::profile::{OtherSpans, Profile};
use std::cell::OnceCell;
use std::collections::btree_map::{BTreeMap, Entry};
use std::ops::ControlFlow;

/// Findings of this kind in a program; more help nobody.
const FINDINGS_MAX: usize = 100;

/// The number of a work coordinate system, and how often such a system has been moved.
type Frame = (u8, u32);

/// What identifies a part: a plane and a frame.
type Part = (Plane, Frame);

/// The contours of the spans so far.
#[derive(Debug)]
pub(crate) struct EarlierSpans<'a> {
    /// The first span waits for a second one: most long programs have one only.
    first: Option<Box<(Part, Span<'a>, Solution)>>,
    left: Vec<SpanWalls>,
    /// Where they are, and which contour each is.
    places: SpanIndex,
    known: BTreeMap<Contour, usize>,
    frame: Frame,
    /// Boxes that may still be visited.
    budget: usize,
    /// How many findings may still be reported.
    findings_left: usize,
    /// The memory of all contours.
    bytes: usize,
}

/// The walls of one span.
#[derive(Debug)]
struct SpanWalls {
    part: Part,
    walls: KeptWalls,
    /// Over the walls, once another contour is near.
    tree: OnceCell<Box<Tree>>,
    /// Equal for a contour that is cut again, in either direction.
    fingerprint: Fingerprint,
}

/// How many walls, and a sum over them.
type Fingerprint = (usize, u64);

/// What identifies a contour: the axis of its tool, its work coordinate system, and its walls.
type Contour = (usize, Frame, Fingerprint);

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
            frame: (1, 0),
            budget: budget(0),
            findings_left: FINDINGS_MAX,
            bytes: 0,
        }
    }

    /// The same without the events of the spans so far.
    pub(crate) fn for_next_part<'b>(mut self) -> EarlierSpans<'b> {
        self.add_first();
        let Self { left, places, known, frame, budget, findings_left, bytes, .. } = self;
        EarlierSpans { first: None, left, places, known, frame, budget, findings_left, bytes }
    }

    /// The memory of the walls of all contours.
    pub(crate) fn kept_bytes(&self) -> usize {
        self.bytes
    }

    /// Follows the work coordinate system.
    pub(crate) fn action(&mut self, action: &Action) {
        match action {
            Action::WorkOffset { system } => self.frame.0 = *system,
            Action::SetWorkOffset { .. } => self.frame.1 += 1,
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
        let part = (span.plane, self.frame);
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
        self.add_first();
        let heights = span.leg_heights();
        let (left, bounds) = SpanWalls::of(part, &span, &solution, &heights)?;
        self.budget += budget(left.walls.count()) - budget(0);
        let near = self.near(&solution, &left, &span, profile);
        let found = match near.as_deref() {
            Some([]) => None,
            _ => {
                // The span itself checks a link against the wall that it leaves.
                let by_link = |said: &&Finding| said.code == Code::LinkGouge;
                let checked = said.iter().filter(by_link).filter_map(|it| it.other);
                let checked: Vec<Source> = checked.collect();
                let pieces = pieces(&span, exit, &solution, &heights, profile, said);
                self.cut((&left, near), pieces, &checked, &span, profile)
            }
        };
        self.add(left, bounds);
        self.findings_left -= usize::from(found.is_some());
        found
    }

    fn add_first(&mut self) {
        if let Some((part, span, solution)) = self.first.take().map(|first| *first) {
            let left = SpanWalls::of(part, &span, &solution, &span.leg_heights());
            left.into_iter().for_each(|(left, bounds)| self.add(left, bounds));
        }
    }

    /// Adds a contour, unless it is known: then it is cut at another height.
    fn add(&mut self, left: SpanWalls, bounds: Bounds) {
        match self.known.entry(left.contour()) {
            Entry::Occupied(same) => self.left[*same.get()].is_cut_again(&left),
            Entry::Vacant(new) => {
                new.insert(self.left.len());
                self.bytes += left.bytes();
                self.places.push(bounds);
                self.left.push(left);
            }
        }
    }

    /// The other contours that the tool may come near to, as far as a box around its path shows, the
    /// latest first; `None` without such a box.
    fn near(
        &self,
        solution: &Solution,
        of: &SpanWalls,
        span: &Span<'_>,
        profile: &Profile,
    ) -> Option<Vec<usize>> {
        let (bounds, reach) = solution.bounds(span, profile)?;
        let mut near = self.places.near(&bounds, reach);
        near.retain(|left| self.is_other(*left, of));
        Some(near)
    }

    fn is_other(&self, left: usize, of: &SpanWalls) -> bool {
        self.left[left].part == of.part && !self.left[left].is_same(of)
    }

    /// The deepest cut into the latest span that is cut.
    fn cut(
        &mut self,
        (of, near): (&SpanWalls, Option<Vec<usize>>),
        pieces: Vec<Piece>,
        checked: &[Source],
        span: &Span<'_>,
        profile: &Profile,
    ) -> Option<Finding> {
        self.budget += budget(pieces.len()) - budget(0);
        let boxes: Vec<Bounds> = pieces.iter().map(|piece| Bounds::of(&piece.path)).collect();
        let reach = pieces.iter().fold(0.0, |reach: f64, piece| reach.max(piece.radius_mm));
        let bounds = boxes.iter().copied().fold(Bounds::EMPTY, Bounds::union);
        let mut near = near.unwrap_or_else(|| self.places.near(&bounds, reach));
        let is_near = |left| self.places.bounds(left).gap_squared(&bounds) < reach * reach;
        near.retain(|left| self.is_other(*left, of) && is_near(*left));
        let mut tree = None;
        for left in near.into_iter().map(|left| &self.left[left]) {
            let chained = boxes.iter().map(|bounds| (*bounds, NO_CHAIN));
            let tree = tree.get_or_insert_with(|| Tree::new(chained));
            let mut deepest: Option<OtherCut> = None;
            let wall_box = |wall: usize| Bounds::of(&left.walls.element(wall));
            let of = (|piece: usize| (boxes[piece], ()), wall_box);
            let is_new = left.tree.get().is_none();
            let walls = left.tree();
            self.bytes += if is_new { walls.bytes() } else { 0 };
            let is_complete = tree.near_pairs(walls, reach, &mut self.budget, of, |on, into| {
                let cut = pieces[on].cut_into(&left.walls, into, profile, span.d_mm);
                let is_deeper = |cut: &OtherCut| {
                    !checked.contains(&cut.into)
                        && deepest.is_none_or(|other| cut.depth_mm() > other.depth_mm())
                };
                deepest = cut.filter(is_deeper).or(deepest);
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
    /// With a box around them; `None` when the walls of the contour are not complete.
    fn of(
        part: Part,
        span: &Span<'_>,
        solution: &Solution,
        heights: &[(f64, f64)],
    ) -> Option<(Self, Bounds)> {
        let walls = solution.walls();
        let runs = solution.runs();
        let is_first = |&run: &usize| walls.copies(run).nth(1).is_none_or(|first| first == run);
        if !walls.is_complete() {
            return None;
        }
        let mut judged: Vec<Judged> = Vec::with_capacity(walls.count());
        let (mut bounds, mut sum) = (Bounds::EMPTY, 0_u64);
        for run in (0..walls.count()).filter(is_first) {
            let Some(element) = walls.of(run).filter(|_| walls.is_judged(run)) else { continue };
            let lowest = |run| lowest(heights, &runs[run]);
            let height_mm = walls.copies(run).map(lowest).fold(f64::INFINITY, f64::min);
            bounds = bounds.union(Bounds::of(&element));
            sum = sum.wrapping_add(print(&element));
            judged.push(Judged { element, height_mm, run });
        }
        let fingerprint = (judged.len(), sum);
        let walls = KeptWalls::new(&judged, runs, span);
        Some((Self { part, fingerprint, walls, tree: OnceCell::new() }, bounds))
    }

    /// Its memory, with that of its places in lists.
    fn bytes(&self) -> usize {
        let places = 3 * size_of::<Bounds>() + 2 * size_of::<(Contour, usize)>();
        2 * size_of::<Self>() + places + self.walls.bytes()
    }

    fn contour(&self) -> Contour {
        let (plane, frame) = self.part;
        (plane.axes()[2], frame, self.fingerprint)
    }

    fn tree(&self) -> &Tree {
        let boxes =
            (0..self.walls.count()).map(|wall| (Bounds::of(&self.walls.element(wall)), NO_CHAIN));
        self.tree.get_or_init(|| Box::new(Tree::new(boxes)))
    }

    fn is_same(&self, other: &Self) -> bool {
        (self.part, self.fingerprint) == (other.part, other.fingerprint)
    }

    /// Merges the same contour, cut at another height.
    fn is_cut_again(&mut self, other: &Self) {
        self.walls.lower_to(other.walls.highest_mm());
    }
}

impl Piece {
    /// The cut into a wall, if any.
    fn cut_into(
        &self,
        walls: &KeptWalls,
        wall: usize,
        profile: &Profile,
        d_mm: f64,
    ) -> Option<OtherCut> {
        let limit = self.radius_mm - GOUGE_MM - profile.accept_tolerance_mm;
        if self.height_mm > walls.height_mm(wall) + LENGTH_MM || limit <= 0.0 {
            return None;
        }
        let element = walls.element(wall);
        if are_apart(&self.path, &element, limit) {
            return None;
        }
        let near = nearest_between(&self.path, &element);
        (near.distance < limit).then_some(OtherCut {
            on: self.source,
            into: walls.source(wall),
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
    let number = |value: f64| (value / LENGTH_MM).round() as i64 as u64;
    let of = |point: Vec2| mixed(mixed(number(point.x)) ^ number(point.y));
    let center = match element {
        Element::Line(_) => 0,
        Element::Arc(arc) => of(arc.center),
    };
    mixed(of(element.start()).wrapping_add(of(element.end())) ^ center)
}

/// Each bit depends on each (the finalizer of `SplitMix64`).
fn mixed(mut bits: u64) -> u64 {
    bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
