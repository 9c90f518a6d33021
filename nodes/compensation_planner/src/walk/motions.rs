//! Decides what each motion is: a free move, a lead-on, a leg, a move out of the plane or a lead-off.

use super::{Active, Walk, WalkState};
use crate::geometry::frame::{element, height};
use crate::geometry::tolerance::LENGTH_MM;
use crate::span::ItemKind;
use crate::walk::compensate::Exit;
use crate::walk::rules;
use cnc_msgs::contour::{Motion, MotionClass, Source};
use cnc_msgs::geometry::{Position, Shape};
use cnc_msgs::path::Role;
use cnc_msgs::profile::{LeadMove, OffPlaneAfterCancel};

impl<'a> Walk<'a> {
    pub(super) fn motion(&mut self, motion: &'a Motion, source: Source) {
        if !rules::is_sane(motion) {
            self.report.findings.push(rules::not_sane(source, motion));
            return;
        }
        let shifts_z = self.apply_length_of_d(motion, source);
        let start = self.programmed;
        self.programmed = motion.end;
        match std::mem::replace(&mut self.state, WalkState::Off) {
            WalkState::Off => self.out.programmed(motion, source, Role::None),
            WalkState::Selected(selection) => {
                let leads = is_lead(motion, self.profile.select.lead);
                if leads && self.moves_in_plane(start, motion) {
                    self.open(selection, start, motion, source, None, false);
                } else {
                    let plane = self.plane;
                    if height(plane, motion.end) != height(plane, start) {
                        self.rules().off_plane_move(source, plane);
                    }
                    self.out.programmed(motion, source, Role::None);
                    self.state = WalkState::Selected(selection);
                }
            }
            WalkState::Active(active) => {
                let rises = shifts_z || height(self.plane, motion.end) != height(self.plane, start);
                self.active_motion(active, start, motion, source, rises);
            }
        }
    }

    fn active_motion(
        &mut self,
        mut active: Box<Active<'a>>,
        start: Position,
        motion: &'a Motion,
        source: Source,
        rises: bool,
    ) {
        let plane = active.span.plane;
        let leads = match (&active.cancel, &active.relink) {
            (Some(_), _) => is_lead(motion, self.profile.cancel.lead),
            (None, Some(_)) => is_lead(motion, self.profile.select.lead),
            (None, None) => false,
        };
        let is_only_up = rises && !self.shifts(start, motion);
        if leads && self.moves_in_plane(start, motion) && !is_only_up {
            self.off_plane_blocks(&mut active, source);
            if let Some((exit, _)) = active.cancel {
                let lead = self.lead(start, motion, source, exit);
                active.span.exit_corner = self.corner;
                self.rules().lead_off(&lead, plane, active.span.d_out_mm.abs());
                self.led_off_in = Some(source);
                self.close(*active, Exit::LeadOff(lead));
            } else if let Some((selection, exit)) = active.relink {
                let lead = self.lead(start, motion, source, exit);
                active.span.exit_corner = self.corner;
                let wall = self.close(*active, Exit::Link(lead));
                self.open(selection, start, motion, source, Some(wall), false);
            }
            return;
        }
        self.rules().wrong_arc_plane(source, motion, plane);
        match element(plane, start, motion).filter(|element| element.length() > 0.0) {
            Some(element) => {
                if rises {
                    self.rules().off_plane_move(source, plane);
                }
                self.rules().leg(source, motion, &element);
                let excess = self.off_plane_blocks(&mut active, source);
                active = match self.before_leg(active, excess, start, motion, source, &element) {
                    Some(active) => active,
                    None => return,
                };
                self.leg(&mut active, start, &element, motion, source);
            }
            None => {
                active.between.block(source);
                if rises {
                    if active.cancel.is_some()
                        && self.profile.cancel.before_off_plane.rule
                            == OffPlaneAfterCancel::LeadOffFirst
                    {
                        self.report.findings.push(rules::no_lead_off(source, self.profile));
                    } else {
                        self.rules().off_plane_move(source, plane);
                    }
                    active.push_item(source, ItemKind::OffPlane(*motion));
                }
            }
        }
        self.state = WalkState::Active(active);
    }

    /// Whether a motion counts as one in the plane: it moves there, or names one of its axes (S21).
    fn moves_in_plane(&self, start: Position, motion: &Motion) -> bool {
        let [u, v, _] = self.plane.axes();
        self.shifts(start, motion) || motion.axes.contains(u) || motion.axes.contains(v)
    }

    /// Whether a motion changes the position in the plane.
    fn shifts(&self, start: Position, motion: &Motion) -> bool {
        let [u, v, _] = self.plane.axes();
        let far = (motion.end[u] - start[u]).abs().max((motion.end[v] - start[v]).abs());
        far > LENGTH_MM * 1e-3
            || matches!(motion.shape, Shape::Arc(arc) if arc.turns > 0 && arc.plane == self.plane)
    }
}

/// Whether a motion in the plane can be a lead.
pub(super) fn is_lead(motion: &Motion, rule: LeadMove) -> bool {
    rule == LeadMove::Any || motion.class == MotionClass::Feed
}
