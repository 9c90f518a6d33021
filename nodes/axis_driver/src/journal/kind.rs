//! The kinds of entries, as `cnc_msgs/TrafficEntry` numbers them.

use super::EntryKind;
use cnc_msgs::wire::cnc_msgs::msg::TrafficEntry;

const KINDS: [EntryKind; 7] = [
    EntryKind::Tx,
    EntryKind::Rx,
    EntryKind::Opened,
    EntryKind::Closed,
    EntryKind::Timer,
    EntryKind::Command,
    EntryKind::Checkpoint,
];

/// The constant of `TrafficEntry` for a kind.
pub const fn kind_to_wire(kind: EntryKind) -> u8 {
    match kind {
        EntryKind::Tx => TrafficEntry::KIND_TRANSMITTED,
        EntryKind::Rx => TrafficEntry::KIND_RECEIVED,
        EntryKind::Opened => TrafficEntry::KIND_OPENED,
        EntryKind::Closed => TrafficEntry::KIND_CLOSED,
        EntryKind::Timer => TrafficEntry::KIND_TIMER,
        EntryKind::Command => TrafficEntry::KIND_COMMAND,
        EntryKind::Checkpoint => TrafficEntry::KIND_CHECKPOINT,
    }
}

/// The kind that a constant of `TrafficEntry` stands for.
pub fn kind_from_wire(kind: u8) -> Option<EntryKind> {
    KINDS.into_iter().find(|&known| kind_to_wire(known) == kind)
}
