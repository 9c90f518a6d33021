//! G28, G30 and G53: moves whose end is unknown in the work frame.

use super::axes::Cause;
use super::moves::AXIS_WORDS;
use super::{Interpreter, Scene};
use crate::dialect::{Distance, FeedMode, Group, Mode};
use cnc_msgs::contour::{Action, MotionClass};
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::{AxisSet, Shape};

impl Interpreter<'_> {
    /// G28 and G30: first to the programmed point, then home the named axes, or all.
    pub(super) fn reference(&mut self, scene: &mut Scene<'_>, second: bool, at: usize) {
        if let Some((_, motion)) = self.request.g(Group::Motion)
            && !self.request.has_refused_word
            && AXIS_WORDS.iter().any(|&letter| self.request.present.contains(letter))
        {
            let words = (scene.quote(at), scene.quote(motion));
            let message =
                format!("{} and {} both use the axis words of this block", words.0, words.1);
            let help = "write two blocks";
            self.report_at(scene, motion, Code::ModalConflict, message, help);
        }
        let mut via = self.end(scene);
        let mut named = via.named;
        // G91 G28 Z0 homes from any position.
        let stays = (0..3).filter(|&axis| {
            let letter = AXIS_WORDS[axis];
            via.relative.contains(axis) && self.request.value(letter) == Some(0.0)
        });
        let stays = stays.fold(AxisSet::NONE, AxisSet::with);
        via.named = via.named.without(stays);
        via.relative = via.relative.without(stays);
        let is_sound = self.relies(scene, via.relative);
        let arrives = self.arrive(&via);
        if named.is_empty() {
            named = AxisSet::ALL;
        }
        if arrives && is_sound {
            if !via.named.is_empty() {
                self.add_to_bounds(via.position, Shape::Line, via.position, via.named);
                self.emit_motion(Shape::Line, via.position, MotionClass::Rapid, via.named);
            }
            self.act(Action::Reference { axes: named, second });
        }
        let word = if second { "G30" } else { "G28" };
        self.axes.lose(named, Cause { source: self.source, word });
    }

    /// G53.
    pub(super) fn machine_move(&mut self, scene: &mut Scene<'_>, at: usize) {
        let position = self.axes.position;
        let distance = std::mem::replace(&mut self.modal.distance, Distance::Absolute);
        let shift = std::mem::take(&mut self.modal.shift);
        let end = self.end(scene);
        self.modal.shift = shift;
        self.modal.distance = distance;
        self.axes.position = position;
        let rapid = match self.modal.mode {
            Some(Mode::Rapid) => true,
            Some(Mode::Feed) => false,
            _ if self.modal.mode_is_poisoned => return self.axes.poison(end.named),
            _ => {
                self.axes.poison(end.named);
                self.request.has_refused_word = true;
                let message = "G53 works with G0 and G1 only".to_owned();
                return self.report_at(
                    scene,
                    at,
                    Code::ModalConflict,
                    message,
                    "write G0 into this block",
                );
            }
        };
        if distance == Distance::Incremental {
            self.axes.poison(end.named);
            let message = "G53 needs absolute coordinates, and G91 is in force".to_owned();
            return self.report_at(
                scene,
                at,
                Code::ModalConflict,
                message,
                "write G90 into this block",
            );
        }
        if !rapid && self.modal.feed_mode == FeedMode::InverseTime {
            let message = "the length of a G53 move is not known, and G93 is in force".to_owned();
            let help = "write G94 and F with mm/min before it, or G0";
            self.axes.poison(end.named);
            return self.report_at(scene, at, Code::ModalConflict, message, help);
        }
        if end.named.is_empty() && !self.request.has_refused_word {
            let message = "G53 without X, Y or Z".to_owned();
            return self.report_at(
                scene,
                at,
                Code::MissingWord,
                message,
                "name the axes that move",
            );
        }
        let class = if rapid { MotionClass::Rapid } else { MotionClass::Feed };
        if self.has_feed(scene, class) && !self.request.is_damaged {
            let mut target = [0.0; 3];
            for axis in (0..3).filter(|&axis| end.named.contains(axis)) {
                target[axis] = end.position[axis];
            }
            let feed_mm_per_min = if rapid { 0.0 } else { self.modal.feed_mm_per_min };
            self.act(Action::MachineMove { target, axes: end.named, rapid, feed_mm_per_min });
        }
        self.axes.lose(end.named, Cause { source: self.source, word: "G53" });
    }
}
