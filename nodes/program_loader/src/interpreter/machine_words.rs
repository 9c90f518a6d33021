//! M words that only the machine knows: M19, M48 to M53, M61 to M68, M100 to M199.
//!
//! Knows which words belong to each and which values they take; what a board does with them is the
//! driver's. M61 names the tool in the spindle, which is the loader's.

use super::{Interpreter, Scene};
use crate::dialect::Letters;
use crate::expression::whole;
use crate::no_effect::{WAIT, WAIT_ANALOG};
use cnc_msgs::contour::Action;
use cnc_msgs::finding::Code;
use cnc_msgs::text::Words;
use std::fmt::Write;

/// M48 to M53: whether the operator may override feed and speed, whether the feed adapts, and
/// whether it may be held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Overrides {
    pub(super) feed: bool,
    pub(super) speed: bool,
    pub(super) adapts: bool,
    pub(super) may_hold: bool,
}

impl Default for Overrides {
    fn default() -> Self {
        Self { feed: true, speed: true, adapts: false, may_hold: true }
    }
}

impl Overrides {
    /// After M48 to M53.
    fn after(mut self, number: u16, is_on: bool) -> Self {
        match number {
            48 => (self.feed, self.speed) = (true, true),
            49 => (self.feed, self.speed) = (false, false),
            50 => self.feed = is_on,
            51 => self.speed = is_on,
            52 => self.adapts = is_on,
            _ => self.may_hold = is_on,
        }
        self
    }
}

/// The words that a number of M takes.
const fn words_of(number: u16) -> Letters {
    Letters::of(match number {
        19 => b"RQP",
        50..=53 | 62..=65 => b"P",
        61 => b"Q",
        66 => b"PELQ",
        67 | 68 => b"EQ",
        100..=199 => b"PQ",
        _ => b"",
    })
}

/// The word that a number of M needs, and what it is.
const fn needed(number: u16) -> Option<(u8, &'static str)> {
    match number {
        61 => Some((b'Q', "the number of the tool")),
        62..=65 => Some((b'P', "the number of the output")),
        67 | 68 => Some((b'E', "the number of the output")),
        _ => None,
    }
}

impl Interpreter<'_> {
    /// A word for the machine, with those that belong to it.
    #[cold]
    pub(super) fn machine_word(&mut self, scene: &mut Scene<'_>, number: u16, at: usize) {
        let letters = words_of(number).intersection(self.request.present);
        let mut words = String::new();
        for letter in letters.iter() {
            // It has been read to here once, whatever else is wrong with it.
            let Some(value) = self.take(letter) else { continue };
            self.check_value(scene, number, letter, value);
            if !words.is_empty() {
                words.push(' ');
            }
            let _ = write!(words, "{}{value}", char::from(letter));
        }
        self.check_words(scene, number, at);
        if self.request.is_damaged {
            return;
        }
        if matches!(number, 48..=53) {
            let is_on = self.request.value(b'P') != Some(0.0);
            return self.set_overrides(self.modal.overrides.after(number, is_on));
        }
        let Some(words) = Words::new(&words) else {
            let message = format!("the words of {} are too long", scene.quote(at));
            let help = "round the values: 44 characters are passed on";
            return self.report_at(scene, at, Code::Limit, message, help);
        };
        self.act(Action::Auxiliary { letter: 'M', number: f64::from(number), words });
        if number == 66 {
            self.count_input();
        }
    }

    /// Says those that change: M48 and M49 are M50 and M51 together.
    pub(super) fn set_overrides(&mut self, wanted: Overrides) {
        let before = std::mem::replace(&mut self.modal.overrides, wanted);
        for (number, is_on, was_on) in [
            (50.0, wanted.feed, before.feed),
            (51.0, wanted.speed, before.speed),
            (52.0, wanted.adapts, before.adapts),
            (53.0, wanted.may_hold, before.may_hold),
        ] {
            if is_on != was_on {
                let words = Words::new(if is_on { "P1" } else { "P0" }).unwrap_or_default();
                self.act(Action::Auxiliary { letter: 'M', number, words });
            }
        }
    }

    fn check_value(&mut self, scene: &mut Scene<'_>, number: u16, letter: u8, value: f64) {
        let is_whole = whole(value).is_some();
        let (is_good, help) = match (number, letter) {
            _ if value.is_nan() => return,
            (19, b'R') => ((0.0..=360.0).contains(&value), "write an angle from 0 to 360"),
            (19, b'Q') => (value > 0.0, "write the longest wait in seconds, above 0"),
            (19, b'P') => {
                (is_whole && (0.0..=2.0).contains(&value), "write P0, P1 or P2: the way around")
            }
            (50..=53, _) => (is_whole && value >= 0.0, "write P0 for off, or P1 for on"),
            (66, b'L') => (
                is_whole && (0.0..=4.0).contains(&value),
                "write L0 to read now, L1 to L4 to wait for rise, fall, on or off",
            ),
            (66, b'Q') => (value >= 0.0, "write the longest wait in seconds"),
            (62..=66, _) | (67 | 68, b'E') => {
                (is_whole && (0.0..=63.0).contains(&value), "write a number from 0 to 63")
            }
            _ => (true, ""),
        };
        if !is_good {
            let quote = scene.quote(self.request.word(letter));
            let message = format!("M{number} does not take {quote}");
            self.report(scene, letter, Code::BadNumber, message, help);
        }
    }

    /// Words that are missing, or that exclude each other.
    fn check_words(&mut self, scene: &mut Scene<'_>, number: u16, at: usize) {
        let has = |letter: u8| self.request.present.contains(letter);
        if let Some((letter, what)) = needed(number)
            && !has(letter)
        {
            let letter = char::from(letter);
            let message = format!("{} without {letter}", scene.quote(at));
            let help = format!("write {letter} with {what}");
            return self.report_at(scene, at, Code::MissingWord, message, &help);
        }
        if number != 66 {
            return;
        }
        if has(b'P') == has(b'E') {
            let message = format!("{} reads one input", scene.quote(at));
            let help = "write either P with a digital input or E with an analog one";
            return self.report_at(scene, at, Code::MissingWord, message, help);
        }
        let waits = self.request.value(b'L').is_some_and(|mode| mode > 0.0);
        if waits && has(b'E') {
            let message = "an analog input is read at once".to_owned();
            let help = "write L0, or P with a digital input";
            self.report(scene, b'L', Code::BadNumber, message, help);
        } else if waits && self.request.value(b'Q').is_none_or(|seconds| seconds == 0.0) {
            let message = format!("{} waits without a time", scene.quote(at));
            let help = "write Q with the longest wait in seconds";
            self.report_at(scene, at, Code::MissingWord, message, help);
        } else if !waits && self.request.value(b'Q') > Some(0.0) {
            let why = if has(b'E') { WAIT_ANALOG } else { WAIT };
            self.has_no_effect(scene, self.request.word(b'Q'), why);
        }
    }

    /// M61: this tool is in the spindle, without a change.
    #[cold]
    pub(super) fn name_tool(&mut self, scene: &mut Scene<'_>, at: usize) {
        let tool = self.take_number(scene, b'Q');
        self.check_words(scene, 61, at);
        let (Some(tool), false) = (tool, self.request.is_damaged) else { return };
        if self.modal.compensation.is_selected() {
            let message = "M61 changes the tool under cutter radius compensation".to_owned();
            let help = "cancel with G40 and a straight move before it";
            return self.report_at(scene, at, Code::ForbiddenUnderCompensation, message, help);
        }
        self.modal.spindle_tool = Some(tool);
        self.modal.is_tool_named = true;
        self.named_tools.push((tool, self.source));
    }
}
