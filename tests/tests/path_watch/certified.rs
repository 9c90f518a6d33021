//! Where the tool may be: the certified path, by geometry of its own.

use cnc_msgs::geometry::{Arc, Position, Shape};
use cnc_msgs::path::CompensatedPath;
use std::f64::consts::TAU;

/// Chords of an arc are this long at most, rad.
const CHORD_RAD: f64 = 0.02;

/// The path as chords, in the machine frame.
#[derive(Debug, Clone)]
pub(crate) struct Certified {
    chords: Vec<(Position, Position)>,
}

impl Certified {
    /// `begins`: where the tool stands before it, machine frame; the path is written in the
    /// frame whose zero is `zero`.
    pub(crate) fn new(path: &CompensatedPath, zero: Position, begins: Position) -> Self {
        let mut chords = Vec::new();
        let in_machine = |place: Position| [0, 1, 2].map(|axis| place[axis] + zero[axis]);
        let mut at = begins;
        for (index, element) in path.elements.iter().enumerate() {
            let ends = match element.shape {
                Shape::Line => vec![element.end],
                Shape::Arc(arc) => {
                    // The tool is where the path says, from its first full place on.
                    arc_places(path.start_of(index), element.end, &arc)
                }
            };
            for end in ends {
                let end = in_machine(end);
                chords.push((at, end));
                at = end;
            }
        }
        Self { chords }
    }

    /// The distance to the nearest place of it, mm, beginning with the chord that was nearest
    /// last.
    pub(crate) fn off_mm(&self, place: Position, hint: &mut usize) -> f64 {
        let count = self.chords.len();
        let mut least = f64::INFINITY;
        let mut nearest = *hint;
        for step in 0..count {
            let index = (*hint + step) % count;
            let off = off_chord(self.chords[index], place);
            if off < least {
                (least, nearest) = (off, index);
            }
            if off < NEAR_MM {
                break;
            }
        }
        *hint = nearest;
        least
    }

    /// Where the path ends, machine frame.
    pub(crate) fn end(&self) -> Position {
        self.chords[self.chords.len() - 1].1
    }
}

/// No nearer place is looked for, mm.
const NEAR_MM: f64 = 0.02;

fn off_chord((from, to): (Position, Position), place: Position) -> f64 {
    let along = [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let off = [0, 1, 2].map(|axis| place[axis] - from[axis]);
    let dot = |a: Position, b: Position| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let squared = dot(along, along);
    let part = if squared > 0.0 { (dot(off, along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    let rest = [0, 1, 2].map(|axis| off[axis] - part * along[axis]);
    dot(rest, rest).sqrt()
}

fn arc_places(from: Position, to: Position, arc: &Arc) -> Vec<Position> {
    let [a, b, normal] = arc.plane.axes();
    let radius = (from[a] - arc.center[a]).hypot(from[b] - arc.center[b]);
    let angle = |place: Position| (place[b] - arc.center[b]).atan2(place[a] - arc.center[a]);
    let turned = angle(to) - angle(from);
    let turned = if arc.clockwise { -turned } else { turned }.rem_euclid(TAU);
    let is_whole = (from[a] - to[a]).hypot(from[b] - to[b]) < 1e-9;
    let turned = if is_whole { 0.0 } else { turned };
    let sweep = turned + TAU * f64::from(arc.turns);
    let count = (sweep / CHORD_RAD).ceil().max(1.0) as u32;
    let place = |step: u32| {
        let part = f64::from(step) / f64::from(count);
        let swept = if arc.clockwise { -sweep * part } else { sweep * part };
        let mut place = from;
        place[a] = arc.center[a] + radius * (angle(from) + swept).cos();
        place[b] = arc.center[b] + radius * (angle(from) + swept).sin();
        place[normal] = from[normal] + (to[normal] - from[normal]) * part;
        place
    };
    (1..count).map(place).chain([to]).collect()
}
