//! Where the tool may be: the certified path, by geometry of its own.

use cnc_msgs::contour::Action;
use cnc_msgs::further::{FurtherMode, FurtherMove};
use cnc_msgs::geometry::{Arc, Position, Shape};
use cnc_msgs::path::CompensatedPath;
use std::f64::consts::TAU;

/// Chords of an arc are this long at most, rad.
const CHORD_RAD: f64 = 0.02;

/// The path as chords, in the machine frame.
#[derive(Debug, Clone)]
pub(crate) struct Certified {
    chords: Vec<Chord>,
}

/// A straight piece of it, and A at its ends.
#[derive(Debug, Clone, Copy)]
struct Chord {
    from: Position,
    to: Position,
    a: [f64; 2],
}

/// How far the axes are off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Off {
    pub(crate) mm: f64,
    /// Of A, where the tool is.
    pub(crate) degrees: f64,
}

impl Off {
    pub(crate) fn is_on_path(&self) -> bool {
        self.mm <= OFF_MM && self.degrees <= OFF_DEGREES
    }
}

impl Certified {
    /// `begins`: where the axes stand before it, machine frame; the path is written in the
    /// frame whose zero is `zero`, and in which A counts as the machine does.
    pub(crate) fn new(path: &CompensatedPath, zero: Position, begins: [f64; 6]) -> Self {
        let mut chords = Vec::new();
        let in_machine = |place: Position| [0, 1, 2].map(|axis| place[axis] + zero[axis]);
        let [x, y, z, mut angle, ..] = begins;
        let mut at = [x, y, z];
        for (index, element) in path.elements.iter().enumerate() {
            let (before, mut goes_along) = (angle, false);
            for event in path.events.iter().filter(|event| event.at_element == index) {
                let Action::Further(FurtherMove { axes, mode }) = event.action else { continue };
                let to = axes.get(0).unwrap_or(angle);
                goes_along = mode == FurtherMode::Along;
                if !goes_along {
                    chords.push(Chord { from: at, to: at, a: [angle, to] });
                }
                angle = to;
            }
            let from = if goes_along { before } else { angle };
            let ends = match element.shape {
                Shape::Line => vec![element.end],
                Shape::Arc(arc) => {
                    // The tool is where the path says, from its first full place on.
                    arc_places(path.start_of(index), element.end, &arc)
                }
            };
            for end in ends {
                let end = in_machine(end);
                chords.push(Chord { from: at, to: end, a: [from, angle] });
                at = end;
            }
        }
        Self { chords }
    }

    /// How far the axes are from the nearest place of it, beginning with the chord that was nearest
    /// last.
    pub(crate) fn off(&self, axes: [f64; 6], hint: &mut usize) -> Off {
        let [x, y, z, angle, ..] = axes;
        let place = [x, y, z];
        let count = self.chords.len();
        let mut least = Off { mm: f64::INFINITY, degrees: f64::INFINITY };
        let (mut nearest, mut nearest_mm) = (*hint, f64::INFINITY);
        for step in 0..count {
            let index = (*hint + step) % count;
            let (mm, degrees) = self.chords[index].off(place, angle);
            if mm < nearest_mm {
                (nearest, nearest_mm) = (index, mm);
            }
            least.mm = least.mm.min(mm);
            if mm <= OFF_MM {
                least.degrees = least.degrees.min(degrees);
            }
            if mm < NEAR_MM && degrees == 0.0 {
                nearest = index;
                break;
            }
        }
        *hint = nearest;
        if least.mm > OFF_MM {
            least.degrees = 0.0;
        }
        least
    }

    /// Where the path ends, machine frame, and A there.
    pub(crate) fn end(&self) -> (Position, f64) {
        let last = self.chords[self.chords.len() - 1];
        (last.to, last.a[1])
    }
}

/// No nearer place is looked for, mm.
const NEAR_MM: f64 = 0.02;
/// Farther away is off the path, mm: what the watch lets pass on this machine (250 steps/mm,
/// `$12` 0.002 mm), and the chords of [`Certified`].
pub(crate) const OFF_MM: f64 = 0.06;
/// The same of A, besides the way that it may have gone within [`OFF_MM`] of the tool.
pub(crate) const OFF_DEGREES: f64 = 0.25;

impl Chord {
    /// The distance of a place, and how far A is from where it may be there: where X, Y and Z hardly move, it may be
    /// anywhere on its way.
    fn off(&self, place: Position, angle: f64) -> (f64, f64) {
        let dot = |a: Position, b: Position| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let along = [0, 1, 2].map(|axis| self.to[axis] - self.from[axis]);
        let off = [0, 1, 2].map(|axis| place[axis] - self.from[axis]);
        let squared = dot(along, along);
        let part = if squared > 0.0 { (dot(off, along) / squared).clamp(0.0, 1.0) } else { 0.0 };
        let rest = [0, 1, 2].map(|axis| off[axis] - part * along[axis]);
        let mm = dot(rest, rest).sqrt();
        let near = if squared > 0.0 { OFF_MM / squared.sqrt() } else { 1.0 };
        let at = |part: f64| self.a[0] + (self.a[1] - self.a[0]) * part.clamp(0.0, 1.0);
        let (one, other) = (at(part - near), at(part + near));
        let degrees = (one.min(other) - angle).max(angle - one.max(other)).max(0.0);
        (mm, degrees)
    }
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
