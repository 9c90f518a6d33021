//! The straight line or circle that an element of the path is part of.

use crate::blocks::chains::Chains;
use crate::blocks::program::NONE;
use crate::blocks::tool_path::ToolPath;
use crate::geometry::planar::{Piece, Point, cross};
use crate::offsets::element_offset::{ElementOnLeg, runs_on};
use cnc_msgs::path::Role;

/// The line or circle that an element is part of, long enough to be lengthened, and its offset.
pub(super) fn run(
    tool_path: &ToolPath<'_>,
    on_leg: &ElementOnLeg,
    chains: &Chains<'_>,
    backwards: bool,
) -> (Piece, f64) {
    const LONG_MM: f64 = 1.0;
    const STEPS_MAX: usize = 64;
    if on_leg.leg.round.is_some() {
        return (on_leg.leg, 0.0);
    }
    let d_mm = if backwards { on_leg.d_out } else { on_leg.d_in };
    if on_leg.d_in != on_leg.d_out {
        return (on_leg.leg, 0.0);
    }
    let mut run = on_leg.piece;
    let mut element = on_leg.element;
    for _ in 0..STEPS_MAX {
        let next = if backwards { element.wrapping_sub(1) } else { element + 1 };
        if run.length() >= LONG_MM || !chains.span.elements.contains(&next) {
            break;
        }
        if tool_path.roles[next] != Role::Contour || tool_path.block_of[next] == NONE {
            break;
        }
        let piece = chains.element(next);
        let goes_on = if backwards { runs_on(&piece, &run) } else { runs_on(&run, &piece) };
        if !goes_on || !piece.is_line() {
            break;
        }
        run = if backwards {
            Piece::line(piece.from, run.to)
        } else {
            Piece::line(run.from, piece.to)
        };
        element = next;
    }
    (run, d_mm)
}

/// How far a programmed point is from the contour that a run follows, mm.
pub(super) fn off_run(run: &Piece, point: Point, d_mm: f64) -> f64 {
    match &run.round {
        None => (cross(run.tangent(run.from), point - run.from) + d_mm).abs(),
        Some(round) => ((point - round.center).norm() - round.radius).abs(),
    }
}
