//! An arc as pieces that grbl draws as they are meant.
//!
//! grbl works out the angle of an arc from its ends in 32 bit numbers. Where both ends
//! are one point, or nearly, it hangs on the last place of a coordinate whether it draws
//! a full circle or nothing. So a full circle is sent in two halves, and what is flat,
//! tiny or ragged as lines; and every arc is drawn here as the firmware will draw it
//! before it is sent ([`super::firmware_arc`]). One that would be off is cut into more
//! pieces, or into lines. A helix of very many turns is looked at part by part, so that the
//! serial line never waits for all of it.

use super::firmware_arc::{ArcWords, DrawingFrame, PlannedArc, deviation};
use super::words::{GRID_PER_MM, to_grid};
use cnc_msgs::geometry::{Arc, Position};
use std::f64::consts::{FRAC_PI_4, PI, TAU};

/// The radii at both ends of an arc differ by at most this, mm. grbl refuses from
/// 0.005 mm on (`error:33`).
const RADIUS_MISMATCH_MM_MAX: f64 = 0.004;
/// An arc no higher than this over its chord is a line, mm: one step of the grid.
const FLAT_SAGITTA_MM: f64 = 1.0 / GRID_PER_MM;
/// A line of a polyline is off its arc by at most this, mm: half of grbl's own default.
const CHORD_TOLERANCE_MM: f64 = 0.001;
/// What the firmware draws is off what was planned by at most this, mm, and by twice what
/// `$12` lets it be: so much grbl itself says that its chords may be off.
const DRAWN_MM_MAX: f64 = 0.005;
const CHORD_TOLERANCES: f64 = 2.0;
/// Below this radius the grid makes the angles of an arc too coarse, mm.
const RADIUS_MM_MIN: f64 = 0.01;
/// Above this radius 32 bit floats make the points of an arc too coarse, mm.
const RADIUS_MM_MAX: f64 = 5_000.0;
/// A piece turns no further than this, rad.
const SWEEP_MAX: f64 = 1.5 * PI;
/// How often pieces that would be drawn wrongly are halved before they become lines.
const HALVINGS_MAX: u32 = 7;
/// Ends nearer than this in the plane count as one point, mm.
const SAME_POINT_MM: f64 = 1e-6;
/// With such ends and no whole turn, less than this is a point and more than a circle
/// less this is a contradiction, rad.
const TINY_SWEEP: f64 = 1e-3;
/// Chords of the firmware in one part of an arc, about: some milliseconds' work.
const CHORDS_PER_PART: f64 = 50_000.0;
/// The most that the firmware draws of one piece.
const CHORDS_PER_PIECE_MAX: f64 = 65_535.0;
/// Lines for one part of an arc, at most.
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

/// One of the equal parts of an arc.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    /// Counted from 0.
    pub(super) number: u32,
    pub(super) of: u32,
}

impl Part {
    pub(super) const WHOLE: Self = Self { number: 0, of: 1 };

    /// The first of so many parts that none takes long to look at. `None` when the arc cannot be
    /// drawn.
    pub(super) fn first(
        start: Position,
        end: Position,
        arc: &Arc,
        frame: &DrawingFrame,
    ) -> Option<Self> {
        let polar = Polar::new(start, end, arc)?;
        let parts = (polar.chords(frame) / CHORDS_PER_PART).ceil().max(1.0);
        Some(if polar.is_smooth() { Self { number: 0, of: parts as u32 } } else { Self::WHOLE })
    }

    pub(super) fn next(self) -> Option<Self> {
        let number = self.number + 1;
        (number < self.of).then_some(Self { number, ..self })
    }
}

/// Why an arc is not drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Undrawable {
    /// It has no radius, or its ends contradict each other.
    Shape,
    /// It would be more than [`LINES_MAX`] lines.
    Lines { count: f64, max: f64 },
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

/// Cuts a part of an arc into pieces.
pub(super) fn pieces(
    start: Position,
    end: Position,
    arc: &Arc,
    frame: &DrawingFrame,
    part: Part,
) -> Result<Vec<Piece>, Undrawable> {
    let polar = Polar::new(start, end, arc).ok_or(Undrawable::Shape)?;
    if !polar.is_smooth() {
        return polar.lines(part);
    }
    let (radius, sweep) = (polar.start_radius, polar.sweep / f64::from(part.of));
    if part.of == 1 && sweep < PI && radius * (1.0 - (sweep / 2.0).cos()) <= FLAT_SAGITTA_MM {
        return Ok(vec![Piece::Line { end }]);
    }
    let least = (sweep / SWEEP_MAX).ceil().max(1.0) as u32;
    (0..=HALVINGS_MAX)
        .map(|halvings| polar.arcs(part, least << halvings))
        .find(|arcs| polar.are_drawn(part, arcs, frame))
        .map_or_else(|| polar.lines(part), Ok)
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

    /// Whether it may be drawn as arcs.
    fn is_smooth(&self) -> bool {
        (self.start_radius - self.end_radius).abs() <= RADIUS_MISMATCH_MM_MAX
            && (RADIUS_MM_MIN..=RADIUS_MM_MAX).contains(&self.start_radius)
    }

    /// How many chords the firmware draws of it, about.
    fn chords(&self, frame: &DrawingFrame) -> f64 {
        let (radius, tolerance) = (self.start_radius, frame.tolerance_mm);
        let chords = 0.5 * self.sweep * radius / (tolerance * (2.0 * radius - tolerance)).sqrt();
        let least = (self.sweep / SWEEP_MAX).ceil().max(1.0);
        // No number where the circle is no larger than the tolerance.
        let chords = if chords.is_nan() { 0.0 } else { chords };
        chords.clamp(least, least * CHORDS_PER_PIECE_MAX)
    }

    /// Where a part begins.
    fn start_of(&self, part: Part) -> Position {
        match part.number {
            0 => self.start,
            number => self.point(self.sweep * f64::from(number) / f64::from(part.of)),
        }
    }

    /// The ends of so many equal pieces of a part.
    fn ends(&self, part: Part, count: u32) -> impl Iterator<Item = Position> {
        let (all, done) =
            (f64::from(part.of) * f64::from(count), f64::from(part.number) * f64::from(count));
        let inner =
            (1..count).map(move |step| self.point(self.sweep * (done + f64::from(step)) / all));
        inner.chain([part.next().map_or(self.end, |next| self.start_of(next))])
    }

    fn arcs(&self, part: Part, count: u32) -> Vec<Piece> {
        self.ends(part, count).map(|end| Piece::Arc { end }).collect()
    }

    /// Whether the firmware draws these of a part as they are meant.
    fn are_drawn(&self, part: Part, arcs: &[Piece], frame: &DrawingFrame) -> bool {
        let [a, b, _] = self.arc.plane.axes();
        let most = DRAWN_MM_MAX + CHORD_TOLERANCES * frame.tolerance_mm;
        let center = self.arc.center;
        let sweep = self.sweep / f64::from(part.of) / arcs.len() as f64;
        let mut start = self.start_of(part);
        arcs.iter().all(|piece| {
            let end = piece.end();
            let planned = PlannedArc { start, end, sweep, center: [center[a], center[b]] };
            let words = ArcWords {
                plane: self.arc.plane,
                clockwise: self.arc.clockwise,
                start: start.map(to_grid),
                end: end.map(to_grid),
                offset: [a, b].map(|axis| to_grid(center[axis]) - to_grid(start[axis])),
            };
            start = end;
            deviation(&words, &planned, frame).is_some_and(|off| off <= most)
        })
    }

    fn lines(&self, part: Part) -> Result<Vec<Piece>, Undrawable> {
        let radius = self.start_radius.max(self.end_radius);
        let half = (1.0 - CHORD_TOLERANCE_MM / radius).clamp(-1.0, 1.0).acos();
        let sweep = self.sweep / f64::from(part.of);
        let count = (sweep / (2.0 * half).min(FRAC_PI_4)).ceil().max(1.0);
        // Numbers that are none end here too.
        if count.is_nan() || count > LINES_MAX {
            return Err(Undrawable::Lines { count, max: LINES_MAX });
        }
        Ok(self.ends(part, count as u32).map(|end| Piece::Line { end }).collect())
    }
}
