//! What the probes of a program have found, and what it has read of inputs.

use crate::geometry::Position;
use serde::{Deserialize, Serialize};

/// What one probe has found, in the work frame, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ProbeResult {
    /// It has touched, or let go.
    pub has_touched: bool,
    /// Where it has; the end of its way where it has not.
    pub contact: Position,
    /// Where the tool stands afterwards.
    pub stands: Position,
}

/// What a run has measured so far, each kind in the order of the run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Measured {
    pub probes: Vec<ProbeResult>,
    /// What M66 has read; -1 where it has waited in vain.
    pub inputs: Vec<i32>,
}
