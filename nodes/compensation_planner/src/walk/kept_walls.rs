//! The walls of a contour in few bytes: they are kept until the program ends.
//!
//! Nothing is rounded. A wall comes back bit for bit, because lines and arcs are made again from the programmed points;
//! what is not made of them alone, as a merged arc or a wall that was cut off, is kept as it is.

use crate::geometry::element::{Element, Vec2};
use crate::geometry::frame::in_plane;
use crate::span::{Run, Span};
use cnc_msgs::contour::Source;
use std::f64::consts::TAU;

/// A wall as it is handed in: its element, its lowest height, and the run that it is of.
pub(crate) struct Judged {
    pub element: Element,
    pub height_mm: f64,
    pub run: usize,
}

/// Walls, by number.
#[derive(Debug)]
pub(crate) struct KeptWalls {
    /// Where each wall starts, and where the last one ends.
    points: Box<[Vec2]>,
    places: Box<[Place]>,
    /// What most contours have in common: of the first wall.
    height_mm: f64,
    block: Option<u32>,
    call: u32,
    /// What this contour has not in common.
    rest: Option<Box<Rest>>,
}

/// A place in the program.
#[derive(Debug, Clone, Copy)]
struct Place {
    line: u32,
    column: u16,
    length: u16,
}

/// Each is empty where nothing differs.
#[derive(Debug, Default)]
struct Rest {
    /// Walls that are no line from their point to the next, in order.
    others: Box<[(u32, Other)]>,
    heights_mm: Box<[f64]>,
    blocks: Box<[Option<u32>]>,
    calls: Box<[u32]>,
}

#[derive(Debug)]
enum Other {
    /// An arc about this centre; negative turns are clockwise, and one too many.
    Arc {
        center: Vec2,
        turns: i32,
    },
    Whole(Box<Element>),
}

impl KeptWalls {
    pub(crate) fn new(walls: &[Judged], runs: &[Run], span: &Span<'_>) -> Self {
        let legs = |wall: &Judged| &span.legs[runs[wall.run].legs.clone()];
        let starts = walls.iter().filter_map(|wall| Some(legs(wall).first()?.start));
        let end = walls.last().and_then(|wall| legs(wall).last());
        let end = end.map(|leg| in_plane(span.plane, leg.motion.end));
        let points: Box<[Vec2]> = starts.chain(end).collect();
        let sources = || walls.iter().filter_map(|wall| Some(legs(wall).first()?.source));
        let place = |Source { line, column, length, .. }| Place { line, column, length };
        let first = sources().next().unwrap_or_default();
        let height_mm = walls.first().map_or(0.0, |wall| wall.height_mm);
        let other = |(number, ends): (usize, &[Vec2])| {
            Some((number as u32, Other::of(&walls.get(number)?.element, [ends[0], ends[1]])?))
        };
        let rest = Rest {
            others: points.windows(2).enumerate().filter_map(other).collect(),
            heights_mm: unless_all(height_mm, walls.iter().map(|wall| wall.height_mm)),
            blocks: unless_all(first.block, sources().map(|source| source.block)),
            calls: unless_all(first.call, sources().map(|source| source.call)),
        };
        let places = sources().map(place).collect();
        let rest = (!rest.is_empty()).then(|| Box::new(rest));
        let kept = Self { points, places, height_mm, block: first.block, call: first.call, rest };
        debug_assert!(sources().enumerate().all(|(wall, source)| {
            let Judged { element, height_mm, .. } = walls[wall];
            (kept.element(wall), kept.height_mm(wall), kept.source(wall))
                == (element, height_mm, source)
        }));
        kept
    }

    pub(crate) fn count(&self) -> usize {
        self.places.len()
    }

    /// The memory that it has allocated.
    pub(crate) fn bytes(&self) -> usize {
        let rest = self.rest.as_deref().map_or(0, |Rest { others, heights_mm, blocks, calls }| {
            let is_whole = |it: &&(u32, Other)| matches!(it.1, Other::Whole(_));
            let whole = others.iter().filter(is_whole).count() * size_of::<Element>();
            size_of::<Rest>()
                + size_of_val(&**others)
                + whole
                + size_of_val(&**heights_mm)
                + size_of_val(&**blocks)
                + size_of_val(&**calls)
        });
        size_of_val(&*self.points) + size_of_val(&*self.places) + rest
    }

    pub(crate) fn element(&self, wall: usize) -> Element {
        let (from, to) = (self.points[wall], self.points[wall + 1]);
        let others = self.rest.as_deref().map_or(&[][..], |rest| &rest.others);
        let found = others.binary_search_by_key(&(wall as u32), |(number, _)| *number);
        let element = match found.ok().map(|at| &others[at].1) {
            None => Element::line(from, to),
            Some(Other::Arc { center, turns }) => arc(from, to, *center, *turns),
            Some(Other::Whole(element)) => return **element,
        };
        // `Other::of` has seen that there is one.
        element.unwrap_or_else(|| Element::corner(from, Vec2::x(), Vec2::x(), 0.0))
    }

    /// The lowest height at which it was cut, mm.
    pub(crate) fn height_mm(&self, wall: usize) -> f64 {
        self.rest
            .as_ref()
            .and_then(|rest| rest.heights_mm.get(wall))
            .copied()
            .unwrap_or(self.height_mm)
    }

    pub(crate) fn highest_mm(&self) -> f64 {
        (0..self.count()).map(|wall| self.height_mm(wall)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// All of it has been cut as low as this, mm.
    pub(crate) fn lower_to(&mut self, height_mm: f64) {
        self.height_mm = self.height_mm.min(height_mm);
        let heights = self.rest.iter_mut().flat_map(|rest| &mut rest.heights_mm);
        heights.for_each(|it| *it = it.min(height_mm));
    }

    pub(crate) fn source(&self, wall: usize) -> Source {
        let Place { line, column, length } = self.places[wall];
        let rest = self.rest.as_deref();
        let block = rest.and_then(|rest| rest.blocks.get(wall)).copied().unwrap_or(self.block);
        let call = rest.and_then(|rest| rest.calls.get(wall)).copied().unwrap_or(self.call);
        Source { line, block, column, length, call }
    }
}

impl Rest {
    fn is_empty(&self) -> bool {
        let Self { others, heights_mm, blocks, calls } = self;
        others.is_empty() && heights_mm.is_empty() && blocks.is_empty() && calls.is_empty()
    }
}

impl Other {
    /// `None` for a line between these points.
    fn of(element: &Element, [from, to]: [Vec2; 2]) -> Option<Self> {
        let same = |made: Option<Element>| made.as_ref() == Some(element);
        match element {
            Element::Line(_) if same(Element::line(from, to)) => return None,
            Element::Arc(it) => {
                let turns = (it.sweep / TAU) as i32;
                let turns = if it.turn > 0.0 { turns } else { -1 - turns };
                if same(arc(from, to, it.center, turns)) {
                    return Some(Self::Arc { center: it.center, turns });
                }
            }
            Element::Line(_) => {}
        }
        Some(Self::Whole(Box::new(*element)))
    }
}

fn arc(from: Vec2, to: Vec2, center: Vec2, turns: i32) -> Option<Element> {
    let is_ccw = turns >= 0;
    let turns = if is_ccw { turns } else { -1 - turns };
    Element::arc(from, to, center, is_ccw, u16::try_from(turns).ok()?)
}

/// The values, unless all are this one.
fn unless_all<T: PartialEq>(value: T, values: impl Iterator<Item = T> + Clone) -> Box<[T]> {
    match values.clone().all(|it| it == value) {
        true => Box::default(),
        false => values.collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_comes_back_bit_for_bit() {
        let at = |x: f64, y: f64| Vec2::new(x, y);
        let (from, to) = (at(0.1, -3.7), at(12.3, 4.56));
        let center = at(5.0, 1.1);
        let programmed = [
            Element::line(from, to),
            // With a centre that is moved to where both ends are equally far.
            Element::arc(from, to, center, true, 0),
            Element::arc(from, to, center, false, 2),
            Element::arc(from, from, center, false, 1),
        ];
        for element in programmed.into_iter().flatten() {
            for ends in [[from, to], [from, from], [to, from]] {
                let made = match Other::of(&element, ends) {
                    None => Element::line(ends[0], ends[1]),
                    Some(Other::Arc { center, turns }) => arc(ends[0], ends[1], center, turns),
                    Some(Other::Whole(whole)) => Some(*whole),
                };
                assert_eq!(made, Some(element));
            }
        }
        let is_whole =
            |element: Element, ends| matches!(Other::of(&element, ends), Some(Other::Whole(_)));
        // What was cut off is not what was programmed.
        let cut = programmed[0].and_then(|line| line.after(0.1)).expect("a longer line");
        assert!(is_whole(cut, [from, to]));
        for (element, ends) in
            programmed.into_iter().zip([[from, to], [from, to], [from, to], [from, from]])
        {
            assert!(!is_whole(element.expect("an element"), ends));
        }
    }
}
