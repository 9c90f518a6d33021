//! An arc as pieces that grbl draws as they are meant.
//!
//! grbl works out the angle of an arc from its ends in 32 bit floats: an arc that is
//! almost nothing becomes a full circle and the reverse. So a full circle is sent
//! with equal ends, an arc that is almost one in two halves, and what is flat, tiny
//! or ragged as lines.

use super::words::{GRID_PER_MM, from_grid, to_grid};
use cnc_msgs::geometry::{Arc, Position};
use std::f64::consts::{FRAC_PI_4, PI, TAU};

/// The radii at both ends of a piece differ by at most this, mm. grbl refuses from
/// 0.005 mm on (`error:33`).
const RADIUS_MISMATCH_MM_MAX: f64 = 0.004;
/// An arc no higher than this over its chord is a line, mm: one step of the grid.
const FLAT_SAGITTA_MM: f64 = 1.0 / GRID_PER_MM;
/// A line of a polyline is off its arc by at most this, mm: half of grbl's own default.
const CHORD_TOLERANCE_MM: f64 = 0.001;
/// Below this radius the grid makes the angles of an arc too coarse, mm.
const RADIUS_MM_MIN: f64 = 0.01;
/// Above this radius 32 bit floats make the points of an arc too coarse, mm.
const RADIUS_MM_MAX: f64 = 5_000.0;
/// An arc that turns further than this is sent in two halves, rad.
const SWEEP_MAX: f64 = 1.5 * PI;
/// Ends nearer than this in the plane count as one point, mm.
const SAME_POINT_MM: f64 = 1e-6;
/// With such ends and no whole turn, less than this is a point and more than a circle
/// less this is a contradiction, rad.
const TINY_SWEEP: f64 = 1e-3;
/// Lines for one arc, at most.
const LINES_MAX: f64 = 100_000.0;

/// A part of an arc; it starts where the one before it ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Piece {
    Line {
        end: Position,
    },
    /// About the centre of the whole arc.
    Arc {
        end: Position,
    },
}

impl Piece {
    pub(super) fn end(self) -> Position {
        match self {
            Self::Line { end } | Self::Arc { end } => end,
        }
    }
}

/// An arc in polar form about its centre; angles in rad, radii in mm.
struct Polar<'a> {
    arc: &'a Arc,
    start: Position,
    end: Position,
    start_angle: f64,
    start_radius: f64,
    end_radius: f64,
    /// Along the direction of motion, all turns together.
    sweep: f64,
}

/// Cuts an arc into pieces; `None` when it cannot be drawn.
pub(super) fn pieces(start: Position, end: Position, arc: &Arc) -> Option<Vec<Piece>> {
    let polar = Polar::new(start, end, arc)?;
    let radius = polar.start_radius;
    let is_smooth = (polar.start_radius - polar.end_radius).abs() <= RADIUS_MISMATCH_MM_MAX
        && (RADIUS_MM_MIN..=RADIUS_MM_MAX).contains(&radius);
    if !is_smooth {
        return polar.lines(0.0, polar.sweep);
    }
    let mut pieces = Vec::new();
    let mut done = 0.0;
    for _ in 0..arc.turns {
        // The last turn may be all there is left.
        done += TAU;
        pieces.push(Piece::Arc { end: polar.point_after_turns(done) });
    }
    let rest = polar.sweep - done;
    let middle = done + rest / 2.0;
    if rest <= 0.0 {
        // In the plane it ends on the very step of the grid where it starts: one step
        // further, and the firmware draws that step and not the circle.
        set_height(&mut pieces, end, arc.plane.axes()[2]);
    } else if rest < PI && radius * (1.0 - (rest / 2.0).cos()) <= FLAT_SAGITTA_MM {
        pieces.push(Piece::Line { end });
    } else if rest > SWEEP_MAX {
        pieces.push(Piece::Arc { end: polar.point(middle) });
        pieces.push(Piece::Arc { end });
    } else {
        pieces.push(Piece::Arc { end });
    }
    // What the grid makes of it is what counts.
    let mut from = start;
    for piece in &pieces {
        let is_arc = matches!(piece, Piece::Arc { .. });
        if is_arc && mismatch_on_grid(from, piece.end(), arc) > RADIUS_MISMATCH_MM_MAX {
            return polar.lines(0.0, polar.sweep);
        }
        from = piece.end();
    }
    Some(pieces)
}

fn set_height(pieces: &mut [Piece], end: Position, normal: usize) {
    if let Some(Piece::Line { end: last } | Piece::Arc { end: last }) = pieces.last_mut() {
        last[normal] = end[normal];
    }
}

impl<'a> Polar<'a> {
    fn new(start: Position, end: Position, arc: &'a Arc) -> Option<Self> {
        let [a, b, _] = arc.plane.axes();
        let from = [start[a] - arc.center[a], start[b] - arc.center[b]];
        let to = [end[a] - arc.center[a], end[b] - arc.center[b]];
        let (start_radius, end_radius) = (from[0].hypot(from[1]), to[0].hypot(to[1]));
        let is_drawable = start_radius.is_finite() && end_radius.is_finite();
        if !is_drawable || start_radius < SAME_POINT_MM || end_radius < SAME_POINT_MM {
            return None;
        }
        let start_angle = from[1].atan2(from[0]);
        let turned = to[1].atan2(to[0]) - start_angle;
        let turned = if arc.clockwise { -turned } else { turned }.rem_euclid(TAU);
        let chord = (end[a] - start[a]).hypot(end[b] - start[b]);
        let turned = match chord < SAME_POINT_MM {
            // Whole turns alone; the ends may differ by what floats lose.
            true if arc.turns > 0 => 0.0,
            true if turned > TAU - TINY_SWEEP => return None,
            _ => turned,
        };
        let sweep = turned + TAU * f64::from(arc.turns);
        Some(Self { arc, start, end, start_angle, start_radius, end_radius, sweep })
    }

    /// The point after this much of the sweep, rad.
    fn point(&self, swept: f64) -> Position {
        let [a, b, normal] = self.arc.plane.axes();
        let part = if self.sweep > 0.0 { swept / self.sweep } else { 1.0 };
        let radius = self.start_radius + (self.end_radius - self.start_radius) * part;
        let signed = if self.arc.clockwise { -swept } else { swept };
        let (sin, cos) = (self.start_angle + signed).sin_cos();
        let mut point = self.start;
        point[a] = self.arc.center[a] + radius * cos;
        point[b] = self.arc.center[b] + radius * sin;
        point[normal] = self.start[normal] + (self.end[normal] - self.start[normal]) * part;
        point
    }

    /// The point after whole turns: exactly above the start.
    fn point_after_turns(&self, swept: f64) -> Position {
        let [a, b, _] = self.arc.plane.axes();
        let mut point = self.point(swept);
        point[a] = self.start[a];
        point[b] = self.start[b];
        point
    }

    fn lines(&self, from: f64, to: f64) -> Option<Vec<Piece>> {
        let radius = self.start_radius.max(self.end_radius);
        let half = (1.0 - CHORD_TOLERANCE_MM / radius).clamp(-1.0, 1.0).acos();
        let count = ((to - from) / (2.0 * half).min(FRAC_PI_4)).ceil().max(1.0);
        // Numbers that are none end here too.
        if count.is_nan() || count > LINES_MAX {
            return None;
        }
        let count = count as u32;
        let mut pieces = Vec::new();
        for step in 1..count {
            let swept = from + (to - from) * f64::from(step) / f64::from(count);
            pieces.push(Piece::Line { end: self.point(swept) });
        }
        pieces.push(Piece::Line { end: self.end });
        Some(pieces)
    }
}

/// How much the radii at both ends differ once everything stands on the grid, mm.
fn mismatch_on_grid(start: Position, end: Position, arc: &Arc) -> f64 {
    let [a, b, _] = arc.plane.axes();
    let radius = |point: Position| {
        let offset = |axis: usize| from_grid(to_grid(point[axis]) - to_grid(arc.center[axis]));
        offset(a).hypot(offset(b))
    };
    (radius(start) - radius(end)).abs()
}
