//! Finds the block of the contour that each element of a path belongs to.
//!
//! Elements come in the order of their blocks. What a block may become depends on its kind. Free
//! moves, and moves out of the plane, must be as programmed.

use crate::blocks::program::{BlockKind, NONE};
use crate::blocks::tool_path::ToolPath;
use crate::geometry::planar::{Piece, cross, flat};
use crate::report::{self, Report};
use cnc_msgs::contour::{Motion, MotionClass};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::{PathElement, Role};
use cnc_msgs::profile::{ArcLead, Profile};

/// How far a position may be from the programmed one, mm. The planner drops elements shorter than
/// half of it.
pub(crate) const SAME_MM: f64 = 2e-6;

/// How many blocks are looked at for an element of a line that is executed again: those before it
/// are left out of the path.
const REPEATS_MAX: usize = 1000;

/// After so many elements without a block the audit gives up.
const STRAYS_MAX: usize = 20;

/// Gives every element its block. False when path and program have too little in common.
pub(crate) fn align(tool_path: &mut ToolPath<'_>, report: &mut Report<'_>) -> bool {
    let mut next = 0;
    let mut strays = 0;
    for index in 0..tool_path.path.elements.len() {
        let element = &tool_path.path.elements[index];
        tool_path.roles.push(element.role);
        let Some(found) = find(tool_path, index, element, next) else {
            strays += 1;
            report.push(report::unknown_block(element, index));
            if strays >= STRAYS_MAX {
                return false;
            }
            continue;
        };
        let here = tool_path.position_before(index);
        for skipped in next..found {
            check_skipped(tool_path, skipped as u32, here, report);
        }
        tool_path.block_of[index] = found as u32;
        next = found;
        let motion = tool_path.program.motion(found as u32);
        let is_programmed = match element.role {
            Role::None => same_motion(motion, element),
            Role::LeadOff => near(motion.end, element.end),
            Role::OffPlane => {
                let [u, v, w] = tool_path.program.offset(found as u32).plane.axes();
                element.shape == Shape::Line
                    && element.end[w] == motion.end[w]
                    && (element.end[u] - here[u]).abs().max((element.end[v] - here[v]).abs())
                        <= SAME_MM
            }
            Role::LeadOn => same_lead(motion, element, report.profile),
            Role::Link => element.shape == Shape::Line,
            Role::Contour | Role::Corner => true,
        };
        if !is_programmed {
            report.push(report::not_as_programmed(element, motion));
        }
        let block = &mut tool_path.program.blocks[found];
        if is_own(block.kind, element.role) {
            block.element = index as u32;
            next = found + 1;
        } else if block.kind == BlockKind::Leg && element.role == Role::Link {
            block.begins = true;
        }
    }
    let here = tool_path.path.elements.last().map_or(tool_path.path.start, |element| element.end);
    for skipped in next..tool_path.program.blocks.len() {
        check_skipped(tool_path, skipped as u32, here, report);
    }
    true
}

/// Whether an element is the block's own motion; no other element of the block can follow it.
fn is_own(kind: BlockKind, role: Role) -> bool {
    match kind {
        BlockKind::Leg => role == Role::Contour,
        _ => role != Role::Corner,
    }
}

fn may_be(kind: BlockKind, role: Role) -> bool {
    match kind {
        BlockKind::Free => role == Role::None,
        BlockKind::LeadOn => role == Role::LeadOn,
        BlockKind::Leg => matches!(role, Role::Contour | Role::Corner | Role::Link),
        BlockKind::OffPlane => role == Role::OffPlane,
        BlockKind::LeadOff => matches!(role, Role::Corner | Role::LeadOff),
        BlockKind::Link => matches!(role, Role::Corner | Role::Link),
        BlockKind::Still => false,
    }
}

/// The first block from here on that an element can belong to. If several share a line, or a loop
/// executes a line again, the one that it fits.
fn find(
    tool_path: &ToolPath<'_>,
    index: usize,
    element: &PathElement,
    next: usize,
) -> Option<usize> {
    let blocks = &tool_path.program.blocks;
    let is_candidate = |block: usize| {
        tool_path.program.source(block as u32) == element.source
            && may_be(blocks[block].kind, element.role)
    };
    let first = (next..blocks.len()).find(|&block| is_candidate(block))?;
    if tool_path.program.repeats_lines {
        let here = tool_path.position_before(index);
        let until = blocks.len().min(next + REPEATS_MAX);
        for block in next..until {
            if is_candidate(block) && fits(tool_path, index, element, block as u32) {
                return Some(block);
            }
            if !moves_nothing(tool_path, block as u32, here) {
                break;
            }
        }
        return Some(first);
    }
    let in_line = (first..blocks.len())
        .take_while(|&block| tool_path.program.source(block as u32) == element.source);
    let mut others = in_line.filter(|&block| is_candidate(block));
    if blocks
        .get(first + 1)
        .is_none_or(|_| tool_path.program.source(first as u32 + 1) != element.source)
    {
        return Some(first);
    }
    others.find(|&block| fits(tool_path, index, element, block as u32)).or(Some(first))
}

/// Whether an element is far from a block; only for blocks that share a line.
fn fits(tool_path: &ToolPath<'_>, index: usize, element: &PathElement, block: u32) -> bool {
    const OFFSET_MM: f64 = 1e-2;
    let motion = tool_path.program.motion(block);
    let plane = tool_path.program.offset(block).plane;
    match element.role {
        Role::None => near(motion.end, element.end),
        Role::OffPlane => motion.end[plane.axes()[2]] == element.end[plane.axes()[2]],
        Role::Contour => {
            let leg = tool_path.leg(block);
            let d_out = tool_path.program.offset(block).d_out;
            let end = flat(plane, element.end);
            let from_leg = leg.nearest(end) - end;
            match (&leg.round, &element.shape) {
                (None, Shape::Line) => {
                    let along = leg.along(end);
                    let off = cross(leg.tangent(leg.from), end - leg.from) - d_out;
                    off.abs() <= OFFSET_MM && along <= leg.length() + OFFSET_MM
                }
                (Some(_), Shape::Arc(_)) => (from_leg.norm() - d_out.abs()).abs() <= OFFSET_MM,
                _ => false,
            }
        }
        Role::Corner => {
            let from = flat(plane, tool_path.position_before(index));
            let at = Piece::line(from, from).nearest(tool_path.program.ends(block).0);
            let vertex = tool_path.program.ends(block).0;
            (at - vertex).norm() <= tool_path.program.offset(block).d_in.abs() * 2.0 + OFFSET_MM
        }
        Role::LeadOn | Role::LeadOff | Role::Link => true,
    }
}

/// A block without an element must be one that moves nothing.
fn check_skipped(tool_path: &ToolPath<'_>, block: u32, here: Position, report: &mut Report<'_>) {
    if tool_path.program.blocks[block as usize].element != NONE {
        return;
    }
    if !moves_nothing(tool_path, block, here) {
        let motion = tool_path.program.motion(block);
        report.push(report::dropped(tool_path.program.source(block), motion));
    }
}

/// Whether a path may be without an element of this block, from where the tool is before it.
fn moves_nothing(tool_path: &ToolPath<'_>, block: u32, here: Position) -> bool {
    let motion = tool_path.program.motion(block);
    match tool_path.program.blocks[block as usize].kind {
        BlockKind::Free | BlockKind::LeadOff => near(motion.end, here) && !turns(motion),
        BlockKind::OffPlane => {
            let w = tool_path.program.offset(block).plane.axes()[2];
            (motion.end[w] - here[w]).abs() <= SAME_MM
        }
        // A lead may be too short to be a move. `offsets` checks what is left of a contour.
        BlockKind::LeadOn | BlockKind::Link | BlockKind::Leg | BlockKind::Still => true,
    }
}

fn turns(motion: &Motion) -> bool {
    matches!(motion.shape, Shape::Arc(arc) if arc.turns > 0)
}

fn near(a: Position, b: Position) -> bool {
    (0..3).all(|axis| (a[axis] - b[axis]).abs() <= SAME_MM)
}

/// Whether a lead-on has the shape that its profile makes of the programmed move. `offsets` checks where
/// an arc runs.
fn same_lead(motion: &Motion, element: &PathElement, profile: &Profile) -> bool {
    match (&motion.shape, &element.shape) {
        (Shape::Arc(a), Shape::Arc(b)) => {
            profile.select.arc_lead == ArcLead::Arc
                && (a.plane, a.clockwise, a.turns) == (b.plane, b.clockwise, b.turns)
        }
        (Shape::Arc(_), Shape::Line) => profile.select.arc_lead != ArcLead::Arc,
        (Shape::Line, shape) => *shape == Shape::Line,
    }
}

fn same_motion(motion: &Motion, element: &PathElement) -> bool {
    let same_shape = match (&motion.shape, &element.shape) {
        (Shape::Line, Shape::Line) => true,
        (Shape::Arc(a), Shape::Arc(b)) => {
            near(a.center, b.center)
                && (a.plane, a.clockwise, a.turns) == (b.plane, b.clockwise, b.turns)
        }
        _ => false,
    };
    let feed = (motion.class == MotionClass::Feed).then_some(motion.feed_mm_per_min);
    let same_feed = match (feed, element.feed_mm_per_min) {
        (Some(a), Some(b)) => (a - b).abs() <= 1e-9 * a.abs(),
        (a, b) => a.is_none() && b.is_none(),
    };
    same_shape && same_feed && near(motion.end, element.end)
}
