//! M50 and M51: whether the operator may override feed and spindle speed.
//!
//! No firmware has to know them: the driver brings the overrides to 100 % and keeps them there.

use super::{EncodeProblem, Encoder, EncoderStep};
use cnc_msgs::contour::{Action, Source};
use std::fmt::{self, Display};

/// What a program lets its operator override; both where it begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AllowedOverrides {
    /// Feed and rapid.
    pub feed: bool,
    pub spindle: bool,
}

impl Default for AllowedOverrides {
    fn default() -> Self {
        Self { feed: true, spindle: true }
    }
}

impl Display for AllowedOverrides {
    /// `feed and rapid`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.feed, self.spindle) {
            (true, true) => "feed, rapid and spindle",
            (true, false) => "feed and rapid",
            (false, true) => "spindle",
            (false, false) => "none",
        })
    }
}

impl AllowedOverrides {
    /// After an action; `None` if that is none of M50 to M53, as RS-274 has them.
    ///
    /// # Errors
    /// It asks for what is never done.
    pub(crate) fn after(self, action: &Action) -> Option<Result<Self, EncodeProblem>> {
        let Action::Auxiliary { letter: 'M', number, words } = *action else { return None };
        let number = (50..=53_u8).find(|known| f64::from(*known) == number)?;
        let is_on = words.value('P')? != 0.0;
        let refused = |why| Some(Err(EncodeProblem::NeverDone { word: action.text(), why }));
        match (number, is_on) {
            (50, _) => Some(Ok(Self { feed: is_on, ..self })),
            (51, _) => Some(Ok(Self { spindle: is_on, ..self })),
            (52, true) => {
                refused("no controller here adapts the feed to an input; delete the word")
            }
            (53, false) => refused("a feed hold has to work at any time; delete the word"),
            _ => Some(Ok(self)),
        }
    }
}

impl Encoder {
    /// Says what is allowed from here on, if it is something else than before.
    pub(super) fn allow_overrides(&mut self, allowed: AllowedOverrides, source: Source) {
        if std::mem::replace(&mut self.allowed_overrides, allowed) != allowed {
            self.pending.push_back(EncoderStep::AllowOverrides { allowed, source });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cnc_msgs::text::Words;

    #[test]
    fn each_word_allows_or_forbids_its_own_and_what_is_never_done_is_refused() {
        let nothing = AllowedOverrides { feed: false, spindle: false };
        let feed = AllowedOverrides { feed: true, spindle: false };
        let spindle = AllowedOverrides { feed: false, spindle: true };
        let all = AllowedOverrides::default();
        for (before, number, words, expected) in [
            (all, 50.0, "P0", Ok(spindle)),
            (all, 51.0, "P0", Ok(feed)),
            (spindle, 51.0, "P0", Ok(nothing)),
            (nothing, 50.0, "P1", Ok(feed)),
            (nothing, 51.0, "P1", Ok(spindle)),
            (feed, 52.0, "P0", Ok(feed)),
            (feed, 53.0, "P1", Ok(feed)),
            (all, 52.0, "P1", Err("M52 P1 is not done: no controller")),
            (all, 53.0, "P0", Err("M53 P0 is not done: a feed hold has to work")),
        ] {
            let words = Words::new(words).expect("short");
            let action = Action::Auxiliary { letter: 'M', number, words };
            let after = before.after(&action).expect("one of them").map_err(|it| it.to_string());
            match (after, expected) {
                (Ok(after), Ok(expected)) => assert_eq!(after, expected, "M{number} {words:?}"),
                (Err(text), Err(expected)) => assert!(text.contains(expected), "{text}"),
                (after, expected) => panic!("M{number}: {after:?}, not {expected:?}"),
            }
        }
    }

    #[test]
    fn words_of_other_languages_mean_something_else() {
        for (letter, number, words) in [('M', 50.0, ""), ('M', 49.0, "P0"), ('H', 50.0, "P0")] {
            let words = Words::new(words).expect("short");
            let action = Action::Auxiliary { letter, number, words };
            assert!(AllowedOverrides::default().after(&action).is_none(), "{letter}{number}");
        }
    }
}
