//! G28, G30 and G53: moves whose end is unknown in the work frame.

use super::axes::Cause;
use super::moves::AXIS_WORDS;
use super::{Interpreter, Scene};
use crate::dialect::{Distance, FeedMode, GWord, Group, Mode};
use cnc_msgs::contour::{Action, MotionClass};
use cnc_msgs::finding::Code;
use cnc_msgs::further::{FurtherAxes, FurtherMode};
use cnc_msgs::geometry::{AxisSet, Shape};

impl Interpreter<'_> {
    /// G28 and G30: first to the programmed point, then home the named axes, or all.
    pub(super) fn reference(&mut self, scene: &mut Scene<'_>, second: bool, at: usize) {
        // Fanuc posts write G0 G91 G28 Z0: G0 is in force after it.
        let is_straight =
            |word| matches!(word, GWord::Motion(Mode::Rapid | Mode::Feed | Mode::Polar { .. }));
        if let Some((word, motion)) = self.request.g(Group::Motion)
            && !is_straight(word)
            && !self.request.has_refused_word
            && AXIS_WORDS.iter().any(|&letter| self.request.present.contains(letter))
        {
            let words = (scene.quote(at), scene.quote(motion));
            let message =
                format!("{} and {} both use the axis words of this block", words.0, words.1);
            let help = "write two blocks";
            self.report_at(scene, motion, Code::ModalConflict, message, help);
        }
        let further = self.further_values(scene);
        let mut via = self.end(scene);
        self.check_turned_reference(scene, via.named, at);
        let mut named = via.named;
        // G91 and 0: there is no point to go by.
        let is_direct = self.modal.distance == Distance::Incremental
            && further.iter().all(|(_, value)| value == 0.0);
        let is_plain = match named.is_empty() {
            true => further.is_empty() && !self.further.is_used(),
            false => further.is_empty() || is_direct,
        };
        if !is_plain {
            self.report_reference(scene, further, at);
        }
        // G91 G28 Z0 homes from any position.
        let stays = (0..3).filter(|&axis| {
            let letter = AXIS_WORDS[axis];
            via.relative.contains(axis) && self.request.value(letter) == Some(0.0)
        });
        let stays = stays.fold(AxisSet::NONE, AxisSet::with);
        via.named = via.named.without(stays);
        via.relative = via.relative.without(stays);
        let via = self.with_turned_axes(via);
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
            if !further.is_empty() {
                self.act_further(further, FurtherMode::Along);
            }
            self.act(Action::Reference { axes: named, second });
        }
        let word = if second { "G30" } else { "G28" };
        let cause = Cause { source: self.source, word };
        self.axes.lose(self.turned_axes(named), cause);
        self.further.lose(further, cause);
    }

    /// In a rotated work system, one of X and Y alone leads along neither of the axes.
    fn check_turned_reference(&mut self, scene: &mut Scene<'_>, named: AxisSet, at: usize) {
        if self.turned_axes(named) == named {
            return;
        }
        let word = scene.quote(at);
        let degrees = self.rotation(u32::from(self.modal.work_offset));
        let message = format!(
            "{word} of one of X and Y alone, and the work system is rotated by {degrees} degrees"
        );
        let help =
            "name both X and Y: the stored position is one of the machine, which is not rotated";
        self.report_at(scene, at, Code::Axes, message, help);
    }

    /// G28 and G30 take other axes with X, Y or Z, and by no point of their own.
    #[cold]
    fn report_reference(&mut self, scene: &mut Scene<'_>, further: FurtherAxes, at: usize) {
        let word = scene.quote(at);
        let (message, help) = match further.letters() {
            letters if letters.is_empty() => (
                format!("{word} without axes would also move axes besides X, Y and Z"),
                "name X, Y and Z, and move the others with G53 G0 in a block of their own",
            ),
            letters => (
                format!("{word} of {letters} is supported with G91, 0 and one of X, Y and Z alone"),
                "write G91 G28 Z0 A0 with your letters, or move it with G53 G0 in a block of its own",
            ),
        };
        self.further.poison(further);
        self.report_at(scene, at, Code::Unsupported, message, help);
    }

    /// G53.
    pub(super) fn machine_move(&mut self, scene: &mut Scene<'_>, at: usize) {
        let position = self.axes.position;
        let distance = std::mem::replace(&mut self.modal.distance, Distance::Absolute);
        let shift = std::mem::take(&mut self.modal.shift);
        let end = self.end(scene);
        let concerned = self.turned_axes(end.named);
        self.modal.shift = shift;
        self.modal.distance = distance;
        self.axes.position = position;
        let further = self.further_values(scene);
        if end.named.is_empty() && further.is_empty() && !self.request.has_refused_word {
            let message = "G53 without X, Y or Z".to_owned();
            let help = "name the axes that move, or delete G53: it acts in its own block alone";
            return self.report_at(scene, at, Code::MissingWord, message, help);
        }
        let rapid = match self.modal.mode {
            Some(Mode::Rapid) => true,
            Some(Mode::Feed) => false,
            _ if self.modal.mode_is_poisoned => return self.axes.poison(concerned),
            _ => {
                self.axes.poison(concerned);
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
            self.axes.poison(concerned);
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
            self.axes.poison(concerned);
            return self.report_at(scene, at, Code::ModalConflict, message, help);
        }
        if !rapid && !further.is_empty() {
            let letters = further.letters();
            let message = format!("how fast {letters} moves by G53 with G1 is not known");
            let help = format!("move {letters} with G53 and G0");
            self.further.poison(further);
            return self.report_at(scene, at, Code::Unsupported, message, &help);
        }
        let class = if rapid { MotionClass::Rapid } else { MotionClass::Feed };
        if !rapid && self.has_feed_of_radius() && end.named.contains(0) {
            let message =
                "how fast X moves by G53 with G1 depends on how far it is from X0 (G95 under G96)";
            let help = "move X with G53 and G0, or write G94 and F before it";
            return self.report_at(scene, at, Code::Unsupported, message.to_owned(), help);
        }
        self.feed_at_surface(class, self.axes.position, self.axes.position, None);
        if self.has_feed(scene, class) && !self.request.is_damaged {
            let mut target = [0.0; 3];
            for axis in (0..3).filter(|&axis| end.named.contains(axis)) {
                target[axis] = end.position[axis];
            }
            let feed_mm_per_min = if rapid { 0.0 } else { self.modal.feed_mm_per_min };
            if !further.is_empty() {
                self.act_further(further, FurtherMode::Along);
            }
            self.act(Action::MachineMove { target, axes: end.named, rapid, feed_mm_per_min });
        }
        let cause = Cause { source: self.source, word: "G53" };
        self.axes.lose(concerned, cause);
        self.further.lose(further, cause);
    }
}
