//! What may stand between two blocks of a contour other than a corner.
//!
//! A change of side, a rapid that leaves the offset, a new radius that begins
//! perpendicular: each ends the span that is being gathered and begins another.
//! When a span begins and ends otherwise is decided in `walk`.

use super::{Active, Selection, State, Walk};
use crate::compensate::Exit;
use crate::element::Element;
use crate::finding;
use crate::intersect::{Meeting, meet_across};
use crate::rules;
use crate::span::{Lead, OtherSide};
use crate::tolerance::{FAR_CORNER_RADII, LENGTH_MM};
use cnc_msgs::contour::{Approach, Motion, MotionClass, Source};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::profile::{ChangeAt, RapidMode, Strictness};

impl<'a> Walk<'a> {
    /// What the joint before a leg may be other than a corner; `None` when the
    /// motion was no leg after all.
    pub(super) fn before_leg(
        &mut self,
        mut active: Box<Active<'a>>,
        is_excess: bool,
        start: Position,
        motion: &Motion,
        source: Source,
        element: &Element,
    ) -> Option<Box<Active<'a>>> {
        if motion.class != MotionClass::Feed {
            self.verdict.findings.extend(rules::rapid(source, self.profile));
            if self.profile.rapid.rule == RapidMode::Raw {
                self.leave_raw(*active, start, motion, source);
                return None;
            }
        }
        let other_side = active.other_side.take();
        if is_excess && self.profile.off_plane.strictness == Strictness::Emulate {
            active.side = other_side.map_or(active.side, |selection| selection.side);
            return Some(self.stand_perpendicular(active, start, motion, source));
        }
        if let Some(selection) = other_side {
            return Some(self.change_side(active, selection, start, motion, source, element));
        }
        if active.radius_changes.is_some()
            && self.profile.radius.change_at == ChangeAt::Perpendicular
            && element.is_line()
            && !active.span.legs.is_empty()
        {
            self.change_perpendicular(active, start, motion, source);
            return None;
        }
        Some(active)
    }

    /// The tool goes over to the other side at the intersection of the offsets (O02).
    ///
    /// Parallel lines have none, and short ones none on them: there the old contour
    /// ends and the new one begins perpendicular; where an arc takes part, that is a
    /// broken rule.
    fn change_side(
        &mut self,
        mut active: Box<Active<'a>>,
        selection: Selection,
        start: Position,
        motion: &Motion,
        source: Source,
        element: &Element,
    ) -> Box<Active<'a>> {
        let d_mm = match active.radius_changes {
            Some(_) => self.signed_offset(selection.side, selection.source),
            None => -active.span.d_out_mm,
        };
        let next = OtherSide { element: *element, d_mm };
        let last = active.span.legs.last().and_then(|leg| leg.element(active.span.plane));
        let before = last.map(|element| OtherSide { element, d_mm: active.span.d_out_mm });
        let met = before.and_then(|before| Some((before, meeting(&before, &next)?)));
        if let Some((before, meeting)) = met {
            let (distance_mm, radius_mm) = ((meeting.point - element.start()).norm(), d_mm.abs());
            if distance_mm > FAR_CORNER_RADII * radius_mm {
                self.verdict.findings.push(finding::far_corner(source, distance_mm, d_mm));
            }
            active.span.next = Some(next);
            let here = Motion { shape: Shape::Line, end: start, ..*motion };
            let behind = self.close(*active, Exit::None);
            let selection = Selection { approach: Some(Approach::Normal), ..selection };
            self.open(selection, start, &here, source, Some(behind), false);
            let mut active = self.opened();
            let wall = behind.map_or(before.element, |behind| behind.wall);
            active.span.entry.from = Some(OtherSide { element: wall, ..before });
            return active;
        }
        if !(element.is_line() && last.is_none_or(|last| last.is_line())) {
            self.verdict.findings.push(rules::no_intersection(selection.source, self.profile));
        }
        active.side = selection.side;
        self.stand_perpendicular(active, start, motion, source)
    }

    /// The span that has just been opened.
    fn opened(&mut self) -> Box<Active<'a>> {
        match std::mem::replace(&mut self.state, State::Off) {
            State::Active(active) => active,
            _ => unreachable!("open makes the state active"),
        }
    }

    /// The span ends perpendicular where the program is, and another begins there.
    fn stand_perpendicular(
        &mut self,
        active: Box<Active<'a>>,
        start: Position,
        motion: &Motion,
        source: Source,
    ) -> Box<Active<'a>> {
        let here = Motion { shape: Shape::Line, end: start, ..*motion };
        let selection = Selection {
            side: active.side,
            approach: Some(Approach::Normal),
            along: None,
            source: active.span.entry.lead.source,
        };
        let lead = Lead { motion: here, source, start, approach: Approach::Normal, along: None };
        let behind = self.close(*active, Exit::Link(lead));
        self.open(selection, start, &here, source, Some(behind), false);
        self.opened()
    }

    /// A block with a new radius begins perpendicular to the block before (SINUMERIK 880).
    fn change_perpendicular(
        &mut self,
        active: Box<Active<'a>>,
        start: Position,
        motion: &Motion,
        source: Source,
    ) {
        let selection = Selection {
            side: active.side,
            approach: Some(Approach::Normal),
            along: None,
            source: active.radius_changes.unwrap_or(source),
        };
        let lead = Lead { motion: *motion, source, start, approach: Approach::Normal, along: None };
        let behind = self.close(*active, Exit::Link(lead));
        self.open(selection, start, motion, source, Some(behind), true);
    }

    /// A rapid that goes where it is programmed to: the offset is left and entered again.
    ///
    /// A cancel that waited for its move has nothing left to lead off from.
    fn leave_raw(&mut self, active: Active<'a>, start: Position, motion: &Motion, source: Source) {
        let same_side = Selection {
            side: active.side,
            approach: None,
            along: None,
            source: active.span.entry.lead.source,
        };
        let next = match (active.cancel, active.relink) {
            (Some(_), _) => State::Off,
            (None, Some((selection, _))) => State::Selected(selection),
            (None, None) => State::Selected(same_side),
        };
        let approach = self.profile.cancel.default;
        let lead = Lead { motion: *motion, source, start, approach, along: None };
        self.close(active, Exit::LeadOff(lead));
        self.state = next;
    }
}

/// Where the offsets on both sides of the tool meet, if something is left of each.
fn meeting(before: &OtherSide, next: &OtherSide) -> Option<Meeting> {
    let (behind, ahead) = (before.element.offset(before.d_mm)?, next.element.offset(next.d_mm)?);
    let meeting = meet_across(&behind, &ahead)?;
    let is_left =
        meeting.trim_a < behind.length() - LENGTH_MM && meeting.trim_b < ahead.length() - LENGTH_MM;
    (is_left && before.d_mm * next.d_mm < 0.0).then_some(meeting)
}
