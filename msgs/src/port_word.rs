//! M62 to M68: words of a program that switch an output of the board, or read an input.

use crate::contour::Action;
use crate::text::Words;

/// One such word. Those of other languages have these numbers without P and E, and mean something else.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PortWord {
    pub is_analog: bool,
    /// P or E, from 0.
    pub port: u32,
    pub what: PortUse,
}

/// What is done with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PortUse {
    /// M62 to M65, M67 and M68: 0 or 1 for a digital output.
    Switch {
        value: f64,
        /// When the next motion begins, and not where the word stands.
        with_motion: bool,
    },
    /// M66.
    Read {
        /// Q: how long it waits at the most; 0 without.
        seconds: f64,
    },
}

impl PortWord {
    pub fn of(action: &Action) -> Option<Self> {
        let Action::Auxiliary { letter: 'M', number, words } = *action else { return None };
        let number = (62..=68_u8).find(|known| f64::from(*known) == number)?;
        let is_analog = matches!(number, 67 | 68) || number == 66 && words.value('P').is_none();
        let port = words.value(if is_analog { 'E' } else { 'P' })?;
        // A number that is none of a port becomes one that no board has.
        let port = if port >= 0.0 && port.fract() == 0.0 { port as u32 } else { u32::MAX };
        let with_motion = matches!(number, 62 | 63 | 67);
        let what = match number {
            66 => PortUse::Read { seconds: words.value('Q').unwrap_or(0.0) },
            67 | 68 => PortUse::Switch { value: words.value('Q')?, with_motion },
            _ => PortUse::Switch { value: f64::from(u8::from(number % 2 == 0)), with_motion },
        };
        Some(Self { is_analog, port, what })
    }

    /// The word that brings an output to this state where it stands: `M64 P1`; `None` for an input.
    pub fn at_once(&self) -> Option<Action> {
        let PortUse::Switch { value, .. } = self.what else { return None };
        let (number, words) = match self.is_analog {
            true => (68.0, format!("E{} Q{value}", self.port)),
            false => (if value == 0.0 { 65.0 } else { 64.0 }, format!("P{}", self.port)),
        };
        Some(Action::Auxiliary { letter: 'M', number, words: Words::new(&words)? })
    }

    /// Whether it is M62, M63 or M67.
    pub const fn is_with_motion(&self) -> bool {
        matches!(self.what, PortUse::Switch { with_motion: true, .. })
    }

    /// Whether it is M66.
    pub const fn reads(&self) -> bool {
        matches!(self.what, PortUse::Read { .. })
    }

    /// `digital output 3`
    pub fn name(&self) -> String {
        let kind = if self.is_analog { "analog" } else { "digital" };
        let way = if self.reads() { "input" } else { "output" };
        format!("{kind} {way} {}", self.port)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(number: f64, words: &str) -> Option<PortWord> {
        let words = Words::new(words).expect("short");
        PortWord::of(&Action::Auxiliary { letter: 'M', number, words })
    }

    #[test]
    fn each_word_is_read_and_an_output_has_a_word_that_switches_at_once() {
        let switch = |value, with_motion| PortUse::Switch { value, with_motion };
        for (number, words, is_analog, port, what, at_once) in [
            (62.0, "P1", false, 1, switch(1.0, true), "M64 P1"),
            (63.0, "P0", false, 0, switch(0.0, true), "M65 P0"),
            (64.0, "P7", false, 7, switch(1.0, false), "M64 P7"),
            (65.0, "P7", false, 7, switch(0.0, false), "M65 P7"),
            (67.0, "E1 Q-0.5", true, 1, switch(-0.5, true), "M68 E1 Q-0.5"),
            (68.0, "E2 Q2.5", true, 2, switch(2.5, false), "M68 E2 Q2.5"),
            (66.0, "L3 P0 Q2.5", false, 0, PortUse::Read { seconds: 2.5 }, ""),
            (66.0, "L0 E1", true, 1, PortUse::Read { seconds: 0.0 }, ""),
            (66.0, "P2", false, 2, PortUse::Read { seconds: 0.0 }, ""),
        ] {
            let word = read(number, words).expect("one of them");
            assert_eq!(word, PortWord { is_analog, port, what }, "M{number} {words}");
            let text = word.at_once().map_or(String::new(), |action| action.text());
            assert_eq!(text, at_once, "M{number} {words}");
        }
    }

    #[test]
    fn a_word_of_another_language_is_none() {
        for (number, words) in [(62.0, ""), (66.0, ""), (67.0, "E1"), (61.0, "P1"), (69.0, "P1")] {
            assert_eq!(read(number, words), None, "M{number} {words}");
        }
    }
}
