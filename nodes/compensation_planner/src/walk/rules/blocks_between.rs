//! Blocks without motion in the plane between two that have it.

use super::of;
use crate::check::finding::block_name;
use cnc_msgs::contour::Source;
use cnc_msgs::finding::{Code, Finding};
use cnc_msgs::profile::Profile;

/// Blocks without motion in the plane between two that have it (S59, S61).
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct BlocksBetween {
    own: Source,
    last: Source,
    count: u32,
    has_calculation: bool,
}

impl BlocksBetween {
    /// After a block with motion in the plane.
    pub(crate) fn after(source: Source) -> Self {
        Self { own: source, last: source, count: 0, has_calculation: false }
    }

    /// Counts a block; each once, and not the block of the motion itself.
    pub(crate) fn block(&mut self, source: Source) {
        if source != self.last && source != self.own {
            self.last = source;
            self.count += 1;
        }
    }

    /// Counts a calculation.
    pub(crate) fn calculation(&mut self, source: Source) {
        self.has_calculation = true;
        self.block(source);
    }

    /// The finding when there were too many before the motion of this block.
    pub(crate) fn excess(&self, next: Source, profile: &Profile) -> Option<Finding> {
        let max = profile.off_plane.max_blocks?;
        // What stands in the block of the motion itself does not count.
        let count = self.count - u32::from(self.last == next && self.count > 0);
        if count <= max {
            return None;
        }
        let help = match self.has_calculation {
            false => {
                "put auxiliary functions into blocks that move in the plane, or cancel the compensation before"
            }
            true => "calculate before the selection, or cancel the compensation before",
        };
        let mut finding = of(
            profile.off_plane.strictness,
            Code::OffPlaneBlocks,
            next,
            format!(
                "{count} blocks without motion in the plane stand between {} and {}; {} looks across {max}",
                block_name(self.own),
                block_name(next),
                profile.name
            ),
        )
        .help(help);
        finding.alarm.clone_from(&profile.off_plane.alarm);
        finding.other = Some(self.own);
        Some(finding)
    }
}
