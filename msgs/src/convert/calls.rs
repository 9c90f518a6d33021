//! Calls and passes.

use super::WireError;
use crate::calls::{Call, Calls};
use crate::wire::cnc_msgs::msg as wire;
use std::sync::Arc;

impl From<&Call> for wire::Call {
    fn from(call: &Call) -> Self {
        let Call { ref name, line, pass: pass_number, parent, depth } = *call;
        let name = name.as_deref().unwrap_or_default().to_owned();
        Self { name, line, pass_number, parent, depth }
    }
}

impl From<&wire::Call> for Call {
    fn from(call: &wire::Call) -> Self {
        let wire::Call { ref name, line, pass_number: pass, parent, depth } = *call;
        Self { name: (!name.is_empty()).then(|| name.as_str().into()), line, pass, parent, depth }
    }
}

/// The chain of a finding, as a message.
pub fn chain_to_wire(chain: &[Call]) -> Vec<wire::Call> {
    chain.iter().map(Into::into).collect()
}

impl Calls {
    /// Appends rows that came in a message; each may be inside an earlier one only.
    ///
    /// # Errors
    /// A row names one that does not come before it.
    pub fn extend_from_wire(&mut self, rows: &[wire::Call]) -> Result<(), WireError> {
        let mut name: Option<Arc<str>> = None;
        for row in rows {
            if row.parent as usize > self.rows().len() {
                return Err(WireError::Number { field: "parent", value: row.parent.into() });
            }
            // Calls of the same subroutine follow each other.
            if name.as_deref().unwrap_or_default() != row.name {
                name = (!row.name.is_empty()).then(|| row.name.as_str().into());
            }
            self.push(row.parent, name.clone(), row.line, row.pass_number);
        }
        Ok(())
    }

    /// Checks the row of an element or event.
    pub(crate) fn known(&self, row: u32) -> Result<u32, WireError> {
        match row as usize <= self.rows().len() {
            true => Ok(row),
            false => Err(WireError::Number { field: "call", value: row.into() }),
        }
    }
}
