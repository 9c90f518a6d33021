//! G38.2 to G38.5: moves that end where a probe touches, or lets go.
//!
//! Where that is, a plan does not know. So the axes of a probe are not known after it, and can only be
//! moved from there by so much (G91), until a block names them absolutely, or a work offset is set there by the position (G10 L20), which is the
//! machine's to compute.

use super::axes::{Cause, Reliance};
use super::{Interpreter, Scene};
use crate::dialect::FeedMode;
use crate::limits::STAYS_MM;
use cnc_msgs::contour::{Action, MotionClass, Probe};
use cnc_msgs::finding::Code;
use cnc_msgs::geometry::Shape;

impl Interpreter<'_> {
    #[cold]
    pub(super) fn probe(&mut self, scene: &mut Scene<'_>, probe: Probe) {
        let word = probe.word();
        let end = self.end(scene);
        if let Some(since) = self.modal.compensation.selected_at() {
            let message = format!(
                "{word} under cutter radius compensation, which is on since line {}",
                since.line
            );
            let help = "cancel with G40 and a straight move before it";
            self.report_block(scene, Code::ForbiddenUnderCompensation, message, help);
        } else if self.modal.feed_mode != FeedMode::PerMinute {
            let message =
                format!("{word} needs a feed rate in units a minute, and G94 is not in force");
            let help = "write G94 and F into this block";
            self.report_block(scene, Code::ModalConflict, message, help);
        }
        let drifting = self.axes.drifting(end.relative);
        let is_sound = self.relies(scene, end.relative.without(drifting))
            & self.has_feed(scene, MotionClass::Feed);
        let from = self.axes.position;
        let stays = self.axes.rely_on(end.named.without(drifting)) == Reliance::Known
            && (0..3).all(|axis| (from[axis] - end.position[axis]).abs() < STAYS_MM);
        if stays && is_sound && !self.request.is_damaged {
            let message = format!("{word} ends where it begins");
            let help = "name a place beyond the one where the probe is to touch";
            self.report_block(scene, Code::BadNumber, message, help);
        }
        if self.arrive(&end) && is_sound {
            self.act_relative(drifting);
            self.act(Action::Probe(probe));
            self.add_to_bounds(from, Shape::Line, end.position, end.named);
            self.emit_motion(Shape::Line, end.position, MotionClass::Feed, end.named);
        }
        self.axes.drift(end.named, Cause { source: self.source, word });
    }

    #[cold]
    pub(super) fn probe_without_axes(&mut self, scene: &mut Scene<'_>, at: usize) {
        let message = format!("{} without X, Y or Z", scene.quote(at));
        let help = "name the axes that move, and how far they go at most";
        self.report_at(scene, at, Code::MissingWord, message, help);
    }
}
