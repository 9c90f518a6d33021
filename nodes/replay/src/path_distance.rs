//! The distance between two paths of one program.
//!
//! Paths are compared as curves: samples along one, and their distance from the elements of the
//! other that belong to the same lines of the program. Pure.

use cnc_msgs::contour::Source;
use cnc_msgs::geometry::Position;
use cnc_msgs::path::{CompensatedPath, PathElement};
use compensation_planner::tessellate;

/// Chord error of arcs, mm.
const CHORD_ERROR_MM: f64 = 1e-4;

/// How two paths differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathDistance {
    /// The largest distance, mm, where it is, and the block it belongs to.
    pub distance_mm: f64,
    pub position: Position,
    pub source: Source,
    /// Functions that only one path has, or in another order.
    pub functions: usize,
    /// Blocks that run with other feeds.
    pub feeds: usize,
}

/// A chord of one block: from, to.
pub type Chord = (Position, Position);

/// The largest distance between two paths in both directions.
pub fn between(a: &CompensatedPath, b: &CompensatedPath) -> PathDistance {
    let (chords_a, chords_b) = (by_line(a), by_line(b));
    let mut worst = PathDistance {
        distance_mm: 0.0,
        position: a.start,
        source: Source::default(),
        functions: differing_functions(a, b),
        feeds: differing_feeds(a, b),
    };
    for (from, to) in [(&chords_a, &chords_b), (&chords_b, &chords_a)] {
        for (index, block) in from.iter().enumerate() {
            for &(_, point) in &block.chords {
                let distance = nearest(point, block.source.line, to, index);
                if distance > worst.distance_mm {
                    worst.distance_mm = distance;
                    worst.position = point;
                    worst.source = block.source;
                }
            }
        }
    }
    worst
}

/// What one line of the program became.
#[derive(Debug)]
struct Block {
    source: Source,
    chords: Vec<Chord>,
}

fn by_line(path: &CompensatedPath) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    for (index, element) in path.elements.iter().enumerate() {
        let start = path.start_of(index);
        if blocks.last().is_none_or(|block| block.source.line != element.source.line) {
            blocks.push(Block { source: element.source, chords: Vec::new() });
        }
        if let Some(block) = blocks.last_mut() {
            add_chords(start, element, &mut block.chords);
        }
    }
    blocks
}

fn add_chords(start: Position, element: &PathElement, chords: &mut Vec<Chord>) {
    let mut from = start;
    tessellate::points(start, element, CHORD_ERROR_MM, |to| {
        chords.push((from, to));
        from = to;
    });
}

/// The distance of a point of a line from what the other path does in that line and in the
/// neighbouring lines.
fn nearest(point: Position, line: u32, blocks: &[Block], guess: usize) -> f64 {
    let at = match blocks.get(guess) {
        Some(block) if block.source.line == line => guess,
        _ => blocks.partition_point(|block| block.source.line < line),
    };
    let near = at.saturating_sub(2)..(at + 3).min(blocks.len());
    let chords = blocks[near].iter().flat_map(|block| &block.chords);
    chords.map(|chord| from_chord(point, chord)).fold(f64::INFINITY, f64::min)
}

pub fn from_chord(point: Position, (from, to): &Chord) -> f64 {
    let along = [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let out = [0, 1, 2].map(|axis| point[axis] - from[axis]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let squared = dot(along, along);
    let part = if squared > 0.0 { (dot(out, along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    let off = [0, 1, 2].map(|axis| out[axis] - along[axis] * part);
    dot(off, off).sqrt()
}

/// The number of functions, in the order of the program, after the first difference.
fn differing_functions(a: &CompensatedPath, b: &CompensatedPath) -> usize {
    let words = |path: &CompensatedPath| -> Vec<String> {
        path.events.iter().map(|event| event.action.text()).collect()
    };
    let (a, b) = (words(a), words(b));
    let same = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
    let same_end = a[same..].iter().rev().zip(b[same..].iter().rev()).take_while(|(a, b)| a == b);
    let same = same + same_end.count();
    a.len().max(b.len()) - same
}

fn differing_feeds(a: &CompensatedPath, b: &CompensatedPath) -> usize {
    let feeds = |path: &CompensatedPath| -> Vec<(u32, Option<u64>)> {
        let mut feeds: Vec<_> = path
            .elements
            .iter()
            .map(|element| (element.source.line, element.feed_mm_per_min.map(f64::to_bits)))
            .collect();
        feeds.dedup();
        feeds
    };
    let (a, b) = (feeds(a), feeds(b));
    let other = |of: &[(u32, Option<u64>)], than: &[(u32, Option<u64>)]| {
        of.iter()
            .filter(|(line, feed)| {
                let from = than.partition_point(|(other, _)| other < line);
                let mut same = than[from..].iter().take_while(|(other, _)| other == line);
                than.get(from).is_some_and(|(other, _)| other == line)
                    && !same.any(|(_, other)| other == feed)
            })
            .count()
    };
    other(&a, &b).max(other(&b, &a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::contour::Action;
    use cnc_msgs::geometry::{Arc, AxisSet, Plane, Shape};
    use cnc_msgs::path::{PathEvent, Role};

    fn path(ends: &[(u32, [f64; 2])]) -> CompensatedPath {
        let element = |&(line, [x, y]): &(u32, [f64; 2])| PathElement {
            shape: Shape::Line,
            end: [x, y, 0.0],
            feed_mm_per_min: Some(100.0),
            role: Role::Contour,
            side: None,
            axes: AxisSet::ALL,
            source: Source { line, ..Source::default() },
        };
        CompensatedPath { elements: ends.iter().map(element).collect(), ..Default::default() }
    }

    #[test]
    fn the_same_curve_is_the_same_however_it_is_cut() {
        let whole = path(&[(1, [10.0, 0.0]), (2, [10.0, 10.0])]);
        let parts = path(&[(1, [4.0, 0.0]), (1, [10.0, 0.0]), (2, [10.0, 10.0])]);
        let difference = between(&whole, &parts);
        assert_eq!((difference.distance_mm, difference.functions, difference.feeds), (0.0, 0, 0));
    }

    #[test]
    fn the_farthest_point_has_its_line() {
        let one = path(&[(1, [10.0, 0.0]), (2, [10.0, 10.0])]);
        let mut other = path(&[(1, [10.0, 0.0]), (2, [10.0, 13.0])]);
        other.elements[1].feed_mm_per_min = Some(50.0);
        other.events.push(PathEvent {
            at_element: 0,
            action: Action::ExactStop,
            source: Source::default(),
        });
        let difference = between(&one, &other);
        assert_eq!(difference.distance_mm, 3.0);
        assert_eq!((difference.position, difference.source.line), ([10.0, 13.0, 0.0], 2));
        assert_eq!((difference.functions, difference.feeds), (1, 1));
    }

    #[test]
    fn an_arc_and_its_corner_differ_by_what_lies_between() {
        let corner = path(&[(1, [5.0, 5.0]), (2, [5.0, 0.0])]);
        let mut arc = path(&[(1, [0.0, 5.0]), (2, [5.0, 0.0])]);
        arc.elements[1].shape =
            Shape::Arc(Arc { plane: Plane::Xy, center: [0.0; 3], clockwise: true, turns: 0 });
        let mut straight = corner.clone();
        straight.start = [0.0, 5.0, 0.0];
        arc.start = [0.0, 5.0, 0.0];
        let difference = between(&straight, &arc);
        assert!((difference.distance_mm - 5.0 * (2.0_f64.sqrt() - 1.0)).abs() < 1e-3);
    }
}
