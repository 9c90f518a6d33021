//! What the probes of a program have found.

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
