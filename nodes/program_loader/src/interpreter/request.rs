//! The words of one block, sorted by what they ask for.
//!
//! Knows which words exclude each other in a block, but not what they do.

use super::Scene;
use super::polar_words::PolarWords;
use super::refusals::{Elsewhere, of_g, of_m};
use crate::block::Word;
use crate::dialect::{GWord, Group, Letters, MWord, automation1};
use crate::limits::CODE_FUZZ;
use cnc_msgs::contour::{Approach, CoolantMode, OutsideCorner};
use cnc_msgs::finding::Code;

const M_WORDS_MAX: usize = 12;

/// What one block asks for. Reused for each block: only values named by the masks are valid.
#[derive(Debug, Clone)]
pub(super) struct Request {
    /// Letters with a value: all except G, M and N.
    pub(super) present: Letters,
    values: [f64; 26],
    words: [u8; 26],
    groups: u32,
    g: [GWord; Group::COUNT],
    g_words: [u8; Group::COUNT],
    m: [(MWord, u16, u8); M_WORDS_MAX],
    m_count: usize,
    pub(super) corner: Option<OutsideCorner>,
    pub(super) approach: Option<Approach>,
    /// Part of the block was rejected: it must not move.
    pub(super) is_damaged: bool,
    /// A word was rejected that may have used other words of the block.
    pub(super) has_refused_word: bool,
    /// A G or @ word was rejected: letters without a meaning here may belong to it.
    pub(super) has_refused_code: bool,
    /// Words whose letters have no meaning, or occur a second time.
    pub(super) doubtful: Vec<usize>,
    pub(super) polar: PolarWords,
}

impl Default for Request {
    fn default() -> Self {
        Self {
            present: Letters::NONE,
            values: [0.0; 26],
            words: [0; 26],
            groups: 0,
            g: [GWord::Unknown; Group::COUNT],
            g_words: [0; Group::COUNT],
            m: [(MWord::Unknown, 0, 0); M_WORDS_MAX],
            m_count: 0,
            corner: None,
            approach: None,
            is_damaged: false,
            has_refused_word: false,
            has_refused_code: false,
            doubtful: Vec::new(),
            polar: [None; 2],
        }
    }
}

impl Request {
    /// Sorts the words of a block.
    pub(super) fn read(&mut self, scene: &mut Scene<'_>) {
        self.present = Letters::NONE;
        self.groups = 0;
        self.m_count = 0;
        (self.corner, self.approach) = (None, None);
        self.is_damaged = scene.block.is_damaged;
        self.has_refused_word = scene.block.is_damaged;
        self.has_refused_code = false;
        self.doubtful.clear();
        self.polar = [None; 2];
        for at in 0..scene.block.words.len() {
            let word = scene.block.words[at];
            match word.letter {
                b'G' => self.g_word(scene, word, at),
                b'M' => self.m_word(scene, word, at),
                b'@' | b'^' if scene.rules.dialect.lexer.parameters => {
                    self.polar_word(scene, word, at);
                }
                b'@' if scene.rules.dialect.lexer.calls => self.called(scene, word, at),
                b'@' => self.at_word(scene, word, at),
                _ => self.value_word(scene, word, at),
            }
        }
        if !self.doubtful.is_empty() {
            self.doubtful_words(scene);
        }
    }

    /// `@` or `^`.
    #[cold]
    fn polar_word(&mut self, scene: &mut Scene<'_>, word: Word, at: usize) {
        let place = &mut self.polar[usize::from(word.letter == b'^')];
        if place.is_some() {
            let message = format!("{} twice in one block", char::from(word.letter));
            return self.refuse(scene, at, Code::ModalConflict, message, "write two blocks");
        }
        *place = Some((word.value, at));
    }

    /// Gives a letter that the block does not have a value, from the word at an index.
    pub(super) fn set(&mut self, letter: u8, value: f64, at: usize) {
        self.present = self.present.union(Letters::of(&[letter]));
        self.values[usize::from(letter - b'A')] = value;
        self.words[usize::from(letter - b'A')] = at as u8;
    }

    /// Whether the block has a G or M word.
    pub(super) fn has_codes(&self) -> bool {
        self.groups != 0 || self.m_count != 0
    }

    /// Whether the block has only axis words, F and a motion word.
    #[inline]
    pub(super) fn is_plain(&self) -> bool {
        const PLAIN: Letters = Letters::of(b"XYZIJKRF");
        self.groups & !(1 << Group::Motion as u32) == 0
            && self.m_count == 0
            && self.present.without(PLAIN).is_empty()
    }

    /// The value of a letter that is present; NaN if it could not be read.
    #[inline]
    pub(super) fn value(&self, letter: u8) -> Option<f64> {
        self.present.contains(letter).then(|| self.values[usize::from(letter - b'A')])
    }

    /// The index in the block of a letter that is present.
    #[inline]
    pub(super) fn word(&self, letter: u8) -> usize {
        usize::from(self.words[usize::from(letter - b'A')])
    }

    /// The G word of a group, and its index in the block.
    #[inline]
    pub(super) fn g(&self, group: Group) -> Option<(GWord, usize)> {
        let at = group as usize;
        (self.groups & 1 << at != 0).then(|| (self.g[at], usize::from(self.g_words[at])))
    }

    /// The index in the block of the G word of a group that is present.
    pub(super) fn g_place(&self, group: Group) -> usize {
        usize::from(self.g_words[group as usize])
    }

    /// The M words: meaning, number, index in the block.
    #[inline]
    pub(super) fn m(&self) -> impl Iterator<Item = (MWord, u16, usize)> + use<'_> {
        (0..self.m_count).map_while(|index| self.m_at(index))
    }

    /// One of the M words.
    #[inline]
    pub(super) fn m_at(&self, index: usize) -> Option<(MWord, u16, usize)> {
        let (meaning, number, at) = *self.m[..self.m_count].get(index)?;
        Some((meaning, number, usize::from(at)))
    }

    /// The letters that belong to G words without effect.
    #[inline]
    pub(super) fn letters_of_accepted(&self) -> Letters {
        match self.g(Group::Path) {
            Some((GWord::NoEffect(_, letters, _), _)) => letters,
            _ => Letters::NONE,
        }
    }

    #[inline]
    fn value_word(&mut self, scene: &mut Scene<'_>, word: Word, at: usize) {
        let letter = word.letter;
        let dialect = scene.rules.dialect;
        if !dialect.letters.contains(letter) {
            return self.doubtful.push(at);
        }
        if self.present.contains(letter) {
            return self.doubtful.push(at);
        }
        self.present = self.present.union(Letters::of(&[letter]));
        self.values[usize::from(letter - b'A')] = word.value;
        self.words[usize::from(letter - b'A')] = at as u8;
    }

    #[inline]
    fn g_word(&mut self, scene: &mut Scene<'_>, word: Word, at: usize) {
        let Some(tenths) = code_in_tenths(word.value) else {
            return self.no_code(scene, word, at);
        };
        let meaning = (scene.rules.dialect.g)(tenths);
        if scene.under_compensation.is_some()
            && scene.rules.forbids(b'G', tenths)
            && meaning != GWord::Plane(scene.plane)
            && self.forbidden(scene, at, of_g(meaning))
        {
            return;
        }
        let Some(group) = meaning.group() else {
            return self.unusual_g(scene, tenths, meaning, at);
        };
        if let GWord::RefusedMotion(help) = meaning {
            self.has_refused_code = true;
            self.not_done(scene, at, help);
        }
        if self.claim(scene, group, at) {
            self.g[group as usize] = meaning;
        }
    }

    /// Claims a modal group for a word; another word of the group is a conflict.
    #[inline]
    fn claim(&mut self, scene: &mut Scene<'_>, group: Group, at: usize) -> bool {
        let index = group as usize;
        if self.groups & 1 << index != 0 {
            self.exclude(scene, usize::from(self.g_words[index]), at);
            return false;
        }
        self.groups |= 1 << index;
        self.g_words[index] = at as u8;
        true
    }

    #[cold]
    fn unusual_g(&mut self, scene: &mut Scene<'_>, tenths: u16, meaning: GWord, at: usize) {
        if let GWord::Refused(help) = meaning {
            self.has_refused_code = true;
            return self.not_done(scene, at, help);
        }
        if let Some(corner) = scene.rules.corner(tenths) {
            if self.claim(scene, Group::Corner, at) {
                self.corner = Some(corner);
            }
        } else if let Some(approach) = scene.rules.approach(tenths) {
            if self.claim(scene, Group::Approach, at) {
                self.approach = Some(approach);
            }
        } else {
            self.has_refused_code = true;
            self.unknown(scene, at);
        }
    }

    #[inline]
    fn m_word(&mut self, scene: &mut Scene<'_>, word: Word, at: usize) {
        let Some(tenths) = code_in_tenths(word.value).filter(|tenths| tenths % 10 == 0) else {
            return self.no_code(scene, word, at);
        };
        if scene.under_compensation.is_some()
            && scene.rules.forbids(b'M', tenths)
            && self.forbidden(scene, at, of_m((scene.rules.dialect.m)(tenths / 10)))
        {
            return;
        }
        let number = tenths / 10;
        let meaning = (scene.rules.dialect.m)(number);
        match meaning {
            MWord::Refused(help) => return self.not_done(scene, at, help),
            MWord::Unknown => return self.unknown(scene, at),
            _ => {}
        }
        let rival = self.m().find(|&(other, other_number, _)| {
            other_number == number
                || excludes(other, meaning)
                || machine_group(other, other_number).is_some()
                    && machine_group(other, other_number) == machine_group(meaning, number)
        });
        if let Some((_, _, rival)) = rival {
            return self.exclude(scene, rival, at);
        }
        if self.m_count == M_WORDS_MAX {
            let message = format!("more than {M_WORDS_MAX} M words in one block");
            return self.refuse(scene, at, Code::Limit, message, "write two blocks");
        }
        self.m[self.m_count] = (meaning, number, at as u8);
        self.m_count += 1;
    }

    /// A call that has no G word.
    #[cold]
    fn called(&mut self, scene: &mut Scene<'_>, word: Word, at: usize) {
        let meaning = automation1::called(word.value);
        // The rules for G44 hold for the call that does the same.
        if meaning == GWord::SetAxes
            && scene.under_compensation.is_some()
            && scene.rules.forbids(b'G', 440)
            && self.forbidden(scene, at, Elsewhere::Done)
        {
            return;
        }
        if let Some(group) = meaning.group()
            && self.claim(scene, group, at)
        {
            self.g[group as usize] = meaning;
        }
    }

    /// `@` functions of the 840C.
    #[cold]
    fn at_word(&mut self, scene: &mut Scene<'_>, word: Word, at: usize) {
        // @714 stops reading ahead; it has no effect, because the whole program is read first.
        const STOP_READING_AHEAD: u16 = 7140;
        const CALCULATIONS: &str = "write calculations and jumps out as plain blocks";
        match code_in_tenths(word.value) {
            None => self.no_code(scene, word, at),
            Some(tenths)
                if scene.under_compensation.is_some() && scene.rules.forbids(b'@', tenths) =>
            {
                let elsewhere = match tenths {
                    STOP_READING_AHEAD => Elsewhere::Done,
                    _ => Elsewhere::Refused(CALCULATIONS),
                };
                let _ = self.forbidden(scene, at, elsewhere);
            }
            Some(STOP_READING_AHEAD) => {}
            Some(_) => {
                let message = format!("{} is not supported", scene.quote(at));
                let help = CALCULATIONS;
                self.has_refused_code = true;
                self.refuse(scene, at, Code::Unsupported, message, help);
            }
        }
    }
}

/// Whether two M words cannot be in one block. Mist and flood can.
fn excludes(one: MWord, other: MWord) -> bool {
    match (one, other) {
        (
            MWord::Stop { .. } | MWord::ProgramEnd { .. },
            MWord::Stop { .. } | MWord::ProgramEnd { .. },
        )
        | (MWord::ProgramEnd { .. } | MWord::EndProgram, MWord::CallProgram | MWord::EndProgram)
        | (MWord::CallProgram, MWord::ProgramEnd { .. } | MWord::EndProgram)
        | (MWord::EndProgram, MWord::ProgramEnd { .. })
        | (MWord::ChangeTool, MWord::NameTool)
        | (MWord::NameTool, MWord::ChangeTool) => true,
        (MWord::Coolant(one), MWord::Coolant(other)) => {
            one == CoolantMode::Off || other == CoolantMode::Off
        }
        _ => false,
    }
}

/// The modal group of words that only the machine knows, as LinuxCNC numbers it: two of one group exclude each other.
const fn machine_group(meaning: MWord, number: u16) -> Option<u8> {
    match (meaning, number) {
        (MWord::Machine, 62..=68) => Some(5),
        (MWord::Spindle(_), _) | (MWord::Machine, 19) => Some(7),
        (MWord::Machine, 48..=53) => Some(9),
        (MWord::Machine, 100..=199) => Some(10),
        _ => None,
    }
}

/// A G or M number in tenths: 41.1 is 411. `None` if it is not a code.
#[inline]
pub(crate) fn code_in_tenths(value: f64) -> Option<u16> {
    let tenths = value * 10.0;
    let near = tenths.round();
    ((0.0..=9999.0).contains(&near) && (tenths - near).abs() < CODE_FUZZ).then_some(near as u16)
}
