//! What a parameter has as its value: what the program has set, or what the interpreter knows.

use crate::expression::{Lookup, Trouble};
use crate::interpreter::Interpreter;
use crate::parameters::Parameters;

/// All parameters that a line may read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Values<'v, 'r> {
    pub(crate) parameters: &'v Parameters,
    pub(crate) interpreter: &'v Interpreter<'r>,
    /// The number of the line.
    pub(crate) line: u32,
}

impl Lookup for Values<'_, '_> {
    fn numbered(&self, number: u32) -> Option<Result<f64, Trouble>> {
        self.interpreter.system_number(number).or_else(|| self.parameters.numbered(number).map(Ok))
    }

    fn named(&self, name: &str) -> Option<Result<f64, Trouble>> {
        if let Some(value) = self.parameters.named(name) {
            return Some(Ok(value));
        }
        match name {
            "_line" => Some(Ok(f64::from(self.line))),
            "_call_level" => Some(Ok(self.parameters.depth() as f64)),
            _ => self.interpreter.system_name(name),
        }
    }
}
