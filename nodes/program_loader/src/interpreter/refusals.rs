//! The findings for words that a block must not have.
//!
//! `request` decides what is rejected; this file has only the texts.

use super::Scene;
use super::request::Request;
use crate::block::Word;
use crate::dialect::{GWord, MWord};
use cnc_msgs::finding::{Code, Finding};

/// What a word that is forbidden under compensation does without compensation.
#[derive(Debug, Clone, Copy)]
pub(super) enum Elsewhere {
    Done,
    /// It is rejected with this help.
    Refused(&'static str),
    Unknown,
}

pub(super) fn of_g(meaning: GWord) -> Elsewhere {
    match meaning {
        GWord::Refused(help) | GWord::RefusedMotion(help) => Elsewhere::Refused(help),
        // The profile defines the words of corners and approaches, and no profile forbids them.
        GWord::Unknown => Elsewhere::Unknown,
        _ => Elsewhere::Done,
    }
}

pub(super) fn of_m(meaning: MWord) -> Elsewhere {
    match meaning {
        MWord::Refused(help) => Elsewhere::Refused(help),
        MWord::Unknown => Elsewhere::Unknown,
        _ => Elsewhere::Done,
    }
}

impl Request {
    fn letter_twice(&mut self, scene: &mut Scene<'_>, letter: u8, at: usize) {
        let message = format!("{} twice in one block", char::from(letter));
        let help = "a block takes each letter but G and M once; write two blocks";
        self.refuse(scene, at, Code::ModalConflict, message, help);
    }

    /// Reports letters that the control does not have, or that occur twice. Not if the block has a
    /// rejected word: they may belong to it, and it is the one cause.
    #[cold]
    pub(super) fn doubtful_words(&mut self, scene: &mut Scene<'_>) {
        if self.has_refused_code {
            return;
        }
        for at in std::mem::take(&mut self.doubtful) {
            let word = scene.block.words[at];
            if scene.rules.dialect.letters.contains(word.letter) {
                self.letter_twice(scene, word.letter, at);
            } else {
                self.unknown_letter(scene, word, at);
            }
        }
    }

    fn unknown_letter(&mut self, scene: &mut Scene<'_>, word: Word, at: usize) {
        let letter = char::from(word.letter);
        if word.value.is_nan() {
            return;
        }
        if scene.rules.dialect.foreign_axes.contains(word.letter) {
            let message = format!("{letter} is not an axis of this machine");
            let help = if scene.rules.dialect.letters.contains(b'Y') {
                "post the program for three axes: X, Y and Z"
            } else {
                "post the program for two axes: X and Z"
            };
            return self.refuse(scene, at, Code::Axes, message, help);
        }
        self.unknown(scene, at);
    }

    /// Checks a word that may be forbidden under compensation; returns whether it was rejected.
    #[cold]
    pub(super) fn forbidden(
        &mut self,
        scene: &mut Scene<'_>,
        at: usize,
        elsewhere: Elsewhere,
    ) -> bool {
        let Some(since) = scene.under_compensation else { return false };
        let word = scene.quote(at);
        let message = format!(
            "{word} must not stand under cutter radius compensation, which is on since line {}",
            since.line
        );
        let help = match elsewhere {
            Elsewhere::Done => format!(
                "cancel with G40 and a straight move before line {}, program {word}, then select again",
                scene.line.number
            ),
            Elsewhere::Refused(help) => {
                format!("delete {word}, which is not supported without compensation either; {help}")
            }
            Elsewhere::Unknown => {
                format!("delete {word}, which {} does not have", scene.rules.control)
            }
        };
        let mut finding =
            Finding::error(Code::ForbiddenUnderCompensation, scene.source_of(at), message);
        finding.other = Some(since);
        finding.severity = scene.rules.forbidden_severity;
        let is_refused = finding.is_error();
        self.is_damaged |= is_refused;
        self.has_refused_word |= is_refused;
        scene.findings.push(finding.help(help));
        is_refused
    }

    /// Reports a G or M number that no code has.
    #[cold]
    pub(super) fn no_code(&mut self, scene: &mut Scene<'_>, word: Word, at: usize) {
        self.is_damaged = true;
        self.has_refused_word = true;
        if !word.value.is_nan() {
            let message = format!("{} has no word {}", scene.rules.control, scene.quote(at));
            let help = "G and M take numbers from 0 to 999; G with one place after the point";
            self.refuse(scene, at, Code::UnknownWord, message, help);
        }
    }

    /// Reports a word of another control.
    #[cold]
    pub(super) fn unknown(&mut self, scene: &mut Scene<'_>, at: usize) {
        let message = format!("{} has no word {}", scene.rules.control, scene.quote(at));
        let word = scene.block.words[at];
        let instead = match scene.rules.dialect.lexer.parameters {
            true => instead(word.letter, word.value),
            false => None,
        };
        let help = "delete it, or choose the control that the program was written for";
        self.refuse(scene, at, Code::UnknownWord, message, instead.unwrap_or(help));
    }

    #[cold]
    pub(super) fn not_done(&mut self, scene: &mut Scene<'_>, at: usize, help: &str) {
        let message = format!("{} is not supported", scene.quote(at));
        self.refuse(scene, at, Code::Unsupported, message, help);
    }

    /// Reports two words that exclude each other in a block.
    #[cold]
    pub(super) fn exclude(&mut self, scene: &mut Scene<'_>, first: usize, at: usize) {
        let (first, second) = (scene.quote(first), scene.quote(at));
        let message = format!("{first} and {second} exclude each other in one block");
        let help = "delete one of them, or write two blocks";
        self.refuse(scene, at, Code::ModalConflict, message, help);
    }

    #[cold]
    pub(super) fn refuse(
        &mut self,
        scene: &mut Scene<'_>,
        at: usize,
        code: Code,
        message: String,
        help: &str,
    ) {
        self.is_damaged = true;
        self.has_refused_word = true;
        scene.findings.push(Finding::error(code, scene.source_of(at), message).help(help));
    }
}

/// What RS-274 has in the place of a word that posts of other controls write.
fn instead(letter: u8, value: f64) -> Option<&'static str> {
    const INSTEAD: [(u8, f64, &str); 8] = [
        (b'G', 31.0, "probe with G38.2"),
        (b'G', 50.0, "delete it; the highest speed under G96 is its D"),
        (b'G', 54.1, "select one of G54 to G59.3"),
        (b'G', 65.0, "write a subroutine, o<name> sub, and call it with o<name> call"),
        (b'G', 68.0, "rotate the work system with G10 L2 P R, or post rotated"),
        (b'G', 187.0, "delete it; how closely corners are cut is a setting of the controller"),
        (b'M', 10.0, "delete it; outputs are switched with M64 and M65"),
        (b'M', 11.0, "delete it; outputs are switched with M64 and M65"),
    ];
    INSTEAD.iter().find(|it| it.0 == letter && it.1 == value).map(|it| it.2)
}
