//! The rules that the loader takes from a control profile.
//!
//! Words and planes; rules that need geometry are the planner's.

use cnc_msgs::contour::{Approach, OutsideCorner, Source};
use cnc_msgs::finding::{Code, Finding, Severity};
use cnc_msgs::profile::{LengthOfD, Profile, RadiusKind, ZeroOffset};

use crate::dialect::{self, Dialect, Letters, RadiusWord};

#[derive(Debug)]
pub(crate) struct Rules<'p> {
    pub(crate) dialect: &'static Dialect,
    /// The name of the control.
    pub(crate) control: &'p str,
    /// X words are diameters.
    pub(crate) x_is_diameter: bool,
    /// Where G41 takes its radius from.
    pub(crate) radius_word: RadiusWord,
    /// How strict a selection without such a word is treated.
    pub(crate) no_radius: Severity,
    /// The letters of a block that calls a program with a word of its own.
    pub(crate) call_letters: Letters,
    /// What D0 does.
    pub(crate) d0: ZeroOffset,
    /// Whether D selects a length as well (S34).
    pub(crate) d_selects_length: bool,
    /// By G number in tenths.
    corners: Vec<(u16, OutsideCorner)>,
    approaches: Vec<(u16, Approach)>,
    /// Letter and number in tenths.
    forbidden: Vec<(u8, u16)>,
    /// How strict a forbidden word is treated.
    pub(crate) forbidden_severity: Severity,
}

impl<'p> Rules<'p> {
    /// Reads the words of a profile; returns a finding for each text that is not a word.
    pub(crate) fn of(profile: &'p Profile) -> (Self, Vec<Finding>) {
        let mut wrong = Vec::new();
        let mut number = |word: &str, letters: &[u8], key: &str| {
            let parsed = parse(word).filter(|(letter, _)| letters.contains(letter));
            if parsed.is_none() {
                let message =
                    format!("profile {}: `{word}` under {key} is not a word", profile.name);
                wrong.push(
                    Finding::error(Code::UnknownWord, Source::default(), message)
                        .help("correct the profile; words are written like G54"),
                );
            }
            parsed
        };
        let corner_words = profile.corner.words.iter();
        let corners = corner_words
            .filter_map(|(word, &corner)| Some((number(word, b"G", "corner.words")?.1, corner)))
            .collect();
        let approach_words = profile.select.words.iter();
        let approaches = approach_words
            .filter_map(|(word, &approach)| Some((number(word, b"G", "select.words")?.1, approach)))
            .collect();
        let forbidden_words = profile.forbidden_under_compensation.words.iter();
        let forbidden = forbidden_words
            .filter_map(|word| number(word, b"GM@", "forbidden_under_compensation"))
            .collect();
        let dialect = dialect::of(profile.language.dialect);
        let call = dialect.lexer.programs.and_then(|programs| programs.call);
        let rules = Self {
            dialect,
            call_letters: call.map_or(Letters::NONE, |(word, times)| Letters::of(&[word, times])),
            control: &profile.name,
            x_is_diameter: profile.language.x_is_diameter,
            radius_word: radius_word(profile),
            no_radius: profile.radius.source.severity(),
            d0: profile.d0,
            d_selects_length: profile.radius.length_of_d == LengthOfD::WithZ,
            corners,
            approaches,
            forbidden,
            forbidden_severity: profile.forbidden_under_compensation.strictness.severity(),
        };
        (rules, wrong)
    }

    pub(crate) fn corner(&self, tenths: u16) -> Option<OutsideCorner> {
        find(&self.corners, tenths)
    }

    pub(crate) fn approach(&self, tenths: u16) -> Option<Approach> {
        find(&self.approaches, tenths)
    }

    /// Whether a word is forbidden in a block under compensation.
    pub(crate) fn forbids(&self, letter: u8, tenths: u16) -> bool {
        self.forbidden.contains(&(letter, tenths))
    }
}

/// The profile decides what D and P mean, if the language has them.
fn radius_word(profile: &Profile) -> RadiusWord {
    match profile.radius.source.rule {
        RadiusKind::ToolNumber => RadiusWord::Tool,
        RadiusKind::DRegister => RadiusWord::ModalOffset,
        RadiusKind::SpindleToolPlusP => RadiusWord::Addend,
        RadiusKind::ProgramValue => RadiusWord::Set,
        RadiusKind::NoseRegister => RadiusWord::Nose,
    }
}

fn find<T: Copy>(words: &[(u16, T)], tenths: u16) -> Option<T> {
    words.iter().find(|(word, _)| *word == tenths).map(|&(_, meaning)| meaning)
}

/// `G54` to a letter and a number in tenths.
fn parse(word: &str) -> Option<(u8, u16)> {
    let letter = *word.as_bytes().first()?;
    let number: f64 = word.get(1..)?.parse().ok()?;
    Some((letter, crate::code_in_tenths(number)?))
}
