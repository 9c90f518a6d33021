//! The blocks of the subroutine that has the profile of a lathe cycle.
//!
//! G0 counts as G1, and F and S have no effect, as in LinuxCNC. U and W count from the end of the motion before, A and
//! C round and bevel the end of a motion.

use super::moves::AXIS_WORDS;
use super::turning::AXES;
use super::{Interpreter, Scene};
use crate::dialect::{Distance, Letters, Mode};
use crate::limits::COORDINATE_MM_MAX;
use crate::no_effect::PROFILE;
use crate::turning::{Bevel, Circle, Corner, Piece, Point};
use cnc_msgs::finding::Code;

/// Motions of a profile: more than any that is written, and few enough to compare each with each.
const MOTIONS_MAX: usize = 1000;

impl Interpreter<'_> {
    /// Reads one block of a profile.
    #[cold]
    pub(super) fn profile_block(&mut self, scene: &mut Scene<'_>) {
        let Some(mut profile) = self.profile.take() else { return };
        self.refuse_in_profile(scene, &profile.word, profile.source);
        for letter in [b'F', b'S'] {
            if self.take(letter).is_some() {
                self.has_no_effect(scene, self.request.word(letter), PROFILE);
            }
        }
        if let Some((piece, bevel)) = self.profile_motion(scene, profile.has_begun)
            && !self.request.is_damaged
        {
            self.axes.position[AXES[0]] = piece.to[0];
            self.axes.position[AXES[1]] = piece.to[1];
            if profile.has_begun {
                let origin = profile.motions.len();
                profile.motions.push(Corner { piece: Piece { origin, ..piece }, bevel });
                profile.sources.push(self.source);
            }
            profile.has_begun = true;
            if profile.motions.len() > MOTIONS_MAX {
                profile.motions.pop();
                if !profile.is_damaged {
                    let message = format!("the profile has more than {MOTIONS_MAX} motions");
                    let help = "divide the profile, or write arcs in place of many short lines";
                    self.report_block(scene, Code::Limit, message, help);
                }
            }
        }
        self.unused_words(scene);
        profile.is_damaged |= self.request.is_damaged || scene.block.is_cut;
        self.profile = Some(profile);
    }

    /// The motion of a block, and what is at its end; `None` where it has none, or after an error.
    fn profile_motion(
        &mut self,
        scene: &mut Scene<'_>,
        has_begun: bool,
    ) -> Option<(Piece, Option<Bevel>)> {
        const MOVES: Letters = Letters::of(b"XYZUWIKR");
        let mode = self.profile_mode();
        let end = self.profile_end(scene);
        let bevel = self.bevel(scene);
        if self.request.present.intersection(MOVES).is_empty() {
            if bevel.is_some() {
                let letter = if self.request.present.contains(b'A') { b'A' } else { b'C' };
                let message = "a fillet or chamfer without a motion".to_owned();
                let help = "write it into the block of the motion that ends there";
                self.report(scene, letter, Code::MissingWord, message, help);
            }
            return None;
        }
        let from = AXES.map(|axis| self.axes.position[axis]);
        let Some(mode) = mode else {
            let message = "axis words, but neither G0, G1, G2 nor G3 is in force".to_owned();
            let help = "write G0 or G1 into this block";
            self.report_block(scene, Code::MissingWord, message, help);
            return None;
        };
        let Mode::Arc { clockwise } = mode else {
            let is_first = !has_begun && bevel.is_some();
            if is_first {
                self.begins_wrong(scene);
            }
            return Some((Piece { from, to: end, circle: None, origin: 0 }, bevel));
        };
        if !has_begun {
            self.begins_wrong(scene);
        }
        let turns = self.turns(scene);
        let resolved = self.center(scene, AXES, from, end, clockwise)?;
        if resolved.is_full_circle || turns != Some(1) {
            let message = "the profile has an arc of a full turn".to_owned();
            let help = "correct the end of the arc, or P";
            self.report_block(scene, Code::BadNumber, message, help);
        }
        let circle = Circle { center: resolved.center, counterclockwise: !clockwise };
        Some((Piece::arc(from, end, circle, 0), bevel))
    }

    #[cold]
    fn begins_wrong(&mut self, scene: &mut Scene<'_>) {
        let message = "the first motion of a profile is not only a straight one".to_owned();
        let help = "begin with G0 to the first point of the profile";
        self.report_block(scene, Code::BadNumber, message, help);
    }

    /// Z and X at the end of a motion.
    fn profile_end(&mut self, scene: &mut Scene<'_>) -> Point {
        let end = self.end(scene);
        let mut position = end.position;
        if end.named.contains(1) {
            let help = "leave it out: the profile is in X and Z";
            self.report(scene, b'Y', Code::Axes, "Y in a profile".to_owned(), help);
        }
        for (letter, axis) in [(b'U', 0), (b'W', 2)] {
            let scale = self.scale_of(axis);
            let Some(by) = self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm") else {
                continue;
            };
            let [name, of] = [letter, AXIS_WORDS[axis]].map(char::from);
            if end.named.contains(axis) {
                let message = format!("{name} and {of} in one block");
                let help = "write one of them";
                self.report(scene, letter, Code::ModalConflict, message, help);
            } else if self.modal.distance == Distance::Incremental {
                let message = format!("{name} while G91 is in force");
                let help = format!("write {of}, which counts from the last point under G91");
                self.report(scene, letter, Code::ModalConflict, message, &help);
            }
            position[axis] = self.axes.position[axis] + by;
            if position[axis].abs() > COORDINATE_MM_MAX {
                let message = format!("{of} leads beyond {COORDINATE_MM_MAX} mm");
                let help = "look for a missing decimal point";
                self.report(scene, letter, Code::Limit, message, help);
            }
        }
        AXES.map(|axis| position[axis])
    }

    /// A and C.
    fn bevel(&mut self, scene: &mut Scene<'_>) -> Option<Bevel> {
        let scale = self.scale();
        let [fillet, chamfer] = [b'A', b'C'].map(|letter| {
            let size = self.take_within(scene, letter, scale, COORDINATE_MM_MAX, "mm");
            if size <= Some(0.0) && size.is_some() {
                let message = format!("{} is not above 0", scene.quote(self.request.word(letter)));
                let help = "write the radius of the fillet, or delete the word";
                self.report(scene, letter, Code::BadNumber, message, help);
            }
            size
        });
        if fillet.is_some() && chamfer.is_some() {
            let message = "A and C in one block".to_owned();
            let help = "write A for a fillet or C for a chamfer";
            self.report(scene, b'C', Code::ModalConflict, message, help);
        }
        fillet.map(Bevel::Fillet).or(chamfer.map(Bevel::Chamfer))
    }
}
