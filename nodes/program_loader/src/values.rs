//! What a parameter has as its value: what the program has set, or what the interpreter knows.

use crate::expression::{Lookup, Trouble};
use crate::interpreter::Interpreter;
use crate::parameters::Parameters;

const FORGOTTEN: &str = "a parameter, and nothing is kept from one block by hand to the next";

/// All parameters that a line may read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Values<'v, 'r> {
    pub(crate) parameters: &'v Parameters,
    pub(crate) interpreter: &'v Interpreter<'r>,
    /// The number of the line.
    pub(crate) line: u32,
    /// Nothing is kept from the blocks before this one.
    pub(crate) is_single_block: bool,
}

impl Lookup for Values<'_, '_> {
    fn numbered(&self, number: u32) -> Option<Result<f64, Trouble>> {
        if self.is_single_block {
            return Some(Err(Trouble::NotHere { what: FORGOTTEN.to_owned() }));
        }
        self.interpreter.system_number(number).or_else(|| self.parameters.numbered(number).map(Ok))
    }

    fn named(&self, name: &str) -> Option<Result<f64, Trouble>> {
        if self.is_single_block {
            return Some(Err(Trouble::NotHere { what: FORGOTTEN.to_owned() }));
        }
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
