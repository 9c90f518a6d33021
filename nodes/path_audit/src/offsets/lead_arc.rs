//! Checks a lead-on that is an arc: it reaches the offset of the programmed one at a tangent.
//!
//! `clearance` measures what it cuts, and `align` knows that it turns as programmed.

use crate::blocks::program::{BlockKind, NONE};
use crate::blocks::spans::Span;
use crate::blocks::tool_path::ToolPath;
use crate::geometry::planar::{Piece, Point, left};
use crate::offsets::element_offset::PLACE_MM;
use crate::report::{self, Report};

/// How far off a centre may be by rounding, as a part of its coordinates.
const ROUNDING: f64 = 1e-14;

pub(super) fn check(tool_path: &ToolPath<'_>, span: &Span, legs: &[u32], report: &mut Report<'_>) {
    let Some(element) = span.lead_on else { return };
    let block = tool_path.block_of[element];
    if block == NONE || tool_path.program.blocks[block as usize].kind != BlockKind::LeadOn {
        return;
    }
    let (path, programmed) = (tool_path.piece(element), tool_path.leg(block));
    if path.is_line() || programmed.is_line() {
        return;
    }
    let d_mm = tool_path.program.offset(legs[span.legs.start]).d_in;
    let path_element = &tool_path.path.elements[element];
    if let Some(what) = wrong(&path, &programmed, d_mm) {
        report.push_shape(report::wrong_place(path_element, what));
    }
}

/// What is wrong with the path of a lead at a signed distance from the programmed arc.
fn wrong(path: &Piece, programmed: &Piece, d_mm: f64) -> Option<&'static str> {
    let round = path.round?;
    let along = programmed.tangent(programmed.to);
    // The place where the tool is one radius beside the programmed end.
    let at = programmed.to + left(along) * d_mm;
    let out: Point = at - round.center;
    let chord_mm = (at - path.from).norm();
    let place_mm = PLACE_MM + ROUNDING * round.center.amax();
    let off_mm = (out.norm() - round.radius).abs();
    // As far as a wrong direction at that place moves the arc aside over its chord.
    let aside_mm = along.dot(&out).abs() / round.radius * chord_mm;
    let is_ahead = path.tangent(at).dot(&along) > 0.0;
    let end_mm = ((path.to - round.center).norm() - round.radius).abs();
    if end_mm > place_mm {
        return Some("ends off its own circle");
    }
    if off_mm > place_mm || aside_mm > place_mm || !is_ahead {
        return Some("does not lead to the offset of its arc at a tangent");
    }
    let to_end_mm = ((programmed.to - round.center).norm() - round.radius).abs();
    if to_end_mm < d_mm.abs() - place_mm {
        return Some("comes nearer to its end than the radius");
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::planar::Round;

    fn arc(from: [f64; 2], to: [f64; 2], center: [f64; 2], sweep: f64) -> Piece {
        let [from, to, center] = [from, to, center].map(Point::from);
        let radius = (from - center).norm();
        Piece { from, to, round: Some(Round { center, radius, sweep }) }
    }

    #[test]
    fn only_one_arc_leads_to_the_offset_at_a_tangent() {
        // A quarter of a circle of 20 mm, and a tool of 5 mm on its left: to (15, 20).
        let quarter = std::f64::consts::FRAC_PI_2;
        let programmed = arc([0.0, 0.0], [20.0, 20.0], [0.0, 20.0], quarter);
        let lead = arc([0.0, 0.0], [15.0, 20.0], [-35.0 / 6.0, 20.0], 1.287_002_217_6);
        assert_eq!(wrong(&lead, &programmed, 5.0), None);
        // One that the contour ends earlier is on the same circle.
        let early = arc(
            [0.0, 0.0],
            [-35.0 / 6.0 + 0.6 * 125.0 / 6.0, 20.0 - 0.8 * 125.0 / 6.0],
            [-35.0 / 6.0, 20.0],
            0.35,
        );
        assert_eq!(wrong(&early, &programmed, 5.0), None);
        for (what, path) in [
            // The programmed arc, and one about the same centre.
            ("offset", programmed),
            ("own circle", arc([0.0, 0.0], [15.0, 20.0], [0.0, 20.0], quarter)),
            // Through the right end, from another direction.
            ("tangent", arc([0.0, 0.0], [15.0, 20.0], [-5.0, 19.375], 1.2)),
            ("tangent", arc([0.0, 0.0], [15.0, 20.0], [35.0 / 6.0 + 14.0, 0.3], -1.2)),
            // A hair aside at both ends.
            ("tangent", arc([0.0, 0.0], [15.0, 20.0], [-35.0 / 6.0 - 0.002, 20.0015], 1.287)),
        ] {
            assert!(wrong(&path, &programmed, 5.0).is_some(), "{what}: {path:?}");
        }
        // Backwards: a sixth turn, where the tool stands beyond the tangent.
        let short = arc([0.0, 0.0], [10.0, 2.679_492], [0.0, 20.0], std::f64::consts::FRAC_PI_6);
        let back = arc([0.0, 0.0], [7.5, 7.009_619], [18.853_6, -12.655_4], 5.83);
        assert!(wrong(&back, &short, 5.0).is_some());
    }
}
