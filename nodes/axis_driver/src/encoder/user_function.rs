//! Functions of the user: M100 to M199, which a node of the cell does while the machine stands.

use super::{EncodeProblem, Encoder, EncoderStep};
use cnc_msgs::contour::{Action, Source};
use cnc_msgs::path::CompensatedPath;
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display};

/// So many different calls of a path are asked about before it is run.
const ASKED_MAX: usize = 100;

/// One call.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct UserFunction {
    /// 100 to 199.
    pub number: u8,
    /// The words of the block, as they are written.
    pub p: Option<f64>,
    pub q: Option<f64>,
}

impl UserFunction {
    /// The function that an action calls, if it calls one.
    pub(crate) fn of(action: &Action) -> Option<Self> {
        let Action::Auxiliary { letter: 'M', number, words } = *action else { return None };
        // M107.5 is not a function of the user.
        let number = (100..=199_u8).find(|known| f64::from(*known) == number)?;
        Some(Self { number, p: words.value('P'), q: words.value('Q') })
    }
}

/// A function that a path calls.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CalledFunction {
    pub function: UserFunction,
    /// The first line that does so, and the last.
    pub line: u32,
    pub last_line: u32,
}

impl CalledFunction {
    /// The functions of a path, each once, as far as they are asked about before it is run.
    pub fn all_of(path: &CompensatedPath) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for event in &path.events {
            let Some(function) = UserFunction::of(&event.action) else { continue };
            let line = event.source.line;
            if let Some(known) = all.iter_mut().find(|known| known.function == function) {
                known.last_line = known.last_line.max(line);
            } else if all.len() < ASKED_MAX {
                all.push(Self { function, line, last_line: line });
            }
        }
        all
    }
}

impl Display for UserFunction {
    /// `M101 P1 Q2.5`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "M{}", self.number)?;
        for (letter, value) in [('P', self.p), ('Q', self.q)] {
            if let Some(value) = value {
                write!(f, " {letter}{value}")?;
            }
        }
        Ok(())
    }
}

impl Encoder {
    pub(super) fn encode_user_function(
        &mut self,
        function: UserFunction,
        source: Source,
    ) -> Result<(), EncodeProblem> {
        if !self.config.has_user_functions {
            return Err(EncodeProblem::NoUserFunctions { word: function.to_string() });
        }
        self.pending.push_back(EncoderStep::UserFunction { function, source });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoder::EncoderConfig;
    use cnc_msgs::path::PathEvent;
    use cnc_msgs::text::Words;
    use std::sync::Arc;

    fn calls(words: &[(f64, &str)]) -> CompensatedPath {
        let events = words.iter().zip(3..).map(|(&(number, words), line)| PathEvent {
            at_element: 0,
            action: Action::Auxiliary {
                letter: 'M',
                number,
                words: Words::new(words).expect("short"),
            },
            source: Source { line, ..Source::default() },
        });
        CompensatedPath { events: events.collect(), ..CompensatedPath::default() }
    }

    #[test]
    fn functions_are_named_once_with_their_words_and_first_line() {
        let path = calls(&[
            (101.0, "P2 Q-0.5"),
            (62.0, "P1"),
            (101.0, "P2 Q-0.5"),
            (199.0, ""),
            (200.0, ""),
            (107.5, ""),
        ]);
        let named: Vec<_> = CalledFunction::all_of(&path)
            .iter()
            .map(|it| (it.line, it.last_line, it.function.to_string()))
            .collect();
        assert_eq!(named, [(3, 5, "M101 P2 Q-0.5".to_owned()), (6, 6, "M199".to_owned())]);
    }

    #[test]
    fn none_is_called_where_the_parameter_says_so() {
        let config = EncoderConfig { has_user_functions: false, ..EncoderConfig::default() };
        let mut encoder = Encoder::new(Arc::new(calls(&[(150.0, "")])), config);
        let refused = encoder.next_step().expect("a step").expect_err("a refusal").to_string();
        assert!(refused.starts_with("line 3: M150 calls a function of the user"), "{refused}");
        assert!(refused.contains("user_function_s_max"), "{refused}");
    }
}
