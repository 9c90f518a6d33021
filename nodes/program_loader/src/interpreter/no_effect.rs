//! Words of a block that have no effect here.

use super::{Interpreter, Scene, code_in_tenths};
use crate::no_effect::{NoEffect, RETRACT_TO_R};
use cnc_msgs::finding::Finding;

impl Interpreter<'_> {
    /// A word of the block has no effect here.
    #[cold]
    pub(super) fn has_no_effect(&mut self, scene: &Scene<'_>, at: usize, why: NoEffect) {
        let word = scene.block.words[at];
        let code = match word.letter {
            b'G' => code_in_tenths(word.value).unwrap_or_default(),
            letter => u16::MAX - u16::from(letter),
        };
        self.no_effects.add(code, why, scene.source_of(at), || match word.letter {
            // Whatever its values are.
            letter @ (b'F' | b'S' | b'Q') => char::from(letter).to_string(),
            _ => scene.quote(at),
        });
    }

    /// Words that have no effect, each once. `is_whole`: no cycle may follow what was read.
    pub(crate) fn no_effects(&self, is_whole: bool) -> impl Iterator<Item = Finding> {
        let may_return = self.has_returned.get() || !is_whole;
        self.no_effects.findings(may_return.then_some(RETRACT_TO_R))
    }
}
