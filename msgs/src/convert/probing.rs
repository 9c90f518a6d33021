//! Results of probes.

use super::{WireError, position};
use crate::probing::ProbeResult;
use crate::units::point_from_position;
use crate::wire::cnc_msgs::msg as wire;

impl From<&ProbeResult> for wire::ProbeResult {
    fn from(result: &ProbeResult) -> Self {
        Self {
            has_touched: result.has_touched,
            contact: point_from_position(result.contact),
            stands: point_from_position(result.stands),
        }
    }
}

impl TryFrom<&wire::ProbeResult> for ProbeResult {
    type Error = WireError;

    fn try_from(result: &wire::ProbeResult) -> Result<Self, WireError> {
        Ok(Self {
            has_touched: result.has_touched,
            contact: position("contact", &result.contact)?,
            stands: position("stands", &result.stands)?,
        })
    }
}
