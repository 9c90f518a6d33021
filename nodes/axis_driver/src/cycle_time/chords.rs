//! The straight blocks that the firmware makes of an arc (`mc_arc`).
//!
//! As many as `$12` asks for, of equal angles. In 64 bits: the rounding of the firmware is far below
//! a step.

use crate::vectors::sweep;
use cnc_msgs::geometry::{Arc, Position};

/// The firmware counts them in 16 bits.
const CHORDS_MAX: f64 = 65_535.0;

/// The ends of the chords of one arc, one after the other.
#[derive(Debug, Clone)]
pub(super) struct Chords {
    arc: Arc,
    from: Position,
    to: Position,
    radius: f64,
    start: f64,
    sweep: f64,
    count: u32,
    next: u32,
}

impl Chords {
    pub(super) fn new(from: Position, to: Position, arc: &Arc, tolerance_mm: f64) -> Self {
        let [a, b, _] = arc.plane.axes();
        let sweep = sweep(arc, from, to);
        let radius = (from[a] - arc.center[a]).hypot(from[b] - arc.center[b]);
        let half = (tolerance_mm * (2.0 * radius - tolerance_mm)).max(0.0).sqrt();
        let count = (0.5 * sweep * radius / half).floor();
        let turns = f64::from(arc.turns).max(1.0);
        let count = if count.is_finite() { count.clamp(1.0, CHORDS_MAX * turns) } else { 1.0 };
        let start = (from[b] - arc.center[b]).atan2(from[a] - arc.center[a]);
        Self { arc: *arc, from, to, radius, start, sweep, count: count as u32, next: 1 }
    }
}

impl Iterator for Chords {
    type Item = Position;

    fn next(&mut self) -> Option<Position> {
        if self.next > self.count {
            return None;
        }
        self.next += 1;
        if self.next > self.count {
            return Some(self.to);
        }
        let [a, b, normal] = self.arc.plane.axes();
        let part = f64::from(self.next - 1) / f64::from(self.count);
        let signed = if self.arc.clockwise { -self.sweep } else { self.sweep };
        let (sine, cosine) = (self.start + signed * part).sin_cos();
        let mut point = self.from;
        point[a] = self.arc.center[a] + self.radius * cosine;
        point[b] = self.arc.center[b] + self.radius * sine;
        point[normal] = self.from[normal] + (self.to[normal] - self.from[normal]) * part;
        Some(point)
    }
}
