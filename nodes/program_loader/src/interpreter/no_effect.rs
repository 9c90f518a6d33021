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
            letter @ (b'F' | b'S') => char::from(letter).to_string(),
            _ => scene.quote(at),
        });
    }

    /// Words that have no effect, each once.
    pub(crate) fn no_effects(&self) -> impl Iterator<Item = Finding> {
        self.no_effects.findings(self.has_returned.get().then_some(RETRACT_TO_R))
    }
}
