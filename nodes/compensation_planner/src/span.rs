//! What lies between a lead-on and the next lead-off, before its geometry.
//!
//! Only data: `walk` fills it, `compensate` reads it.

pub(crate) mod chain;
pub(crate) mod chain_links;
pub(crate) mod corner;
pub(crate) mod lead_arc;
pub(crate) mod links;
pub(crate) mod runs;

use crate::geometry::element::{Arc, Element, Vec2};
use crate::geometry::frame::{element_from, height};
use cnc_msgs::contour::{Action, Approach, Motion, MotionClass, OutsideCorner, Source};
use cnc_msgs::geometry::{Plane, Position};

/// One block with motion in the plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leg<'a> {
    /// What the block programs.
    pub motion: &'a Motion,
    pub source: Source,
    /// Where it starts in the plane, mm.
    pub start: Vec2,
    /// How an outside corner at its start is rounded: it belongs to this block (S07, S09).
    pub corner: OutsideCorner,
    /// The signed offset at its end; it differs from that at its start in a
    /// block that changes the radius (S43).
    pub d_out_mm: f64,
    /// Direction of the tip that the path is of, 1 to 9; 0: it is that of the centre.
    pub tip: u8,
    /// Where it ends along its run: mm on a line, rad on an arc.
    pub reach: f64,
}

impl Leg<'_> {
    /// What the block does in the plane; `None` when it stays where it is there.
    pub(crate) fn element(&self, plane: Plane) -> Option<Element> {
        element_from(plane, self.start, self.motion)
    }

    /// Its feed, mm/min; `None` for a rapid.
    pub(crate) fn feed_mm_per_min(&self) -> Option<f64> {
        feed(self.motion)
    }
}

/// A motion that leads to or from the contour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lead {
    pub motion: Motion,
    pub source: Source,
    /// Where it starts in the program.
    pub start: Position,
    pub approach: Approach,
    /// Direction of an imaginary line that enters the contour at the end of this move.
    pub along: Option<Vec2>,
}

/// Something between two blocks with motion in the plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Item {
    /// It comes before this leg; the number of legs means before the lead-off.
    pub before: usize,
    pub source: Source,
    pub what: ItemKind,
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum ItemKind {
    Action(Action),
    OffPlane(Motion),
}

/// How a span begins.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entry {
    pub lead: Lead,
    /// The arc of a lead-on that is run as one, as programmed: `lead_arc`.
    pub arc: Option<Arc>,
    /// Whether it also ends the span before: a change of side or a reselection.
    pub is_link: bool,
    /// Its end is on the offset of the lead itself, joined to the contour as a corner.
    pub is_joined: bool,
    /// What the tool comes from, where the side changes without a move between (O02).
    pub from: Option<OtherSide>,
}

/// The neighbour on the other side of the tool, and the signed offset that it has.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OtherSide {
    pub element: Element,
    pub d_mm: f64,
}

/// The run that is joined with the other side of the tool.
#[derive(Debug, Clone)]
pub(crate) struct AtChange {
    pub legs: std::ops::Range<usize>,
    /// Points so near a line are on it, mm.
    pub straight_mm: f64,
}

/// A compensated piece of the program.
#[derive(Debug, Clone)]
pub(crate) struct Span<'a> {
    pub plane: Plane,
    /// The signed offset at the lead-on, positive to the left.
    pub d_mm: f64,
    /// The signed offset at the end of the last leg.
    pub d_out_mm: f64,
    /// Direction of the tip that the path is of at the lead-on, as of a leg.
    pub tip: u8,
    pub entry: Entry,
    pub legs: Vec<Leg<'a>>,
    pub items: Vec<Item>,
    /// What the tool continues with, if the side changes at its end (O02).
    pub next: Option<OtherSide>,
    /// The first run where the side changes at its start, the last where it does at its end:
    /// both contours must see the same.
    pub at_change: [Option<AtChange>; 2],
    /// How an outside corner before the lead-off is rounded.
    pub exit_corner: OutsideCorner,
}

impl Span<'_> {
    /// The lowest and the highest place of each leg along the tool, mm: where it starts or ends.
    pub(crate) fn leg_heights(&self) -> Vec<(f64, f64)> {
        let mut items = self.items.iter().peekable();
        let mut now = height(self.plane, self.entry.lead.motion.end);
        let ends = |(index, leg): (usize, &Leg<'_>)| {
            while let Some(item) = items.next_if(|item| item.before <= index) {
                if let ItemKind::OffPlane(motion) = item.what {
                    now = height(self.plane, motion.end);
                }
            }
            let start = std::mem::replace(&mut now, height(self.plane, leg.motion.end));
            (start.min(now), start.max(now))
        };
        self.legs.iter().enumerate().map(ends).collect()
    }
}

/// Legs that are one line or arc for the geometry.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    pub element: Element,
    pub legs: std::ops::Range<usize>,
    pub d_in_mm: f64,
    pub d_out_mm: f64,
}

impl Lead {
    /// Its length in the plane, mm.
    pub(crate) fn length(&self, plane: Plane) -> f64 {
        let from = crate::geometry::frame::in_plane(plane, self.start);
        (crate::geometry::frame::in_plane(plane, self.motion.end) - from).norm()
    }
}

/// The feed of a motion; `None` for a rapid.
pub(crate) fn feed(motion: &Motion) -> Option<f64> {
    (motion.class == MotionClass::Feed).then_some(motion.feed_mm_per_min)
}

/// The feed that holds next to a rapid, where no motion has had it yet.
pub(crate) fn feed_in_force(motion: &Motion) -> Option<f64> {
    (motion.feed_mm_per_min > 0.0).then_some(motion.feed_mm_per_min)
}
